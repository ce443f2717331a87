"""A structure that bends: the slave IMU turns and moves while the rigid body, and with it the master, does not.

The motion beneath is that of the rigid body at the slave's place. The truth of the slave is the *flexed* motion; a master is
simulated from the motion beneath. A slave on a mount that yields turns in its place. One at an arm `r` from where its structure is
clamped moves, too, by ``delta = (k theta) x r`` (:mod:`truenorth.errors.bending`).

Each angle is a second-order Gauss-Markov process, as is usual for wings and decks (J. Kain and J. Cloutier, Rapid transfer
alignment for tactical weapon applications, AIAA GNC 1989). It is drawn exactly at knots and continued between them by cubics
through angle and rate, which for a process driven by white angular acceleration are its conditional mean: what they leave out is
.5 % of sigma.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import UsageError
from truenorth.records.flexure import FlexureSpec
from truenorth.records.motion import MotionStates, Moving
from truenorth.simulation.aiding import Draws
from truenorth.simulation.gnss import place_of
from truenorth.simulation.motion import body_rates
from truenorth.simulation.processes import second_order_gauss_markov
from truenorth.simulation.sensing import acceleration_gain

Array = NDArray[np.float64]
KNOT = 0.1  # of 1/beta


class Flexed:
    """The motion of a slave IMU on a structure that bends.

    Parameters
    ----------
    motion : Motion or Indexed
        Of the rigid body at the slave's place.
    spec : FlexureSpec
    duration, start : float, s
        It is known from start to start + duration.
    seed, run, scenario : int
        The same three give the same bits.
    """

    def __init__(
        self,
        motion: Moving,
        spec: FlexureSpec,
        *,
        duration: float,
        start: float = 0.0,
        seed: int = 0,
        run: int = 0,
        scenario: int = 0,
    ) -> None:
        from scipy.interpolate import CubicHermiteSpline

        step = KNOT / spec.beta
        self.motion, self.spec = motion, spec
        self.span = start, start + duration
        self.knots = start + step * np.arange(math.ceil(duration / step) + 2)
        rng = Draws("flexure", seed, run, scenario)("")
        angles, rates = self.drawn(rng)
        self._angles: Any = CubicHermiteSpline(self.knots, angles, rates)
        self._rates, self._accelerations = self._angles.derivative(1), self._angles.derivative(2)

    def drawn(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Heading, pitch and roll relative to the rigid body at the knots, and how fast they change, (K, 3) rad and rad/s."""
        step = float(self.knots[1] - self.knots[0])
        return second_order_gauss_markov(np.array(self.spec.sigma), self.spec.beta, step, len(self.knots), rng)

    @property
    def breaks(self) -> Array:
        """Those of the motion beneath and the knots of the flexure."""
        return np.union1d(self.motion.breaks, self.knots)

    @property
    def shortest_period(self) -> float:
        """Of the motion beneath, s; the flexure is a cubic between its knots."""
        return self.motion.shortest_period

    def angles(self, t: ArrayLike) -> Array:
        """Heading, pitch and roll of the slave relative to the rigid body, (..., 3) rad."""
        return np.asarray(self._angles(self._checked(t)))

    def states(self, t: ArrayLike) -> MotionStates:
        """The true motion of the slave at any times (s) of its span."""
        t = self._checked(t)
        angles, rates, accelerations = (
            np.moveaxis(f(t), -1, 0) for f in (self._angles, self._rates, self._accelerations)
        )
        at = self.motion.states(t)
        if np.any(self.spec.arm):
            at = shifted(at, *(self._moved(of) for of in (angles, rates, accelerations)))
        return turned(at, angles, rates, accelerations)

    def _moved(self, angles: Array) -> Array:
        """(..., 3) what these angles (heading, pitch, roll), or their derivatives, move the slave by, rigid body's axes."""
        turn = np.stack([angles[1], angles[2], -angles[0]], axis=-1)
        return np.cross(np.asarray(self.spec.coupling) * turn, self.spec.arm)

    def _checked(self, t: ArrayLike) -> Array:
        t = np.asarray(t, dtype=np.float64)
        if t.size and not (self.span[0] <= t.min() and t.max() <= self.knots[-1]):
            raise UsageError(
                f"flexure is drawn from {self.span[0]:g} s to {self.span[1]:g} s; {t.min():g} s to {t.max():g} s are asked: give "
                "it a longer duration"
            )
        return t


def shifted(at: MotionStates, away: Array, speed: Array, acceleration: Array) -> MotionStates:
    """The motion of a point of a body that is displaced in the body's axes, (..., 3) m, m/s, m/s^2, and does not turn."""
    lat, lon, alt, v_n = place_of(at, away)
    w, moving = at.w_ib_b, (at.C_nb @ speed[..., None])[..., 0]
    more = acceleration + 2.0 * np.cross(w, speed) + (acceleration_gain(at) @ away[..., None])[..., 0]
    return replace(at, lat=lat, lon=lon, alt=alt, v_n=v_n + moving, f_b=at.f_b + more)


def turned(at: MotionStates, angles: Array, rates: Array, accelerations: Array) -> MotionStates:
    """The motion of an IMU that turns in its place on a body.

    Parameters
    ----------
    at : MotionStates
        Of the body.
    angles, rates, accelerations : (3, ...) arrays, rad, rad/s, rad/s^2
        Heading, pitch and roll of the IMU relative to the body, with their derivatives.
    """
    C_bs = dcm_from_euler(*angles)
    C_sb = np.swapaxes(C_bs, -1, -2)
    own = body_rates(np.sin(angles), np.cos(angles), rates, accelerations)
    w_bs, dw_bs = (np.ascontiguousarray(np.moveaxis(x, 0, -1)) for x in own)
    w_ib, dw_ib, f = (np.einsum("...ij,...j->...i", C_sb, x) for x in (at.w_ib_b, at.dw_ib_b, at.f_b))
    return MotionStates(
        time=at.time,
        C_nb=at.C_nb @ C_bs,
        v_n=at.v_n,
        lat=at.lat,
        lon=at.lon,
        alt=at.alt,
        w_ib_b=w_ib + w_bs,
        f_b=f,
        dw_ib_b=dw_ib - np.cross(w_bs, w_ib) + dw_bs,
    )
