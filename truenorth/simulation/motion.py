"""Motion of an IMU on the ellipsoid: from angles and the path of a centre to rates and forces.

A motion gives its angles, velocity and acceleration in closed form; rate and specific force follow by rigid-body
kinematics. Their integrals over each sampling interval are taken in :mod:`truenorth.simulation.sensing`.

Vectors and matrices stand component by component, (3, ...) and (3, 3, ...): what is done with one is done in a row of memory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_elements
from truenorth.core.earth import EARTH_RATE, normal_gravity_at, radii, radii_at
from truenorth.core.position import Position
from truenorth.records.motion import MotionStates

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kinematics:
    """Motion of the body and of its centre, as a kind of motion gives it.

    Of a centre that stays, place, velocity and acceleration may have one value on each axis of the times.
    """

    angles: Array  # (3, ...) rad: heading, pitch, roll and their derivatives
    rates: Array  # (3, ...) rad/s
    accelerations: Array  # (3, ...) rad/s^2
    lat: Array  # (...): of the centre
    lon: Array  # (...)
    alt: Array  # (...)
    v: Array  # (3, ...) m/s: its velocity in n, and the derivative of those components
    a: Array  # (3, ...) m/s^2


class Motion(ABC):
    """A motion known at any time.

    Kinds of motion define :meth:`kinematics`, those with corners also :attr:`breaks`, and those whose IMU moves in the
    body :meth:`arm`.
    """

    @abstractmethod
    def kinematics(self, t: Array) -> Kinematics:
        """Angles and the centre's path at times `t` (s), of any shape."""

    def arm(self, t: Array) -> tuple[Array, Array, Array]:
        """From the centre to the IMU, body axes, (..., 3) m, and its two derivatives; one that is fixed once for all times."""
        still = np.zeros((*(1,) * np.ndim(t), 3))
        return still + getattr(self, "lever_arm", (0.0, 0.0, 0.0)), still, still

    @property
    def breaks(self) -> Array:
        """Times where a higher derivative jumps, s: quadrature does not step across them."""
        return np.empty(0)

    @property
    def shortest_period(self) -> float:
        """Of the fastest oscillation, s: quadrature steps are an eighth of it at most."""
        return float("inf")

    def states(self, t: ArrayLike) -> MotionStates:
        """Attitude, velocity, position, rate and specific force at any times (s)."""
        t = np.asarray(t, dtype=np.float64)
        k = self.kinematics(t)
        sines, cosines = np.sin(k.angles), np.cos(k.angles)
        C_nb = dcm_elements(sines, cosines)
        w_nb, dw_nb = body_rates(sines, cosines, k.rates, k.accelerations)
        path = k.lat, k.lon, k.alt, k.v, k.a
        arm, d_arm, dd_arm = (np.moveaxis(x, -1, 0) for x in self.arm(t))
        if arm.any() or d_arm.any() or dd_arm.any():
            turning = _cross(w_nb, arm) + d_arm
            centripetal = _cross(dw_nb, arm) + _cross(w_nb, turning + d_arm) + dd_arm
            path = displaced(path, (_turned(C_nb, arm), _turned(C_nb, turning), _turned(C_nb, centripetal)))
        lat, lon, alt, v, a = path
        s, c, tan = np.sin(lat), np.cos(lat), np.tan(lat)
        R_M, R_N = radii_at(s**2)
        R_M, R_N = R_M + alt, R_N + alt

        def transport_rate(v: Array) -> Array:
            """``w_en`` of a velocity; of an acceleration what that changes it by."""
            east = v[0] / R_N
            return np.stack([-v[1] / R_M, east, east * tan])

        w_ie, w_en = EARTH_RATE * np.stack([np.zeros_like(lat), c, s]), transport_rate(v)
        f_n = a + _cross(2 * w_ie + w_en, v)
        f_n[2] += normal_gravity_at(s**2, alt)
        w_in_b = _turned_back(C_nb, w_ie + w_en)
        # The rate of n changes with acceleration; what it changes by the change of latitude, (v/R)^2, is left out.
        dw_in_b = _turned_back(C_nb, transport_rate(a)) - _cross(w_nb, w_in_b)
        found = C_nb, v, lat, lon, alt, w_nb + w_in_b, _turned_back(C_nb, f_n), dw_nb + dw_in_b
        return MotionStates(t, *(_by_time(x, t.shape) for x in found))


