"""How a slave turns against its master's rigid body: what bends between them, by the master's attitudes and the slave's gyros.

The master's attitudes, through the mounting, are those of the rigid body, and a cubic spline leads from row to row. The slave's
attitude is carried by its gyros. The angle between both,

    theta = log(C_rigid' C_slave)

has what the seat bends, a constant (the mounting), what drifts, and noise. Where the master's spectrum is no more than its noise,
and beyond half the rate of its rows, the body does not move: what the gyros show is the seat. What is left is what is expected
where noise of the density N is known of (Wiener's filter),

    theta_hat(f) = S(f) / (S(f) + N(f)) theta(f),    S = 4 beta^3 sigma^2 / ((2 pi f)^2 + beta^2)^2

with S of the second-order process that was said. So what it does to the arm (:mod:`truenorth.errors.bending`) is a known motion in
each row, and the coupling a constant that is estimated. A state of theta by itself does not do: from row to row the master's
attitudes alone show it, though the gyros in the same row do, too. A filter that takes the one for independent of the other
finds the arm `k` times as long as it is, tens of its sigmas off.

Source: N. Wiener, "Extrapolation, interpolation, and smoothing of stationary time series" (1949). The use of it is ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_nominal import Carried
from truenorth.core.attitude import dcm_from_quaternion, rotation_vector_from_dcm, skew
from truenorth.errors.master import TransferModel
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments, interval_lengths

Array = NDArray[np.float64]

APART = 3.0  # intervals of the master without a row, in which nobody knows how the body turns
FEWEST = 8  # rows, of which a spline is made
SMOOTH = 0.2  # Hz, over which a spectrum is averaged
SURELY = 2.0  # times the noise of the master's attitudes: what is less is no motion of the body


@dataclass(frozen=True)
class Bend:
    """How a slave turns against the rigid body, slave axes, at the ends of its samples and where the first begins."""

    knots: Array  # (N + 1,) s
    angles: Array  # (N + 1, 3) rad
    coupling: Array  # (3,) of the chord, as assumed and found so far
    coupling_sigma: float = 0.0  # before the log

    @property
    def idle(self) -> Array:
        """(N + 1, 3) what the chord does not turn of the angles, rad."""
        return np.asarray((1.0 - self.coupling) * self.angles)

    @property
    def unsure(self) -> Array:
        """(N + 1, 3) what the chord turns by a coupling that is off by its sigma, rad."""
        return self.coupling_sigma * self.angles

    @cached_property
    def _course(self) -> Any:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.knots, self.angles)

    def at(self, times: Array, derivative: int = 0) -> Array:
        """(M, 3) the angles at some times, s, or a derivative of them."""
        return np.asarray(self._course(np.clip(times, self.knots[0], self.knots[-1]), derivative))

    def rates(self, slave: ImuRecord, times: Array) -> Array:
        """(M, 3) what the slave's gyros turn at some times, rad/s, by a spline as that of the angles."""
        whole = replace(self, angles=own_angles(slave))
        return whole.at(times, 1) + (np.sum(increments(slave)[0], axis=0) / (self.knots[-1] - self.knots[0]))

    def without(self, slave: ImuRecord, share: Array | float = 1.0) -> ImuRecord:
        """The slave as it would turn without so much of what it bends, by axis."""
        dtheta, dvel = increments(slave)
        return slave._with(gyro=dtheta - share * np.diff(self.angles, axis=0), accel=dvel, kind="increments")

    def chord(self, slave: ImuRecord, arm: Array | None = None) -> ImuRecord:
        """A slave that turns with the chord of the arm; of a given one, m, without the force that moves its end."""
        seat = self.without(slave, 1.0 - self.coupling)
        if arm is None:
            return seat
        moving = np.cross(self.coupling * self.at(self.knots, 1), arm)
        return seat._with(accel=seat.accel - np.diff(moving, axis=0))

    def turned(self, C: Array) -> Array:
        """(N + 1, 3, 3) attitudes at the knots, turned to those of the chord."""
        return np.asarray(C @ (np.eye(3) - skew(self.idle)))


