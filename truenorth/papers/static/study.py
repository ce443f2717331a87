"""`truenorth reproduce static`: the paper's two filters literally and honestly, and what of its claims holds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.observability import PiecewiseObservability, Segment, piecewise_observability
from truenorth.core.units import parse
from truenorth.errors.stationary import DV, KEPT, StationaryModel, names_and_units
from truenorth.errors.walks import Walks
from truenorth.filters import LinearSystem, h_infinity, kalman, smallest_bound
from truenorth.papers.errors import AttitudeErrors
from truenorth.papers.static.degrees import add_degrees, degrees_of, hardly_in_words
from truenorth.papers.static.drawings import draw_convergence, draw_degrees, draw_large, draw_literal
from truenorth.papers.static.filtering import errors_at, system_of
from truenorth.papers.static.large import DURATION, add_large, align_all, make_setting, simulate_logs
from truenorth.papers.static.truth import ARCMIN, EVERY, PERIOD, Base, Truth, attitudes, simulate
from truenorth.papers.study import Study
from truenorth.papers.sweeps import Sweep, dependences, draw_sweeps, swept
from truenorth.papers.table import OF_RUNS, Table
from truenorth.papers.texts import read_texts
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]

TEXTS = read_texts(__file__)
RULES = TEXTS.rules
RUNS = 200
LAT = math.radians(45.0)
TIMES = (20.0, 60.0, 120.0, 300.0, 600.0)
PHI_SIGMA = np.array([10.0, 10.0, 60.0]) * ARCMIN
GYRO_BIAS = parse("0.01 deg/h", "angular_rate")
ACCEL_BIAS = parse("100 ug", "acceleration")
GYRO_WALK = parse("0.001 deg/sqrt(h)", "angle_random_walk")
ACCEL_WALK = parse("10 ug/sqrt(Hz)", "velocity_random_walk")
WALKS = Walks(GYRO_WALK, ACCEL_WALK)
VELOCITY_PRIOR = 1e-3  # m/s, one sigma
SIGMAS = np.array([*PHI_SIGMA, *[VELOCITY_PRIOR] * 2, *[GYRO_BIAS] * 3, *[ACCEL_BIAS] * 2])  # of the ten states
QUIET = 1e-10  # (m/s)^2, and (m/s^2)^2: what even a still base is allowed
SWAY_PERIOD = 5.5  # s, the middle of what is drawn
WRONG = 1e-4  # the share of the sway's variance that a badly tuned filter believes in

# The paper's own scenario: 1000 steps of .02 s.
LITERAL_P0, LITERAL_R, LITERAL_TIME = 1e5, 1e-3, 20.0
LITERAL_TIMES = (0.5, 2.0, 10.0, LITERAL_TIME)
LITERAL_DRIFT = np.array([0.01, 0.01, 0.03]) * parse("1 deg/h", "angular_rate")

# What decides between ten and eight states there: R has another unit in each.
SWEEPS = (
    Sweep("literal", "R", "R, (m/s)^2 and (m/s^2)^2", LITERAL_R, (1e-4, LITERAL_R, 1e-2, 1e-1)),
    Sweep("literal", "P0", "P0, all states, SI", LITERAL_P0, (1e-3, 1.0, 1e3, LITERAL_P0)),
    Sweep("literal", "start", "initial misalignment, times 10', 10', 60'", 1.0, (0.1, 1.0, 6.0)),
)
SWEPT_RUNS = 50  # at most

BASES = {
    "still": Base("still"),
    "sway": Base("sway", sway=5e-3),
    "vibration": Base("vibration", vibration=3e-3),
    "two_position": Base("two_position", headings=(0.0, math.pi)),
    "multi_position": Base("multi_position", headings=tuple(np.radians([0.0, 90.0, 180.0, 270.0]))),
}


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count = runs or RUNS
    table = Table()
    found: dict[tuple[str, int], list[AttitudeErrors]] = {}
    progress(f"the paper's own scenario: {count} runs")
    literal = _literal(count, seed)
    _add_literal(table, "literal", literal)
    for sweep in SWEEPS:
        for value in sweep.values:
            _add_literal(table, sweep.case_of(value), _literal(min(count, SWEPT_RUNS), seed, **{sweep.name: value}))
    for name, base in BASES.items():
        progress(f"{name}: {count} runs")
        truth = _honest_truth(base, count, seed)
        for states in (10, 8):
            errors = errors_at(_honest_system(truth, base, states), truth, TIMES, workers=workers)
            found[name, states] = errors
            _add_errors(table, name, f"states{states}", errors)
        if name == "two_position":
            short = errors_at(_honest_system(truth, base, 10, complete=False), truth, TIMES[-1:])
        if name == "sway":
            progress("sway: H-infinity and the Kalman filter under wrong noise")
            for method, errors in _wrong_noise(truth, base).items():
                _add_errors(table, name, method, errors)
    progress("observability")
    for quantity, limit in zip(("level", "heading"), StationaryModel(LAT).limits(GYRO_BIAS, ACCEL_BIAS), strict=True):
        table.value("still", "limit", quantity, "value", limit / ARCMIN, "arcmin")
    seen = {
        (name, states): _observability(BASES[name], states) for name in ("still", "two_position") for states in (10, 8)
    }
    for (name, states), result in seen.items():
        table.value(name, f"states{states}", "rank", "value", result.rank[-1], "1")
    degrees = {
        (name, states): degrees_of(_honest_system(truth, BASES[name], states))
        for name in ("still", "two_position")
        for truth in [_honest_truth(BASES[name], 1, seed)]
        for states in (10, 8)
    }
    add_degrees(table, degrees)
    progress(f"any azimuth to start from: {count} runs")
    spec = ImuSpec(gyro_bias=GYRO_BIAS, gyro_random_walk=GYRO_WALK, accel_bias=ACCEL_BIAS, accel_random_walk=ACCEL_WALK)
    setting = make_setting(LAT, spec, float(PHI_SIGMA[0]), seed)
    large = align_all(simulate_logs(setting, count), setting, workers)
    add_large(table, large)
    progress("cost of a step")
    _add_cost(table, seed)
    sweeps = swept(RULES, table, SWEEPS)
    drawings = {
        "figures_1_to_6": draw_literal(literal),
        "convergence": draw_convergence(TIMES, found, count),
        "observability": draw_degrees(degrees),
        "large_180": draw_large(large, DURATION),
        "open_choices": draw_sweeps(
            table, SWEEPS, sweeps, {"states10": "10 states", "states8": "8 states"}, "level@20"
        ),
    }
    return TEXTS.study(
        table,
        drawings,
        dependences(sweeps),
        entangled="; ".join(map(str, seen["still", 10].entangled)),
        every=PERIOD * EVERY,
        short=_rms(short),
        complete=_rms(found["two_position", 10]),
        still10=hardly_in_words(degrees["still", 10]),
        still8=hardly_in_words(degrees["still", 8]),
        turned10=hardly_in_words(degrees["two_position", 10]),
    )


def _honest_truth(base: Base, runs: int, seed: int) -> Truth:
    model = StationaryModel(LAT, 0.0, WALKS)
    return simulate(
        model,
        base,
        duration=TIMES[-1],
        runs=runs,
        seed=seed,
        phi_sigma=PHI_SIGMA,
        gyro_bias=GYRO_BIAS,
        accel_bias=ACCEL_BIAS,
    )


def _honest_system(truth: Truth, base: Base, states: int, share: float = 1.0, complete: bool = True) -> LinearSystem:
    """The filter that knows the noise; `share` of the base's motion, where it does not."""
    model = StationaryModel(LAT, 0.0, WALKS, complete)
    P0 = np.diag(SIGMAS**2)
    T = PERIOD * EVERY
    if states == 10:
        R = base.sway**2 + base.vibration**2
    else:  # the same motion differentiated
        R = (base.sway * 2 * math.pi / SWAY_PERIOD) ** 2 + 2 * (base.vibration / T) ** 2
    return system_of(truth, model, states, P0, share * R + QUIET)


