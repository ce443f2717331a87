"""What the slave measures and the master says: the paper's flight, and the standard manoeuvres in its place."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector, euler_from_dcm
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.motion import Moving
from truenorth.simulation import Flexed, FlexureSpec, IdealLog, MasterSpec, ideal_log, simulate, simulate_sensor
from truenorth.simulation.gnss import moved
from truenorth.simulation.scenario import Scenario, read_scenario
from truenorth.simulation.streams import stream
from truenorth.state.state import State

Array = NDArray[np.float64]

SCENARIO = "transfer_flat_turn"
BEGIN, STOP, END = 120.0, 150.0, 200.0  # s: the paper's turn, and its end
ARCMIN = math.radians(1.0 / 60.0)
LEVEL, HEADING = math.radians(0.5), math.radians(1.0)
VELOCITY_NOISE = 0.2  # m/s
POSITION_NOISE, ACCELERATION_NOISE = 1.0, 0.02  # m and m/s^2; ours, of a master that is matched so
ATTITUDE_NOISE = ARCMIN  # ours; the paper's master says no attitude
TAU, ARM = 0.03, (1.0, 0.1, 0.2)  # the paper's; also sigmas, where they are drawn
TAU_SIGMA, ARM_SIGMA = 0.05, 1.0  # as the filter believes
FLEXURE = FlexureSpec(sigma=(6 * ARCMIN, 3 * ARCMIN, 3 * ARCMIN), correlation_time=5.0)  # heading, pitch, roll
MORE = 1.0  # s of flight after the end, so that rows that come late still find the slave there
STREAM = 300  # of what this study draws
LINE = 1.0  # s of rows, through which a line extrapolates

STRAIGHT = {"kind": "straight", "duration": f"{BEGIN} s"}
MANOEUVRES: dict[str, list[dict[str, Any]]] = {
    "banked_turn": [{"kind": "turn", "angle": "90 deg", "rate": "3 deg/s", "bank": "coordinated"}],
    "s_turn": [{"kind": "s_turn", "angle": "20 deg", "rate": "3 deg/s"}],
    "accelerate": [
        {"kind": "accelerate", "to": "250 m/s", "acceleration": "4 m/s^2"},
        {"kind": "accelerate", "to": "200 m/s", "acceleration": "4 m/s^2"},
    ],
    "wing_rock": [{"kind": "wing_rock", "duration": "30 s", "amplitude": "20 deg", "period": "4 s"}],
    # As much as the turn's 10.5 m/s^2: for the same time, and rolled to where a lift of 1 g would pull sideways with it.
    "accelerate_10.5": [
        {"kind": "accelerate", "to": "331 m/s", "acceleration": "10.5 m/s^2"},
        {"kind": "accelerate", "to": "200 m/s", "acceleration": "10.5 m/s^2"},
    ],
    "wing_rock_10.5": [{"kind": "wing_rock", "duration": "30 s", "amplitude": "47 deg", "period": "4 s"}],
}


def scenario_of(manoeuvre: str) -> Scenario:
    """The paper's scenario with one of the standard manoeuvres in place of its turn."""
    paper = read_scenario(SCENARIO)
    if manoeuvre == "flat_turn":
        return paper
    content = paper.to_mapping()
    legs = [STRAIGHT, *MANOEUVRES[manoeuvre], {"kind": "straight", "duration": "60 s"}]
    return read_scenario(content | {"name": f"transfer_{manoeuvre}", "motion": {**content["motion"], "legs": legs}})


@dataclass(frozen=True)
class Case:
    """A manoeuvre, and how the master stands and speaks."""

    name: str
    number: int  # of the random numbers
    manoeuvre: str = "flat_turn"
    space_time: str = "paper"  # delay and lever arm: the paper's, none, or drawn with the paper's as sigmas
    flexure: bool = False  # the slave's seat bends
    drop: tuple[float, float] | None = None  # tuple of (start, stop) or None, s; the master is silent
    extra_delay: float = 0.0  # s; by which the master is later still

    @cached_property
    def scenario(self) -> Scenario:
        """Of the manoeuvre."""
        return scenario_of(self.manoeuvre)


@dataclass(frozen=True)
class Run:
    """One run: records and truth."""

    slave: ImuRecord
    master: MasterRecord
    motion: Moving  # of the slave
    start: State  # of the slave, as it is handed over
    mounting: Array  # (3,) rad: ``C_mb = exp([mounting x])``
    tau: float  # s
    arm: Array  # (3,) m
    gyro_bias: Array  # (3,)
    accel_bias: Array  # (3,)
    felt: MasterRecord  # the same master with noise of its place, and with its specific force


