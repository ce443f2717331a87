"""What the numbers of an IMU's log must be in, by physics: each reading of them with its probability.

- **Accelerometers.** At rest and over most motions the norm of the specific force is gravity's; increments show it times the
  interval. A unit is as likely as the median norm is near to what gravity is in it (1 % for a good sensor, 5 % for a bad one).
- **Gyros, where gravity turns.** ``du/dt = -w x u``: the rate that gravity's direction shows in the accelerometers over the
  rate of the gyros is the unit.
- **Gyros at rest.** White noise gives the angle random walk of a reading, and with it what bias such a gyro has: from one to
  ten thousand deg/h for each deg/sqrt(h). The mean rate, the earth's plus that bias, is likely or not: a gyrocompass shows the
  earth's rate in one unit only, a cheap gyro's bias explains several, and then nobody can tell.
- **Gyros that never rest.** What a leg or a hand turns by from row to row is no noise: the noise is at most that, and the mean rate
  is the motion's. Gravity's turn counts there even where quick motions hide most of it, and decides less.
- **Clocks.** IMUs write 5 to 4000 rows a second; dates since 1970 have their size.

What is usual (rad/s with m/s^2, deg/s with g) weighs a little; it never decides alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import means_of
from truenorth.core.earth import EARTH_RATE
from truenorth.core.turning import AGREES, Turning, fit_turning
from truenorth.core.units import STANDARD_GRAVITY as G
from truenorth.core.units import parse_quantity, parse_unit
from truenorth.records.imu import Kind

Array = NDArray[np.float64]

DEG = np.pi / 180.0
SURE = 0.98  # probability from which a reading is taken without a question
SURE_GYRO = 0.995  # of a gyro's unit: drawn sensors were read wrong at .989 in 2 of 1032 logs
TOLERANCE = 0.12  # of gravity: beyond it no reading of the accelerometers is one
CELL = 0.1  # s
REST_CELL = 1.0  # s, of which a log is at rest or is moved
RESTS = 30.0  # times as much as at rest the gyros show of a sensor that a hand moves
JUDGED = 2**21  # rows that say what the numbers of a log are: three hours at 200 Hz
WALKS = (DEG / 60.0 * 5e-5, DEG / 60.0 * 3.0)  # rad/sqrt(s): random walks of the best and the worst gyros
LARGEST_BIAS = 5.0 * DEG  # rad/s
LARGEST_RATE = 2000.0 * DEG  # rad/s
BIAS_RATIOS = np.logspace(0.0, 4.0, 17)  # bias, deg/h, over random walk, deg/sqrt(h), of gyros of all classes
TYPICAL, TYPICAL_FORCE, WORST_FORCE_WALK = DEG / 60.0 * 0.2, 80e-6 * G, 400e-6 * G  # rad/sqrt(s), m/s/sqrt(s)
CLASS_DECADES = 0.6
ROUGH = 2.3  # variance of second differences over that of first ones: 3 for white noise, 2.3 where neighbours correlate by .7
NO_UNIT = 1.1  # of the logarithm, by which the unit that fits best turns gravity too far or not enough: counts, for one
LARGE_TURN = 3.0 * DEG  # of two axes: what angles must turn by to be known from rates
FAR_BETTER = 0.5  # of the agreement of angles: what that of rates must stay below
ANGLE_SCALE = 0.3  # of the logarithm, by which angles turn gravity more or less than in rad or deg
DECADE = 0.25  # decades by which those limits are soft
SHAKEN = 3.0 * WORST_FORCE_WALK  # by motions that are quick from row to row
MOVES = 8.0  # times the white noise of a row, that the gyros of a log at rest never show
SLOW_CELL, RESTLESS, NEARLY_ALL = (
    0.5,
    5.0,
    0.8,
)  # s, how many times as far as by white noise its means differ, in how many tenths
LITTLE = 0.1  # power of a likelihood at rest, of a log that does not rest and whose force does not turn, as of a drone that hovers
PUSHED = 0.02  # of gravity, by which the force differs from one half of a second to the next
LIVELY = 2.0 * DEG  # rad/s: as quickly as this turns at some time what turns its force; what is shaken, twice
HINTS = 0.3  # share of gravity's turn that the gyros of a log without a rest explain by more than chance
LEAST_HINT = 0.01  # likelihood of a unit that turns gravity too far, where quick motions hide most of its turn

# Prior weight of a unit: how often logs are written so.
ACCEL_UNITS: dict[Kind, dict[str, float]] = {
    "rates": {"m/s^2": 1.0, "g": 1.0, "mg": 0.2, "cm/s^2": 0.05, "ug": 0.02, "ft/s^2": 0.02},
    "increments": {"m/s": 1.0, "g*s": 0.05, "cm/s": 0.01, "mm/s": 0.01, "ft/s": 0.01},
}
GYRO_UNITS: dict[Kind, dict[str, float]] = {
    "rates": {"rad/s": 1.0, "deg/s": 1.0, "deg/h": 0.1, "mrad/s": 0.02, "mdps": 0.05},
    "increments": {"rad": 1.0, "deg": 0.3, "arcsec": 0.2, "mrad": 0.02},
}
USUAL_WEIGHT = 0.1
USUAL = {"m/s^2": ("rad/s", 4.0), "g": ("deg/s", 6.0), "mg": ("deg/s", 4.0), "m/s": ("rad", 4.0), "g*s": ("deg", 4.0)}
CLOCKS = {"s": 1.0, "ms": 1.0, "us": 0.7, "ns": 0.7, "0.1 ms": 0.02}
RATES = ((20.0, 1000.0, 1.0), (5.0, 4000.0, 0.3), (1.0, 4000.0, 0.05), (0.2, 20000.0, 0.003))  # Hz, weight
EPOCH = (9.4e8, 2.3e9)  # s since 1970: the years 2000 to 2042


@dataclass(frozen=True)
class Reading:
    """One way to read some columns: its unit (and kind), its probability, and why."""

    unit: str
    probability: float
    why: str
    kind: Kind = "rates"


def is_usual(sensor: str, unit: str, kind: Kind) -> bool:
    """Whether many logs are in this unit of the ``gyro`` or the ``accel``; one of the others fits some numbers by chance."""
    units = GYRO_UNITS if sensor == "gyro" else ACCEL_UNITS
    return units[kind].get(unit, 0.0) >= USUAL_WEIGHT


def size(unit: str) -> float:
    """What a unit, or a count of so much, is in SI."""
    return (parse_quantity(unit) if unit[:1].isdigit() and unit != "1" else parse_unit(unit))[0]


def _ranked(readings: Sequence[tuple[str, float, str, Kind]]) -> list[Reading]:
    total = sum(weight for _, weight, _, _ in readings)
    if total <= 0.0 or not np.isfinite(total):
        return []
    found = [Reading(unit, weight / total, why, kind) for unit, weight, why, kind in readings if weight > 1e-9 * total]
    return sorted(found, key=lambda reading: -reading.probability)


def gravity_level(accel: Array) -> float:
    """Median norm of three columns."""
    return float(np.median(np.sqrt(np.einsum("ki,ki->k", accel, accel))))


def accel_readings(
    level: float, interval: float, kinds: Sequence[Kind], units: Sequence[str] | None = None
) -> list[Reading]:
    """Units of accelerometers whose median norm is `level`, most likely first; none where gravity is in no unit.

    Parameters
    ----------
    interval : float, s
        NaN where it is not known: then increments cannot be recognised.
    kinds : sequence of {"rates", "increments"}
    units : sequence of str, optional
        Those that are possible; the usual ones of `kinds` when left out.
    """
    readings = []
    for kind in kinds:
        for unit, prior in ACCEL_UNITS[kind].items() if units is None else dict.fromkeys(units, 1.0).items():
            wanted = G / size(unit) * (interval if kind == "increments" else 1.0)
            away = np.log(level / wanted) if level > 0.0 and wanted > 0.0 else np.inf
            if not abs(away) < TOLERANCE:
                continue
            near = 0.9 / 0.01 * np.exp(-0.5 * (away / 0.01) ** 2) + 0.1 / 0.05 * np.exp(-0.5 * (away / 0.05) ** 2)
            why = f"the median norm of the accelerometers is {level:.4g}, gravity is {wanted:.4g} {unit}"
            why += f" a row of {interval:.4g} s" if kind == "increments" else ""
            readings.append((unit, prior * float(near), why, kind))
    return _ranked(readings)


@dataclass(frozen=True)
class GyroFacts:
    """What the gyros show, in their own unit a second, and of the accelerometers how they turn gravity and their random walk."""

    turning: Turning
    mean: float
    mean_sigma: float
    walk: float
    largest: float
    force_walk: float
    moves: bool = False  # and rests nowhere: the noise is `walk` at most, the mean rate that of the motion
    restless: bool = False  # moves in each part of the log by far more than the noise of its rows, which is `walk`

    @property
    def turned(self) -> bool:
        """Whether the gyros turn gravity as the accelerometers show it, to a factor."""
        best = self.turning.best_agreement
        return bool(np.isfinite(best) and best >= AGREES)


def gyro_facts(time: Array, gyro: Array, accel: Array, kind: Kind) -> GyroFacts:
    """What the gyros of a log show in its first `JUDGED` rows; `gyro` and `accel` (N, 3) in any unit, rates or increments."""
    time, gyro, accel = time[:JUDGED], gyro[:JUDGED], accel[:JUDGED]
    interval = float(np.median(np.diff(time)))
    rows = max(1, round(CELL / interval))
    cells = len(time) // rows
    data = np.hstack([gyro, accel])[: cells * rows]
    if kind == "increments":
        data = data / interval
    rates = means_of(data.reshape(cells, rows, 6)).T if cells else np.zeros((6, 0))
    turning = fit_turning(rows * interval, np.ascontiguousarray(rates))
    largest = float(np.quantile(np.abs(data[:, :3]), 0.999)) if len(data) else 0.0
    data = _at_rest_part(data, interval)
    (walk, is_noise), (force_walk, _) = _random_walk(data[:, :3], interval), _random_walk(data[:, 3:], interval)
    moves = not is_noise and _swing(data[:, :3]) > MOVES * walk / np.sqrt(interval)
    parts = [part.mean(axis=0) for part in np.array_split(data[:, :3], 10)] if len(data) >= 100 else []
    wander = float(np.linalg.norm(np.std(parts, axis=0))) / np.sqrt(10.0) if parts else np.inf
    mean = float(np.linalg.norm(data[:, :3].mean(axis=0))) if len(data) else 0.0
    restless = is_noise and _restless(data, interval)
    return GyroFacts(turning, mean, wander, walk, largest, force_walk, moves, restless)


def _restless(data: Array, interval: float) -> bool:
    """Whether in nearly each tenth of a log a base accelerates, and turns about two axes by far more than the noise of rows.

    By means of half a second: at rest that noise is white, or that of a filter which leaves a fifth of it from row to row, biases
    wander within minutes, and no force goes to and fro by `PUSHED` of gravity. A base that trembles on its legs turns as much.
    """
    rows = round(SLOW_CELL / interval)
    cells = len(data) // max(rows, 1) // 10
    if rows < 5 or cells < 8:
        return False
    parts = np.ascontiguousarray(data[: 10 * cells * rows].reshape(10, cells * rows, 6))
    noise = np.mean(np.diff(parts[..., :3], axis=1) ** 2, axis=1)
    slow = np.mean(np.diff(parts.reshape(10, cells, rows, 6).mean(axis=2), axis=1) ** 2, axis=1)
    turns = np.sum(rows * slow[:, :3] > RESTLESS**2 * noise, axis=1) >= 2
    pushed = np.sqrt(slow[:, 3:].sum(axis=1)) > PUSHED * gravity_level(data[:, 3:])
    return bool(np.mean(turns & pushed) >= NEARLY_ALL)


def _swing(gyro: Array) -> float:
    """How far the rates go from their middle."""
    return float(np.quantile(np.abs(gyro - np.median(gyro, axis=0)), 0.999)) if len(gyro) else 0.0


def are_angles(time: Array, gyro: Array, accel: Array, as_rates: float) -> bool:
    """Whether columns taken for rates are angles: what they change by turns gravity as rates would, and they do not.

    Roll, pitch and yaw of a base that tilts little change as the rates about its axes. Angles that jump at 360 deg are not seen.
    The turns are large about two axes: a vehicle that brakes and leans seems to tilt a little. `as_rates` is the agreement of
    the columns as they are, NaN where nothing turned.
    """
    time, gyro, accel = time[:JUDGED], gyro[:JUDGED], accel[:JUDGED]
    interval = float(np.median(np.diff(time)))
    rows = max(1, round(CELL / interval))
    cells = len(time) // rows
    if cells < 3:
        return False
    means = means_of(np.hstack([gyro, accel])[: cells * rows].reshape(cells, rows, 6))
    change = np.gradient(means[:, :3], rows * interval, axis=0)
    found = fit_turning(rows * interval, np.ascontiguousarray(np.hstack([change, means[:, 3:]]).T))
    if not found.best_scale > 0.0 or not found.best_agreement >= AGREES:
        return False
    away, unit = min((abs(np.log(found.best_scale * unit)), unit) for unit in (1.0, DEG))
    turns = np.sort(np.ptp(means[:, :3], axis=0))[1] * unit
    better = not as_rates > FAR_BETTER * found.best_agreement
    return bool(away < ANGLE_SCALE and better and turns > LARGE_TURN)


def _at_rest_part(data: Array, interval: float) -> Array:
    """The longest rest of a sensor that is moved for a part of the log; the whole log where none stands out.

    What the gyros say at rest (their bias, the earth's rate, their noise) nothing says while a hand turns them. A turntable's rate
    is as steady as a rest: of steady seconds those count whose rate is the least. Seconds without any noise are of a dead sensor.
    """
    rows = max(2, round(REST_CELL / interval))
    cells = len(data) // rows
    if cells < 5:
        return data
    rates = data[: cells * rows, :3].reshape(cells, rows, 3)
    mean = means_of(rates)
    spread = np.linalg.norm(np.sqrt(means_of((rates - mean[:, None]) ** 2)), axis=1)
    alive = spread[spread > 0.0]
    if not alive.size or not np.quantile(alive, 0.9) > RESTS * (quiet := np.quantile(alive, 0.1)):
        return data
    steady = (spread > 0.0) & (spread <= 3.0 * quiet)
    least = mean[steady][np.argmin(np.linalg.norm(mean[steady], axis=1))]
    rest = np.flatnonzero(steady & (np.linalg.norm(mean - least, axis=1) <= 3.0 * quiet))
    run = max(np.split(rest, np.flatnonzero(np.diff(rest) > 1) + 1), key=len)
    return data[run[0] * rows : (run[-1] + 1) * rows]


def _random_walk(data: Array, interval: float) -> tuple[float, bool]:
    """Of the three columns the middle one's: the least of the Allan deviation times the root of its time; and whether it is noise.

    Rows that a low-pass filter or an interpolation has smoothed differ less from their neighbours than the noise: they do not
    count where tenths of a second differ as white noise does. (Of a sway these are smooth, too, and rows count.) Second
    differences have three times the variance of first ones where noise is white, ``3 - rho`` times where neighbours correlate
    by rho.
    """
    walks, rough = [], []
    axes = np.ascontiguousarray(data.T)  # each by itself in memory: a quarter of the time
    for tau in (interval, 0.1, 0.5, 1.0, 2.0):
        m = max(1, round(tau / interval))
        count = len(data) // m
        if count >= 8:
            means = axes if m == 1 else axes[:, : count * m].reshape(3, count, m).mean(axis=2)
            change = np.diff(means)
            power, second = _mean_square(change), _mean_square(np.diff(change))
            walks.append(np.sqrt(0.5 * power * m * interval))
            rough.append(bool(np.median(second - ROUGH * power) > 0.0))
    smoothed = rough[:2] == [False, True]
    if not walks:
        return 0.0, True
    least = int(np.argmin(np.median(walks[smoothed:], axis=1))) + smoothed
    return float(np.median(np.min(walks[smoothed:], axis=0))), rough[least]


def _mean_square(axes: Array) -> Array:
    return np.asarray(np.einsum("ik,ik->i", axes, axes) / axes.shape[1])


def gyro_readings(facts: GyroFacts, kind: Kind, accel_unit: str, units: Sequence[str] | None = None) -> list[Reading]:
    """Units of gyros, most likely first."""
    priors = GYRO_UNITS[kind] if units is None else dict.fromkeys(units, 1.0)
    turned = facts.turned
    if turned and min(abs(np.log(facts.turning.best_scale * size(unit))) for unit in priors) > NO_UNIT:
        return []
    shaken = facts.force_walk * size(accel_unit) > SHAKEN and np.isfinite(facts.turning.best_agreement)
    flies = facts.restless and not np.isfinite(facts.turning.best_agreement)
    usual, weight = USUAL.get(accel_unit, ("", 1.0))
    readings = []
    for unit, prior in priors.items():
        factor = size(unit)
        likely = prior * (weight if unit == usual else 1.0) * _below(facts.largest * factor, LARGEST_RATE)
        if turned:
            scale = facts.turning.best_scale * factor
            away = np.log(scale)
            likely *= 0.95 * np.exp(-0.5 * (away / 0.15) ** 2) + 0.05 * np.exp(-0.5 * (away / 0.6) ** 2) + 1e-12
            why = f"in {unit} the gyros turn {scale:.3g} times as far as gravity in the accelerometers"
        elif shaken:
            likely *= _in_motion(facts.mean * factor, facts.mean_sigma * factor, facts.walk * factor)
            why = f"in {unit} the rates of a log that never rests are up to {facts.largest * factor / DEG:.3g} deg/s"
        elif facts.walk > 0.0 and facts.mean_sigma < np.inf:
            rest = _at_rest(facts.mean * factor, facts.mean_sigma * factor, facts.walk * factor)
            rest *= _of_one_class(facts.walk * factor, facts.force_walk * size(accel_unit))
            likely *= rest**LITTLE if flies else rest
            walk = facts.walk * factor / DEG * 60.0
            why = (
                f"in {unit} the mean rate is {facts.mean * factor / EARTH_RATE:.3g} times the earth's, the random walk "
                f"{walk:.2g} deg/sqrt(h)"
            )
            if flies:
                why = (
                    f"in {unit} the rates of a log that never rests are up to {facts.largest * factor / DEG:.3g} deg/s"
                )
        else:
            why = "usual"
        if not turned and np.isfinite(facts.turning.best_agreement):
            likely *= _below((2.0 if shaken else 1.0) * LIVELY, facts.largest * factor)
        if not turned and (facts.moves or shaken) and facts.turning.best_agreement > HINTS:
            scale = facts.turning.best_scale * factor
            likely *= _hint(facts.turning.best_agreement, scale)
            why += f"; they turn {scale:.2g} times as far as gravity in the accelerometers, which other forces hide"
        readings.append((unit, float(likely), why, kind))
    return _ranked(readings)


def _below(value: float, limit: float) -> float:
    """Likelihood of a value that has a soft upper limit."""
    return float(np.exp(-0.5 * (max(0.0, np.log10(value / limit)) / DECADE) ** 2)) if value > 0.0 else 1.0


def _at_rest(mean: float, sigma: float, walk: float) -> float:
    """Likelihood of a mean rate (rad/s) and a random walk (rad/sqrt(s)) of a gyro triad on a base that does not turn.

    The norm x of the earth's rate W plus a bias of variance s^2 on each axis has the density
    ``x / (W s sqrt(2 pi)) (exp(-(x - W)^2 / 2 s^2) - exp(-(x + W)^2 / 2 s^2))``; times x, of its logarithm.
    """
    limits = _below(walk, WALKS[1]) * _below(WALKS[0], walk) * _below(mean, LARGEST_BIAS)
    return _density(mean, sigma, walk) * limits


def _density(mean: float, sigma: float, walk: float) -> float:
    bias = np.hypot(BIAS_RATIOS * walk / 60.0, sigma)  # deg/h for deg/sqrt(h) is 1/60 of rad/s for rad/sqrt(s)
    x, w = mean, EARTH_RATE
    near = np.exp(-0.5 * ((x - w) / bias) ** 2) - np.exp(-0.5 * ((x + w) / bias) ** 2)
    density = x * x / (w * bias * np.sqrt(2.0 * np.pi)) * near
    return float(np.mean(density) + 1e-6)


def _in_motion(mean: float, sigma: float, walk: float) -> float:
    """Likelihood of a mean rate of a log that never rests, whose noise is `walk` at most: over the noises of all gyros."""
    walks = np.geomspace(*WALKS, 13)
    likely = sum(_density(mean, sigma, float(w)) for w in walks if w <= walk) / len(walks)
    return likely * _below(max(0.0, mean - 2.0 * sigma), LARGEST_BIAS) + 1e-9


def _hint(agreement: float, scale: float) -> float:
    """Likelihood of a scale of the gyros by gravity's turn of which they explain a part: the less, the less it decides."""
    away = np.log(scale)
    near = 0.5 * np.exp(-0.5 * (away / 0.3) ** 2) + 0.5 * np.exp(-0.5 * (away / NO_UNIT) ** 2)
    return float(near + LEAST_HINT) ** ((agreement - HINTS) / (AGREES - HINTS))


def _of_one_class(walk: float, force_walk: float) -> float:
    """Likelihood of a gyro's random walk (rad/sqrt(s)) with an accelerometer of this one (m/s/sqrt(s)) in one IMU.

    Data sheets from ring lasers with pendulous accelerometers to MEMS: ``walk = TYPICAL (force walk / 80 ug/sqrt(Hz))^1.3``,
    to half a decade. A base that shakes raises the accelerometers' more: beyond a MEMS's it says nothing more.
    """
    if not force_walk > 0.0:
        return 1.0
    expected = TYPICAL * (min(force_walk, WORST_FORCE_WALK) / TYPICAL_FORCE) ** 1.3
    return float(np.exp(-0.5 * (np.log10(walk / expected) / CLASS_DECADES) ** 2) + 1e-4)


def clock_readings(step: float, first: float, units: Sequence[str] | None = None) -> list[Reading]:
    """Units of a clock whose median step is `step` and whose first value is `first`, most likely first."""
    readings = []
    for unit, prior in CLOCKS.items() if units is None else dict.fromkeys(units, 1.0).items():
        rate = 1.0 / (step * size(unit))
        weight = next((weight for low, high, weight in RATES if low <= rate <= high), 1e-6)
        epoch = EPOCH[0] < first * size(unit) < EPOCH[1]
        why = f"{rate:.4g} rows a second" + (", counted from 1970" if epoch else "")
        readings.append((unit, prior * weight * (1000.0 if epoch else 1.0), why, "rates"))
    return _ranked(readings)  # type: ignore[arg-type]
