"""A ship for hours in waves, in a world that shares no code with the simulator of the library: at the quay first, then at sea.

Its log sits somewhere in the hull, its own filter makes it late, and in the water it shows the current, with a tide. The plumb line
bends along the way, as a process over distance. Motion is smooth by splines; what an IMU feels are their integrals, exact but for
rounding (a perfect IMU navigated for four hours has a velocity .1 mm/s off).

Run: ``python -m benchmarks.honesty.sailing --runs 10``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

import truenorth
from benchmarks.honesty.foreign import ARCSEC, E2, RATE, A, attitude, coloured, gravity
from benchmarks.honesty.frame import Case, Outcome, main
from truenorth.core.attitude import misalignment
from truenorth.damping.options import Damper
from truenorth.records import ImuRecord, VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import DP, DV, PHI

Array = NDArray[np.float64]
STEP, QUAY, HOURS, HOUR, DEG = 0.1, 1200.0, 12.0, 3600.0, math.radians(1.0)
# Of logs: scale, mounting (deg), bias (m/s), noise (m/s)
LOGS = {
    "em": (0.005, 0.3, 0.1, 0.1),
    "doppler-water": (0.003, 0.2, 0.02, 0.05),
    "doppler-bottom": (0.003, 0.2, 0.02, 0.02),
}


@dataclass(frozen=True)
class Sailed:
    """The truth, STEP apart, and the increments between that a perfect IMU feels."""

    time: Array
    place: Array  # (M, 3) lat, lon, alt
    v: Array  # (M, 3) east, north, up
    C: Array  # (M, 3, 3)
    rate: Array  # (M, 3) of the body, rad/s
    turned: Array  # (M-1, 3) rad
    gained: Array  # (M-1, 3) m/s
    current: Array  # (M, 2) m/s


def _slow(x: Array, time: float) -> Array:
    """Three first-order lags in a row."""
    a = math.exp(-STEP / time)
    for _ in range(3):
        x = lfilter([1.0 - a], [1.0, -a], x, zi=[x[0] * a])[0]
    return x


def sailed(rng: np.random.Generator) -> Sailed:
    """Twenty minutes at the quay, then legs of a quarter to one and a half hours at 4 to 12 m/s, turns of up to 170 deg."""
    t = np.arange(0.0, QUAY + HOURS * HOUR, STEP)
    cruise, at = rng.uniform(4.0, 12.0), QUAY + 400.0
    turn, speed = np.zeros(len(t)), np.where(t < QUAY + 30.0, 0.0, cruise)
    while at < t[-1] - 600.0:
        angle, rate = rng.uniform(10.0, 170.0) * rng.choice([-1.0, 1.0]), rng.uniform(0.3, 1.2)
        end = at + abs(angle) / rate
        turn[(t >= at) & (t < end)] = math.copysign(rate * DEG, angle)
        if rng.uniform() < 0.3:
            speed[t >= end] = rng.uniform(0.3, 1.0) * cruise
        at = end + rng.uniform(900.0, 5400.0)
    turn, speed = _slow(turn, 4.0), _slow(speed, 20.0)
    sea = _slow(np.where(t < QUAY, 0.15, 1.0), 60.0) * rng.uniform(0.3, 1.5)

    def swing(size: float, least: float, most: float) -> Array:
        tones = (
            0.5 * rng.uniform(0.3, 1.0) * np.sin(2.0 * math.pi * (t / rng.uniform(least, most) + rng.uniform()))
            for _ in range(4)
        )
        return size * sea * sum(tones)

    heading = rng.uniform(0.0, 2.0 * math.pi) + np.cumsum(turn) * STEP + swing(0.8 * DEG, 8.0, 14.0)
    pitch, roll = swing(1.2 * DEG, 5.0, 9.0), swing(4.0 * DEG, 7.0, 13.0) - 0.3 * turn * speed
    ahead, aside, up = speed + swing(0.3, 6.0, 10.0), swing(0.4, 6.0, 10.0) - 12.0 * turn, swing(0.5, 6.0, 10.0)
    minutes = np.arange(0.0, t[-1] + 120.0, 60.0)
    wander = coloured(rng, len(minutes), 60.0, rng.uniform(0.1, 0.4), rng.uniform(2.0, 8.0) * HOUR, 2)
    tide = rng.uniform(0.0, 0.4) * np.stack([np.cos(t / 7116.0 + 1.0), np.sin(t / 7116.0)], axis=1)
    current = (CubicSpline(minutes, wander)(t) + tide) * _slow(np.where(t < QUAY + 30.0, 0.0, 1.0), 60.0)[:, None]
    s, c = np.sin(heading), np.cos(heading)
    v = np.stack([ahead * s + aside * c + current[:, 0], ahead * c - aside * s + current[:, 1], up], axis=1)
    lat0 = rng.uniform(-60.0, 65.0) * DEG
    lat = lat0 + CubicSpline(t, v[:, 1]).antiderivative()(t) / A
    for _ in range(4):  # Picard
        lat = lat0 + CubicSpline(t, v[:, 1] * (1.0 - E2 * np.sin(lat) ** 2) ** 1.5 / (A * (1.0 - E2))).antiderivative()(
            t
        )
    root = np.sqrt(1.0 - E2 * np.sin(lat) ** 2)
    R_N, R_M = A / root, A * (1.0 - E2) / root**3
    lon = CubicSpline(t, v[:, 0] / (R_N * np.cos(lat))).antiderivative()(t)
    alt = CubicSpline(t, up).antiderivative()(t)
    earth = RATE * np.stack([0.0 * t, np.cos(lat), np.sin(lat)], axis=1)
    carried = np.stack([-v[:, 1] / R_M, v[:, 0] / R_N, v[:, 0] / R_N * np.tan(lat)], axis=1)
    gone = np.cumsum(np.hypot(v[:, 0], v[:, 1])) * STEP
    miles = np.arange(0.0, gone[-1] + 2000.0, 500.0)
    xi = CubicSpline(miles, coloured(rng, len(miles), 500.0, 3.0 * ARCSEC, 20e3, 2))(gone)
    g = gravity(lat, alt)
    g[:, :2] -= 9.81 * xi
    force = CubicSpline(t, v).derivative()(t) + np.cross(2.0 * earth + carried, v) - g
    C = attitude(heading, pitch, roll)
    dh, dp, dr = (CubicSpline(t, x).derivative()(t) for x in (-heading, pitch, roll))
    level = np.stack([dp, dr, dh], axis=1)  # about the axes of pitch, roll and heading, in the body:
    body = np.stack([np.cos(roll), 0.0 * t, np.sin(roll)], axis=1) * level[:, :1] + [0.0, 1.0, 0.0] * level[:, 1:2]
    body += C[:, 2] * level[:, 2:]
    rate = body + np.einsum("kji,kj->ki", C, earth + carried)
    felt = np.einsum("kji,kj->ki", C, force)
    turned, gained = (np.diff(CubicSpline(t, x).antiderivative()(t), axis=0) for x in (rate, felt))
    return Sailed(t, np.stack([lat, lon, alt], axis=1), v, C, rate, turned, gained, current)


def sensed(rng: np.random.Generator, ship: Sailed, spec: ImuSpec) -> ImuRecord:
    """Increments with the errors that the specification promises, half of its bias warming off in two hours besides."""
    rows = []
    for true, kind in ((ship.turned, "gyro"), (ship.gained, "accel")):

        def of(name: str, kind: str = kind) -> float:
            return float(getattr(spec, f"{kind}_{name}"))

        axes = of("misalignment") * rng.standard_normal((3, 3)) * (1.0 - np.eye(3))
        axes += np.diag(of("scale_factor") * rng.standard_normal(3))
        bias = of("bias") * rng.standard_normal(3)
        bias = bias + coloured(rng, len(true), STEP, of("bias_instability"), spec.correlation_time)
        bias += 0.5 * of("bias") * rng.standard_normal(3) * np.exp(-ship.time[1:, None] / 7200.0)
        white = of("random_walk") * math.sqrt(STEP) * rng.standard_normal(true.shape)
        rows.append(true @ (np.eye(3) + axes).T + bias * STEP + white)
    return ImuRecord(ship.time[1:], rows[0], rows[1], "increments", "ship of another world")


def logged(rng: np.random.Generator, ship: Sailed, kind: str) -> VelocityRecord:
    """Once a second, in steps of a centimetre a second: up to 40 m from the IMU, behind a filter of up to three seconds."""
    scale, mounting, bias, noise = LOGS[kind]
    arm = np.array([rng.uniform(-3.0, 3.0), rng.uniform(-30.0, 40.0), -5.0])
    seen = ship.v.copy()
    seen[:, :2] -= ship.current * (kind != "doppler-bottom")
    v = np.einsum("kji,kj->ki", ship.C, seen) + np.cross(ship.rate, arm)
    turn = mounting * DEG * rng.standard_normal()
    v = (1.0 + scale * rng.standard_normal()) * v
    v = np.stack([v[:, 0] - turn * v[:, 1], v[:, 1] + turn * v[:, 0], v[:, 2]], axis=1)
    v[:, :2] += bias * rng.standard_normal(2)
    a = math.exp(-STEP / rng.uniform(0.1, 3.0))
    v = lfilter([1.0 - a], [1.0, -a], v, axis=0)[1::10]
    return VelocityRecord(
        ship.time[1::10], np.round(v + noise * rng.standard_normal(v.shape), 2), "body", source="log of another world"
    )


def damped(method: str, kind: str) -> Any:
    """A run: aligned at the quay, navigated for hours and damped; of the log its kind is said."""

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 5])
        ship, spec = sailed(rng), truenorth.imu_spec("navigation")
        record, log = sensed(rng, ship, spec), logged(rng, ship, kind)
        lat, lon, alt = ship.place[0]
        start = truenorth.align(record.between(None, QUAY), truenorth.Position(lat, lon, alt), spec)
        if start.status != "aligned":
            return Outcome(refused=str(start.reasons[0]))
        result = truenorth.navigate(
            record,
            start,
            aid=[truenorth.VelocityLog(log, errors=kind)],
            damping=Damper(method),  # type: ignore[arg-type]  # one of them
            altitude="fixed",
        )
        track = result.track
        k = [int(np.argmin(np.abs(track.time - QUAY - h * HOUR))) for h in (2.0, 4.0, 6.0, 8.0, 10.0, 11.9)]
        i = np.round(track.time[k] / STEP).astype(int)
        off = track.position[k, :2] - ship.place[i, :2]
        way = np.stack([off[:, 1] * A * np.cos(ship.place[i, 0]), off[:, 0] * A], axis=1)
        phi = np.array([misalignment(a, b) for a, b in zip(track.C_nb[k], ship.C[i], strict=True)])
        sigma = track.sigma[k]
        ratios = {
            "velocity": (track.v_n[k, :2] - ship.v[i, :2]) / sigma[:, DV][:, :2],
            "position": way / sigma[:, DP][:, :2],
            "heading": phi[:, 2] / sigma[:, PHI][:, 2],
            "level": phi[:, :2] / sigma[:, PHI][:, :2],
        }
        bad = "" if result.status == "navigated" else str(result.reasons[0])
        return Outcome({name: np.ravel(x) for name, x in ratios.items()}, bad)

    return run


CASES = (
    *(Case("ship of another world", f"damping augmented, {kind} log", damped("augmented", kind)) for kind in LOGS),
    Case("ship of another world", "damping double, em log", damped("double", "em")),
)

if __name__ == "__main__":
    main(CASES)
