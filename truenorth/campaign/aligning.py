"""What a campaign does with a run: simulate it, align it by every method, and hold the answers against the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from truenorth.aiding.aids import Gnss, Indexer, Odometer
from truenorth.alignment import Alignment, align
from truenorth.alignment.assumptions import MOVING
from truenorth.alignment.rotary import INDEXER_METHODS
from truenorth.campaign.rows import Row
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.core.remembered import remembered
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.records import ImuRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation.indexer import Indexed

if TYPE_CHECKING:
    from truenorth.campaign.plan import Case, MethodPlan, Plan
    from truenorth.simulation.ideal import IdealLog
    from truenorth.simulation.runs import Simulation
    from truenorth.simulation.scenario import Scenario

ARCMIN = math.radians(1.0) / 60.0
MOST_EPOCHS = 100  # of a motion, whose states are remembered
KNOWN = ("aligned", "level_only", "not_converged", "not_observable", "inconsistent")


def align_runs(plan: Plan, case: Case, runs: Sequence[int]) -> list[Row]:
    """Rows of some runs of a case.

    What fails, fails as a row: its status is ``failed``, its reason the message.
    """
    scenario = case.built
    rows: list[Row] = []
    for run in runs:
        try:
            shared = None if scenario.is_drawn else _shared_ideal(scenario)
            simulated = scenario.simulate(seed=plan.seed, run=run, number=case.scenario_number, ideal=shared)
        except Exception as error:
            rows += [
                _failure(case, method.name, run, time, error)
                for method in plan.methods
                for time in (*plan.times, scenario.duration)
            ]
            continue
        for method in plan.methods:
            spec = _spec_for(method, scenario.imu_spec)
            for time in (*plan.times, scenario.duration):
                rows += _aligned(plan, case, run, method, spec, simulated, time)
    return rows


@remembered
def _shared_ideal(scenario: Scenario) -> IdealLog:
    """What an ideal IMU measures on a motion that all runs share; made once for all blocks of a case in turn."""
    return scenario.ideal()


@remembered
def _truth_of(motion: Moving) -> Callable[[float], MotionStates]:
    """States of a motion at a time (s), each worked out once: runs that share a motion ask for the same epochs."""
    return lru_cache(maxsize=MOST_EPOCHS)(lambda time: motion.states(np.array(time)))


@remembered
def _is_sound(scenario: Scenario) -> bool:
    """Whether every log of a scenario is known to be without the faults that :func:`align` looks for.

    A base at rest, and an IMU with noise that neither counts in steps nor ends at a range: no row repeats or is cut off, and
    no stretch is noisier than the others.
    """
    spec, at_rest = scenario.imu_spec, scenario.motion.kind == "rest" and not scenario.disturbances
    if not at_rest or scenario.indexer is not None or scenario.flexure is not None:
        return False
    noise = (
        spec.gyro_random_walk + spec.gyro_sample_noise > 0.0 and spec.accel_random_walk + spec.accel_sample_noise > 0.0
    )
    counts = spec.gyro_quantisation + spec.accel_quantisation > 0.0
    return noise and not counts and math.isinf(spec.gyro_range) and math.isinf(spec.accel_range)


def _aligned(
    plan: Plan, case: Case, run: int, method: MethodPlan, spec: ImuSpec | None, simulated: Simulation, time: float
) -> list[Row]:
    try:
        record = simulated.record.between(None, case.built.start + time * (1 + 1e-12))
        start = _truth_of(simulated.motion)(case.built.start)
        place = Position(float(start.lat), float(start.lon), float(start.alt))
        motion = simulated.motion
        if method.method in ("in_motion", *MOVING):
            assert spec is not None  # the plan sees to it
            answer = _in_motion(plan, case, run, method.method, spec, record, place)
        else:
            aid: list[Indexer] = []
            if isinstance(motion, Indexed) and method.method in INDEXER_METHODS:
                aid, motion = [_indexer(plan, case, run, motion)], motion.motion  # the answer is the body's
            # Where no faults can be, none are looked for; an answer that is held against the truth is the end.
            known: dict[str, Any] = {"sound": True, "goes_on": False} if _is_sound(case.built) else {}
            limit = plan.heading_limit
            answer = align(record, place, spec, aid=aid, method=method.method, heading_limit=limit, **known)
        errors = [
            Row(case.number, method.name, run, time, quantity, value, sigma, unit, answer.status)
            for quantity, value, sigma, unit in _errors(answer, simulated, _truth_of(motion)(answer.time))
        ]
    except Exception as error:
        return [_failure(case, method.name, run, time, error)]
    outcome = Row(
        case.number, method.name, run, time, "outcome", status=answer.status, reason="; ".join(answer.reasons)
    )
    return [outcome, *errors]


def _indexer(plan: Plan, case: Case, run: int, motion: Indexed) -> Indexer:
    """The encoder of a scenario's indexer, with the lever arm as the scenario has it."""
    scenario = case.built
    logs = scenario.simulate_aiding(seed=plan.seed, run=run, number=case.scenario_number)
    axes = tuple(axis.direction for axis in motion.indexer.axes)
    return Indexer(logs["encoder"].record, axes=axes, lever_arm=[-x for x in scenario.lever_arm])


