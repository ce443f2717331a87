"""A world that shares no code with the simulator of the library: earth, motion and sensors written anew, from books.

The earth is WGS-84 with its zonal harmonics up to J6 (Hofmann-Wellenhof and Moritz, "Physical Geodesy", 2-93), a gravity
disturbance and a deflection of the vertical. A vehicle (:mod:`benchmarks.honesty.vehicles`) gives velocity and attitude every
two milliseconds; place is their integral, and what an IMU feels is found from attitudes between two such steps and from velocity's
change, so that nothing is differentiated by hand. Sensors have errors of the sizes that the specification promises, besides some
that no specification has: temperature, coloured fixes, multipath, pulses, slip, stamps that scatter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfilt

from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]
A, F, GM, RATE = 6378137.0, 1.0 / 298.257223563, 3.986004418e14, 7.292115e-5  # WGS-84
E2 = F * (2.0 - F)
# J2, J4, J6 of the ellipsoid
ZONAL = {2: 1.082629821e-3, 4: -2.37091222e-6, 6: 6.08347e-9}
STEP = 0.002  # s
ARCSEC = math.pi / 648000.0


@dataclass(frozen=True)
class World:
    """What is true: M epochs, STEP apart, of the IMU; and the increments between them that a perfect one feels."""

    time: Array  # (M,)
    place: Array  # (M, 3) lat, lon, alt
    v: Array  # (M, 3) east, north, up
    C: Array  # (M, 3, 3) body to east, north, up
    turned: Array  # (M-1, 3) rad
    gained: Array  # (M-1, 3) m/s
    speed: Array  # (M,) of the wheel, m/s

    def at(self, time: Any) -> tuple[Array, Array, Array]:
        """Places, velocities and attitudes at some times, between the epochs where they fall there."""
        x = np.clip((np.asarray(time) - self.time[0]) / STEP, 0.0, len(self.time) - 1.001)
        k = x.astype(int)
        part = (x - k)[..., None]
        place, v = (a[k] + part * (a[k + 1] - a[k]) for a in (self.place, self.v))
        return place, v, self.C[k] @ exp(part * log(np.swapaxes(self.C[k], -1, -2) @ self.C[k + 1]))


def exp(r: Array) -> Array:
    """Rotation by (..., 3) vectors: Rodrigues' formula, ``cos I + sinc [r x] + (1 - cos) r r' / r^2``."""
    square = np.sum(r**2, axis=-1)
    angle = np.sqrt(square)
    part = 0.5 * np.sinc(angle / (2.0 * math.pi)) ** 2
    x, y, z = np.moveaxis(np.sinc(angle / math.pi)[..., None] * r, -1, 0)
    C = (part[..., None] * r)[..., :, None] * r[..., None, :]
    C += (1.0 - part * square)[..., None, None] * np.eye(3)
    for i, j, s in ((2, 1, x), (0, 2, y), (1, 0, z)):
        C[..., i, j] += s
        C[..., j, i] -= s
    return np.asarray(C)


def log(C: Array) -> Array:
    """(..., 3) rotation vectors of small rotations."""
    s = 0.5 * np.stack([C[..., 2, 1] - C[..., 1, 2], C[..., 0, 2] - C[..., 2, 0], C[..., 1, 0] - C[..., 0, 1]], axis=-1)
    size = np.linalg.norm(s, axis=-1)[..., None]
    cos = 0.5 * (np.trace(C, axis1=-2, axis2=-1)[..., None] - 1.0)
    return np.asarray(s * np.where(size > 0.0, np.arctan2(size, cos) / np.maximum(size, 1e-300), 1.0))


def attitude(heading: Array, pitch: Array, roll: Array) -> Array:
    """Body (right, forward, up) to east, north, up; heading clockwise, nose up, right side down."""
    zero = np.zeros_like(heading)
    about = (np.stack(v, axis=-1) for v in ((zero, zero, -heading), (pitch, zero, zero), (zero, roll, zero)))
    yaw, nod, tilt = (exp(r) for r in about)
    return np.asarray(yaw @ nod @ tilt)


def gravity(lat: Array, alt: Array) -> Array:
    """(M, 3) east, north, up: attraction by zonal harmonics and the centrifugal force."""
    R_N = A / np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
    x, z = (R_N + alt) * np.cos(lat), (R_N * (1.0 - E2) + alt) * np.sin(lat)
    r = np.hypot(x, z)
    u, c = z / r, x / r  # sine and cosine of the geocentric latitude
    radial, south = -GM / r**2, np.zeros_like(r)
    for n, J in ZONAL.items():
        P = np.polynomial.legendre.Legendre.basis(n)
        size = GM / r**2 * J * (A / r) ** n
        radial = radial + (n + 1) * size * P(u)
        south = south + size * P.deriv()(u) * c  # -(1/r) dV/dlat
    out, up = radial * c + south * u + RATE**2 * x, radial * u - south * c
    return np.stack(
        [np.zeros_like(r), -out * np.sin(lat) + up * np.cos(lat), out * np.cos(lat) + up * np.sin(lat)], axis=1
    )


def world(rng: np.random.Generator, start: Array, v: Array, C: Array, shift: Array, speed: Array) -> World:
    """The world of a vehicle whose centre has velocities `v` and whose IMU is displaced by `shift` (body axes)."""
    M = len(v)
    off = np.einsum("kij,kj->ki", C, shift)
    v = v + np.gradient(off, STEP, axis=0)
    place = np.tile(start, (M, 1))
    for _ in range(4):  # Picard: radii depend on place by a part of 1e-7 a metre
        s2 = np.sin(place[:, 0]) ** 2
        R_N, R_M = A / np.sqrt(1.0 - E2 * s2), A * (1.0 - E2) / (1.0 - E2 * s2) ** 1.5
        rates = np.stack(
            [v[:, 1] / (R_M + place[:, 2]), v[:, 0] / ((R_N + place[:, 2]) * np.cos(place[:, 0])), v[:, 2]], axis=1
        )
        place = start + np.vstack([np.zeros(3), np.cumsum(0.5 * (rates[1:] + rates[:-1]), axis=0) * STEP])
    lat = place[:, 0]
    earth = RATE * np.stack([np.zeros(M), np.cos(lat), np.sin(lat)], axis=1)
    carried = np.stack([-rates[:, 0], rates[:, 1] * np.cos(lat), rates[:, 1] * np.sin(lat)], axis=1)
    g = gravity(lat, place[:, 2])
    xi = 6.0 * ARCSEC * rng.standard_normal(2)
    g[:, :2] -= 9.81 * xi  # the plumb line's foot points west and south where its deflection is east and north
    g[:, 2] += 25e-5 * rng.standard_normal()

    def mean(a: Array) -> Array:
        return np.asarray(0.5 * (a[1:] + a[:-1]))

    between = np.swapaxes(C[:-1], 1, 2) @ exp(mean(earth + carried) * STEP) @ C[1:]
    turned = log(between)
    C_mid = exp(-0.5 * mean(carried + earth) * STEP) @ C[:-1] @ exp(0.5 * turned)
    force = np.diff(v, axis=0) + (np.cross(mean(2.0 * earth + carried), mean(v)) - mean(g)) * STEP
    return World(STEP * np.arange(M), place, v, C, turned, np.einsum("kji,kj->ki", C_mid, force), speed)


def coloured(rng: np.random.Generator, count: int, step: float, sigma: float, time: float, axes: int = 3) -> Array:
    """(count, axes) Gauss-Markov from its steady state."""
    a = math.exp(-step / time)
    white = sigma * math.sqrt(1.0 - a * a) * rng.standard_normal((count, axes))
    white[0] = sigma * rng.standard_normal(axes)
    return np.asarray(lfilter([1.0], [1.0, -a], white, axis=0))


def _sensed(rng: np.random.Generator, spec: ImuSpec, group: str, true: Array, step: float, time: Array) -> Array:
    """Rates with errors of a specification's sizes."""
    size = {k: getattr(spec, f"{group}_{k}") for k in ("bias", "bias_instability", "random_walk", "scale_factor")}
    axes = spec.gyro_misalignment if group == "gyro" else spec.accel_misalignment
    M = axes * rng.standard_normal((3, 3))
    np.fill_diagonal(M, size["scale_factor"] * rng.standard_normal(3))
    slow = coloured(rng, len(true), step, size["bias_instability"], rng.uniform(200.0, 600.0))
    # it warms up: as much as the instability, which a datasheet measures over such times
    warm = (
        size["bias_instability"] * rng.standard_normal(3) * (1.0 - np.exp(-time / rng.uniform(300.0, 900.0)))[:, None]
    )
    noise = size["random_walk"] / math.sqrt(step) * rng.standard_normal(true.shape)
    return np.asarray(true + true @ M.T + size["bias"] * rng.standard_normal(3) + slow + warm + noise)


