"""How cost grows: time and memory over length and rate of a log, states of a filter, runs and workers, in one figure.

Processor time, of several workers time on the clock: the least of three, of what takes seconds one. Memory is the most that Python
and NumPy held at once, the log itself apart. The slope is that of a straight line through the logarithms: 1 is proportional.
Run: ``python -m benchmarks growth``; table and figure are written to docs.
"""

from __future__ import annotations

import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench_campaign import PLAN
from benchmarks.bench_days import at_rest
from benchmarks.timing import DOCUMENT, write_between
from truenorth import ImuRecord, Position, align, imu_spec, read_imu
from truenorth.campaign import run_campaign
from truenorth.figures.style import COLOURS, new_figure, style
from truenorth.filters import LinearSystem, kalman
from truenorth.simulation import rest, simulate
from truenorth.strapdown.level import NavigationState, mechanise

PLACE = Position.from_degrees(45.0)
DAYS = 48 * 3600.0
LONG = 4.0  # s, from which a call is timed once
MARKS = "<!-- growth: made by python -m benchmarks growth -->", "<!-- growth end -->"
FIGURE = DOCUMENT.parent / "assets/growth.svg"
NAMES = {"length": ["1 min", "10 min", "1 h", "4 h", "48 h"]}
OVER = ("length", "rate, Hz", "states", "runs", "workers")


class Line(NamedTuple):
    """Cost over one size, all else fixed."""

    title: str
    over: str
    sizes: list[float]
    make: Callable[[float], Callable[[], object]]  # what is measured, of a size


