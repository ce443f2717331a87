"""The paper's ship, its variants and their runs: logs with the angles of the indexer and the true attitude.

Configuration A is the scenario `rotary_ship` that ships with the library; the others change it:

B             angular phases, bias signs and the periods of the sway (5 to 9 s) drawn anew in each run
C             narrow-band swell of 15 % bandwidth in place of single tones
jonswap       a ship in a JONSWAP sea, an engine's vibration on top, bias signs drawn
unrotated     as B, the indexer at rest
rotation_off  as A, the indexer at rest
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from importlib import resources
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import ecef_axes
from truenorth.core.position import Position
from truenorth.core.yaml_file import read_mapping
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.records.motion import Moving
from truenorth.records.specs import ImuSpec
from truenorth.simulation.scenario import Scenario, read_scenario
from truenorth.simulation.streams import stream

Array = NDArray[np.float64]
Noise = Literal["per_sample", "random_walk"]

CASES = ("A", "B", "C", "jonswap", "unrotated", "rotation_off")
NUMBERS = {"A": 0, "B": 1, "C": 2, "jonswap": 3, "unrotated": 1, "rotation_off": 0}  # alike: the same ship and IMU
AXES = ("z", "x")  # of the indexer, the outermost first
INDEXER_RATES = tuple(np.radians([6.0, 18.0]).tolist())  # rad/s: the paper's w2 about z and w1 = 3 w2 about x
DURATION = 720  # s: 120 of coarse, 600 of fine alignment
DRAWS = 300  # stream of what a case draws
BANDWIDTH = "15 %"
PERIODS = (5.0, 9.0)  # s, between which B draws those of the sway
SEA = {"kind": "sea", "heading": "-30 deg", "waves": {"height": "1.5 m", "period": "8 s", "direction": "40 deg"}}
ENGINE = {"kind": "vibration", "sines": [{"frequency": "12 Hz", "acceleration": ["2 mg", "2 mg", "5 mg"]}]}
WALKS: dict[str, dict[str, str]] = {
    "gyro": {"bias": "0.01 deg/h", "random_walk": "0.001 deg/sqrt(h)"},
    "accel": {"bias": "100 ug", "random_walk": "10 ug/sqrt(Hz)"},
}


@dataclass(frozen=True)
class Run:
    """One run of a case."""

    record: ImuRecord
    encoder: EncoderRecord | None  # None where the indexer rests
    motion: Moving  # Motion or Indexed; of the IMU
    imu: ImuSpec  # as the aligner knows it
    place: Position  # where the IMU is in the mean
    arm: Array  # (3,) m

    def C_ns(self, time: Array) -> Array:
        """(..., 3, 3) true attitude of the IMU at times (s), against the level at the mean place.

        The level at the IMU's own place follows its sway: .2 arcsec at 5 m.
        """
        at = self.motion.states(time)
        C: Array = ecef_axes(self.place.lat, self.place.lon).T @ ecef_axes(at.lat, at.lon) @ at.C_nb
        return C


def scenario_of(case: str, run: int, seed: int, noise: Noise = "per_sample", signs: int = 0) -> Scenario:
    """The scenario of a run of a case; `signs` above 0: other signs of the biases, the same in all runs."""
    with resources.as_file(resources.files("truenorth.simulation") / "scenarios" / "rotary_ship.yaml") as file:
        mapping: dict[str, Any] = copy.deepcopy(read_mapping(file))
    mapping["duration"] = f"{DURATION + 1} s"  # a sample beyond the last whole second
    rng = stream(seed, NUMBERS[case], run, DRAWS)
    tones = mapping["motion"]["tones"]
    if noise == "random_walk":
        mapping["imu"] = {"name": "paper 1, random walk", **WALKS}
    if case in ("B", "unrotated"):
        for name in ("heading", "pitch", "roll"):
            del tones[name][0]["phase"]
        for name in ("east", "north", "up"):
            tones[name][0]["period"] = f"{rng.uniform(*PERIODS)!r} s"
    if case == "C":
        for name, (tone,) in tones.items():
            number, unit = str(tone["amplitude"]).split()
            tones[name] = [
                {
                    "rms": f"{abs(float(number)) / math.sqrt(2)!r} {unit}",
                    "period": tone["period"],
                    "bandwidth": BANDWIDTH,
                }
            ]
    if case == "jonswap":
        mapping["motion"], mapping["disturbances"] = copy.deepcopy(SEA), [copy.deepcopy(ENGINE)]
    if signs or case in ("B", "jonswap", "unrotated"):
        draws = stream(seed, NUMBERS[case], signs, DRAWS + 1) if signs else rng
        gyro, accel = draws.choice((-1.0, 1.0), (2, 3))
        mapping["errors"] = {
            "gyro": {"bias": [f"{float(0.01 * s)!r} deg/h" for s in gyro]},
            "accel": {"bias": [f"{float(100.0 * s)!r} ug" for s in accel]},
        }
    if case in ("unrotated", "rotation_off"):
        del mapping["indexer"]
    return read_scenario(mapping)


def simulate_run(case: str, run: int, seed: int, noise: Noise = "per_sample", signs: int = 0) -> Run:
    """Simulate a run; the same numbers give the same bits."""
    scenario = scenario_of(case, run, seed, noise, signs)
    simulation = scenario.simulate(seed=seed, run=run, number=NUMBERS[case])
    aiding = scenario.simulate_aiding(seed=seed, run=run, number=NUMBERS[case])
    record = simulation.record
    at = simulation.motion.states(record.time[:: round(scenario.rate)])
    place = Position(float(at.lat.mean()), float(at.lon.mean()), float(at.alt.mean()))
    return Run(
        record,
        aiding["encoder"].record if "encoder" in aiding else None,
        simulation.motion,
        scenario.imu_spec.with_random_walks(record.interval),
        place,
        np.array(scenario.lever_arm),
    )
