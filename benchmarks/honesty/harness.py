"""Cases of alignment on the frame of honesty: runs of a scenario, and errors over sigma.

A case is a scenario whose numbers are drawn anew in each run, and a procedure. The plumb line is deflected as sigma allows for,
which the simulator does not do: drawn in each run, it turns the truth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.honesty import frame
from benchmarks.honesty.frame import Outcome
from truenorth.alignment.result import Alignment
from truenorth.alignment.task import deflection_covariance
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import ecef_axes, normal_gravity
from truenorth.core.position import Position
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.simulation.scenario import read_scenario

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Log:
    """A simulated log and its truth."""

    record: ImuRecord
    encoder: EncoderRecord | None
    position: Position  # where the IMU is in the mean
    C_nb: Callable[[float], Array]  # true attitude of the body at a time, s, against the level at that place
    aiding: Mapping[str, Any] = field(default_factory=dict)  # records of the sensors besides the IMU, by their keys
    start: Position | None = None  # where the log begins
    numbers: tuple[int, int] = (0, 0)  # seed and run: what a case spoils is drawn by them, anew in each run


@dataclass(frozen=True)
class Case:
    """A row of the table."""

    name: str
    # ``scenario(rng)``: the mapping of a scenario, its numbers drawn
    scenario: Callable[[np.random.Generator], Mapping[str, Any]]
    align: Callable[[Log], Alignment]  # ``align(log)``: the procedure
    good: Sequence[str] = ("aligned",)  # statuses that are no refusal
    of_imu: bool = False  # the truth is the attitude of the IMU, not of the body that it turns in
    left_out: bool = False  # no log can show it: kept to show what it costs
    flagged: bool = False  # no model holds this world: a flag is right


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
    moves = bool(aiding) and "indexer" not in scenario  # its level is that of where it is
    turned = "indexer" in scenario and not of_imu
    body = getattr(simulation.motion, "motion", simulation.motion) if turned else simulation.motion

    def C_nb(when: float) -> Array:
        then = body.states(np.asarray(when))
        if moves:
            return np.asarray(then.C_nb)
        C: Array = ecef_axes(here.lat, here.lon).T @ ecef_axes(then.lat, then.lon) @ then.C_nb
        return C

    records = {key: sensed.record for key, sensed in aiding.items()}
    start = Position(float(at.lat[0]), float(at.lon[0]), float(at.alt[0]))
    return Log(record, records.get("encoder"), here, C_nb, records, start, (seed, run))


def outcome(case: Case, seed: int, run: int) -> Outcome:
    """Heading and level of one run over their sigmas."""
    log = simulated(case.scenario(np.random.default_rng([seed, run])), seed, run, case.of_imu)
    answer = case.align(log)
    here = log.position
    deflection = deflection_covariance(here.lat, float(normal_gravity(here.lat, here.alt)))
    true = log.C_nb(answer.time)
    phi = -rotation_vector_from_dcm(answer.C_nb @ true.T)
    phi[:2] = answer.C_nb[:2] @ np.cross(answer.C_nb[2], true[2])  # level alone, whatever heading
    phi += np.random.default_rng([seed, run, 1]).multivariate_normal(np.zeros(3), deflection)
    ratio = phi / np.sqrt(np.diag(answer.phi_covariance))
    known = answer.status != "level_only" or "level_only" not in case.good
    ratios = {"heading": ratio[2:], "level": ratio[:2]} if known else {"level": ratio[:2]}
    refused = "" if answer.status in case.good else f"{answer.status}: {answer.reasons[0]}"
    return Outcome(ratios, refused, f"{answer.status} {answer.method} {np.degrees(phi) * 60} arcmin")


def of_transfer(answer: Alignment, C_nb: Array, delay: float, arm: Array) -> Outcome:
    """Heading, level, delay and arm of a transfer over their sigmas; what is printed as not estimated claims nothing."""
    t = answer.transfer
    assert t is not None
    phi = -rotation_vector_from_dcm(answer.C_nb @ C_nb.T)
    ratio = phi / np.sqrt(np.diag(answer.phi_covariance))
    ratios = {
        "heading": ratio[2:],
        "level": ratio[:2],
        "delay": np.array([(t.delay - delay) / t.delay_sigma if t.delay_estimated else np.nan]),
        "arm": np.where(t.lever_arm_estimated, (t.lever_arm - arm) / t.lever_arm_sigma, np.nan),
    }
    return Outcome(ratios, "" if answer.status == "aligned" else f"{answer.status}: {answer.reasons[0]}")


def framed(procedure: str, cases: Sequence[Case]) -> tuple[frame.Case, ...]:
    """These cases as rows of the matrix."""
    return tuple(
        frame.Case(procedure, case.name, partial(outcome, case), case.left_out, case.flagged) for case in cases
    )


def main(cases: Sequence[Case]) -> None:
    """Command line of a script, see :func:`benchmarks.honesty.frame.main`."""
    frame.main(framed("alignment", cases))