def on_disk(seconds: float, rate: float) -> ImuRecord:
    """A log at rest; a long one stays on the disk while it is used, its file already without a name."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.npz"
        at_rest(path, round(seconds * rate), rate)
        return read_imu(path)


def aligned(record: ImuRecord) -> Callable[[], object]:
    return lambda: align(record, PLACE, "navigation", method="kalman")


def simulated(rate: float) -> ImuRecord:
    return simulate(rest(PLACE), rate=rate, duration=600.0, imu=imu_spec("navigation"), seed=1).record


def journey(seconds: float) -> Callable[[], object]:
    record = on_disk(seconds, 200.0)
    start = NavigationState.at(np.eye(3), PLACE.lat, PLACE.lon, PLACE.alt)
    return lambda: mechanise(record, start, every=200)


def filtered(
    states: int = 15, runs: int = 1, workers: int = 1, epochs: int = 200, own: bool = True
) -> Callable[[], object]:
    """Runs with transitions of their own, or such that share all but measurements."""
    rng = np.random.default_rng(0)
    turn = rng.standard_normal((states, states))
    Phi = (np.eye(states) + 0.01 * (turn - turn.T) / np.sqrt(states))[None]
    system = LinearSystem(
        Phi=Phi * rng.uniform(0.99, 1.0, (runs, 1, 1, 1)) if own else Phi,
        Q=1e-4 * np.eye(states)[None],
        H=rng.standard_normal((1, 3, states)),
        R=np.eye(3)[None],
        z=rng.standard_normal((runs, epochs, 3)),
        x0=np.zeros(states),
        P0=np.eye(states),
    )
    return lambda: kalman(system, workers=workers)


def campaign(runs: int, workers: int = 1) -> Callable[[], object]:
    """Simulated and aligned, each time in a new folder."""

    def run() -> None:
        plan: dict[str, Any] = PLAN | {"runs": runs}
        with tempfile.TemporaryDirectory() as folder:
            run_campaign(plan, folder, workers=workers)

    return run


MANY: list[float] = [1, 10, 100, 1000, 10_000, 100_000]
LINES = [
    Line("alignment, 100 Hz", "length", [60, 600, 3600, 14400, DAYS], lambda s: aligned(on_disk(s, 100.0))),
    Line("strapdown, 200 Hz", "length", [60, 600, 3600, 14400, DAYS], journey),
    Line("alignment of 600 s", "rate, Hz", [25, 50, 100, 200, 400], lambda r: aligned(simulated(r))),
    Line("filter, 2000 epochs", "states", [6, 9, 15, 24, 40], lambda n: filtered(states=int(n), epochs=2000)),
    Line("filter of 15 states, 200 epochs, own systems", "runs", MANY, lambda n: filtered(runs=int(n))),
    Line("the same, one system", "runs", MANY, lambda n: filtered(runs=int(n), own=False)),
    Line("campaign of alignments of 600 s", "runs", [4, 20, 100, 500], lambda n: campaign(int(n))),
    Line("filter of 2000 runs, threads", "workers", [1, 2], lambda n: filtered(runs=2000, workers=int(n))),
    Line("campaign of 500 runs, processes", "workers", [1, 2], lambda n: campaign(500, int(n))),
]


def spent(call: Callable[[], object]) -> tuple[float, float]:
    """Time of processors and on the clock, s."""
    begun, at = time.process_time(), time.perf_counter()
    call()
    return time.process_time() - begun, time.perf_counter() - at


def cost(call: Callable[[], object], traced: bool) -> tuple[float, float, float]:
    """Time of processors and on the clock, s; memory, MiB, where it is `traced`."""
    times = [spent(call)]
    if times[0][1] < LONG:
        times += [spent(call), spent(call)]
    most = float("nan")
    if traced:
        tracemalloc.start()
        call()
        most = tracemalloc.get_traced_memory()[1] / 2**20
        tracemalloc.stop()
    cpu, wall = np.min(times, axis=0)
    return float(cpu), float(wall), most


def slope(sizes: list[float], costs: NDArray[np.float64]) -> float:
    """Of a straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def in_words(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


def main() -> None:
    table = [
        "| what | over | time, of the least and the largest | slope | memory, MiB | slope |",
        "| --- | --- | --- | ---: | --- | ---: |",
    ]
    drawn = []
    for line in LINES:
        line.make(line.sizes[0])()  # compiles
        alone = line.over != "workers"
        costs = np.array([cost(line.make(size), alone) for size in line.sizes])
        times, memory = costs[:, 0 if alone else 1], costs[:, 2]
        drawn.append((line, times, memory if alone else None))
        ends = f"{in_words(times[0])} to {in_words(times[-1])}" + ("" if alone else " on the clock")
        of_memory = f"{memory[0]:.2g} to {memory[-1]:.3g} | {slope(line.sizes, memory):.2f}" if alone else "|"
        first, *_, last = NAMES.get(line.over, [f"{size:,g}" for size in line.sizes])
        over = f"{line.over}, {first} to {last}"
        table.append(f"| {line.title} | {over} | {ends} | {slope(line.sizes, times):.2f} | {of_memory} |")
        print(f"  {table[-1]}", flush=True)
        for size, (cpu, wall, most) in zip(line.sizes, costs):
            print(f"    {size:8g}{1e3 * cpu:12.3g} ms{1e3 * wall:12.3g} ms on the clock{most:10.3g} MiB", flush=True)
    write_between(MARKS, table)
    draw(drawn)


def draw(drawn: list[tuple[Line, NDArray[np.float64], NDArray[np.float64] | None]]) -> None:
    """Time above, memory below, a column for each size; in the last place what the lines are."""
    with style():
        figure = new_figure(11.0, 5.6)
        panels = figure.subplots(2, len(OVER), sharex="col", sharey="row")
        handles = []
        for i, (line, times, memory) in enumerate(drawn):
            column = OVER.index(line.over)
            look: dict[str, Any] = {
                "color": COLOURS[i % len(COLOURS)],
                "marker": "o^"[i // len(COLOURS)],
                "markersize": 4,
            }
            look["linestyle"] = ("-", "--")[i % 2]
            handles += panels[0, column].loglog(line.sizes, times, label=line.title, **look)
            for row, values in enumerate((times, memory)):
                if values is not None:
                    panel = panels[row, column]
                    panel.loglog(line.sizes, values, **look)
                    text = f" {slope(line.sizes, values):.2f}"
                    if line.over != "runs":
                        named = NAMES.get(line.over, [f"{size:g}" for size in line.sizes])
                        panel.set_xticks(line.sizes, named, fontsize=8)
                        panel.minorticks_off()
                    panel.annotate(text, (line.sizes[-1], values[-1]), color=look["color"], fontsize=8, va="center")
        for column, over in enumerate(OVER):
            panels[1, column].set_xlabel(over)
            panels[0, column].margins(x=0.25)
        panels[0, 0].set_ylabel("time, s")
        panels[1, 0].set_ylabel("memory, MiB")
        panels[1, -1].set_axis_off()
        panels[0, -1].set_xlabel(OVER[-1])
        panels[0, -1].xaxis.set_tick_params(labelbottom=True)
        figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8)
        figure.savefig(FIGURE)


if __name__ == "__main__":
    main()
