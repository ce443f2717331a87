"""`truenorth reproduce odometer`: the paper's model with its filters, invariant errors next to them, and what holds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.azimuth_filters import METHODS, Belief, reduced
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.filters.strong_tracking import StrongTracking
from truenorth.papers.errors import AttitudeErrors, near_from
from truenorth.papers.odometer.drawings import STARTS, draw_paper_figures, draw_starts
from truenorth.papers.odometer.invariant import coarse_errors, run_invariant
from truenorth.papers.odometer.loop import LEVEL_SIGMA, Errors, run_method
from truenorth.papers.odometer.paper_table import add_paper_table
from truenorth.papers.odometer.scenario import (
    Drives,
    coarser,
    drive,
    ring,
    slipping,
    starts,
    stepping,
    straight,
    with_walk,
)
from truenorth.papers.study import Study
from truenorth.papers.sweeps import Sweep, dependences, draw_sweeps, swept
from truenorth.papers.table import OF_RUNS, Table
from truenorth.papers.texts import read_texts

Array = NDArray[np.float64]

TEXTS = read_texts(__file__)
RULES = TEXTS.rules
RUNS = 30
ANGLES = (1.0, 10.0, 30.0, 60.0)
TIMES = (60.0, 120.0, 150.0, 300.0, 600.0)
ARCMIN = math.radians(1.0) / 60.0
DIVERGED = math.radians(1.0)  # of heading at the end
PAPER_VELOCITY = 0.5  # m/s: "about", of its figure 1
CHAIN_SIGMA = math.radians(3.0)  # of heading after 120 s of coarse alignment
COARSE_TIMES = (120.0, 300.0, 600.0)
INVARIANT, ORDINARY = "invariant_ekf", "ordinary_ekf"
TILTS_ONLY = "_tilts_only"
ORDINARY_METHODS = [m for m in METHODS if m != "sgkf3_capped"]
ACTED = ("start1", "start10", "start30", "start60", "chain", "straight", "slip", "bias_step")
TRACKED = ["ckf", "gh3", "sgkf3"]
SWEEPS = (
    *(
        Sweep("start30", name, f"{name} as believed, times ours", 1.0, values)
        for name, values in (("P0", (0.1, 1.0, 10.0)), ("Q", (0.1, 1.0, 10.0)), ("R", (0.01, 0.1, 1.0, 10.0)))
    ),
    Sweep("start30", "memory", "memory of the tracking (forgetting)", 0.95, (0.5, 0.8, 0.95, 0.99), logarithmic=False),
    Sweep("start30", "weakening", "weakening of its factor", 1.0, (1.0, 2.0, 4.0)),
    Sweep("start30", "step", "step of the filter, s", 1.0, (1.0, 2.0, 5.0)),
)


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count = runs or RUNS
    progress(f"simulating {count} drives")
    base = drive(ring(), count, seed)
    found: dict[tuple[str, str], Errors] = {}
    jobs: list[tuple[str, str, Callable[[], Errors]]] = []

    def plan(case: str, drives: Drives, phi0: Array, sigma: float, methods: Sequence[str], **options: Any) -> None:
        jobs.extend((case, name, partial(_run, name, drives, phi0, sigma, **options)) for name in methods)

    for angle in ANGLES:
        phi0 = starts(count, seed, math.radians(angle), LEVEL_SIGMA)
        plan(f"start{angle:g}", base, phi0, math.radians(angle), [*ORDINARY_METHODS, INVARIANT, ORDINARY])
        if angle == 30.0:
            plan("start30", base, phi0, math.radians(angle), [m + TILTS_ONLY for m in ("ckf", "gh7", "sgkf7")])
    ten = partial(plan, phi0=starts(count, seed, math.radians(10.0), LEVEL_SIGMA), sigma=math.radians(10.0))
    progress("coarse alignment")
    coarse = {end: coarse_errors(base, end) for end in COARSE_TIMES}
    plan("chain", base, coarse[120.0], CHAIN_SIGMA, [*ORDINARY_METHODS, INVARIANT])
    plan("chain_once", base, coarse[120.0], CHAIN_SIGMA, TRACKED, begin=120)
    ten("start10_arw_0.01", drive(with_walk("0.01 deg/sqrt(h)"), count, seed), methods=["gh3", INVARIANT])
    ten("straight", drive(straight(), count, seed), methods=[*TRACKED, INVARIANT])
    names = [*TRACKED, INVARIANT]
    ten("slip", slipping(base, seed), methods=[*names, *(f"{name}_gated" for name in (*names, "sgkf3_capped"))])
    ten("bias_step", stepping(base), methods=TRACKED)
    thirty = starts(count, seed, math.radians(30.0), LEVEL_SIGMA)
    for sweep in SWEEPS:
        for value in sweep.values:
            if value != sweep.chosen:
                drives, options = _choice(base, sweep.name, value)
                touched = TRACKED[-1:] if "tracking" in options else TRACKED
                plan(sweep.case_of(value), drives, thirty, math.radians(30.0), touched, **options)

    seconds: dict[tuple[str, str], float] = {}

    def execute(job: tuple[str, str, Callable[[], Errors]]) -> Errors:
        case, name, call = job
        progress(f"{case}: {name}")
        begin = time.thread_time()
        result = call()
        seconds[case, name] = time.thread_time() - begin
        return result

    with ThreadPoolExecutor(workers) as pool:
        for (case, name, _), errors in zip(jobs, pool.map(execute, jobs), strict=True):
            found[case, name] = errors
    for sweep in SWEEPS:  # what a choice does not touch is as in its case
        for value in sweep.values:
            for name in TRACKED:
                found.setdefault((sweep.case_of(value), name), found["start30", name])
    result = Table()
    for (case, name), errors in found.items():
        _add_errors(result, case, name, errors)
    for end, phi in coarse.items():
        result.errors("chain", "oba", "heading", phi[:, 2] / ARCMIN, "arcmin", time=end, noise="random_walk")
    for (case, name), value in seconds.items():
        if case == "start10":
            result.value(case, name, "runtime", "value", value / count, "s", runs=count)
    progress("the paper's table")
    add_paper_table(result, count, seed)
    sweeps = swept(RULES, result, SWEEPS)
    drawings = {
        "figures_1_to_4": draw_paper_figures(found, "start10"),
        "starts": draw_starts(found, ANGLES),
        "open_choices": draw_sweeps(result, SWEEPS, sweeps, STARTS),
    }
    acted = {case: result.number_of(f"{case} sgkf3 factor_share mean") for case in ACTED}
    return TEXTS.study(
        result,
        drawings,
        dependences(sweeps),
        count=count,
        tilts_only=_ended(found["start30", "gh7" + TILTS_ONLY]),
        turned=_ended(found["start30", "gh7"]),
        acted=", ".join(f"{case} {share:.1%}" for case, share in acted.items()),
    )


def _choice(drives: Drives, name: str, value: float) -> tuple[Drives, dict[str, Any]]:
    """The drives and the options of a filter with one choice made otherwise."""
    if name == "step":
        return coarser(drives, round(value)), {}
    if name in ("memory", "weakening"):
        return drives, {"tracking": StrongTracking(**{"rho" if name == "memory" else "softening": value})}
    return drives, {"belief": Belief(**{name: value})}


def _run(name: str, drives: Drives, phi0: Array, sigma: float, **options: Any) -> Errors:
    """All runs of a case by one method, with its suffix."""
    every, sigmas = np.arange(len(phi0)), np.full(len(phi0), sigma)
    method, gated, turned = name.removesuffix("_gated"), name.endswith("_gated"), not name.endswith(TILTS_ONLY)
    method = method.removesuffix(TILTS_ONLY)
    if (tracking := options.pop("tracking", None)) is not None:
        return run_method(drives, every, phi0, sigmas, reduced(3, tracking), gated, turned, **options)
    if method in (INVARIANT, ORDINARY):
        return run_invariant(drives, every, phi0, sigmas, gated, invariant=method == INVARIANT)
    return run_method(drives, every, phi0, sigmas, method, gated, turned, **options)


def heading(errors: Errors, at: float) -> Array:
    """(B,) heading error at a time, rad; level, as it is, it is the azimuth's."""
    return np.asarray(errors.phi[:, int(np.searchsorted(errors.time, at - 0.5)), 2])