class Flights:
    """All runs of a case; what they share is made once."""

    def __init__(self, case: Case, seed: int) -> None:
        self.case, self.seed = case, seed
        self.scenario = case.scenario
        self.body = self.scenario.build_motion()
        self.start = self.body.states(np.array(self.scenario.start))
        if not case.flexure:
            self.ideal: IdealLog = self._ideal(self.body)

    def _ideal(self, motion: Any) -> IdealLog:
        return ideal_log(motion, rate=self.scenario.rate, duration=self.scenario.duration + MORE)

    def __call__(self, run: int) -> Run:
        """Make one run."""
        case, at = self.case, self.start
        rng = stream(self.seed, case.number, run, STREAM)
        mounting = np.array([LEVEL, LEVEL, HEADING]) * rng.standard_normal(3)
        dv = VELOCITY_NOISE * rng.standard_normal(3)
        tau, arm = TAU, np.array(ARM)
        if case.space_time == "none":
            tau, arm = 0.0, np.zeros(3)
        elif case.space_time == "drawn":
            tau, arm = TAU_SIGMA * float(rng.standard_normal()), ARM_SIGMA * rng.standard_normal(3)
        ideal, C_start = self._moving(run)
        log = simulate(ideal, imu=self.scenario.imu_spec, seed=self.seed, run=run, scenario=case.number)
        felt = self._master(run, tau + case.extra_delay, arm, mounting)
        master = replace(felt, lat=None, lon=None, alt=None, w_ib_b=None, f_b=None)
        C_nb = C_start @ dcm_from_rotation_vector(-mounting)
        return Run(
            log.record,
            master,
            ideal.motion if case.flexure else self.body,
            State.at(C_nb, at.lat, at.lon, at.alt, at.v_n + dv),
            mounting,
            tau + case.extra_delay,
            arm,
            log.errors.gyro_bias,
            log.errors.accel_bias,
            _noisy(felt, stream(self.seed, case.number, run, STREAM + 1)),
        )

    def _moving(self, run: int) -> tuple[IdealLog, Array]:
        """What an ideal slave measures, and the attitude of the rigid body at the start."""
        if not self.case.flexure:
            return self.ideal, self.start.C_nb
        span = {"duration": self.scenario.duration + MORE, "seed": self.seed, "run": run, "scenario": self.case.number}
        return self._ideal(Flexed(self.body, FLEXURE, **span)), self.start.C_nb

    def _master(self, run: int, tau: float, arm: Array, mounting: Array) -> MasterRecord:
        heading, pitch, roll = (float(x) for x in euler_from_dcm(dcm_from_rotation_vector(mounting)))
        usual = self.scenario.aiding_specs["master"]
        assert isinstance(usual, MasterSpec)
        spec = replace(
            usual,
            latency=0.0,
            clock_offset=tau,
            lever_arm=(float(arm[0]), float(arm[1]), float(arm[2])),
            mounting=(heading, pitch, roll),
            attitude_noise=ATTITUDE_NOISE,
            with_position=True,
            with_sensors=True,
        )
        record = simulate_sensor(
            self.body, spec, duration=self.scenario.duration + MORE, seed=self.seed, run=run, scenario=self.case.number
        ).record
        if self.case.drop is not None:
            there = (record.time < self.case.drop[0]) | (record.time > self.case.drop[1])
            record = replace(
                record,
                **{
                    name: getattr(record, name)[there]
                    for name in ("time", "C_nb", "v_n", "lat", "lon", "alt", "w_ib_b", "f_b")
                },
            )
        return record


def _noisy(master: MasterRecord, rng: np.random.Generator) -> MasterRecord:
    """White noise of place and specific force."""
    dp = POSITION_NOISE * rng.standard_normal((len(master), 3))
    lat, lon, alt = moved(np.asarray(master.lat), np.asarray(master.lon), np.asarray(master.alt), dp)
    f_b = np.asarray(master.f_b) + ACCELERATION_NOISE * rng.standard_normal((len(master), 3))
    return replace(master, lat=lat, lon=lon, alt=alt, f_b=f_b)


def extrapolated(master: MasterRecord, ahead: float) -> MasterRecord:
    """What a simple receiver makes of a master that is late by `ahead` (s): velocity goes on along the line of the last second."""
    assert master.v_n is not None
    rows = round(LINE / master.interval)
    t = master.interval * (np.arange(rows) - 0.5 * (rows - 1))
    weights = 1.0 / rows + t * (t[-1] + ahead) / float(t @ t)
    windows = np.lib.stride_tricks.sliding_window_view(master.v_n, rows, axis=0)
    return replace(master[rows - 1 :], v_n=windows @ weights)
