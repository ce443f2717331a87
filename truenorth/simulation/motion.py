"""Motion of a base, analytic: rest and sway, with the rates, forces and increments that an ideal IMU measures.

Increments are integrals of the analytic rate and specific force over each interval by Gauss-Legendre quadrature of four
nodes: exact to rounding for any motion of many samples a period.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.attitude import dcm_from_euler
from truenorth.earth import earth_rate_n, gravity_n, radii, transport_rate_n
from truenorth.position import Position

Array = NDArray[np.float64]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)
BLOCK = 4096  # intervals at once: keeps the work arrays in the cache


@dataclass(frozen=True)
class Tone:
    """One sinusoid, ``amplitude * cos(2 pi t / period + phase)``.

    Attributes
    ----------
    amplitude : float, rad or m
    period : float, s
    phase : float, rad
    """

    amplitude: float
    period: float
    phase: float = 0.0


@dataclass(frozen=True)
class Sway:
    """A base that sways about a fixed place; without tones, a base at rest.

    Attributes
    ----------
    position : Position
        Of the centre of rotation.
    heading, pitch, roll : float, rad
        Mean attitude.
    heading_tones, pitch_tones, roll_tones : tuple of Tone
        Angles are the mean plus ``sum A cos(w t + phase)``.
    east_tones, north_tones, up_tones : tuple of Tone
        The centre's displacement is ``sum A sin(w t + phase)``, its velocity ``sum A w cos(w t + phase)``.
    lever_arm : (3,) sequence, m
        From the centre of rotation to the IMU, body axes.
    """

    position: Position
    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    heading_tones: tuple[Tone, ...] = ()
    pitch_tones: tuple[Tone, ...] = ()
    roll_tones: tuple[Tone, ...] = ()
    east_tones: tuple[Tone, ...] = ()
    north_tones: tuple[Tone, ...] = ()
    up_tones: tuple[Tone, ...] = ()
    lever_arm: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0))

    def states(self, t: ArrayLike) -> MotionStates:
        """Attitude, velocity, position, rate and specific force at any times (s)."""
        t = np.asarray(t, dtype=np.float64)
        h, dh, ddh = _angle(self.heading, self.heading_tones, t)
        p, dp, ddp = _angle(self.pitch, self.pitch_tones, t)
        r, dr, ddr = _angle(self.roll, self.roll_tones, t)
        C_nb = dcm_from_euler(h, p, r)
        sp, cp, sr, cr = np.sin(p), np.cos(p), np.sin(r), np.cos(r)
        # C_nb = Rz(-h) Rx(p) Ry(r) differentiated, and differentiated again.
        w_nb = np.stack([cr * dp + sr * cp * dh, dr - sp * dh, sr * dp - cr * cp * dh], -1)
        dw_nb = np.stack(
            [
                cr * ddp - sr * dr * dp + sr * cp * ddh + (cr * cp * dr - sr * sp * dp) * dh,
                ddr - sp * ddh - cp * dp * dh,
                sr * ddp + cr * dr * dp - cr * cp * ddh + (sr * cp * dr + cr * sp * dp) * dh,
            ],
            -1,
        )
        arm = np.asarray(self.lever_arm, dtype=np.float64)
        turning = np.cross(w_nb, arm)
        s, v, a = (np.stack(x, -1) for x in zip(*(_shift(k, t) for k in self._shifts), strict=True))
        s = s + (C_nb @ arm)
        v = v + _apply(C_nb, turning)
        a = a + _apply(C_nb, np.cross(dw_nb, arm) + np.cross(w_nb, turning))

        place = self.position
        R_M, R_N = radii(place.lat)  # displacements are metres: the radii change by a part in 1e9
        lat = place.lat + s[..., 1] / (R_M + place.alt)
        lon = place.lon + s[..., 0] / ((R_N + place.alt) * np.cos(place.lat))
        alt = place.alt + s[..., 2]
        w_ie, w_en = earth_rate_n(lat), transport_rate_n(lat, alt, v)
        f_n = a + np.cross(2 * w_ie + w_en, v) - gravity_n(lat, alt)
        C_bn = np.swapaxes(C_nb, -1, -2)
        return MotionStates(
            time=t,
            C_nb=C_nb,
            v_n=v,
            lat=lat,
            lon=lon,
            alt=alt,
            w_ib_b=w_nb + _apply(C_bn, w_ie + w_en),
            f_b=_apply(C_bn, f_n),
        )

    @property
    def _shifts(self) -> tuple[tuple[Tone, ...], ...]:
        return self.east_tones, self.north_tones, self.up_tones

    def increments(self, edges: Array) -> tuple[Array, Array]:
        """Integrals of rate and specific force between successive `edges` (N+1,), as (N, 3) rad and m/s."""
        count = len(edges) - 1
        dtheta, dvel = np.empty((count, 3)), np.empty((count, 3))
        for first in range(0, count, BLOCK):
            rows = slice(first, min(first + BLOCK, count))
            start, length = edges[rows], np.diff(edges[first : rows.stop + 1])
            nodes = start[:, None] + 0.5 * length[:, None] * (1.0 + NODES)
            at = self.states(nodes)
            weights = 0.5 * length[:, None] * WEIGHTS
            dtheta[rows] = np.einsum("kn,kni->ki", weights, at.w_ib_b)
            dvel[rows] = np.einsum("kn,kni->ki", weights, at.f_b)
        return dtheta, dvel


@dataclass(frozen=True)
class MotionStates:
    """True motion at a set of times, any leading shape.

    Attributes
    ----------
    time : (...) array, s
    C_nb : (..., 3, 3) array
    v_n : (..., 3) array, m/s
    lat, lon, alt : (...) arrays, rad and m
    w_ib_b : (..., 3) array, rad/s
    f_b : (..., 3) array, m/s^2
    """

    time: Array
    C_nb: Array
    v_n: Array
    lat: Array
    lon: Array
    alt: Array
    w_ib_b: Array
    f_b: Array


def rest(position: Position, heading: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Sway:
    """A base at rest; angles in rad."""
    return Sway(position, heading, pitch, roll)


def _angle(mean: float, tones: tuple[Tone, ...], t: Array) -> tuple[Array, Array, Array]:
    value, rate, acceleration = np.full_like(t, mean), np.zeros_like(t), np.zeros_like(t)
    for tone in tones:
        w = 2 * np.pi / tone.period
        cosine, sine = np.cos(w * t + tone.phase), np.sin(w * t + tone.phase)
        value += tone.amplitude * cosine
        rate -= tone.amplitude * w * sine
        acceleration -= tone.amplitude * w**2 * cosine
    return value, rate, acceleration


def _shift(tones: tuple[Tone, ...], t: Array) -> tuple[Array, Array, Array]:
    value, rate, acceleration = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for tone in tones:
        w = 2 * np.pi / tone.period
        cosine, sine = np.cos(w * t + tone.phase), np.sin(w * t + tone.phase)
        value += tone.amplitude * sine
        rate += tone.amplitude * w * cosine
        acceleration -= tone.amplitude * w**2 * sine
    return value, rate, acceleration


def _apply(C: Array, v: Array) -> Array:
    return np.einsum("...ij,...j->...i", C, v)