def bend_along(
    slave: ImuRecord,
    carried: Carried,
    C_rigid: Array,
    held: Array,
    model: TransferModel,
    coupling: Array,
) -> Bend | None:
    """What bends, along the motion that a pass has found; None where too few rows say how the body turns.

    Parameters
    ----------
    carried : Carried
        The attitude of the slave along it.
    C_rigid : (M, 3, 3) array
        At rows of the master, by its attitudes and the mounting; NaN where they are absent.
    held : (M,) array, s
        When they held.
    coupling : (3,) array
    """
    raw = relative(slave, carried, C_rigid, held)
    if raw is None:
        return None
    knots, angles = raw
    apart, w = float(np.median(np.diff(held))), 2.0 * math.pi * frequencies(len(knots), slave.interval)
    between = w < math.pi / apart
    seen, noise = _seen_of_body(own_angles(slave) - angles, w, apart)
    beta, size = model.flexure_beta, np.asarray(model.flexure_sigma)
    w = np.maximum(w, 1e-9)[:, None]
    shown = 4.0 * beta**3 * size**2 / (w**2 + beta**2) ** 2
    noise = np.where(between[:, None], seen * noise, 0.0) + model.gyro_random_walk**2 / w**2
    share = np.divide(shown, shown + noise, out=np.zeros_like(shown), where=shown > 0.0)
    fast = filtered(own_angles(slave), share * (1.0 - seen))
    return Bend(knots, filtered(angles, share * seen) + fast, coupling, model.coupling_sigma)


def own_angles(slave: ImuRecord) -> Array:
    """(N + 1, 3) rad: what a slave's gyros add up to about each of its axes, without a straight line from end to end."""
    whole = np.vstack([np.zeros(3), np.cumsum(increments(slave)[0], axis=0)])
    return np.asarray(whole - np.linspace(0.0, 1.0, len(whole))[:, None] * whole[-1])


def _seen_of_body(turned: Array, w: Array, apart: float) -> tuple[Array, Array]:
    """How much of what a master's attitudes show is the body's motion, (F, 3), and the density (3,) of their noise, rad^2/Hz.

    Parameters
    ----------
    turned : (N + 1, 3) array, rad
        What the body turns about each axis by the master's attitudes.
    w : (F,) array, rad/s
    apart : float, s
        From row to row.
    """
    spectrum = np.abs(np.fft.rfft(np.concatenate([turned, turned[::-1]]), axis=0)) ** 2
    many = max(3, round(SMOOTH * 2.0 * math.pi / w[1]) | 1)
    smooth = np.stack([np.convolve(column, np.full(many, 1.0 / many), mode="same") for column in spectrum.T], axis=1)
    floor = np.median(smooth[(w > 0.5 * math.pi / apart) & (w < 0.9 * math.pi / apart)], axis=0)
    seen = np.clip(1.0 - SURELY * floor / np.maximum(smooth, 1e-300), 0.0, 1.0)
    seen[w >= math.pi / apart] = 0.0
    step = math.pi / (w[1] * (len(turned)))  # s
    return seen, np.asarray(floor * step / (2.0 * len(turned)), dtype=np.float64)


def relative(slave: ImuRecord, carried: Carried, C_rigid: Array, held: Array) -> tuple[Array, Array] | None:
    """Knots (N + 1,), s, and angles (N + 1, 3) of the slave against the rigid body there, without their mean; 0 in outages."""
    from scipy.spatial.transform import Rotation, RotationSpline

    known = np.isfinite(C_rigid).all(axis=(1, 2))
    if np.count_nonzero(known) < FEWEST:
        return None
    held, C_rigid = held[known], C_rigid[known]
    knots = np.append(slave.time[0] - interval_lengths(slave)[0], slave.time)
    course = RotationSpline(held, Rotation.from_matrix(C_rigid))
    between = (knots >= held[0]) & (knots <= held[-1])
    row = np.clip(np.searchsorted(held, knots), 1, len(held) - 1)
    between &= held[row] - held[row - 1] < APART * float(np.median(np.diff(held)))
    angles = np.zeros((len(knots), 3))
    C_body = course(knots[between]).as_matrix()
    C_slave = dcm_from_quaternion(carried.q[between])
    angles[between] = rotation_vector_from_dcm(np.swapaxes(C_body, 1, 2) @ C_slave)
    angles[between] -= angles[between].mean(axis=0)
    return knots, angles


def frequencies(rows: int, interval: float) -> Array:
    """(F,) Hz, of rows that are taken there and back: without a jump at the ends."""
    return np.asarray(np.fft.rfftfreq(2 * rows, interval), dtype=np.float64)


def filtered(values: Array, gain: Array) -> Array:
    """(N, 3) values through a filter without delay, (F, 3) by :func:`frequencies`."""
    whole = np.fft.rfft(np.concatenate([values, values[::-1]]), axis=0)
    return np.asarray(np.fft.irfft(whole * gain, 2 * len(values), axis=0)[: len(values)])
