"""Where the time of a campaign's run goes: by its parts, in compiled code and in Python.

Run: ``python -m benchmarks run``. A run is a static alignment of 600 s at 100 Hz, as in ``bench_campaign``. Of each part the lowest
tenth of the runs counts: what other programs do on the machine makes times longer, never shorter. Parts within parts are taken
off, and so is what the clocks themselves take.
"""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np

import truenorth.alignment.fine
import truenorth.alignment.procedure
import truenorth.alignment.task
import truenorth.campaign.aligning
import truenorth.simulation.runs
from benchmarks.bench_campaign import PLAN
from benchmarks.timing import write_between
from truenorth.campaign.aligning import align_runs
from truenorth.campaign.plan import read_plan
from truenorth.core.compiled import Kernel

RUNS = 200
QUIET = 0.1  # of the runs
MARKS = ("<!-- run: made by python -m benchmarks run -->", "<!-- run end -->")
_ALIGN = truenorth.alignment.procedure
PARTS: tuple[tuple[str, Any, str], ...] = (
    ("simulation", truenorth.simulation.runs, "apply_errors"),
    ("kind of motion", truenorth.alignment.task, "motion_summary"),
    ("mean rate and force", truenorth.alignment.task, "means_at_rest"),
    ("integration in the inertial frame", _ALIGN, "integrate"),
    ("coarse attitude", _ALIGN, "oba"),
    ("filter that checks the log", _ALIGN, "check_filter"),
    ("filter that aligns", truenorth.alignment.fine, "settle_fine"),
    ("its gains and floors", _ALIGN, "fine_align"),
    ("signatures of what begins on the way", _ALIGN, "what_begins"),
    ("history and answer at the epoch", _ALIGN, "answer_of"),
    ("verdict and the rest of an alignment", truenorth.campaign.aligning, "align"),
)
REST = "record, errors against the truth, rows"


class Clock:
    """Time of each part, kernels and the rest, s; of the innermost part that is under way."""

    def __init__(self) -> None:
        self.spent: dict[tuple[str, str], float] = defaultdict(float)
        self.under_way = [(REST, "Python")]
        self.since = 0.0

    def enter(self, what: tuple[str, str]) -> None:
        """What goes on now counts for this."""
        now = time.perf_counter()
        self.spent[self.under_way[-1]] += now - self.since
        self.under_way.append(what)
        self.since = time.perf_counter()

    def leave(self) -> None:
        """What goes on now counts for what was under way before."""
        now = time.perf_counter()
        self.spent[self.under_way.pop()] += now - self.since
        self.since = time.perf_counter()

    def watched(self, call: Callable[..., Any], part: str | None) -> Callable[..., Any]:
        """A function of a part; a kernel, of the part under way, without one."""

        def watch(*arguments: Any, **named: Any) -> Any:
            self.enter((self.under_way[-1][0], "kernels") if part is None else (part, "Python"))
            try:
                return call(*arguments, **named)
            finally:
                self.leave()

        return watch


def measured(runs: int) -> dict[tuple[str, str], float]:
    """Of each part and kind of code, the low quantile over the runs, ms."""
    plan, clock = read_plan(PLAN), Clock()
    align_runs(plan, plan.cases[0], range(3))  # compiles, and remembers what all runs share
    places: list[tuple[str | None, Any, str]] = [*PARTS, (None, Kernel, "__call__")]
    before = [getattr(place, name) for _, place, name in places]
    found = []
    try:
        for (part, place, name), call in zip(places, before, strict=True):
            setattr(place, name, clock.watched(call, part))
        for run in range(3, 3 + runs):
            clock.spent.clear()
            clock.since = time.perf_counter()
            align_runs(plan, plan.cases[0], [run])
            clock.enter((REST, "Python"))
            clock.leave()
            found.append(dict(clock.spent))
    finally:
        for (_, place, name), call in zip(places, before, strict=True):
            setattr(place, name, call)
    keys = {key for run in found for key in run}
    return {key: 1e3 * float(np.quantile([run.get(key, 0.0) for run in found], QUIET)) for key in keys}


def main() -> None:
    spent = measured(RUNS)
    names = [*[name for name, _, _ in PARTS], REST]
    rows = [(name, spent.get((name, "kernels"), 0.0), spent.get((name, "Python"), 0.0)) for name in names]
    rows.append(("together", sum(row[1] for row in rows), sum(row[2] for row in rows)))
    for name, kernels, python in rows:
        print(f"  {name:40s}{kernels:8.2f}{python:8.2f}{kernels + python:8.2f}")
    lines = ["| part of a run | kernels, ms | Python, ms | both |", "| --- | ---: | ---: | ---: |"]
    lines += [f"| {name} | {kernels:.2f} | {python:.2f} | {kernels + python:.2f} |" for name, kernels, python in rows]
    write_between(MARKS, lines)


if __name__ == "__main__":
    main()