def _in_motion(
    plan: Plan, case: Case, run: int, method: str, spec: ImuSpec, record: ImuRecord, place: Position
) -> Alignment:
    """By the odometer and the receiver that the scenario has, as far as the log goes; where they sit is estimated.

    Published filters take the odometer alone.
    """
    logs = case.built.simulate_aiding(seed=plan.seed, run=run, number=case.scenario_number)
    stop = float(record.time[-1])
    kinds = {"odometer": Odometer, "gnss": Gnss} if method == "in_motion" else {"odometer": Odometer}
    aid = [kind(logs[key].record.between(None, stop)) for key, kind in kinds.items() if key in logs]
    own = "auto" if method == "in_motion" else method
    return align(record, place, spec, aid=aid, method=own, heading_limit=plan.heading_limit)


def _errors(answer: Alignment, simulated: Simulation, true: MotionStates) -> Iterator[tuple[str, float, float, str]]:
    """Quantity, error, sigma and unit of what an alignment found, against the motion at its epoch.

    The squares, normalised by what the method says, are means over components: 1 where it says the truth.
    """
    phi = -rotation_vector_from_dcm(answer.C_nb @ true.C_nb.T)  # C_hat = (I - [phi x]) C
    sigma = np.sqrt(answer.phi_covariance.diagonal())
    usable = 3 if answer.heading_known else 2
    angles = zip(("phi_e", "phi_n", "phi_u")[:usable], phi.tolist(), sigma.tolist(), strict=False)
    for name, error, one in angles:
        yield name, error / ARCMIN, one / ARCMIN, "arcmin"
    level = math.hypot(phi[0], phi[1]) / ARCMIN
    yield "level", level, math.hypot(sigma[0], sigma[1]) / ARCMIN, "arcmin"
    block = answer.phi_covariance[:usable, :usable]
    yield "nees", float(phi[:usable] @ np.linalg.solve(block, phi[:usable])) / usable, math.nan, "1"
    if answer.history is not None:
        count = max(1, int(np.isfinite(answer.history.innovation).sum()))
        nis = answer.history.nis
        yield "nis", float(np.where(np.isnan(nis), 0.0, nis).sum()) / count, math.sqrt(2.0 / count), "1"
    for what, found, spread, drawn, unit, scale in (
        ("gyro_bias", answer.gyro_bias, answer.gyro_bias_sigma, simulated.errors.gyro_bias, "deg/h", DEG_PER_HOUR),
        ("accel_bias", answer.accel_bias, answer.accel_bias_sigma, simulated.errors.accel_bias, "ug", MICRO_G),
    ):
        off, sigmas = ((found - drawn) / scale).tolist(), (spread / scale).tolist()
        for letter, error, one in zip("xyz", off, sigmas, strict=True):
            yield f"{what}_{letter}", error, one, unit


def _failure(case: Case, method: str, run: int, time: float, error: Exception) -> Row:
    return Row(case.number, method, run, time, "outcome", status="failed", reason=f"{type(error).__name__}: {error}")


def _spec_for(method: MethodPlan, simulated: ImuSpec) -> ImuSpec | None:
    if method.imu == "simulated":
        return simulated
    return None if method.imu == "none" else imu_spec(method.imu)
