"""What the paper leaves open, changed one by one: its filters and their fusion on the same voyages with random signs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import errors_of
from truenorth.damping.filters import Estimate, Filter, run_filters
from truenorth.papers.damping.methods import R2, SPAN, SWITCH, filters_of, fused, left_of
from truenorth.papers.damping.statistics import Signs, drawn_voyage
from truenorth.papers.damping.truth import Voyage
from truenorth.papers.sweeps import Sweep

Array = NDArray[np.float64]

SWEEPS = (
    Sweep("random_signs", "R2", "R2, m/s^2 (the unit is ours)", R2, (2.5e-4, 5e-4, R2, 2e-3, 4e-3)),
    Sweep("random_signs", "tau", "correlation time of the biases, s", 300.0, (100.0, 300.0, 1000.0, 3600.0)),
    Sweep("random_signs", "P0", "P0, times ours", 1.0, (0.1, 0.3, 1.0, 3.0, 10.0)),
    Sweep("random_signs", "N", "N of the fusion, s", SPAN, (600.0, SPAN, 18000.0)),
)
RUNS = 30  # at most
EVERY = 60.0  # s, of what is kept


def swept_signs(
    voyage: Voyage, c: float, runs: int, seed: int, workers: int, progress: Callable[[str], None]
) -> dict[str, Signs]:
    """Errors of filters 1 and 2 and of their fusion for each value of each choice, by the case's name."""
    cases = {sweep.case_of(value): (sweep.name, value) for sweep in SWEEPS for value in sweep.values}
    methods = ("filter1", "filter2", "fused")
    kept: dict[str, dict[str, list[Array]]] = {case: {name: [] for name in methods} for case in cases}
    chosen = {sweep.name: sweep.chosen for sweep in SWEEPS}
    every = round(EVERY / voyage.truth.interval)
    for run in range(runs):
        progress(f"open choices: voyage {run + 1} of {runs}")
        own, course, reference = drawn_voyage(voyage, c, seed, run)
        start = round(SWITCH / course.interval)
        usual = {name: kind for name, kind in filters_of(own, course, raw=False).items() if name in methods}
        free = errors_of(course, voyage.truth)
        by_choice: dict[tuple[str, float] | None, dict[str, Estimate]] = {}
        for case, (name, value) in cases.items():
            choice = None if name == "N" or value == chosen[name] else (name, value)  # None: the filters as they are
            if choice not in by_choice:
                kinds = {key: _changed(kind, name, value) for key, kind in usual.items()}
                by_choice[choice] = run_filters(course, reference, start=start, kinds=kinds, workers=workers)
            found = dict(by_choice[choice])
            found["fused"] = fused(found, course.interval, value if name == "N" else SPAN)
            for method in methods:
                kept[case][method].append(left_of(voyage, free, found[method].x)[::every])
    nothing = np.zeros(0)
    return {
        case: Signs(voyage.truth.time[::every], {m: np.array(v) for m, v in of.items()}, nothing, nothing)
        for case, of in kept.items()
    }


def _changed(kind: Filter, name: str, value: float) -> Filter:
    """A filter with one choice made otherwise; `N` is the fusion's."""
    if name == "R2":
        return replace(kind, sigma=value) if kind.window else kind
    if name == "tau":
        return replace(kind, model=replace(kind.model, accel_time=value, gyro_time=value))
    return replace(kind, P0=value**2 * kind.P0) if name == "P0" else kind
