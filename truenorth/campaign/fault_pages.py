"""Trials of a campaign of faults on disk, one line each as they come, and its tables in Markdown."""

from __future__ import annotations

import csv
import math
import os
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from truenorth.campaign.fault_limits import (
    AXES,
    BY_LATENCY,
    BY_LIKELIHOOD,
    BY_MEANS,
    BY_SIGN,
    BY_STAYING,
    LATE,
    LIKE_HEADING,
    LIKE_MOTION,
    ON_THE_MOVE,
    REST,
    SHOWN_BY_SWAY,
    SIGNS,
    UNSEEN,
)
from truenorth.campaign.faults import OUTCOMES, SOUND, Trial, table
from truenorth.core.atomic import atomic_path
from truenorth.core.errors import DataError, UsageError
from truenorth.core.paths import unreadable
from truenorth.formats.content import check_regular


def read_trials(path: Path) -> list[Trial]:
    """The whole lines of a file of trials; a line that was cut off is left out.

    Raises
    ------
    DataError
        Another file.
    """
    if not path.exists():
        return []
    check_regular(path)
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
    except OSError as error:
        raise unreadable(path, error) from None
    except (csv.Error, UnicodeDecodeError) as error:
        raise DataError(f"{path}: not a file of trials ({error})") from None
    if rows and tuple(rows[0]) != Trial._fields:
        raise DataError(f"{path}: its columns are {','.join(rows[0])}; expected {','.join(Trial._fields)}")
    found = []
    for row in rows[1:]:
        if len(row) == len(Trial._fields) and row[5] in OUTCOMES:
            procedure, fault, seed, run, size, outcome, worst, reason = row
            try:
                numbers = int(seed), int(run), float(worst)
            except ValueError as error:
                raise DataError(f"{path}: not a file of trials ({error})") from None
            found.append(
                Trial(procedure, fault, numbers[0], numbers[1], size, outcome, numbers[2], reason)  # type: ignore[arg-type]
            )
    return found


def keeper(path: Path, done: Sequence[Trial]) -> Callable[[Trial], None]:
    """A function that writes each trial to the end of a file, on disk before it returns; those done come first."""
    with atomic_path(path) as whole, whole.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([Trial._fields, *done])

    def keep(trial: Trial) -> None:
        try:
            with path.open("a", newline="", encoding="utf-8") as file:
                csv.writer(file).writerow(trial)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise UsageError(f"{path}: a trial could not be kept ({error.strerror})") from None

    return keep


def page(trials: Sequence[Trial], before: Sequence[Trial] = ()) -> str:
    """The tables in Markdown: by procedure, by fault, sound logs, and what passes in silence.

    Parameters
    ----------
    trials : sequence of Trial
    before : sequence of Trial
        Of an earlier version, with the same faults where it could be asked.
    """
    then = {(t.procedure, t.fault, t.seed, t.run): t for t in before}
    both = [(t, then.get((t.procedure, t.fault, t.seed, t.run))) for t in trials if t.fault != SOUND]
    lines = []
    for by in ("procedure", "fault"):
        count = Counter(getattr(old, by) for _, old in both if old is not None)
        was = Counter(getattr(t, by) for t, old in both if old is not None and old.outcome in ("silent", "crash"))
        rows = table([t for t, _ in both], (by,))
        names = [*OUTCOMES, *(["silent or crashed before"] if before else [])]
        lines += ["", f"| {by} | {' | '.join(names)} |", f"| --- |{' --- |' * len(names)}"]
        for row in rows:
            cells = [str(row[name] or "") for name in OUTCOMES]
            if before:
                cells.append(f"{was[row[by]]} of {count[row[by]]}" if count[row[by]] else "not comparable")
            lines.append(f"| {row[by]} | {' | '.join(cells)} |")
        if by == "procedure":
            whole = Counter(t.outcome for t, _ in both)
            cells = [str(whole[name]) for name in OUTCOMES]
            if before:
                cells.append(f"{sum(was.values())} of {sum(count.values())}")
            lines.append(f"| all | {' | '.join(cells)} |")
    return "\n".join([*lines, "", *_sound(trials), "", *_silent(trials), "", *_unseen()]).strip() + "\n"


def _sound(trials: Sequence[Trial]) -> list[str]:
    sound = [t for t in trials if t.fault == SOUND]
    if not sound:
        return []
    alarms = [t for t in sound if t.outcome != "harmless"]
    said = "; ".join(f"{t.procedure} (seed {t.seed}, run {t.run}): {t.outcome}, {t.reason[:80]}" for t in alarms)
    return [f"Sound logs: {len(sound)}, of which {len(alarms)} were not accepted.{' ' + said if said else ''}"]


def _silent(trials: Sequence[Trial]) -> list[str]:
    rows = [row for row in table(trials) if row["silent"] or row["crash"]]
    if not rows:
        return ["Nothing passed in silence."]
    lines = ["| in silence | fault | of | worst, sigmas |", "| --- | --- | --- | --- |"]
    for row in rows:
        runs = sum(row[name] for name in OUTCOMES)
        worst = f"{row['worst']:.1f}" if math.isfinite(row["worst"]) else ""
        lines.append(f"| {row['procedure']} | {row['fault']} | {row['silent'] + row['crash']} of {runs} | {worst} |")
    return lines


def _unseen() -> list[str]:
    lines = ["| cannot be seen | by | why |", "| --- | --- | --- |"]
    lines += [f"| {u.fault}{_sizes(u.size)} | {', '.join(u.procedures)} | {u.why} |" for u in UNSEEN]
    lines.append(f"| {', '.join(LIKE_HEADING)} | {', '.join(REST)} | {BY_MEANS} |")
    biases = [name for name in LIKE_MOTION if name.startswith(("gyro", "accel")) and name != SHOWN_BY_SWAY]
    lines.append(f"| {', '.join(biases)} | swaying | {BY_STAYING} |")
    lines.append(f"| {', '.join(LATE)} | transfer, attitude | {BY_LATENCY} |")
    lines.append(f"| {', '.join(SIGNS)} | transfer | {BY_SIGN} |")
    return [*lines, f"| {', '.join((*LIKE_MOTION, *AXES))} | {', '.join(ON_THE_MOVE)} | {BY_LIKELIHOOD} |"]


def _sizes(size: str) -> str:
    named = {"(?!yxz)": "all but x and y exchanged", "[xy] ": "x or y", "z ": "z"}
    return f" ({named.get(size, size)})" if size else ""
