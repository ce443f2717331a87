"""One frame for all cases of honesty: run, compare errors with their sigmas, count refusals, mark.

A case is a name, the procedure it belongs to, and a function of seed and run that draws its world and gives an outcome: errors
over sigma by output, and why it was refused, if it was. Sigma is honest where the RMS over the runs lies in .8 to 1.25; a run
beyond four sigmas with a good status is a defect.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from truenorth.core.errors import TruenorthError

Array = NDArray[np.float64]
HONEST = (0.8, 1.25)
DEFECT = 4.0
FALSE_ALARMS, RARE = 0.01, 0.02  # of sound logs at most; as seldom as that no chance


@dataclass(frozen=True)
class Outcome:
    """Of one run."""

    ratios: Mapping[str, Array] = field(default_factory=dict)  # errors over their sigmas
    refused: str = ""  # why the answer has no good status; empty: it has one
    said: str = ""  # what the run has to say beyond that, for `--verbose`


@dataclass(frozen=True)
class Case:
    """A row of the table."""

    procedure: str
    name: str
    run: Callable[[int, int], Outcome]  # of seed and number
    left_out: bool = False  # the model leaves the error out on purpose, to show what that costs
    flagged: bool = False  # no model holds this world: a flag is right, an answer that claims too much is not


@dataclass(frozen=True)
class Line:
    """Of a case: RMS of error over sigma by output, refusals, the worst run with a good status, in sigmas."""

    case: Case
    runs: int
    rms: Mapping[str, float]
    refused: Sequence[str]
    worst: float
    worst_run: int
    seconds: float
    # in how many runs each output has been shown; all when left out
    shown: Mapping[str, int] = field(default_factory=dict)

    @property
    def mark(self) -> str:
        """What is wrong with it.

        ``ok``; ``left out`` on purpose; ``defect``: beyond four sigmas with a good status; ``flagged``: as is right; ``refused``:
        more than a tenth, and more than false alarms of one in a hundred give by chance; ``small`` and ``large``: sigma.
        """
        if self.case.left_out:
            return "left out"
        # A ratio of few runs scatters: 1/sqrt(2 N) of itself, three times of which is chance.
        rooms = {name: 3.0 / math.sqrt(2.0 * max(self.shown.get(name, self.runs), 1)) for name in self.rms}
        if self.worst > DEFECT:
            return "defect"
        by_chance = float(binom.sf(len(self.refused) - 1, self.runs, FALSE_ALARMS)) > RARE
        if not self.case.flagged and len(self.refused) > 0.1 * self.runs and not by_chance:
            return "refused"
        if any(value > max(HONEST[1], 1.0 + rooms[name]) for name, value in self.rms.items()):
            return "small"
        if self.case.flagged and self.refused:
            return "flagged"
        if any(value < min(HONEST[0], 1.0 - rooms[name]) for name, value in self.rms.items()):
            return "large"
        return "ok"

    def cells(self) -> list[str]:
        """Of the table."""
        rms = ", ".join(f"{name} {value:.2f}" for name, value in self.rms.items())
        if not rms:
            rms = "none: each run was flagged" if self.case.flagged else "none"
        worst = f"{self.worst:.1f}" if self.worst else ""
        return [self.case.procedure, self.case.name, str(self.runs), rms, str(len(self.refused)), worst, self.mark]


HEADER = ["procedure", "case", "runs", "RMS of error over sigma", "refused", "worst, sigmas", "mark"]


def run_case(case: Case, seed: int, runs: int, verbose: bool = False) -> Line:
    """Run a case."""
    found: dict[str, list[Array]] = {}
    refused: list[str] = []
    worst = (0.0, 0)
    begun = time.perf_counter()
    for run in range(runs):
        try:
            outcome = case.run(seed, run)
        except TruenorthError as error:
            outcome = Outcome(refused=str(error))
        # A case that is to be flagged is asked for what it claims without a flag.
        for name, ratio in () if case.flagged and outcome.refused else outcome.ratios.items():
            found.setdefault(name, []).append(np.ravel(ratio))
        if outcome.refused:
            refused.append(f"run {run}: {outcome.refused}")
        else:
            most = max(
                (float(np.nanmax(np.abs(r))) for r in outcome.ratios.values() if np.isfinite(r).any()), default=0.0
            )
            worst = max(worst, (most, run))
        if verbose:
            shown = ", ".join(f"{name} {np.round(r, 2)}" for name, r in outcome.ratios.items())
            print(f"    run {run}: {shown} {outcome.refused} {outcome.said}", flush=True)
    seen = {name: np.concatenate(r) for name, r in found.items()}  # NaN: what a log does not show is not said
    rms = {name: float(np.sqrt(np.nanmean(r**2))) for name, r in seen.items() if np.isfinite(r).any()}
    shown = {name: sum(bool(np.isfinite(r).any()) for r in found[name]) for name in rms}
    return Line(case, runs, rms, tuple(refused), *worst, (time.perf_counter() - begun) / max(runs, 1), shown)


def as_markdown(lines: Sequence[Line]) -> str:
    """The table for the documents."""
    rows = [HEADER, ["---"] * len(HEADER), *(line.cells() for line in lines)]
    return "\n".join(_row(row) for row in rows)


def onto_page(page: Path, line: Line) -> None:
    """Put a row into the page's table: in its old place, or at the end of its procedure's."""
    text = page.read_text("utf-8").splitlines()
    rule = text.index(_row(["---"] * len(HEADER)))
    first = last = rule + 1
    while last < len(text) and text[last].startswith("|"):
        last += 1
    own = [_row([*line.cells()[:n], ""]).rstrip("| ") + " |" for n in (1, 2)]
    of_procedure, same = ([k for k in range(first, last) if text[k].startswith(start)] for start in own)
    if same:
        text[same[0]] = _row(line.cells())
    else:
        text.insert(of_procedure[-1] + 1 if of_procedure else last, _row(line.cells()))
    page.write_text("\n".join(text) + "\n", "utf-8")


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def main(cases: Sequence[Case], about: str = "RMS of error over sigma, refusals, and the worst run") -> None:
    """Command line: ``--runs``, ``--seed``, ``--only`` part of `procedure: name`, ``--markdown``, ``--page``, ``--verbose``."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--only", default="", help="cases with this in `procedure: name`, such as 'damping double: IMU'"
    )
    parser.add_argument("--markdown", action="store_true", help="the table as the documents have it")
    parser.add_argument("--page", type=Path, help="a page whose table gets each row as it is done: docs/honesty.md")
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    lines = []
    asked = [case for case in cases if given.only in f"{case.procedure}: {case.name}"]
    if not asked:
        parser.error(f"--only {given.only!r}: no case has this in its `procedure: name`")
    for case in asked:
        line = run_case(case, given.seed, given.runs, given.verbose)
        lines.append(line)
        if given.page is not None:
            onto_page(given.page, line)
        print("  ".join([*line.cells(), f"{line.seconds:.1f} s each"]), flush=True)
        for why in line.refused if given.verbose else line.refused[:2]:
            print(f"    refused: {why}", flush=True)
    if given.markdown:
        print(as_markdown(lines))
