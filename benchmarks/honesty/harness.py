"""What the scripts of honesty share: runs of a scenario, errors over sigma, and a line of a table.

A case is a scenario whose numbers are drawn anew in each run, and a procedure. The plumb line is deflected as sigma allows for,
which the simulator does not do: drawn in each run, it turns the truth. Printed are the RMS of error over sigma of heading and
level, how many runs were refused (any status but the one that is expected), and the worst run with a good status. Sigma is honest
where the RMS lies in .8 to 1.25; a run beyond four sigmas with a good status is a defect.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment
from truenorth.alignment.task import deflection_covariance
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import ecef_axes, normal_gravity
from truenorth.core.errors import TruenorthError
from truenorth.core.position import Position
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.simulation.scenario import read_scenario

Array = NDArray[np.float64]
HONEST = (0.8, 1.25)
DEFECT = 4.0


@dataclass(frozen=True)
class Log:
    """A simulated log and its truth."""

    record: ImuRecord
    encoder: EncoderRecord | None
    position: Position  # where the IMU is in the mean
    C_nb: Callable[[float], Array]  # true attitude of the body at a time, s, against the level at that place


@dataclass(frozen=True)
class Case:
    """A row of the table."""

    name: str
    # ``scenario(rng)``: the mapping of a scenario, its numbers drawn
    scenario: Callable[[np.random.Generator], Mapping[str, Any]]
    align: Callable[[Log], Alignment]  # ``align(log)``: the procedure
    good: Sequence[str] = ("aligned",)  # statuses that are no refusal
    of_imu: bool = False  # the truth is the attitude of the IMU, not of the body that it turns in


def place(rng: np.random.Generator) -> dict[str, str]:
    """A position between 20 and 55 deg N."""
    return {"lat": f"{rng.uniform(20.0, 55.0):.4f} deg", "lon": "10 deg"}


def direction(rng: np.random.Generator) -> Array:
    """(3,) unit vector, any direction alike."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))


def simulated(scenario: Mapping[str, Any], seed: int, run: int, of_imu: bool = False) -> Log:
    """A run of a scenario."""
    read = read_scenario({"name": "honesty", **scenario})
    simulation = read.simulate(seed=seed, run=run)
    aiding = read.simulate_aiding(seed=seed, run=run)
    record = simulation.record
    at = simulation.motion.states(record.time[:: max(1, round(read.rate))])
    here = Position(float(at.lat.mean()), float(at.lon.mean()), float(at.alt.mean()))
    turned = "indexer" in scenario and not of_imu
    body = getattr(simulation.motion, "motion", simulation.motion) if turned else simulation.motion

    def C_nb(when: float) -> Array:
        then = body.states(np.asarray(when))
        C: Array = ecef_axes(here.lat, here.lon).T @ ecef_axes(then.lat, then.lon) @ then.C_nb
        return C

    encoder = aiding["encoder"].record if "encoder" in aiding else None
    return Log(record, encoder, here, C_nb)


def run_case(case: Case, seed: int, runs: int, verbose: bool = False) -> str:
    """Run a case, and its line of the table."""
    ratios, refusals, worst = [], [], (0.0, 0)
    begun = time.perf_counter()
    for run in range(runs):
        log = simulated(case.scenario(np.random.default_rng([seed, run])), seed, run, case.of_imu)
        try:
            answer = case.align(log)
        except TruenorthError as error:
            refusals.append((run, str(error)))
            continue
        here = log.position
        deflection = deflection_covariance(here.lat, float(normal_gravity(here.lat, here.alt)))
        true = log.C_nb(answer.time)
        phi = -rotation_vector_from_dcm(answer.C_nb @ true.T)
        phi[:2] = answer.C_nb[:2] @ np.cross(answer.C_nb[2], true[2])  # level alone, whatever heading
        phi += np.random.default_rng([seed, run, 1]).multivariate_normal(np.zeros(3), deflection)
        ratio = phi / np.sqrt(np.diag(answer.phi_covariance))
        if answer.status == "level_only" and "level_only" in case.good:
            ratio[2] = np.nan
        ratios.append(ratio)
        if answer.status not in case.good:
            refusals.append((run, f"{answer.status}: {answer.reasons[0]}"))
        elif np.nanmax(np.abs(ratio)) > worst[0]:
            worst = (float(np.nanmax(np.abs(ratio))), run)
        if verbose:
            print(f"    run {run}: {np.round(ratio, 2)} {answer.status} {answer.method} {np.degrees(phi) * 60} arcmin")
    level, heading = math.nan, math.nan
    if ratios:
        found = np.array(ratios)
        level = float(np.sqrt(np.mean(found[:, :2] ** 2)))
        heading = float(np.sqrt(np.nanmean(found[:, 2] ** 2))) if np.isfinite(found[:, 2]).any() else math.nan
    for run, why in refusals if verbose else refusals[:2]:
        print(f"    run {run} refused: {why}")
    seconds = (time.perf_counter() - begun) / runs
    mark = "  DEFECT" if worst[0] > DEFECT else ""
    return (
        f"{case.name:58s} {runs:4d} runs  heading {heading:5.2f}  level {level:5.2f}  refused {len(refusals):3d}  "
        f"worst {worst[0]:5.2f} (run {worst[1]}){mark}  {seconds:.1f} s each"
    )


def main(cases: Sequence[Case]) -> None:
    """Command line of a script: ``--runs``, ``--seed``, ``--only`` part of a name."""
    parser = argparse.ArgumentParser(description="RMS of error over sigma, refusals, and the worst run")
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="cases with this in their name")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    for case in cases:
        if given.only in case.name:
            print(run_case(case, given.seed, given.runs, given.verbose), flush=True)