Path = tuple[Array, Array, Array, Array, Array]  # latitude, longitude, height, velocity, its derivative


def staying(place: Position, t: Array) -> Path:
    """The path of a point that stays, once for all times `t` (s)."""
    still, at_rest = np.zeros((1,) * t.ndim), np.zeros((3, *(1,) * t.ndim))
    return place.lat + still, place.lon + still, place.alt + still, at_rest, at_rest


def displaced(path: Path, away: tuple[Array, Array, Array]) -> Path:
    """The path of a point at a displacement of metres from another one.

    The displacement is taken along E, N, U of the first point's own local level; velocity is what the changes of latitude,
    longitude and height amount to on the curved earth where the second point is, so that position, velocity and force stay
    derivatives of each other: at 200 m/s an arm of 3 m makes .1 mm/s of difference.

    Parameters
    ----------
    path : tuple
        Of the first point: lat, lon, alt (...), v and dv/dt (3, ...).
    away : three (3, ...) arrays, m, m/s, m/s^2
        The displacement with its derivatives.
    """
    lat, lon, alt, v, a = path
    R_M, R_N = radii(lat)
    R_M, R_N, tan = R_M + alt, R_N + alt, np.tan(lat)
    (sE, sN, sU), (dE, dN, dU), _ = away
    plane, change = v + away[1], a + away[2]
    # v_N = (R_M + h + s_U) d/dt (L + s_N/(R_M + h)), v_E = (R_N + h + s_U) cos(L + ..) d/dt (l + s_E/((R_N + h) cos L)),
    # to first order in s/R.
    widening, widens = v[2] - v[1] * tan, a[2] - a[1] * tan
    east, d_east = sU - sN * tan, dU - dN * tan
    v_E = plane[0] + (east * plane[0] - sE * widening) / R_N
    v_N = plane[1] + (sU * plane[1] - sN * v[2]) / R_M
    a_E = change[0] + (d_east * plane[0] + east * change[0] - dE * widening - sE * widens) / R_N
    a_N = change[1] + (dU * plane[1] + sU * change[1] - dN * v[2] - sN * a[2]) / R_M
    return (
        lat + sN / R_M,
        lon + sE / (R_N * np.cos(lat)),
        alt + sU,
        np.stack([v_E, v_N, plane[2]]),
        np.stack([a_E, a_N, change[2]]),
    )


def body_rates(sines: Array, cosines: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """``w_nb_b`` and its derivative, (3, ...): ``C_nb = Rz(-h) Rx(p) Ry(r)`` differentiated once and twice.

    Parameters
    ----------
    sines, cosines : (3, ...) arrays
        Of heading, pitch and roll.
    rates, accelerations : (3, ...) arrays, rad/s, rad/s^2
        Of the same angles.
    """
    (_, sp, sr), (_, cp, cr) = sines, cosines
    dh, dp, dr = rates
    ddh, ddp, ddr = accelerations
    w_nb = np.stack([cr * dp + sr * cp * dh, dr - sp * dh, sr * dp - cr * cp * dh])
    dw_nb = np.stack(
        [
            cr * ddp - sr * dr * dp + sr * cp * ddh + (cr * cp * dr - sr * sp * dp) * dh,
            ddr - sp * ddh - cp * dp * dh,
            sr * ddp + cr * dr * dp - cr * cp * ddh + (sr * cp * dr + cr * sp * dp) * dh,
        ]
    )
    return w_nb, dw_nb


def _by_time(x: Array, shape: tuple[int, ...]) -> Array:
    """A number, a vector (3, ...) or a matrix (3, 3, ...) at times of a shape (...), its components behind those of the times."""
    axes = range(np.ndim(x) - len(shape))
    whole = np.broadcast_to(x, (*np.shape(x)[: len(axes)], *shape))
    return np.array(np.moveaxis(whole, axes, [k - len(axes) for k in axes]), order="C")[()]


def _turned(C: Array, v: Array) -> Array:
    """``C v``, summed as NumPy's einsum does."""
    return C[:, 0] * v[0] + C[:, 2] * v[2] + C[:, 1] * v[1]


def _turned_back(C: Array, v: Array) -> Array:
    """``C' v``."""
    return C[0] * v[0] + C[1] * v[1] + C[2] * v[2]


def _cross(a: Array, b: Array) -> Array:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
