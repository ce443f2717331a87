"""What every method finds in one run; runs share nothing, so that they may be worked on in processes of their own."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.inference import noise_of
from truenorth.alignment.rotary import angles_at
from truenorth.alignment.swaying import UNKNOWN_ARM, sway_align, windowed_align
from truenorth.coarse import oba
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.indexing import C_bs_from_angles
from truenorth.filters import Estimates, LinearSystem, kalman
from truenorth.filters.fading import fading
from truenorth.models.rotary import BA, BG, DV, PHI, RotaryModel, earth_axes
from truenorth.papers.rotary.coarse import LAST, SOURCES, coarse_errors, misalignment, sample
from truenorth.papers.rotary.truth import AXES, Noise, Run, simulate_run
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

Array = NDArray[np.float64]

TIMES = (120.0, 250.0, 600.0)  # s: of whole logs, coarse alignment included
FILTER_TIMES = (250.0, 600.0)  # s since coarse alignment ended
BASE_VELOCITY = 0.05  # m/s
QUIET_R = 0.3  # m/s: a base velocity at which no fading factor ever fires
LARGE_R = "A_large_R"
MEAN_START = np.radians([0.0287, -0.0419, 0.1506])  # the paper's table 1
MAX_START = np.radians([0.0740, 0.1563, 1.4611])
P0_SIGMAS = ((DV, 0.1), (PHI, float(np.radians(1.0))))
FILTERS: dict[str, Callable[..., Estimates]] = {
    "kf": kalman,
    "sakf": partial(fading, kind="single"),
    "sakf_r": partial(fading, kind="noise"),
    "makf": partial(fading, kind="multiple"),
    "imakf": partial(fading, kind="improved"),
}


@dataclass(frozen=True)
class Found:
    """One answer.

    Attributes
    ----------
    phi, sigma : (3,) arrays, rad
        Misalignment E, N, U, and what the method says of it (NaN where it says nothing).
    nees : float
        Over 3; NaN where there is no covariance.
    seconds : float
        That it took.
    """

    phi: Array
    sigma: Array
    nees: float = float("nan")
    seconds: float = float("nan")


@dataclass
class Results:
    """All answers of a run.

    Attributes
    ----------
    coarse : dict
        Misalignment by method and source of the rate.
    found : dict
        By case, method and time.
    curves : dict
        (K, 3) misalignment at each second of fine alignment, by case and method.
    """

    coarse: dict[tuple[str, str], Array] = field(default_factory=dict)
    found: dict[tuple[str, str, float], Found] = field(default_factory=dict)
    curves: dict[tuple[str, str], Array] = field(default_factory=dict)


def work(case: str, seed: int, noise: Noise, parts: Sequence[str], times: Sequence[float], run: int) -> Results:
    """One run; `parts` of coarse, filters (with their ablations), kf alone, pipeline, whole."""
    data = simulate_run(case, run, seed, noise)
    results = Results()
    if "coarse" in parts:
        results.coarse = coarse_errors(data, sample(data, data.record.between(None, LAST + 1.5), SOURCES))
    if {"filters", "kf", "pipeline"} & set(parts):
        stage = _Stage(data)
        if "filters" in parts:
            _filters(stage, case, results, MEAN_START, FILTERS)
            _filters(stage, "A_max_start", results, MAX_START, FILTERS)
            _filters(stage, "lever_arm_at_t1_kept", results, MEAN_START, FILTERS, keep_first=True)
            _filters(stage, LARGE_R, results, MEAN_START, FILTERS, base_velocity=QUIET_R)
        if "kf" in parts:
            _filters(stage, case, results, MEAN_START, {"kf": kalman})
        if "pipeline" in parts:
            _filters(stage, case, results, results.coarse["triad", "gyros"], {"kf_two_pass": kalman}, passes=2)
    if "whole" in parts:
        _whole(data, case, results, times)
    return results


class _Stage:
    """The paper's fine alignment of a run: what all filters share."""

    def __init__(self, data: Run) -> None:
        self.data = data
        self.record = data.record.between(data.record.time[0] + LAST - 0.5 * data.record.interval, None)
        self.sampled = sample(data, self.record)
        self.integrals = self.sampled.integrals
        self.truth = data.C_ns(self.integrals.start + self.integrals.time)
        self.C_ne = earth_axes(data.place.lat)
        self.P0 = np.zeros((12, 12))
        for part, sigma in P0_SIGMAS:
            self.P0[part, part] = sigma**2 * np.eye(3)
        self.P0[BG.start :, BG.start :] = np.diag(data.imu.bias_variance)

    def again(self, bias: Array) -> InertialIntegrals:
        """The integrals with biases taken off."""
        record = self.record.between(None, self.integrals.start + self.integrals.time[-1] + 0.5 * self.record.interval)
        return integrate(record, 1.0, bias[:3], bias[3:])


