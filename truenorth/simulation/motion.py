"""Motion of an IMU on the ellipsoid: from angles and the path of a centre to rates and forces.

A motion gives its angles, velocity and acceleration in closed form; rate and specific force follow by rigid-body
kinematics. Their integrals over each sampling interval are taken in :mod:`truenorth.simulation.sensing`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.core.earth import earth_rate_n, gravity_n, radii, transport_rate_n
from truenorth.records.motion import MotionStates

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Kinematics:
    """Motion of the body and of its centre, as a kind of motion gives it."""

    angles: Array  # (3, ...) rad: heading, pitch, roll and their derivatives
    rates: Array  # (3, ...) rad/s
    accelerations: Array  # (3, ...) rad/s^2
    lat: Array  # (...): of the centre
    lon: Array  # (...)
    alt: Array  # (...)
    v: Array  # (..., 3) m/s: its velocity in n, and the derivative of those components
    a: Array  # (..., 3) m/s^2


class Motion(ABC):
    """A motion known at any time.

    Kinds of motion define :meth:`kinematics`, those with corners also :attr:`breaks`, and those whose IMU moves in the
    body :meth:`arm`.
    """

    @abstractmethod
    def kinematics(self, t: Array) -> Kinematics:
        """Angles and the centre's path at times `t` (s), of any shape."""

    def arm(self, t: Array) -> tuple[Array, Array, Array]:
        """From the centre to the IMU, body axes, (..., 3) m, and its two derivatives."""
        fixed = np.asarray(getattr(self, "lever_arm", (0.0, 0.0, 0.0)), dtype=np.float64)
        still = np.zeros((*np.shape(t), 3))
        return still + fixed, still, still

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
        C_nb = dcm_from_euler(*k.angles)
        w_nb, dw_nb = body_rates(k.angles, k.rates, k.accelerations)
        lat, lon, alt, v, a = k.lat, k.lon, k.alt, k.v, k.a
        arm, d_arm, dd_arm = self.arm(t)
        if arm.any() or d_arm.any() or dd_arm.any():
            turning = np.cross(w_nb, arm) + d_arm
            centripetal = np.cross(dw_nb, arm) + np.cross(w_nb, turning + d_arm) + dd_arm
            away = _apply(C_nb, arm), _apply(C_nb, turning), _apply(C_nb, centripetal)
            lat, lon, alt, v, a = displaced((lat, lon, alt, v, a), away)
        w_ie, w_en = earth_rate_n(lat), transport_rate_n(lat, alt, v)
        f_n = a + np.cross(2 * w_ie + w_en, v) - gravity_n(lat, alt)
        C_bn = np.swapaxes(C_nb, -1, -2)
        w_in_b = _apply(C_bn, w_ie + w_en)
        # The rate of n changes with acceleration; what it changes by the change of latitude, (v/R)^2, is left out.
        dw_in_b = _apply(C_bn, transport_rate_n(lat, alt, a)) - np.cross(w_nb, w_in_b)
        w_ib_b, dw_ib_b = w_nb + w_in_b, dw_nb + dw_in_b
        return MotionStates(t, C_nb, v, lat, lon, alt, w_ib_b, _apply(C_bn, f_n), dw_ib_b)


Path = tuple[Array, Array, Array, Array, Array]  # latitude, longitude, height, velocity, its derivative


def displaced(path: Path, away: tuple[Array, Array, Array]) -> Path:
    """The path of a point at a displacement of metres from another one.

    The displacement is taken along E, N, U of the first point's own local level; velocity is what the changes of latitude,
    longitude and height amount to on the curved earth where the second point is, so that position, velocity and force stay
    derivatives of each other: at 200 m/s an arm of 3 m makes .1 mm/s of difference.

    Parameters
    ----------
    path : tuple
        Of the first point: lat, lon, alt (...), v and dv/dt (..., 3).
    away : three (..., 3) arrays, m, m/s, m/s^2
        The displacement with its derivatives.
    """
    lat, lon, alt, v, a = path
    R_M, R_N = radii(lat)
    R_M, R_N, tan = R_M + alt, R_N + alt, np.tan(lat)
    (sE, sN, sU), (dE, dN, dU), _ = (np.moveaxis(x, -1, 0) for x in away)
    plane, change = v + away[1], a + away[2]
    # v_N = (R_M + h + s_U) d/dt (L + s_N/(R_M + h)), v_E = (R_N + h + s_U) cos(L + ..) d/dt (l + s_E/((R_N + h) cos L)),
    # to first order in s/R.
    widening, widens = v[..., 2] - v[..., 1] * tan, a[..., 2] - a[..., 1] * tan
    east, d_east = sU - sN * tan, dU - dN * tan
    v_E = plane[..., 0] + (east * plane[..., 0] - sE * widening) / R_N
    v_N = plane[..., 1] + (sU * plane[..., 1] - sN * v[..., 2]) / R_M
    a_E = change[..., 0] + (d_east * plane[..., 0] + east * change[..., 0] - dE * widening - sE * widens) / R_N
    a_N = change[..., 1] + (dU * plane[..., 1] + sU * change[..., 1] - dN * v[..., 2] - sN * a[..., 2]) / R_M
    return (
        lat + sN / R_M,
        lon + sE / (R_N * np.cos(lat)),
        alt + sU,
        np.stack([v_E, v_N, plane[..., 2]], -1),
        np.stack([a_E, a_N, change[..., 2]], -1),
    )


def body_rates(angles: Array, rates: Array, accelerations: Array) -> tuple[Array, Array]:
    """``w_nb_b`` and its derivative, (..., 3): ``C_nb = Rz(-h) Rx(p) Ry(r)`` differentiated once and twice."""
    _, p, r = angles
    dh, dp, dr = rates
    ddh, ddp, ddr = accelerations
    sp, cp, sr, cr = np.sin(p), np.cos(p), np.sin(r), np.cos(r)
    w_nb = np.stack([cr * dp + sr * cp * dh, dr - sp * dh, sr * dp - cr * cp * dh], -1)
    dw_nb = np.stack(
        [
            cr * ddp - sr * dr * dp + sr * cp * ddh + (cr * cp * dr - sr * sp * dp) * dh,
            ddr - sp * ddh - cp * dp * dh,
            sr * ddp + cr * dr * dp - cr * cp * ddh + (sr * cp * dr + cr * sp * dp) * dh,
        ],
        -1,
    )
    return w_nb, dw_nb


def _apply(C: Array, v: Array) -> Array:
    return np.einsum("...ij,...j->...i", C, v)
