"""How cost grows: time and memory over length and rate of a log, states of a filter, runs and threads, in one figure.

Processor time, the least of three; memory is the most that Python and NumPy held at once, the log itself apart. The slope
is that of a straight line through the logarithms: 1 is proportional. Run: ``python -m benchmarks growth``; the figure is
written to growth.png.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth import Position, align, imu_spec
from truenorth.figures.style import COLOURS, new_figure, style
from truenorth.filters import LinearSystem, kalman
from truenorth.simulation import rest, simulate
from truenorth.strapdown.level import NavigationState, mechanise

PLACE = Position.from_degrees(45.0)
EPOCHS = 2000


class Line(NamedTuple):
    """Cost over one size, all else fixed."""

    title: str
    sizes: list[float]
    make: Callable[[float], Callable[[], object]]  # what is measured, of a size


def log(seconds: float, rate: float) -> Callable[[], object]:
    record = simulate(rest(PLACE), rate=rate, duration=seconds, imu=imu_spec("navigation"), seed=1).record
    return lambda: align(record, PLACE, "navigation", method="kalman")


def journey(seconds: float) -> Callable[[], object]:
    record = simulate(rest(PLACE), rate=200.0, duration=seconds, imu=imu_spec("navigation"), seed=1).record
    start = NavigationState.at(np.eye(3), PLACE.lat, PLACE.lon, PLACE.alt)
    return lambda: mechanise(record, start, every=200)


def filtered(states: int = 15, runs: int = 1, workers: int = 1) -> Callable[[], object]:
    rng = np.random.default_rng(0)
    turn = rng.standard_normal((states, states))
    system = LinearSystem(
        Phi=(np.eye(states) + 0.01 * (turn - turn.T) / np.sqrt(states))[None],
        Q=1e-4 * np.eye(states)[None],
        H=rng.standard_normal((1, 3, states)),
        R=np.eye(3)[None],
        z=rng.standard_normal((runs, EPOCHS, 3)),
        x0=np.zeros(states),
        P0=np.eye(states),
    )
    return lambda: kalman(system, workers=workers)


LINES = [
    Line("alignment over length, s at 100 Hz", [60, 300, 1200, 3600], lambda s: log(s, 100.0)),
    Line("alignment of 600 s over rate, Hz", [25, 50, 100, 200, 400], lambda r: log(600.0, r)),
    Line("strapdown over length, s at 200 Hz", [60, 600, 3600], journey),
    Line("filter of 2000 epochs over states", [6, 9, 15, 24, 40], lambda n: filtered(states=int(n))),
    Line("filter of 15 states over runs", [1, 10, 100], lambda n: filtered(runs=int(n))),
    Line("filter of 15 states and 100 runs over threads", [1, 2], lambda n: filtered(runs=100, workers=int(n))),
]


def cost(call: Callable[[], object]) -> tuple[float, float, float]:
    """Time of processors and on the clock, s; memory, MiB."""
    call()
    cpu, wall = [], []
    for _ in range(3):
        begun, at = time.process_time(), time.perf_counter()
        call()
        cpu.append(time.process_time() - begun)
        wall.append(time.perf_counter() - at)
    tracemalloc.start()
    call()
    most = tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()
    return min(cpu), min(wall), most


def slope(sizes: list[float], costs: NDArray[np.float64]) -> float:
    """Of a straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def main() -> None:
    with style():
        figure = new_figure(9.0, 4.5)
        panels = figure.subplots(1, 2)
        for line, colour in zip(LINES, COLOURS):
            costs = np.array([cost(line.make(size)) for size in line.sizes])
            slopes = [slope(line.sizes, costs[:, i]) for i in range(3)]
            print(
                f"  {line.title}: slope {slopes[0]:.2f} of time, {slopes[1]:.2f} on the clock, {slopes[2]:.2f} of memory"
            )
            for size, (cpu, wall, most) in zip(line.sizes, costs):
                print(f"    {size:8g}{1e3 * cpu:12.3g} ms{1e3 * wall:12.3g} ms on the clock{most:10.3g} MiB")
            for panel, values, s in ((panels[0], costs[:, 0], slopes[0]), (panels[1], costs[:, 2], slopes[2])):
                panel.loglog(line.sizes, values, "o-", color=colour, label=f"{line.title}: slope {s:.2f}")
        for panel, title in zip(panels, ("processor time, s", "memory, MiB")):
            panel.set_xlabel("size")
            panel.set_ylabel(title)
            panel.legend(fontsize=6)
        figure.savefig("growth.png", dpi=150)


if __name__ == "__main__":
    main()