def diverged(errors: Errors) -> NDArray[np.bool_]:
    """(B,) whether a run ended more than a degree off or was given up."""
    return np.asarray((np.abs(errors.phi[:, -1, 2]) > DIVERGED) | errors.lost)


def converge_times(errors: Errors) -> Array:
    """(B,) from when on each run stays within a degree, s; infinite where it does not."""
    return near_from(errors.phi[:, :, 2], DIVERGED, errors.time)


def _add_errors(table: Table, case: str, method: str, errors: Errors) -> None:
    def add(quantity: str, values: Array, unit: str, statistics: Sequence[str] = ("rms",), **more: Any) -> None:
        table.errors(case, method, quantity, values, unit, statistics=statistics, noise="random_walk", **more)

    for at in TIMES:
        if at < errors.time[0]:
            continue
        k = int(np.searchsorted(errors.time, at - 0.5))
        then = AttitudeErrors.with_sigma(errors.phi[:, k], errors.sigma[:, k])
        table.attitude(case, method, then, statistics=("rms", "max", "median"), time=at, noise="random_walk")
    add("diverged", diverged(errors).astype(float), "1", ("mean",), time=TIMES[-1])
    add("converge_time", converge_times(errors), "s", ("median",))
    add("factor_share", errors.acted, "1", ("mean",))
    paper = PAPER_VELOCITY if (case, method) == ("chain", "sgkf3") else math.nan
    add("velocity", np.sqrt(np.mean(errors.velocity[:, -1] ** 2, axis=1)), "m/s", time=TIMES[-1], paper=paper)
    for i, axis in enumerate("xyz"):
        add(f"gyro_bias_{axis}", errors.gyro_bias[:, -1, i] / DEG_PER_HOUR, "deg/h", time=TIMES[-1])
        add(f"accel_bias_{axis}", errors.accel_bias[:, -1, i] / MICRO_G, "ug", time=TIMES[-1])
        half = _time_to_half(errors.accel_bias[:, :, i], errors.time)
        table.value(
            case, method, f"accel_bias_{axis}_half", "value", half, "s", runs=len(errors.phi), noise="random_walk"
        )


def _ended(errors: Errors) -> str:
    off = heading(errors, TIMES[-1]) / ARCMIN
    rms, median = (float(OF_RUNS[name](off)) for name in ("rms", "median"))
    return f"{rms:.1f}' RMS, median {median:.1f}', {np.mean(diverged(errors)):.0%} diverged"


def _time_to_half(errors: Array, at: Array) -> float:
    """When the RMS over runs falls below half of what it began with, and stays there, s."""
    rms = np.sqrt(np.mean(errors**2, axis=0))
    above = np.flatnonzero(rms > 0.5 * rms[0])
    return float(at[min(above[-1] + 1, len(at) - 1)]) if above.size else float(at[0])
