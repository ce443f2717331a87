"""A campaign of faults: each fault tried on each procedure with drawn sizes, and whether a wrong answer passes in silence."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import closing
from functools import cached_property
from itertools import product
from typing import Any, Literal, NamedTuple
from zlib import crc32

import numpy as np

from truenorth.alignment.result import Alignment
from truenorth.campaign.execution import one_thread_each, pool_of, uninterrupted
from truenorth.campaign.fault import Fault
from truenorth.campaign.fault_aids import AID_FAULTS
from truenorth.campaign.fault_benches import BENCHES, Bench, misses
from truenorth.campaign.fault_imu import IMU_FAULTS
from truenorth.campaign.fault_limits import REST, misfit_at_rest, ratio_on_sway, unseen
from truenorth.campaign.fault_signals import SIGNAL_FAULTS
from truenorth.core.errors import TruenorthError, UsageError
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.navigation.result import Navigation

Outcome = Literal["refused", "flagged", "harmless", "unseen", "silent", "crash"]
Pair = tuple[str, int]  # a procedure and the number of its sound log
FAULTS: tuple[Fault, ...] = (*IMU_FAULTS, *SIGNAL_FAULTS, *AID_FAULTS)
SOUND = "none"
HARMLESS = 3.0  # sigmas
# sigma, by which a fault moves an answer at least where it is to blame: the rest is the log's own chance
OF_THE_FAULT = 1.0
BY_CHANCE = 4.0  # sigmas: a sound answer is that far off once in 16,000
GOOD = ("aligned", "level_only", "navigated")


class Trial(NamedTuple):
    """One run of one fault on one procedure."""

    procedure: str
    fault: str
    seed: int
    run: int
    size: str  # what was drawn
    # ``refused``: an error with a message; ``flagged``: no good status, or a warning; ``harmless``: within three sigmas, or the
    # fault has no share in it; ``unseen``: a good status, and wrong, for a reason of :mod:`truenorth.campaign.fault_limits`;
    # ``silent``: the same without one; ``crash``: anything else
    outcome: Outcome
    worst: float  # the largest error in its sigma, of any output
    reason: str


def run_faults(
    procedures: Sequence[str] = (),
    faults: Sequence[str] = (),
    *,
    runs: int = 3,
    seed: int = 0,
    done: Sequence[Trial] = (),
    workers: int = 1,
    keep: Callable[[Trial], None] | None = None,
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
    done : sequence of Trial
        Of an earlier call: they are taken as they are.
    workers : int
        Processes of this machine that share the sound logs, each with all of its faults; the trials are the same. (They are
        spawned: a script that asks for more than one needs ``if __name__ == "__main__":``.)
    keep : callable, optional
        Called with each new trial.
    progress : callable, optional
        Called with a word about each pair; of several workers, about each sound log.

    Raises
    ------
    UsageError
        A name that is not known; fewer workers than one.
    """
    if workers < 1:
        raise UsageError(f"workers {workers}; expected 1 or more")
    known = (SOUND, *(fault.name for fault in FAULTS))
    for what, names, all_of in (("procedure", procedures, tuple(BENCHES)), ("fault", faults, known)):
        for name in names:
            if name not in all_of:
                raise UsageError(f"{what} {name!r} is not known; choose of {', '.join(all_of)}")
    found = {(t.procedure, t.fault, t.seed, t.run): t for t in done}
    tell, save = progress or (lambda word: None), keep or (lambda trial: None)
    asked = tuple(faults) or known
    draws = list(product(procedures or tuple(BENCHES), range(runs)))
    left = {(name, run): [fault for fault in asked if (name, fault, seed, run) not in found] for name, run in draws}
    left = {draw: missing for draw, missing in left.items() if missing}
    trials = _in_turn(left, seed, tell) if workers == 1 else _by_workers(left, seed, min(workers, len(left)), tell)
    with closing(trials):
        for trial in trials:
            save(trial)
            found[trial.procedure, trial.fault, trial.seed, trial.run] = trial
    keys = ((name, fault, seed, run) for name, run in draws for fault in asked)
    return [found[key] for key in keys if key in found]


Trials = Generator[Trial, None, None]


def _in_turn(left: Mapping[Pair, Sequence[str]], seed: int, tell: Callable[[str], None]) -> Trials:
    for (name, run), faults in left.items():
        draw = _Draw(BENCHES[name], seed, run)
        for fault in faults:
            tell(f"{name} {run + 1}: {'sound' if fault == SOUND else fault}")
            trial = draw.trial(fault)
            if trial is not None:
                yield trial


def _by_workers(left: Mapping[Pair, Sequence[str]], seed: int, workers: int, tell: Callable[[str], None]) -> Trials:
    with one_thread_each(), pool_of(max(workers, 1), __name__) as pool:
        with uninterrupted():  # the first task starts the workers
            under_way = {pool.submit(_of_one, name, run, faults, seed): name for (name, run), faults in left.items()}
        for future in as_completed(under_way):
            trials = future.result()
            tell(f"{under_way[future]}: {len(trials)} trials of a log")
            yield from trials


