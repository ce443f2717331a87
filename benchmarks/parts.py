"""Parts of the library that the first version has as well, timed within one process; `versus` runs this file in both.

Processor time of a call, the least of several; the first call, which may compile, does not count.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.bench_filters import system
from benchmarks.bench_simulation import EVERYTHING, SHIP, WALKS
from truenorth.filters import fading, feedback, innovation_adaptive, kalman, smoother, square_root
from truenorth.papers.transfer import filtering
from truenorth.papers.transfer.truth import Case, Flights
from truenorth.simulation import ideal_log, simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight

REPEATS = 5
Part = tuple[str, Callable[[], object], float]  # what and its unit, the call, units in a second


def there(*places: str) -> Any:
    """The first of these names that exists: ``module:name``, where it stands and where it stood."""
    for place in places:
        module, name = place.split(":")
        try:
            return getattr(import_module(module), name)
        except ModuleNotFoundError:
            continue
    raise ModuleNotFoundError(str(places))


def least(call: Callable[[], object]) -> float:
    """Least processor time of a call, s."""

    def took() -> float:
        begun = time.process_time()
        call()
        return time.process_time() - begun

    took()
    return min(took() for _ in range(REPEATS))


def strapdown() -> Iterator[Part]:
    """The mechanisation and the closed loop, over an hour of flight at 100 Hz."""
    mechanise = there("truenorth.strapdown.level:mechanise", "truenorth.strapdown:mechanise")
    at = there("truenorth.state.state:State", "truenorth.strapdown:NavigationState").at
    position = there("truenorth.core.position:Position", "truenorth.position:Position")
    Aiding = there("truenorth.aiding.source:Aiding", "truenorth.navigation.aiding:Aiding")
    InsModel = there("truenorth.errors.model:InsModel", "truenorth.models.ins:InsModel")
    navigate_track = there("truenorth.estimate.run:navigate_track", "truenorth.navigation.driver:navigate_track")
    Start = there("truenorth.state.state:Start", "truenorth.navigation.driver:Start")
    imu_spec = there("truenorth.records.specs:imu_spec", "truenorth.specs:imu_spec")

    legs = [*straight(20.0), *s_turn(np.radians(60.0), np.radians(3.0), 4)]
    motion = course(position.from_degrees(45.0, 10.0, 3000.0), legs, heading=0.5, speed=200.0)
    record = simulate(motion, rate=100.0, duration=3600.0).record
    s = motion.states(0.0)
    state = at(s.C_nb, float(s.lat), float(s.lon), float(s.alt))
    yield "mechanisation to attitude matrices, ns a sample", lambda: mechanise(record, state).C_nb, 1e9 / len(record)
    yield "the same, 4 samples an update", lambda: mechanise(record, state, algorithm="4").C_nb, 1e9 / len(record)

    P = np.diag(np.repeat([2e-4, 0.2, 10.0, 5e-8, 5e-4], 3) ** 2)
    start = Start(0.0, s.C_nb, s.v_n, float(s.lat), float(s.lon), float(s.alt), np.zeros(3), np.zeros(3), P)
    seconds = np.arange(1.0, 3600.0) + 0.3337
    then = motion.states(seconds)
    place = np.stack([then.lat, then.lon, then.alt], axis=1)
    gnss = Aiding("GNSS position", "position", seconds, place, np.full((len(seconds), 3), 2.0))
    small, large = InsModel(1e-6, 1e-4), InsModel.from_spec(imu_spec("tactical"))

    def loop(model: Any, aiding: Any = (), **options: Any) -> Callable[[], object]:
        return lambda: navigate_track(record, start, model, aiding, **options)

    yield "an hour of navigation, free, ms", loop(small, covariance=False, interval=10.0), 1e3
    yield "with 15 states at 10 Hz and GNSS, ms", loop(small, [gnss], interval=0.1, every=10), 1e3
    yield "with 21 states, ms", loop(large, [gnss], interval=0.1, every=10), 1e3
    yield "21 states at 1 Hz, smoothed, ms", loop(large, [gnss], interval=1.0, every=1, smooth=True), 1e3


def transfer() -> Iterator[Part]:
    """A pass of the closed loop against a master, 16 states."""
    flights = Flights(Case("benchmark", 0), 0)
    run, method = flights(0), filtering.METHODS["states16"]
    later = {} if hasattr(method, "known") else {"known_delay": 0.0}
    yield "a pass of transfer alignment, ms", lambda: filtering._track(flights, run, method, **later), 1e3


def filters() -> Iterator[Part]:
    """15 states, 3 rows at every tenth step."""
    one, many = system(20_000), system(2_000, (50,))
    scale = 1e6 / one.epochs
    yield "a filter step, us: plain", lambda: kalman(one, joseph=False), scale
    yield "Joseph's form", lambda: kalman(one), scale
    yield "with all histories", lambda: kalman(one, history="full"), scale
    yield "feedback", lambda: feedback(one), scale
    yield "fading", lambda: fading(one, kind="single"), scale
    yield "noise from a window", lambda: innovation_adaptive(one), scale
    yield "square root", lambda: square_root(one), scale
    yield "smoother", lambda: smoother(one), scale
    yield "50 runs, of each", lambda: kalman(many), 1e6 / many.epochs / 50


def simulation() -> Iterator[Part]:
    """600 s of a swaying ship at 100 Hz."""
    ideal = ideal_log(SHIP, rate=100.0, duration=600.0)
    yield "simulation of 600 s, ms: the ideal log", lambda: ideal_log(SHIP, rate=100.0, duration=600.0), 1e3
    yield "biases and random walks", lambda: simulate(ideal, imu=WALKS), 1e3
    yield "every error term", lambda: simulate(ideal, imu=EVERYTHING), 1e3


def main() -> None:
    """Print the figures of all parts, by name, as JSON."""
    parts = (part for group in (strapdown, transfer, filters, simulation) for part in group())
    print(json.dumps({what: least(call) * unit for what, call, unit in parts}))


if __name__ == "__main__":
    main()
