"""Many voyages: bias and start errors with random signs, a new log each time; and errors drawn from what a filter is given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.consistency import nees
from truenorth.damping.course import errors_of
from truenorth.damping.filters import run_filters
from truenorth.errors.marine import MOTION, PHI, REF
from truenorth.papers.damping.methods import LONG, LONG_REFERENCE_PRIOR, SWITCH, Case, filters_of, run_all
from truenorth.papers.damping.truth import LOG_NOISE, Voyage, drawn
from truenorth.records.specs import ImuSpec
from truenorth.state.track import Track

Array = NDArray[np.float64]

SPEC = ImuSpec(
    gyro_random_walk=LONG.gyro_random_walk, accel_random_walk=LONG.accel_random_walk, name="what the filter is given"
)
UP = PHI.stop - 1
COMPARED = ("filter1", "filter2", "fused", "fused_tuned", "augmented", "augmented_long")


@dataclass(frozen=True)
class Signs:
    """Errors over runs of the paper's sizes with random signs."""

    time: Array
    errors: dict[str, Array]  # dict of (N, K+1, 7) arrays; by method
    correlation: Array  # (K+1-start, 7): of the errors of filters 1 and 2 over the runs
    fused_ratio: Array  # (7,): RMS of the fused error over its claimed sigma, 18-24 h


def with_log(voyage: Voyage, seed: int, run: int) -> Voyage:
    """The same voyage with another log."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(3, run + 1)))
    noise = LOG_NOISE / np.sqrt(voyage.truth.interval) * rng.standard_normal(voyage.log_noise.shape)
    return Voyage(voyage.ideal, voyage.truth, noise)


def drawn_voyage(voyage: Voyage, c: float, seed: int, run: int) -> tuple[Voyage, Track, Array]:
    """A voyage with the paper's errors and biases, each with a sign of its own, and the log's too: its course and its log."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(4, run)))
    x0 = voyage.paper_errors() * drawn(rng.choice([-1.0, 1.0], 13))
    own = with_log(voyage, seed, run)
    return own, own.navigate(x0), own.reference(c * rng.choice([-1.0, 1.0], 2))


def random_signs(
    voyage: Voyage, c: float, runs: int, seed: int, workers: int, progress: Callable[[str], None]
) -> Signs:
    """Run the filters with the paper's errors and biases, each with a sign of its own, and the log's too."""
    kept: dict[str, list[Array]] = {name: [] for name in COMPARED}
    ratios = []
    for run in range(runs):
        progress(f"random signs: voyage {run + 1} of {runs}")
        own, course, reference = drawn_voyage(voyage, c, seed, run)
        case: Case = run_all(own, course, reference, networks=False, raw=False, workers=workers)
        for name in COMPARED:
            kept[name].append(case.errors[name])
        ratios.append(_fused_over_sigma(voyage, case))
    errors = {name: np.array(values) for name, values in kept.items()}
    a, b = errors["filter1"], errors["filter2"]
    start = round(SWITCH / voyage.truth.interval) + 1
    a, b = a[:, start:] - a[:, start:].mean(axis=0), b[:, start:] - b[:, start:].mean(axis=0)
    correlation = np.sum(a * b, axis=0) / np.sqrt(np.sum(a**2, axis=0) * np.sum(b**2, axis=0))
    return Signs(voyage.truth.time, errors, correlation, np.sqrt(np.mean(np.array(ratios), axis=0)))


def _fused_over_sigma(voyage: Voyage, case: Case) -> Array:
    """(7,) mean over 18-24 h of the fused filter's squared error in units of its variance."""
    fused = case.estimates["fused"]
    free = errors_of(case.course, voyage.truth)[fused.start :]
    since = case.time[fused.start :]
    window = (since >= 18 * 3600.0) & (since < 24 * 3600.0)
    return np.asarray(np.mean(((free - fused.x[:, :7]) / fused.sigma[:, :7])[window] ** 2, axis=0))


def consistency(voyage: Voyage, runs: int, seed: int, progress: Callable[[str], None]) -> tuple[Array, Array]:
    """NEES over 15 of the long-run filter at the end, and its heading error over sigma, (N,) each.

    Errors, biases and the log's error are drawn from what the filter is given, the IMU has its random walks.
    """
    squares, heading = [], []
    for run in range(runs):
        progress(f"consistency: voyage {run + 1} of {runs}")
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5, run)))
        x0 = voyage.paper_errors() * drawn(rng.standard_normal(13))
        c = LONG_REFERENCE_PRIOR * rng.standard_normal(2)
        own = with_log(voyage, seed, runs + run)
        course = own.navigate(x0, SPEC, seed, run)
        kinds = {"augmented_long": filters_of(own, course, raw=False)["augmented_long"]}
        start = round(SWITCH / course.interval)
        found = run_filters(course, own.reference(c), start=start, kinds=kinds)["augmented_long"]
        error = np.concatenate([errors_of(course, own.truth)[-1], x0[MOTION.stop :], c]) - found.x[-1]
        assert error[REF].shape == (2,)
        squares.append(float(nees(error, found.P)) / len(error))
        heading.append(error[UP] / found.sigma[-1, UP])
    return np.array(squares), np.array(heading)
