"""Voyages for the cases of damping and navigation: a ship that turns hard, its IMU, its start, its log; all drawn in each run.

The plumb line is deflected along the way, and the INS has levelled itself by it: the earth has it, the simulator does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.honesty.frame import Outcome
from truenorth.aiding.fixes import AzimuthFix, Fixes, PositionFix
from truenorth.core.earth import radii
from truenorth.core.position import Position
from truenorth.core.units import parse
from truenorth.damping.course import errors_of, without_errors
from truenorth.errors.deflection import STANDARD_GRAVITY, Deflection
from truenorth.errors.log import LogErrors, log_rows
from truenorth.errors.marine import BA, BG, DP, DV, MOTION, OF_INS, PHI
from truenorth.navigation import Start, navigate
from truenorth.records import ImuRecord, VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight, turn
from truenorth.simulation.processes import gauss_markov
from truenorth.state import layout as ins
from truenorth.state.track import Track

Array = NDArray[np.float64]
HOUR, DEG = 3600.0, math.radians(1.0)
SIGMA = np.zeros(13)
SIGMA[DV], SIGMA[DP], SIGMA[PHI] = 0.1, 60.0, np.radians(np.array([0.5, 0.5, 5.0]) / 60.0)
SPEC = ImuSpec(
    gyro_bias=parse("0.005 deg/h", "angular_rate"),
    accel_bias=parse("50 ug", "acceleration"),
    gyro_random_walk=parse("0.001 deg/sqrt(h)", "angle_random_walk"),
    accel_random_walk=parse("10 ug/sqrt(Hz)", "velocity_random_walk"),
)
INTERVAL = 4.0  # s, of the IMU: turns of 1 deg/s are smooth in it
NOISE = 0.05  # m/s, of the log in a second
PLUMB = Deflection()


def scaled(factor: float) -> ImuSpec:
    """The IMU so many times worse."""
    names = ("gyro_bias", "accel_bias", "gyro_random_walk", "accel_random_walk")
    return replace(SPEC, **{name: factor * getattr(SPEC, name) for name in names})


def passage(rng: np.random.Generator, hours: float, turns: bool = True) -> tuple[Any, Track]:
    """Ideal log and true course: from a place up to 60 deg N or S, on any heading, at 4 to 12 m/s.

    A turn of 60 to 170 deg at 1 deg/s every 20 to 80 minutes, or straight on.
    """
    place = Position.from_degrees(rng.uniform(-60.0, 60.0), rng.uniform(-180.0, 180.0))
    heading, speed = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(4.0, 12.0)
    legs, length = [], 0.0
    while turns and length < hours * HOUR:
        part = straight(rng.uniform(1200.0, 4800.0)) + turn(
            rng.uniform(60.0, 170.0) * rng.choice([-1, 1]) * DEG, 1.0 * DEG
        )
        legs += part
        length += sum(leg.duration for leg in part)
    way = course(place, legs, heading=heading, speed=speed)
    ideal = ideal_log(way, rate=1.0 / INTERVAL, duration=hours * HOUR)
    at = way.states(ideal.edges)
    return ideal, Track.along(at)


@dataclass(frozen=True)
class Voyage:
    """One voyage with drawn errors."""

    record: ImuRecord
    start: Start
    truth: Track
    gyro_bias: Array  # (3,) rad/s
    rng: np.random.Generator  # for its sensors

    def log(self, errors: LogErrors, frame: str = "navigation") -> VelocityRecord:
        """A speed log with errors drawn from these."""
        rng, truth = self.rng, self.truth
        v = truth.v_n.copy()
        groups = errors.groups()
        rows = log_rows(groups, truth.C_nb, truth.v_n)
        at = 0
        for group in groups:
            m = len(group.prior)
            if math.isfinite(group.correlation_time):
                x = gauss_markov(group.sigma[0], group.correlation_time, truth.interval, len(v), rng, axes=m)
            else:
                x = np.broadcast_to(group.sigma * rng.standard_normal(m), (len(v), m))
            v[:, :2] += np.einsum("kij,kj->ki", rows[:, :, at : at + m], x)
            at += m
        v[:, :2] += NOISE / math.sqrt(truth.interval) * rng.standard_normal((len(v), 2))
        if frame == "body":
            v = np.einsum("kij,ki->kj", truth.C_nb, v)
        return VelocityRecord(truth.time, v, frame)  # type: ignore[arg-type]  # one of the two

    def navigated(self, aid: Any = (), *, imu: ImuSpec = SPEC, output: float = 60.0, **options: Any) -> Any:
        """The record navigated from its start, its height held."""
        return navigate(
            self.record, self.start, aid=aid, altitude="fixed", imu=imu, interval=INTERVAL, output=output, **options
        )

    def fixes(self, hours: tuple[float, ...] = (10.0, 20.0)) -> Fixes:
        """Places to 100 m and azimuths to .05 deg at some hours."""
        positions, azimuths = [], []
        for h in hours:
            k = round(h * HOUR / self.truth.interval)
            time, (lat, lon, _), C = float(self.truth.time[k]), self.truth.position[k], self.truth.C_nb[k]
            (north, east, turn), (R_M, R_N) = self.rng.standard_normal(3), radii(lat)
            lat, lon = lat + 100.0 * north / R_M, lon + 100.0 * east / (R_N * math.cos(lat))
            positions.append(PositionFix(time, float(lat), float(lon), 100.0))
            azimuths.append(AzimuthFix(time, math.atan2(C[0, 1], C[1, 1]) + 0.05 * DEG * turn, 0.05 * DEG))
        return Fixes(tuple(positions), tuple(azimuths))

    def _errors(self, result: Any) -> tuple[Array, Array]:
        """Times and errors (K, 7) of a navigation."""
        found = result.track
        rows = np.round((found.time - self.truth.time[0]) / self.truth.interval).astype(int)
        truth = self.truth[rows]
        return found.time, errors_of(found, truth)

    def velocity_error(self, result: Any, after: float = 6.0) -> float:
        """RMS of an axis, m/s, from some hours on."""
        time, e = self._errors(result)
        return float(np.sqrt(np.mean(e[time >= after * HOUR, DV] ** 2)))

    def outcome(
        self, result: Any, hours: tuple[float, ...] = (6.0, 12.0, 18.0, 24.0, 30.0), drifts: bool = False
    ) -> Outcome:
        """Errors of a navigation over its sigmas at some hours."""
        time, e = self._errors(result)
        k = np.unique([int(np.argmin(np.abs(time - h * HOUR))) for h in hours])
        e, s = e[k], result.track.sigma[k]
        sigma = s[:, OF_INS[MOTION]]
        ratio = e / sigma
        ratios = {
            "velocity": ratio[:, DV],
            "position": ratio[:, DP],
            "heading": ratio[:, PHI][:, 2],
            "level": ratio[:, PHI][:, :2],
        }
        if drifts:
            off = result.track.sensors[-1, ins.BG] - self.gyro_bias
            ratios["gyro drift"] = off / result.track.sigma[-1, ins.BG]
        bad = "" if result.status == "navigated" else f"{result.status}: {result.reasons[0]}"
        said = f"of {np.round(e[-1, DP])} m, sigma {np.round(sigma[-1, DP])} m"
        return Outcome(ratios, bad, said)


def voyage(
    seed: int,
    run: int,
    *,
    hours: float = 30.0,
    turns: bool = True,
    spec: ImuSpec = SPEC,
    plumb: Deflection = PLUMB,
) -> Voyage:
    """A voyage, errors drawn from the specification and `SIGMA`, and the plumb line from `plumb`."""
    ideal, truth = passage(np.random.default_rng([seed, run, 17]), hours, turns)
    rng = np.random.default_rng([seed, run, 3])
    sigma = SIGMA.copy()
    sigma[BG], sigma[BA] = spec.gyro_bias, spec.accel_bias
    x0 = sigma * rng.standard_normal(13)
    walks = ImuSpec(gyro_random_walk=spec.gyro_random_walk, accel_random_walk=spec.accel_random_walk)
    record = simulate(ideal, imu=walks, seed=seed, run=run, errors={"gyro_bias": x0[BG], "accel_bias": x0[BA]}).record
    P = np.zeros((15, 15))
    P[np.ix_(OF_INS, OF_INS)] = np.diag(sigma**2)
    if plumb.sigma > 0.0:
        xi = deflected_along(truth, plumb, rng)
        mean = 0.5 * (xi[1:] + xi[:-1]) * STANDARD_GRAVITY
        pushed = np.einsum("kij,ki->kj", truth.C_nb[1:, :2], mean)
        record = replace(record, accel=record.accel + pushed * (1.0 if record.kind == "rates" else INTERVAL))
        levelled = at_rest_columns(truth.C_nb[0], float(truth.position[0, 0]))
        x0[PHI] += levelled[ins.PHI] @ xi[0]
        P += plumb.sigma**2 * levelled @ levelled.T
    begin = without_errors(truth[:2], -x0[:7])
    lat, lon, alt = begin.position[0]
    start = Start(0.0, begin.C_nb[0], begin.v_n[0], lat, lon, alt, np.zeros(3), np.zeros(3), P, plumb=plumb.sigma)
    return Voyage(record, start, truth, x0[BG], rng)


def at_rest_columns(C_nb: Array, lat: float) -> Array:
    """(15, 2) what a deflection east, north does to an INS that levels itself: it tilts, and takes it for an accelerometer bias."""
    tilt = np.array([[0.0, -1.0], [1.0, 0.0], [math.tan(lat), 0.0]])
    out = np.zeros((15, 2))
    out[ins.PHI], out[ins.BA] = tilt, STANDARD_GRAVITY * C_nb[:2].T
    return out


def deflected_along(truth: Track, deflection: Deflection, rng: np.random.Generator) -> Array:
    """(K+1, 2) deflection east, north, rad: Gauss-Markov over the distance gone."""
    step = np.linalg.norm(truth.v_n[1:, :2], axis=1) * truth.interval
    decay = np.exp(-step / deflection.distance)
    xi = np.empty((len(truth.time), 2))
    xi[0] = deflection.sigma * rng.standard_normal(2)
    noise = deflection.sigma * np.sqrt(1.0 - decay**2)[:, None] * rng.standard_normal((len(step), 2))
    for k in range(len(step)):
        xi[k + 1] = decay[k] * xi[k] + noise[k]
    return xi
