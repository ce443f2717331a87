"""All methods on one course: what they leave of its errors."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.units import parse
from truenorth.damping.course import errors_of
from truenorth.damping.filters import Estimate, Filter, Fusion, run_filters
from truenorth.damping.loop import Loop, network_correction
from truenorth.damping.networks import second_order
from truenorth.damping.prior import carried_prior, paper_prior
from truenorth.errors.log import LogErrors
from truenorth.errors.marine import DP, MarineModel, position_in_angles
from truenorth.papers.damping.truth import HOUR, LOG_NOISE, Voyage
from truenorth.state.track import Track

Array = NDArray[np.float64]

SWITCH = 2.5 * HOUR
WINDOW = 5.0  # s, the paper's T
R2, TUNED_R2 = 0.001, 1e-4  # m/s^2: the paper's, and that of the fusion tuned like the 15 states
SPAN = 3600.0  # s, over which the fusion takes its mean: the paper's N at its epochs of 1 s
REFERENCE_PRIOR = 0.5  # m/s, of the 15-state filter, next to the paper's P0
LONG_REFERENCE_PRIOR = 0.3  # m/s, of its long-run tuning
NETWORK = Loop(second_order(0.5))
AZIMUTH = Loop(second_order(0.5), azimuth_damping=0.5)

# The two tunings of the 15-state filter: constant biases, and the random walks that it believes in.
SHORT = MarineModel(
    accel_random_walk=parse("1 ug/sqrt(Hz)", "velocity_random_walk"),
    gyro_random_walk=parse("0.0001 deg/sqrt(h)", "angle_random_walk"),
    groups=LogErrors(REFERENCE_PRIOR).groups(),
)
LONG = MarineModel(
    accel_random_walk=parse("10 ug/sqrt(Hz)", "velocity_random_walk"),
    gyro_random_walk=parse("0.001 deg/sqrt(h)", "angle_random_walk"),
    groups=LogErrors(LONG_REFERENCE_PRIOR).groups(),
)


@dataclass(frozen=True)
class Case:
    """What every method left on one course."""

    course: Track  # of the free INS
    time: Array  # (K+1,) s
    # dict of (K+1, 7) arrays; by method: phi_e, phi_n, phi_u (rad), v_e, v_n (m/s), lat, lon (rad), computed minus true after
    # its correction
    errors: dict[str, Array]
    estimates: dict[str, Estimate]  # of the filters
    filters: dict[str, Filter]
    runtime: float  # s; of all methods together, CPU time of all threads


def filters_of(voyage: Voyage, course: Track, *, raw: bool = True) -> dict[str, Filter]:
    """The paper's filters and the two 15-state ones, for a course that has a log of this voyage."""
    start = round(SWITCH / course.interval)
    noise = LOG_NOISE / np.sqrt(course.interval)
    P0, paper = paper_prior(course, start), MarineModel.of_paper()
    carried = carried_prior(course, start, LONG, np.diag(voyage.paper_errors() ** 2))
    kinds = {
        "filter1": Filter(paper, P0, noise),
        "filter2": Filter(paper, P0, R2, window=WINDOW),
        "augmented": Filter(SHORT, SHORT.prior(P0), noise, relinearise=True),
        "augmented_long": Filter(LONG, carried, noise, relinearise=True),
    }
    if raw:
        kinds["filter2_raw"] = Filter(paper, P0, np.sqrt(2.0) * noise / WINDOW, window=WINDOW)
    return kinds


def run_all(
    voyage: Voyage, course: Track, reference: Array, *, networks: bool = True, raw: bool = True, workers: int = 1
) -> Case:
    """Run every method on a course; its filters are switched on at 2.5 h, its networks with them."""
    begun = time.process_time()
    start = round(SWITCH / course.interval)
    kinds = filters_of(voyage, course, raw=raw)
    found = run_filters(course, reference, start=start, kinds=kinds, workers=workers)
    found["fused"] = fused(found, course.interval)
    found["fused_tuned"] = tuned_fusion(voyage, course, reference, workers)
    corrections = {"undamped": np.zeros((1, 7))}
    if networks:
        corrections["network_internal"] = network_correction(course, NETWORK, start=SWITCH, ramp=HOUR)
        corrections["network_external"] = network_correction(course, AZIMUTH, reference, start=SWITCH)
    corrections |= {name: estimate.x for name, estimate in found.items()}
    runtime = time.process_time() - begun
    free = errors_of(course, voyage.truth)
    errors = {name: left_of(voyage, free, x) for name, x in corrections.items()}
    return Case(course, course.time, errors, found, kinds, runtime)


def left_of(voyage: Voyage, free: Array, x: Array) -> Array:
    """(K+1, 7) errors in rad and m/s that the errors found, (M, 7 or more) at the last M epochs, leave of those of a free INS."""
    left = free.copy()
    left[len(free) - len(x) :] -= x[:, :7]
    left[:, DP] = position_in_angles(left[:, DP], *voyage.truth.position[:, [0, 2]].T)
    return left


def fused(found: Mapping[str, Estimate], interval: float, span: float = SPAN) -> Estimate:
    """The paper's fusion of filters 1 and 2, with its mean over as long a time at epochs of any length."""
    return Fusion(samples=max(1, round(span / interval)))(found["filter1"], found["filter2"], interval)


def tuned_fusion(voyage: Voyage, course: Track, reference: Array, workers: int) -> Estimate:
    """The fusion with what the long-run 15-state filter has: the same P0 and Q, and the R2 that suits them."""
    start, model = round(SWITCH / course.interval), replace(LONG, groups=())
    P0 = carried_prior(course, start, model, np.diag(voyage.paper_errors() ** 2))
    kinds = {
        "filter1": Filter(model, P0, LOG_NOISE / np.sqrt(course.interval)),
        "filter2": Filter(model, P0, TUNED_R2, window=WINDOW),
    }
    found = run_filters(course, reference, start=start, kinds=kinds, workers=workers)
    return fused(found, course.interval)


def without_overlap(voyage: Voyage, case: Case, reference: Array) -> tuple[Array, Array]:
    """Filter 2 updated once a window: (K+1, 7) errors in the units of a case, and (K+1-start, 7) their claimed sigma."""
    start = round(SWITCH / case.course.interval)
    kinds = {"filter1": case.filters["filter1"], "filter2": replace(case.filters["filter2"], overlap=False)}
    found = run_filters(case.course, reference, start=start, kinds=kinds)["filter2"]
    return left_of(voyage, errors_of(case.course, voyage.truth), found.x), found.sigma[:, :7]