def _add_errors(table: Table, case: str, method: str, errors: list[AttitudeErrors]) -> None:
    for at, found in zip(TIMES, errors, strict=True):
        table.attitude(case, method, found, time=at, noise="random_walk")


def _literal(
    runs: int, seed: int, R: float = LITERAL_R, P0: float = LITERAL_P0, start: float = 1.0
) -> dict[int, tuple[Truth, Array, Array]]:
    """The paper's scenario, with measurement noise drawn anew in each run: truth, phi (runs, K, 3) and sigmas (K, 3).

    `R` as both the noise has it and the filters believe it; `start` in units of our initial misalignment.
    """
    model = StationaryModel(LAT, complete=False)
    result = {}
    for states in (10, 8):
        truth = simulate(
            model,
            Base("literal"),
            duration=LITERAL_TIME,
            runs=runs,
            seed=seed,
            phi_sigma=start * PHI_SIGMA,
            gyro_bias=-LITERAL_DRIFT,
            accel_bias=ACCEL_BIAS,
            every=1,
            given=True,
        )
        measured = truth.velocity if states == 10 else truth.force
        for run, values in enumerate(measured):
            values += math.sqrt(R) * np.random.default_rng([seed, states, run]).standard_normal(values.shape)
        system = system_of(truth, model, states, P0 * np.eye(10), R)
        estimates = kalman(system, history="sigma", innovations=False)
        sigma = estimates.sigma.reshape(-1, *estimates.sigma.shape[-2:])[0]
        result[states] = truth, estimates.x[..., :3], sigma[:, :3]
    return result