def _filters(
    stage: _Stage,
    case: str,
    results: Results,
    start: Array,
    filters: dict[str, Callable[..., Estimates]],
    keep_first: bool = False,
    base_velocity: float = BASE_VELOCITY,
    passes: int = 1,
) -> None:
    """12 states from the end of coarse alignment on, with its error at the start given."""
    place, C_ne, truth = stage.data.place, stage.C_ne, stage.truth
    model = RotaryModel(noise_of(stage.data.imu), base_velocity)
    for method, run_filter in filters.items():
        nominal, inside, bias = C_ne.T @ dcm_from_rotation_vector(-start) @ truth[0], stage.integrals, np.zeros(6)
        for left in reversed(range(passes)):
            arm = stage.sampled.arm["gyros"]
            system = model.linearise(inside, nominal, place.lat, place.alt, stage.P0, arm, keep_first=keep_first)
            estimates = run_filter(_about(system, bias), history="last" if left else "full", innovations=False)
            if left:  # back to the start, and everything anew about the estimate
                x = estimates.x[-1]
                turned = np.einsum("k,kab->ab", inside.intervals, nominal @ inside.C_mean)
                nominal = dcm_from_rotation_vector(x[PHI] + turned @ x[BG]) @ nominal
                bias = bias + np.concatenate([x[BG], x[BA]])
                inside = stage.again(bias)
        C_n_i = np.swapaxes(earth_rotation(inside.time[1:], place.lat), 1, 2) @ C_ne
        C_hat = C_n_i @ dcm_from_rotation_vector(estimates.x[:, PHI]) @ nominal @ inside.C_ib[1:]
        phi = -rotation_vector_from_dcm(C_hat @ np.swapaxes(truth[1:], 1, 2))
        results.curves[case, method] = phi
        P = C_n_i @ estimates.P[:, PHI, PHI] @ np.swapaxes(C_n_i, 1, 2)
        for at in FILTER_TIMES:
            results.found[case, method, at] = _found(phi[round(at) - 1], P[round(at) - 1])


def _about(system: LinearSystem, bias: Array) -> LinearSystem:
    """The prior of the biases stands about zero, whatever has been taken off."""
    x0 = np.zeros(12)
    x0[6:] = -bias
    return replace(system, x0=x0)


def _whole(data: Run, case: str, results: Results, times: Sequence[float]) -> None:
    """Methods on whole logs from the first sample on: windowed least squares, and the filter with coloured noise."""
    place, walks = data.place, noise_of(data.imu)
    P_bias = np.diag(data.imu.bias_variance)
    for at in times:
        record = data.record.between(None, at + 0.5 * data.record.interval)
        integrals = integrate(record, 1.0)
        mount = UNKNOWN_ARM
        if data.encoder is not None:
            angles = angles_at(data.encoder, integrals.start + integrals.time, AXES)
            mount = replace(UNKNOWN_ARM, C_sb=np.swapaxes(C_bs_from_angles(AXES, angles), -1, -2))
        truth = data.C_ns(np.array([integrals.start + at]))[0]
        C_n_n0 = earth_rotation(at, place.lat).T
        C_n0_i = oba(integrals, place.lat, place.alt).C_n0_i
        begun = time.perf_counter()
        C_start, inside = windowed_align(record, C_n0_i, place, walks, P_bias, 1.0, mount)
        seconds = time.perf_counter() - begun
        phi = misalignment(C_n_n0 @ C_start @ inside.C_ib[-1], truth)
        results.found[case, "windowed_ls", at] = Found(phi, np.full(3, np.nan), seconds=seconds)
        begun = time.perf_counter()
        fine = sway_align(record, C_n0_i, place, walks, P_bias, 1.0, mount=mount)
        seconds = time.perf_counter() - begun
        C_hat, P, _ = fine.misalignment_at(fine.integrals.C_ib[-1], at)
        answer = _found(misalignment(C_n_n0 @ C_hat, truth), C_n_n0 @ P @ C_n_n0.T)
        results.found[case, "coloured_noise_kf", at] = replace(answer, seconds=seconds)


def _found(phi: Array, P: Array) -> Found:
    return Found(phi, np.sqrt(np.diag(P)), float(phi @ np.linalg.solve(P, phi)) / 3)


def all_runs(
    case: str,
    seed: int,
    noise: Noise,
    parts: Sequence[str],
    runs: int,
    pool: ProcessPoolExecutor | None,
    times: Sequence[float] = TIMES,
) -> list[Results]:
    """All runs of a case in their order, on a pool of processes where there is one."""
    task = partial(work, case, seed, noise, tuple(parts), tuple(times))
    return list(map(task, range(runs)) if pool is None else pool.map(task, range(runs)))


@contextmanager
def processes(workers: int) -> Iterator[ProcessPoolExecutor | None]:
    """Processes of one thread each; none where one worker is asked for."""
    if workers == 1:
        yield None
        return
    import multiprocessing

    from truenorth.campaign.execution import one_thread_each

    context: Any = multiprocessing.get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(workers, mp_context=context) as pool:
        yield pool
