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
from truenorth import ImuRecord, Position, align, imu_spec, navigate, read_imu
from truenorth.campaign import run_campaign
from truenorth.figures.style import COLOURS, new_figure, style
from truenorth.filters import LinearSystem, kalman
from truenorth.navigation import Start
from truenorth.simulation import rest, simulate

Array = NDArray[np.float64]
PLACE = Position.from_degrees(45.0)
DAYS = 48 * 3600.0
LONG = 4.0  # s, from which a call is timed once
MARKS = "<!-- growth: made by python -m benchmarks growth -->", "<!-- growth end -->"
FIGURE = DOCUMENT.parent / "assets/growth.svg"
NAMES = {"length": ["1 min", "", "1 h", "", "48 h"]}
PLAIN = {"facecolor": "white", "edgecolor": "none", "pad": 0.3}
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
    sigma = np.array([*3 * [1e-4], *3 * [0.01], *3 * [1.0], *3 * [1e-8], *3 * [1e-4]])
    here = (PLACE.lat, PLACE.lon, PLACE.alt)
    start = Start(0.0, np.eye(3), np.zeros(3), *here, np.zeros(3), np.zeros(3), np.diag(sigma**2))
    return lambda: navigate(record, start, imu="navigation")


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
    Line("free navigation, 200 Hz", "length", [60, 600, 3600, 14400, DAYS], journey),
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


def slope(sizes: list[float], costs: Array) -> float:
    """Of a straight line through the logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def in_words(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1.0 else f"{1e3 * seconds:.3g} ms"


def row(line: Line, times: Array, memory: Array | None) -> str:
    """Of the table."""
    clock = " on the clock" if memory is None else ""
    ends = f"{in_words(times[0])} to {in_words(times[-1])}{clock} | {slope(line.sizes, times):.2f}"
    first, *_, last = NAMES.get(line.over, [f"{size:,g}" for size in line.sizes])
    of_memory = "| "
    if memory is not None:
        few, many = (f"{float(f'{m:.3g}'):,g}" for m in (memory[0], memory[-1]))
        of_memory = f"{few} to {many} | {slope(line.sizes, memory):.2f}"
    return f"| {line.title} | {line.over}, {first} to {last} | {ends} | {of_memory} |"


def main() -> None:
    found = []
    for line in LINES:
        line.make(line.sizes[0])()  # compiles
        alone = line.over != "workers"
        costs = np.array([cost(line.make(size), alone) for size in line.sizes])
        found.append((line, costs[:, 0 if alone else 1], costs[:, 2] if alone else None))
        print(f"  {row(*found[-1])}", flush=True)
        for size, (cpu, wall, most) in zip(line.sizes, costs):
            print(f"    {size:8g}{1e3 * cpu:12.3g} ms{1e3 * wall:12.3g} ms on the clock{most:10.3g} MiB", flush=True)
    write(found)


def write(found: list[tuple[Line, Array, Array | None]]) -> None:
    """The table and the figure."""
    head = "| what | over | time, of the least and the largest | slope | memory, MiB | slope |"
    write_between(MARKS, [head, "| --- | --- | --- | ---: | --- | ---: |", *(row(*line) for line in found)])
    draw(found)


def draw(drawn: list[tuple[Line, Array, Array | None]]) -> None:
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
                    if line.over != "runs":
                        named = [f"{size:g}" for size in line.sizes]
                        panel.set_xticks(line.sizes, NAMES.get(line.over, named), fontsize=8)
                    panel.minorticks_off()
                    side = "bottom" if i % 2 else "top"
                    at = {"xy": (line.sizes[-1], values[-1]), "xytext": (4, 0), "textcoords": "offset points"}
                    panel.annotate(
                        f"{slope(line.sizes, values):.2f}", **at, color=look["color"], fontsize=8, va=side, bbox=PLAIN
                    )
        for column, over in enumerate(OVER):
            panels[1, column].set_xlabel(over)
            panels[0, column].margins(x=0.25)
        panels[0, 0].set_ylabel("time, s")
        panels[1, 0].set_ylabel("memory, MiB")
        panels[1, -1].set_axis_off()
        panels[0, -1].set_xlabel(OVER[-1])
        panels[0, -1].xaxis.set_tick_params(labelbottom=True)
        figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8)
        figure.savefig(FIGURE, metadata={"Date": None})


if __name__ == "__main__":
    main()
