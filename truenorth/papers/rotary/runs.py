"""What every method finds in one run; runs share nothing, so that they may be worked on in processes of their own."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.encoder_angles import angles_at
from truenorth.alignment.fine import CoarseStart
from truenorth.alignment.swaying import UNKNOWN_ARM, sway_align, windowed_align
from truenorth.coarse import oba
from truenorth.core.attitude import dcm_from_rotation_vector, misalignment
from truenorth.core.indexing import C_bs_from_angles
from truenorth.errors.staying import PHI, STATES, StaticModel
from truenorth.estimate.batch import Filtered, in_sigmas, settle
from truenorth.estimate.staying import Prior
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.fading import Fading, fading
from truenorth.papers.errors import AttitudeErrors
from truenorth.papers.rotary.coarse import LAST, SOURCES, coarse_errors, sample
from truenorth.papers.rotary.model import RotaryLog, earth_axes
from truenorth.papers.rotary.truth import AXES, Noise, Run, simulate_run
from truenorth.papers.sweeps import Sweep
from truenorth.strapdown.inertial import earth_rotation, integrate

Array = NDArray[np.float64]

TIMES = (120.0, 250.0, 600.0)  # s: of whole logs, coarse alignment included
FILTER_TIMES = (250.0, 600.0)  # s since coarse alignment ended
BASE_VELOCITY = 0.05  # m/s
MEAN_START = np.radians([0.0287, -0.0419, 0.1506])  # the paper's table 1
MAX_START = np.radians([0.0740, 0.1563, 1.4611])
START_SIGMA = {"velocity": 0.1, "angle": float(np.radians(1.0))}  # m/s, rad: P0, ours
RHO = 0.95
# Kind of fading of each filter. SAKF of the paper's introduction corrects the measurement noise; one factor on P is ours.
FILTERS: dict[str, Fading | None] = {
    "kf": None,
    "sakf_r": "noise",
    "sakf": "single",
    "makf": "multiple",
    "imakf": "improved",
}
SWEEPS = (
    Sweep("A", "R", "base velocity in R, m/s", BASE_VELOCITY, (0.01, 0.02, 0.05, 0.1, 0.3, 1.0)),
    Sweep("A", "P0", "angle in P0, deg", 1.0, (0.2, 0.5, 1.0, 2.0, 5.0)),
    Sweep("A", "rho", "rho of eq. 50", RHO, (0.2, 0.5, 0.95, 5.0, 50.0)),
    Sweep("A", "step", "step of the filter, s", 1.0, (1.0, 2.0, 5.0)),
    Sweep("A", "signs", "draw of the biases' signs (0: as in A)", 0.0, (0.0, 1.0, 2.0, 3.0), logarithmic=False),
)


@dataclass(frozen=True)
class Found(AttitudeErrors):
    """One answer: errors (3,)."""

    seconds: float = float("nan")  # that it took


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
    acted : dict
        Share of the epochs in which a fading factor was above 1, by case and method.
    """

    coarse: dict[tuple[str, str], Array] = field(default_factory=dict)
    found: dict[tuple[str, str, float], Found] = field(default_factory=dict)
    curves: dict[tuple[str, str], Array] = field(default_factory=dict)
    acted: dict[tuple[str, str], float] = field(default_factory=dict)