def _add_literal(table: Table, case: str, literal: dict[int, tuple[Truth, Array, Array]]) -> None:
    for states, (truth, x, sigma) in literal.items():
        true = truth.phi if states == 10 else truth.phi_platform
        for at in LITERAL_TIMES:
            k = round(at / PERIOD) - 1
            errors = AttitudeErrors.with_sigma(x[:, k] - true[:, k], sigma[k])
            table.attitude(case, f"states{states}", errors, time=at, noise="per_sample")


def _wrong_noise(truth: Truth, base: Base) -> dict[str, list[AttitudeErrors]]:
    """H-infinity against Kalman filters, all with ten states, where the sway is believed a hundred times smaller than it is."""
    wrong, right = _honest_system(truth, base, 10, WRONG), _honest_system(truth, base, 10)
    L = np.zeros((1, 10))
    L[0, 2] = 1.0  # heading is what counts
    bound = 1.5 * smallest_bound(replace(wrong, z=wrong.z[0]), L=L)  # covariances alone: of any run
    return {
        "kf_wrong": errors_at(wrong, truth, TIMES),
        "kf_retuned": errors_at(right, truth, TIMES),
        "h_infinity": errors_at(
            wrong, truth, TIMES, lambda part, state: h_infinity(part, state, bound=bound, L=L, innovations=False)
        ),
    }


def _observability(base: Base, states: int) -> PiecewiseObservability:
    """Of the positions of a base, one after the other."""
    model, kept = StationaryModel(LAT), KEPT[states]
    segments = []
    for C in attitudes(base):
        H = np.eye(10)[DV] if states == 10 else model.accelerometer_rows(C)
        duration = TIMES[-1] / len(base.headings)
        segments.append(Segment(model.dynamics(C)[np.ix_(kept, kept)], H, duration))
    return piecewise_observability(segments, SIGMAS[kept], *names_and_units(states))


def _add_cost(table: Table, seed: int) -> None:
    """Time of a filter step with ten and eight states, side by side, the best of twenty; and their ratio.

    Of one log: runs that share all but their measurements are filtered with one covariance, which is not the cost of a step.
    """
    truth = simulate(
        StationaryModel(LAT, 0.0, WALKS),
        BASES["still"],
        duration=600.0,
        runs=1,
        seed=seed,
        phi_sigma=PHI_SIGMA,
        gyro_bias=GYRO_BIAS,
        accel_bias=ACCEL_BIAS,
    )
    systems = {states: _honest_system(truth, BASES["still"], states) for states in (10, 8)}
    best = {10: math.inf, 8: math.inf}
    for _ in range(20):
        for states, system in systems.items():
            start = time.perf_counter()
            kalman(system, innovations=False)
            best[states] = min(best[states], time.perf_counter() - start)
    steps = truth.velocity.shape[0] * truth.velocity.shape[1]
    for n in (10, 8):
        table.value("still", f"states{n}", "runtime", "value", best[n] / steps, "s")
    table.value("still", "states10", "runtime", "ratio", best[10] / best[8], "1")


def _rms(errors: list[AttitudeErrors]) -> float:
    """Of heading over the runs at the end, arcmin."""
    return float(OF_RUNS["rms"](errors[-1].phi[:, 2])) / ARCMIN