def _of_one(name: str, run: int, faults: Sequence[str], seed: int) -> list[Trial]:
    """All faults of one sound log; what runs in a worker."""
    return list(_in_turn({(name, run): faults}, seed, lambda word: None))


def faults_of(inputs: Mapping[str, Any]) -> list[Fault]:
    """Those that can happen to these inputs."""
    return [fault for fault in FAULTS if fault.needs in inputs]


class _Draw:
    """One sound log of a procedure, and what faults make of it."""

    def __init__(self, bench: Bench, seed: int, run: int) -> None:
        self.bench, self.seed, self.run = bench, seed, run
        self.inputs, self.truth = bench.draw(seed, run)

    @cached_property
    def sound(self) -> Alignment | Navigation | None:
        """The answer without a fault; None where it is refused."""
        try:
            return self.bench.align(self.inputs)
        except TruenorthError:
            return None

    def trial(self, name: str) -> Trial | None:
        """One fault; None where it cannot happen."""
        if name == SOUND:
            return self._tried(SOUND, "", self.inputs)
        fault = next((fault for fault in faults_of(self.inputs) if fault.name == name), None)
        if fault is None:
            return None
        rng = np.random.default_rng([self.seed, self.run, crc32(f"{self.bench.name} {name}".encode())])
        try:
            spoilt, size = fault.apply(self.inputs, rng)
        except TruenorthError as error:  # no record can hold it
            return self._ended(name, "", "refused", str(error))
        return self._tried(name, size, spoilt)

    def _tried(self, fault: str, size: str, inputs: dict[str, Any]) -> Trial:
        try:
            answer = self.bench.align(inputs)
        except TruenorthError as error:
            return self._ended(fault, size, "refused", str(error))
        except Exception as error:
            return self._ended(fault, size, "crash", f"{type(error).__name__}: {error}")
        off = misses(answer, self.truth)
        worst = max(float(np.abs(x).max()) for x in off.values())
        warned = next((item.key for item in answer.evidence if item.urgent), None)
        reason = answer.reasons[0] if answer.reasons else ""
        if answer.status not in GOOD:
            return self._ended(fault, size, "flagged", reason, worst)
        if fault == SOUND:
            return self._ended(fault, size, "harmless" if worst <= BY_CHANCE else "silent", reason, worst)
        if warned is not None:
            return self._ended(fault, size, "flagged", warned, worst)
        if not self._to_blame(off):
            return self._ended(fault, size, "harmless", reason, worst)
        why = unseen(self.bench.name, fault, size, self._ratio(answer, inputs))
        return self._ended(fault, size, "silent" if why is None else "unseen", reason if why is None else why, worst)

    def _to_blame(self, off: dict[str, Any]) -> bool:
        """Whether an output is beyond three sigmas, and would not be but for the fault."""
        without = {} if self.sound is None else misses(self.sound, self.truth)
        moved = {name: np.abs(x - without.get(name, 0.0)) for name, x in off.items()}
        return any(bool(np.any((np.abs(x) > HARMLESS) & (moved[name] > OF_THE_FAULT))) for name, x in off.items())

    def _ratio(self, answer: Alignment | Navigation, inputs: dict[str, Any]) -> float | None:
        """By how much the same measurements prefer the sound log; None where they are not the same, or there are none."""
        if self.bench.name in REST and isinstance(answer, Alignment):
            return misfit_at_rest(inputs, answer) - misfit_at_rest(self.inputs, answer)
        if (
            isinstance(answer, Alignment)
            and answer.method == "swaying"
            and inputs["record"] is not self.inputs["record"]
            and np.array_equal(inputs["record"].time, self.inputs["record"].time)
        ):
            return ratio_on_sway(inputs["record"], self.inputs["record"], answer)
        if self.sound is None or not answer.residuals or not self.sound.residuals:
            return None
        both = zip(answer.residuals, self.sound.residuals, strict=False)
        if not all(np.array_equal(one.stamp, other.stamp) for one, other in both):
            return None
        return likelihood_ratio(answer.residuals, self.sound.residuals)

    def _ended(self, fault: str, size: str, outcome: Outcome, reason: str, worst: float = math.nan) -> Trial:
        return Trial(self.bench.name, fault, self.seed, self.run, size, outcome, worst, reason)


OUTCOMES: tuple[Outcome, ...] = ("refused", "flagged", "harmless", "unseen", "silent", "crash")


def table(trials: Sequence[Trial], by: tuple[str, ...] = ("procedure", "fault")) -> list[dict[str, Any]]:
    """One row a procedure and fault (or one of them): how many ended how, and the largest error in silence, in sigmas."""
    rows: dict[tuple[str, ...], dict[str, Any]] = {}
    for trial in trials:
        key = tuple(str(getattr(trial, name)) for name in by)
        empty = dict(zip(by, key, strict=True)) | dict.fromkeys(OUTCOMES, 0) | {"worst": 0.0}
        row = rows.setdefault(key, empty)
        row[trial.outcome] += 1
        if trial.outcome == "silent":
            row["worst"] = max(row["worst"], trial.worst)
    return list(rows.values())
