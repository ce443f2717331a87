"""A campaign of faults: each fault tried on each procedure with drawn sizes, and whether a wrong answer passes in silence."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, NamedTuple
from zlib import crc32

import numpy as np

from truenorth.campaign.fault_benches import BENCHES, Bench, misses
from truenorth.campaign.fault_kinds import FAULTS, Fault, faults_of
from truenorth.core.errors import TruenorthError, UsageError

Outcome = Literal["refused", "flagged", "harmless", "silent", "crash"]
SOUND = "none"
HARMLESS = 3.0  # sigmas
BY_CHANCE = 4.0  # sigmas: a sound answer is that far off once in 16,000
GOOD = ("aligned", "level_only", "navigated")


class Trial(NamedTuple):
    """One run of one fault on one procedure."""

    procedure: str
    fault: str
    run: int
    size: str  # what was drawn
    # ``refused``: an error with a message; ``flagged``: no good status, or a warning; ``harmless``: within three sigmas;
    # ``silent``: a good status, and wrong; ``crash``: anything else
    outcome: Outcome
    worst: float  # the largest error in its sigma, of any output
    reason: str


def run_faults(
    procedures: Sequence[str] = (),
    faults: Sequence[str] = (),
    *,
    runs: int = 3,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> list[Trial]:
    """Try faults on procedures, and each procedure without any.

    Parameters
    ----------
    procedures, faults : sequences of str
        All when left out; the fault ``none`` is a sound log.
    runs : int
        Of each pair, every one with its own motion, errors and size of the fault.
    seed : int
    progress : callable, optional
        Called with a word about each pair.

    Raises
    ------
    UsageError
        A name that is not known.
    """
    known = (SOUND, *(fault.name for fault in FAULTS))
    for what, names, all_of in (("procedure", procedures, tuple(BENCHES)), ("fault", faults, known)):
        for name in names:
            if name not in all_of:
                raise UsageError(f"{what} {name!r} is not known; choose of {', '.join(all_of)}")
    return list(_trials(procedures or tuple(BENCHES), faults or known, runs, seed, progress or (lambda word: None)))


def _trials(
    procedures: Sequence[str], faults: Sequence[str], runs: int, seed: int, tell: Callable[[str], None]
) -> Iterator[Trial]:
    for name in procedures:
        bench = BENCHES[name]
        for run in range(runs):
            inputs, truth = bench.draw(seed, run)
            if SOUND in faults:
                tell(f"{name} {run + 1}: sound")
                yield _tried(bench, SOUND, run, "", inputs, truth)
            for fault in faults_of(inputs):
                if fault.name in faults:
                    tell(f"{name} {run + 1}: {fault.name}")
                    yield _spoilt(bench, fault, run, seed, inputs, truth)


def _spoilt(bench: Bench, fault: Fault, run: int, seed: int, inputs: dict[str, Any], truth: Any) -> Trial:
    rng = np.random.default_rng([seed, run, crc32(fault.name.encode())])
    try:
        spoilt, size = fault.apply(inputs, rng)
    except TruenorthError as error:  # no record can hold it
        return Trial(bench.name, fault.name, run, "", "refused", math.nan, str(error))
    return _tried(bench, fault.name, run, size, spoilt, truth)


def _tried(bench: Bench, fault: str, run: int, size: str, inputs: dict[str, Any], truth: Any) -> Trial:
    try:
        answer = bench.align(inputs)
    except TruenorthError as error:
        return Trial(bench.name, fault, run, size, "refused", math.nan, str(error))
    except Exception as error:
        return Trial(bench.name, fault, run, size, "crash", math.nan, f"{type(error).__name__}: {error}")
    off = misses(answer, truth)
    worst = max(off.values())
    reason = answer.reasons[0] if answer.reasons else ""
    warned = [item for item in answer.evidence if item.urgent]
    if answer.status not in GOOD or (warned and fault != SOUND):
        return Trial(
            bench.name, fault, run, size, "flagged", worst, reason if answer.status not in GOOD else warned[0].key
        )
    outcome: Outcome = "harmless" if worst <= (BY_CHANCE if fault == SOUND else HARMLESS) else "silent"
    return Trial(bench.name, fault, run, size, outcome, worst, f"{reason} {off}")


OUTCOMES: tuple[Outcome, ...] = ("refused", "flagged", "harmless", "silent", "crash")


def table(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """One row a procedure and fault: how many ended how, and the largest error that passed in silence, in sigmas."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for trial in trials:
        row = rows.setdefault(
            (trial.procedure, trial.fault),
            {"procedure": trial.procedure, "fault": trial.fault} | dict.fromkeys(OUTCOMES, 0) | {"worst": 0.0},
        )
        row[trial.outcome] += 1
        if trial.outcome == "silent":
            row["worst"] = max(row["worst"], trial.worst)
    return list(rows.values())
