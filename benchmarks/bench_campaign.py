"""Speed of campaigns: 1,000 static alignments of 600 s at 100 Hz, simulated and aligned, by one worker and by two.

Run: ``python -m benchmarks campaign``.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from typing import Any, NamedTuple

from truenorth.campaign import run_campaign

RUNS = 1000
GOAL_S, MOST_GIB = 60.0, 2.0  # on two cores; the largest process
STILL = {
    "name": "still",
    "duration": "600 s",
    "rate": "100 Hz",
    "position": {"lat": "45 deg"},
    "motion": {"kind": "rest"},
    "imu": "navigation",
}
PLAN: dict[str, Any] = {"name": "still", "runs": RUNS, "block": 20, "scenarios": [STILL], "methods": ["kalman"]}


class Cost(NamedTuple):
    """Of a campaign: time on the clock, s; of processors, s; memory of the largest process, GiB."""

    wall: float
    cpu: float
    memory: float


def cost(runs: int, workers: int) -> Cost:
    """Work on so many runs in a new folder. (The memory is that of the largest so far.)"""
    before, start = _cpu(), time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        run_campaign(PLAN | {"runs": runs}, folder, workers=workers)
    kinds = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    unit = 1 if sys.platform == "darwin" else 1024
    memory = max(resource.getrusage(kind).ru_maxrss for kind in kinds) * unit / 2**30
    return Cost(time.perf_counter() - start, _cpu() - before, memory)


def _cpu() -> float:
    used = [resource.getrusage(kind) for kind in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(x.ru_utime + x.ru_stime for x in used)


def main() -> None:
    cost(2, 1)  # compiles what is not compiled
    idle = cost(2, 2)
    two, one = cost(RUNS, 2), cost(RUNS, 1)
    print(f"  {RUNS} runs, simulated and aligned; s on the clock, s of processors, runs a second on the clock")
    for name, c in (("one worker (this process)", one), ("two workers", two)):
        print(f"  {name:40s}{c.wall:8.1f}{c.cpu:8.1f}{RUNS / c.wall:8.1f}")
    print(f"  {'goal of two workers':40s}{GOAL_S:8.1f}")
    print(f"  {'two workers for two runs':40s}{idle.wall:8.1f}{idle.cpu:8.1f}  (their start: Python, imports, kernels)")
    print(
        f"  {'one worker by two':40s}{one.wall / two.wall:8.2f} times; less their start {one.wall / (two.wall - idle.wall):.2f}"
    )
    print(
        f"  {'processors that two workers had':40s}{two.cpu / two.wall:8.2f}  (below 2: other work on the machine, or waiting)"
    )
    print(
        f"  {'work of a run with two by with one':40s}{two.cpu / one.cpu:8.2f}  (above 1: cores that share memory and cache)"
    )
    print(f"  {'largest process, GiB':40s}{max(one.memory, two.memory):8.2f}  (limit {MOST_GIB:g})")


if __name__ == "__main__":
    main()