# One step of the output: of rates, rad/s and m/s^2, by 16 bits of 250 deg/s and 4 g; of increments, rad and m/s
LSB = {"rates": (math.radians(500.0) / 2**16, 8.0 * 9.81 / 2**16), "increments": (0.1 * ARCSEC, 1e-6)}


def sensed(rng: np.random.Generator, true: World, spec: ImuSpec, rate: float = 100.0) -> ImuRecord:
    """An IMU's log: increments of the better grades, behind no filter; rates of the cheaper, behind one of two poles."""
    fine = round(1.0 / (rate * STEP))
    kind = "increments" if spec.name in ("navigation", "tactical") else "rates"
    rows = (len(true.turned) // fine) * fine
    felt = []
    for a in (true.turned, true.gained):
        if kind == "increments":
            felt.append(a[:rows].reshape(-1, fine, 3).sum(axis=1) * rate)
        else:
            low = butter(2, rng.uniform(80.0, 120.0) if rate > 150.0 else rng.uniform(40.0, 60.0), fs=1.0 / STEP)
            smooth = lfilter(*low, a / STEP - a[0] / STEP, axis=0) + a[0] / STEP
            felt.append(
                0.5 * (smooth[fine - 1 : rows : fine] + smooth[np.minimum(np.arange(fine, rows + 1, fine), rows - 1)])
            )
    time = np.arange(1, rows // fine + 1) / rate
    values = []
    for group, a, lsb in zip(("gyro", "accel"), felt, LSB[kind], strict=True):
        b = _sensed(rng, spec, group, a, 1.0 / rate, time)
        if kind == "increments":  # what is cut off is carried on
            b = np.diff(lsb * np.round(np.cumsum(b / rate, axis=0) / lsb), axis=0, prepend=0.0)
        else:
            b = lsb * np.round(b / lsb)
        values.append(b)
    if kind == "rates":
        time = np.round(time + 1e-4 * rng.standard_normal(len(time)), 4)
        time = np.maximum.accumulate(time + 1e-9 * np.arange(len(time)))
    return ImuRecord(time, values[0], values[1], kind)  # type: ignore[arg-type]  # one of the two


def fixed(
    rng: np.random.Generator,
    true: World,
    arm: Array,
    every: float = 1.0,
    jumps: int = 0,
    speeds: bool = True,
    stays: bool = False,
    scatter: float = 0.0,
) -> GnssRecord:
    """A receiver's fixes: white and slow errors, its own idea of their size, a latency, the jumps of multipath.

    `stays`: they have an error that stays, too, of which the receiver knows the size. `scatter`: one sigma of their stamps, s, as
    of rows that are stamped when they arrive.
    """
    time = np.arange(rng.uniform(0.2, 1.0), true.time[-1] - 0.5, every)
    at = time - rng.uniform(0.0, 0.03)  # of what a stamp says
    if scatter > 0.0:
        at = np.clip(at + scatter * rng.standard_normal(len(at)), 0.05, true.time[-1] - 0.05)
    place, v, C = true.at(at)
    half = 0.02
    after, before = (true.at(at + d) for d in (half, -half))
    turning = (after[2] - before[2]) @ arm / (2.0 * half)
    slow, white = rng.uniform(1.0, 3.0), rng.uniform(0.3, 1.0)
    up = np.array([1.0, 1.0, 1.7])
    off = up * (coloured(rng, len(at), every, slow, rng.uniform(30.0, 100.0)) + white * rng.standard_normal(v.shape))
    for _ in range(jumps):
        first = rng.uniform(0.0, time[-1])
        off[(time > first) & (time < first + rng.uniform(4.0, 12.0))] += rng.uniform(4.0, 15.0) * _way(rng)
    constant = rng.uniform(1.0, 3.0) if stays else 0.0
    if stays:
        off = off + up * constant * rng.standard_normal(3)
    quick = rng.uniform(0.03, 0.08)
    dv = up * (quick * rng.standard_normal(v.shape) + coloured(rng, len(at), every, 0.5 * quick, 5.0))
    off = off + C @ arm
    s2 = np.sin(place[:, 0]) ** 2
    R_N, R_M = A / np.sqrt(1.0 - E2 * s2), A * (1.0 - E2) / (1.0 - E2 * s2) ** 1.5
    lat = place[:, 0] + off[:, 1] / (R_M + place[:, 2])
    lon = place[:, 1] + off[:, 0] / ((R_N + place[:, 2]) * np.cos(place[:, 0]))
    says = rng.uniform(0.8, 1.25)
    return GnssRecord(
        time,
        lat,
        lon,
        place[:, 2] + off[:, 2],
        v_n=v + turning + dv if speeds else None,
        position_sigma=np.tile(says * math.hypot(slow, white, constant) * up, (len(at), 1)),
        velocity_sigma=np.tile(says * 1.1 * quick * up, (len(at), 1)) if speeds else None,
    )


def _way(rng: np.random.Generator) -> Array:
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def counted(rng: np.random.Generator, true: World) -> OdometerRecord:
    """Pulses of a wheel, ten times a second, that slips a little and whose size is wrong by a per cent."""
    rows = np.arange(0, len(true.time), 50)
    slip = 1.0 + 0.01 * rng.standard_normal() + coloured(rng, len(true.time), STEP, 0.003, 5.0, 1)[:, 0]
    way = np.concatenate([[0.0], np.cumsum(true.speed[:-1] * slip[:-1]) * STEP])[rows]
    size = rng.uniform(0.01, 0.04)
    return OdometerRecord(true.time[rows][1:], np.diff(np.floor(way / size + rng.random())), "pulses", size)


def logged(rng: np.random.Generator, true: World) -> VelocityRecord:
    """A Doppler log in body axes at 5 Hz: bottom track, scale, mounting, white noise."""
    rows = np.arange(50, len(true.time), 100)
    v = np.einsum("kji,kj->ki", true.C[rows], true.v[rows])
    v = (1.0 + 0.003 * rng.standard_normal()) * v @ exp(math.radians(0.4) * rng.standard_normal(3)).T
    v += 0.002 * rng.standard_normal(3) + 0.01 * rng.standard_normal(v.shape)
    return VelocityRecord(true.time[rows], v, "body", np.full_like(v, 0.01))


def noise(rng: np.random.Generator, count: int, low: float, high: float, rms: float) -> Array:
    """(count,) a band of noise, Hz, every STEP."""
    sos = butter(4, [low, high], "bandpass", fs=1.0 / STEP, output="sos")
    lead = int(4.0 / (low * STEP))
    x = sosfilt(sos, rng.standard_normal(count + lead))[lead:]
    return np.asarray(rms * x / x.std())
