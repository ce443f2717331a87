"""Which published filter when: this library's own methods and those of the papers on the same logs, as a table in Markdown.

Run: ``python -m benchmarks.which_one --runs 12``; ``--only ring`` for one situation. Each log is simulated with its own draws; the
figures are RMS of level (both tilts) and of heading, in arcmin, over the runs that were aligned, and heading's RMS over its sigma.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import truenorth as tn
from truenorth.aiding.aids import Indexer, Odometer
from truenorth.core.attitude import misalignment
from truenorth.core.errors import TruenorthError
from truenorth.records import ImuRecord
from truenorth.records.motion import Moving
from truenorth.records.specs import ImuSpec
from truenorth.simulation.indexer import Indexed
from truenorth.simulation.scenario import read_scenario

Array = NDArray[np.float64]

ARCMIN = np.radians(1.0 / 60.0)
IMU = {
    "name": "navigation",
    "gyro": {"bias": "0.01 deg/h", "random_walk": "0.001 deg/sqrt(h)"},
    "accel": {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)"},
}
STILL = {
    "name": "still",
    "duration": "240 s",
    "rate": "100 Hz",
    "position": {"lat": "45 deg", "lon": "10 deg"},
    "motion": {"kind": "rest", "heading": "70 deg", "pitch": "1 deg", "roll": "-2 deg"},
    "imu": IMU,
}
TONES = {
    "pitch": [{"amplitude": "3 deg", "period": "5 s"}],
    "roll": [{"amplitude": "5 deg", "period": "6 s"}],
    "east": [{"amplitude": "0.03 m", "period": "7 s"}],
    "north": [{"amplitude": "0.02 m", "period": "8 s"}],
}
SWAY = STILL | {"name": "sway", "duration": "400 s", "motion": {"kind": "sway", "heading": "70 deg", "tones": TONES}}
STAYING = ("kf", "sakf", "makf", "imakf")
MOVING = ("ekf", "ukf", "ckf", "gh3", "gh7", "sgkf3", "sgkf7")


class Situation(NamedTuple):
    """Logs of one kind, and what is tried on them."""

    title: str
    scenario: str | dict[str, Any]
    duration: float  # s
    methods: tuple[str, ...]


class Log(NamedTuple):
    """One log."""

    record: ImuRecord
    place: tuple[float, float, float]
    spec: ImuSpec
    aid: Any
    motion: Moving  # that the answer is held against


SITUATIONS = {
    "still": Situation("still, 240 s", STILL, 240.0, ("auto", *STAYING, "states10", "states8")),
    "sway": Situation("sway of 3 and 5 deg, 400 s", SWAY, 400.0, ("auto", *STAYING)),
    "indexer": Situation("on an indexer, ship, arm known, 400 s", "rotary_ship", 400.0, ("auto", *STAYING)),
    "ring": Situation("driving with an odometer, 600 s", "odometer_ring", 600.0, ("auto", *MOVING)),
}


def logs(situation: Situation, runs: int) -> Iterator[Log]:
    """The logs of a situation."""
    scenario = read_scenario(situation.scenario).model_copy(update={"duration": situation.duration})
    for run in range(runs):
        made, motion = scenario.simulate(seed=8, run=run), None
        aids, motion, aid = scenario.simulate_aiding(seed=8, run=run), made.motion, ()
        if isinstance(motion, Indexed):
            axes = tuple(axis.direction for axis in motion.indexer.axes)
            aid = Indexer(aids["encoder"].record, axes=axes, lever_arm=[-x for x in scenario.lever_arm])
            motion = motion.motion
        elif "odometer" in aids:
            aid = Odometer(aids["odometer"].record)
        at = motion.states(np.array(0.0))
        place = float(np.degrees(at.lat)), float(np.degrees(at.lon)), float(at.alt)
        yield Log(made.record, place, scenario.imu_spec, aid, motion)


def rows(situation: Situation, runs: int, show: Callable[[str], None]) -> None:
    """Align every log by every method and print a row for each."""
    kept: dict[str, list[tuple[float, ...]]] = {name: [] for name in situation.methods}
    spent = dict.fromkeys(situation.methods, 0.0)
    for log in logs(situation, runs):
        for name in situation.methods:
            begun = time.process_time()
            try:
                answer = tn.align(log.record, log.place, log.spec, aid=log.aid, method=name)
            except TruenorthError:
                continue
            finally:
                spent[name] += time.process_time() - begun
            if answer.status != "aligned":
                continue
            phi = misalignment(answer.C_nb, log.motion.states(np.array(answer.time)).C_nb) / ARCMIN
            kept[name].append((*phi, float(np.sqrt(answer.phi_covariance[2, 2])) / ARCMIN))
    for name, found in kept.items():
        x = np.array(found).reshape(-1, 4)
        level, heading = (np.sqrt(np.mean(part**2)) if len(x) else np.nan for part in (x[:, :2], x[:, 2]))
        ratio = np.sqrt(np.mean((x[:, 2] / x[:, 3]) ** 2)) if len(x) else np.nan
        show(
            f"| {situation.title} | `{name}` | {level:.3g} | {heading:.3g} | {ratio:.2f} | {len(x)} of {runs} "
            f"| {spent[name] / runs:.2f} s |"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--only", choices=list(SITUATIONS))
    given = parser.parse_args()
    print(
        "| situation | method | level | heading | RMS/sigma | aligned | a log |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    for name, situation in SITUATIONS.items():
        if given.only in (None, name):
            rows(situation, given.runs, lambda line: print(line, flush=True))


if __name__ == "__main__":
    main()
