"""`truenorth reproduce rotary`: coarse and fine alignment of a rotary SINS on a swaying ship, and what of the claims holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.papers.errors import AttitudeErrors, level, near_from
from truenorth.papers.rotary.coarse import LAST, SOURCES
from truenorth.papers.rotary.drawings import (
    ARCMIN,
    LABELS,
    PAPER_COARSE,
    draw_coarse,
    draw_convergence,
    draw_filters,
    draw_honesty,
    draw_modulation,
)
from truenorth.papers.rotary.runs import FILTER_TIMES, FILTERS, SWEEPS, TIMES, Results, all_runs, processes
from truenorth.papers.study import Study
from truenorth.papers.sweeps import dependences, draw_sweeps, swept
from truenorth.papers.table import OF_RUNS, Table
from truenorth.papers.texts import read_texts

Array = NDArray[np.float64]

TEXTS = read_texts(__file__)
RULES = TEXTS.rules
RUNS = 50
SIDE = 5  # the cases other than A, B, C and jonswap get a part of the runs
COARSE = ("dual_vector", "triad", "q_method")
NEAR = 5.0 * ARCMIN  # the paper's filters end within this of the true heading
PAPER_FINE = {"sakf_r": (-0.34, -0.78, 4.74), "makf": (0.29, 0.66, 3.87), "imakf": (0.24, 0.57, 3.83)}
TITLES = {
    "A": "from the mean coarse error",
    "A_max_start": "from the largest coarse error",
    "lever_arm_at_t1_kept": "first arm velocity kept",
}
Found = dict[str, list[Results]]


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count = runs or RUNS
    few = count if full else max(2, count // SIDE)
    plan = (
        ("A", "A", "per_sample", ("coarse", "filters", "pipeline", "whole"), count, TIMES),
        ("B", "B", "per_sample", ("coarse", "pipeline", "whole"), count, TIMES),
        ("C", "C", "per_sample", ("coarse", "pipeline", "whole"), count, TIMES),
        ("jonswap", "jonswap", "per_sample", ("whole",), count, TIMES),
        ("unrotated", "unrotated", "per_sample", ("whole",), few, TIMES),
        ("rotation_off", "rotation_off", "per_sample", ("kf",), few, TIMES),
        ("A_walk", "A", "random_walk", ("kf", "whole"), few, TIMES),
        ("A_sweeps", "A", "per_sample", ("sweeps",), few, TIMES),
    )
    found: Found = {}
    with processes(workers) as pool:
        for name, case, noise, parts, number, times in plan:
            progress(f"{name.replace('_', ' ')}: {number} runs")
            found[name] = all_runs(case, seed, noise, parts, number, pool, times)  # type: ignore[arg-type]
    table = Table()
    for name, results in found.items():
        _add_answers(table, results, "random_walk" if name == "A_walk" else "per_sample")
        _add_coarse(table, name, results)
    _add_convergence(table, found["A"])
    off, on = table.number_of("rotation_off kf heading@600"), table.number_of("A/per_sample kf heading@600")
    table.value("rotation_off", "kf", "heading", "ratio", off / on, "1", time=600.0, noise="per_sample", runs=few)
    sweeps = swept(RULES, table, SWEEPS)
    drawings = {
        "figures_1_to_3": draw_coarse({m: _coarse(found["A"], m) for m in ("dual_vector", "triad", "q_method")}),
        "figure_4": draw_filters(_curves(found["A"]), TITLES),
        "convergence": draw_convergence(_curves(found["A"]), TITLES),
        "modulation": draw_modulation(),
        "open_choices": draw_sweeps(table, SWEEPS, sweeps, LABELS),
        "honesty": draw_honesty(_honesty(table)),
    }
    by_source = {source: np.degrees(OF_RUNS["rms"](_coarse(found["A"], "triad", source)[:, 2])) for source in SOURCES}
    return TEXTS.study(
        table,
        drawings,
        dependences(sweeps),
        times=", ".join(f"{t:g}" for t in FILTER_TIMES),
        coarse=LAST,
        by_source=", ".join(f"{source} {value:.3f}" for source, value in by_source.items()),
        few=few,
    )


def _coarse(results: Sequence[Results], method: str, source: str = "gyros") -> Array:
    return np.array([r.coarse[method, source] for r in results])


def _curves(results: Sequence[Results]) -> dict[str, dict[str, Array]]:
    return {case: {m: np.array([r.curves[case, m] for r in results]) for m in FILTERS} for case in TITLES}


def _add_answers(table: Table, results: Sequence[Results], noise: str) -> None:
    """All answers of a case: errors, sigmas, NEES, time, and the share of epochs in which a factor acted."""
    for case, method, at in results[0].found:
        answers = [r.found[case, method, at] for r in results]
        paper = PAPER_FINE.get(method) if case == "A" and at == 600.0 and noise == "per_sample" else None
        table.attitude(
            case,
            method,
            AttitudeErrors.together(answers),
            statistics=("mean", "rms", "max"),
            paper=paper or (math.nan,) * 3,
            time=at,
            noise=noise,
        )
        seconds = float(np.median([a.seconds for a in answers]))
        if math.isfinite(seconds):
            table.value(case, method, "runtime", "median", seconds, "s", time=at, noise=noise, runs=len(answers))
    for case, method in results[0].acted:
        acted = np.array([r.acted[case, method] for r in results])
        table.errors(case, method, "factor_share", acted, "1", statistics=("mean",), noise=noise)


def _add_coarse(table: Table, name: str, results: Sequence[Results]) -> None:
    """Table 1 of the paper, deg."""
    if not results[0].coarse:
        return
    common = {"time": float(LAST), "noise": "per_sample"}
    for method in COARSE:
        phi = np.degrees(_coarse(results, method))
        for k, quantity in enumerate(("phi_e", "phi_n", "phi_u")):
            values = {"mean": phi[:, k].mean(), "max": phi[:, k].max(), "min": phi[:, k].min()}
            for row, (statistic, value) in enumerate(values.items()):
                paper = PAPER_COARSE[row, k] if name == "A" and method == "dual_vector" else math.nan
                table.value(name, method, quantity, statistic, value, "deg", paper=paper, runs=len(phi), **common)  # type: ignore[arg-type]
            table.errors(name, method, quantity, phi[:, k], "deg", statistics=("rms",), **common)  # type: ignore[arg-type]
        table.errors(name, method, "coarse_level", level(phi), "deg", **common)  # type: ignore[arg-type]
        table.errors(name, method, "coarse_heading", phi[:, 2], "deg", **common)  # type: ignore[arg-type]


def _add_convergence(table: Table, results: Sequence[Results]) -> None:
    """Time from which heading stays within 5 arcmin of the truth to the end; infinite where it does not."""
    for case in ("A", "A_max_start"):
        for method in FILTERS:
            heading = np.array([r.curves[case, method][:, 2] for r in results])
            times = near_from(
                heading, NEAR, np.arange(heading.shape[1], dtype=np.float64)
            )  # until the last second that is away
            table.errors(case, method, "converge_time", times, "s", statistics=("median",), noise="per_sample")


def _honesty(table: Table) -> list[tuple[str, float, float, float]]:
    cases = {name: f"{name}/per_sample coloured_noise_kf heading" for name in ("A", "B", "C", "jonswap", "unrotated")}
    return [
        (name, at, table.number_of(f"{of}@{at:g}"), table.number_of(f"{of}@{at:g} sigma"))
        for name, of in cases.items()
        for at in TIMES
    ]