def work(case: str, seed: int, noise: Noise, parts: Sequence[str], times: Sequence[float], run: int) -> Results:
    """One run; `parts` of coarse, filters (also with the first arm velocity kept), sweeps or one by name, kf, pipeline, whole."""
    data = simulate_run(case, run, seed, noise)
    results = Results()
    if "coarse" in parts:
        results.coarse = coarse_errors(data, sample(data, data.record.between(None, LAST + 1.5), SOURCES))
    sweeps = [sweep for sweep in SWEEPS if "sweeps" in parts or sweep.name in parts]
    if sweeps or {"filters", "kf", "pipeline"} & set(parts):
        stage = _Stage(data)
        if "filters" in parts:
            _filters(stage, case, results, MEAN_START)
            _filters(stage, "A_max_start", results, MAX_START)
            _filters(stage, "lever_arm_at_t1_kept", results, MEAN_START, keep_first=True)
        if "kf" in parts:
            _filters(stage, case, results, MEAN_START, ("kf",))
        for sweep in sweeps:
            for value in sweep.values:
                at: _Stage = stage
                options: dict[str, Any] = {sweep.name: np.radians(value) if sweep.name == "P0" else value}
                if sweep.name == "signs":
                    signs, options = round(options.pop("signs")), {}
                    at = _Stage(simulate_run(case, run, seed, noise, signs)) if signs else stage
                _filters(at, sweep.case_of(value), results, MEAN_START, **options)
        if "pipeline" in parts:
            _filters(stage, case, results, results.coarse["triad", "gyros"], ("kf_two_pass",), passes=2)
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

    def log(self, start: Array, angle: float, step: float, **options: Any) -> RotaryLog:
        """The log with an attitude off by `start` (3,) rad at the beginning, and angles believed to be known to `angle` (rad).

        `step` is that of the filter, whole seconds.
        """
        P = np.diag([angle**2] * 3 + [START_SIGMA["velocity"] ** 2] * 3 + [*self.data.imu.bias_variance])
        return RotaryLog(
            self.record.between(None, self.integrals.start + self.integrals.time[-1] + 0.5 * self.record.interval),
            dcm_from_rotation_vector(-start) @ self.truth[0],
            self.data.place,
            StaticModel.of(self.data.imu),
            Prior(np.zeros(STATES), P, {}),
            step,
            arm_velocity=self.sampled.arm["gyros"][:: round(step)],
            **options,
        )


def _filters(
    stage: _Stage,
    case: str,
    results: Results,
    start: Array,
    filters: Sequence[str] = tuple(FILTERS),
    keep_first: bool = False,
    passes: int = 1,
    R: float = BASE_VELOCITY,
    P0: float = START_SIGMA["angle"],
    rho: float = RHO,
    step: float = 1.0,
) -> None:
    """12 states from the end of coarse alignment on, with its error at the start given."""
    truth = stage.truth[:: round(step)]
    for method in filters:
        kind = FILTERS.get(method)

        def estimate(system: LinearSystem, kind: Fading | None = kind) -> Filtered:
            if kind is None:
                return Filtered(system, kalman(system, history="full", innovations=False))
            return Filtered(system, fading(system, kind=kind, rho=rho, history="full", innovations=True))

        log = stage.log(start, P0, step, base_velocity=R, keep_first=keep_first)
        estimates = settle(log, estimate, in_sigmas(PHI), most=passes, least=passes).found.estimates
        if kind is not None:
            results.acted[case, method] = float(np.mean(np.any(estimates.adaptation > 1.0, axis=-1)))
        inside, C_ne = log.integrals, earth_axes(log.position.lat)
        C_n_i = np.swapaxes(earth_rotation(inside.time[1:], log.position.lat), 1, 2) @ C_ne
        C_hat = C_n_i @ dcm_from_rotation_vector(estimates.x[:, PHI]) @ C_ne.T @ log.C_n0_i @ inside.C_ib[1:]
        phi = misalignment(C_hat, truth[1:])
        results.curves[case, method] = phi
        P = C_n_i @ estimates.P[:, PHI, PHI] @ np.swapaxes(C_n_i, 1, 2)
        for at in FILTER_TIMES:
            k = round(at / step) - 1
            results.found[case, method, at] = Found.of(phi[k], P[k])


def _whole(data: Run, case: str, results: Results, times: Sequence[float]) -> None:
    """Methods on whole logs from the first sample on: windowed least squares, and the filter with coloured noise."""
    place, walks = data.place, StaticModel.of(data.imu)
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
        C_n0_i = oba(integrals, place.lat, place.alt, history=False).C_n0_i
        start = CoarseStart(record, C_n0_i, place, walks, P_bias, 1.0)
        begun = time.perf_counter()
        C_start, inside = windowed_align(start, mount)
        seconds = time.perf_counter() - begun
        phi = misalignment(C_n_n0 @ C_start @ inside.C_ib[-1], truth)
        results.found[case, "windowed_ls", at] = Found.with_sigma(phi, seconds=seconds)
        begun = time.perf_counter()
        fine = sway_align(start, mount)
        seconds = time.perf_counter() - begun
        C_hat, P, _ = fine.misalignment_at(fine.integrals.C_ib[-1], at)
        phi = misalignment(C_n_n0 @ C_hat, truth)
        results.found[case, "coloured_noise_kf", at] = Found.of(phi, C_n_n0 @ P @ C_n_n0.T, seconds=seconds)


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
    from truenorth.campaign.execution import one_thread_each, pool_of

    with one_thread_each(), pool_of(workers) as pool:
        yield pool
