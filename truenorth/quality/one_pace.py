"""Logs whose rate of rows changes, as a record of one rate: increments over the longest of their steps.

What reads a record takes its rows for intervals of one length: their noise, what is a lost row, what an increment says of a rate.
Rows of a faster stretch are therefore added up until all stretches have the longest pace. Rates are integrated first, by the same
rule as ever. Nothing is lost by it but what the base does within a step, as in a log that has the lower rate throughout.

Between two lost rows, and between two changes of the pace, steps are even: a whole number of them, so that each is a little longer
or shorter than the longest pace. Where a step then ends within a row, the row is shared out by time. An increment that does not
grow with the step of its stretch is no integral over it: rows are missing there, and the record stays as it is.

The rule is ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from truenorth.core.remembered import remembered
from truenorth.quality.sampling import Finding
from truenorth.records import GAP_FACTOR, Guess, ImuRecord
from truenorth.records.lost_rows import lack_rows
from truenorth.records.pace import Stretch, stretches
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

PACES = "rate of the rows"  # what a record has been taken for


@remembered
def at_one_pace(record: ImuRecord) -> ImuRecord:
    """The record with rows of one step, where its rate changes; else as it is."""
    found = stretches(record.time)
    if len(found) == 1 or (record.kind == "increments" and not _grow(record, found)):
        return record
    step = max(s.pace for s in found)
    lost, edges = np.zeros(len(record)), [np.zeros(1)]
    for stretch, end in _spans(record, found):
        lengths = record.steps[stretch.first : end] / stretch.pace
        lengths[0] = 1.0 if stretch.first == 0 else lengths[0]
        gone = np.flatnonzero(lengths > GAP_FACTOR)
        steps, pace = lengths[gone] * stretch.pace, np.full(len(gone), stretch.pace)
        gone = gone[lack_rows(record.time, stretch.first + gone, steps, pace)]
        lost[stretch.first + gone] = lengths[gone] - 1.0
        parts = np.unique([0, *gone, len(lengths)])
        for a, b in pairwise(parts):
            groups = max(1, round((b - a) * stretch.pace / step))
            edges.append(stretch.first + np.linspace(a, b, groups + 1)[1:])
    at, rows = (
        np.concatenate(edges),
        np.concatenate([_integrals(record, s.first, end) for s, end in _spans(record, found)]),
    )
    said = Finding("note", "rate_changes", _message(record, found, step))
    values, ends = _at(at, np.vstack([np.zeros(6), np.cumsum(rows, axis=0)])), np.append(record.time[0], record.time)
    ends[0] -= found[0].pace
    merged = replace(
        record,
        time=_at(at[1:], ends[:, None])[:, 0],
        gyro=np.diff(values[:, :3], axis=0),
        accel=np.diff(values[:, 3:], axis=0),
        kind="increments",
        taken_for=(*record.taken_for, Guess(PACES, f"{1.0 / step:.4g} Hz", said.message)),
    )
    return merged if record.kind == "rates" or not lost.any() else _bridged(merged, rows, lost, at)


def pace_findings(record: ImuRecord) -> list[Finding]:
    """A note where the rate of the rows changes."""
    return [Finding("note", "rate_changes", taken.why) for taken in record.taken_for if taken.what == PACES]


def _spans(record: ImuRecord, found: Sequence[Stretch]) -> list[tuple[Stretch, int]]:
    """Each stretch with the row behind its last one."""
    return list(zip(found, [*(s.first for s in found[1:]), len(record)], strict=True))


def _grow(record: ImuRecord, found: Sequence[Stretch]) -> bool:
    """Whether increments are as long as the steps of their stretches: forces are alike, rather than velocities a row."""
    size = np.linalg.norm(record.accel, axis=1)
    medians = np.array([max(float(np.median(size[s.first : end])), 1e-12) for s, end in _spans(record, found)])
    paces = np.array([s.pace for s in found])
    return bool(np.ptp(np.log(medians / paces)) < np.ptp(np.log(medians)))


def _integrals(record: ImuRecord, first: int, end: int) -> Array:
    """(n, 6) increments of a stretch; of rates the row before it is the start."""
    begin = max(first - 1, 0)
    return np.hstack(increments(record[begin:end]))[first - begin :]


def _at(at: Array, values: Array) -> Array:
    """Columns of `values` at rows that need not be whole."""
    rows = np.arange(len(values))
    return np.column_stack([np.interp(at, rows, column) for column in values.T])


def _bridged(merged: ImuRecord, rows: Array, lost: Array, at: Array) -> ImuRecord:
    """The merged increments with lost rows that the merged clock does not show as a gap, by the rows around them."""
    gyro, accel = merged.gyro.copy(), merged.accel.copy()
    for row in np.flatnonzero(lost):
        group = int(np.searchsorted(at, row, "right")) - 1
        if row and group not in merged.gaps:
            add = 0.5 * lost[row] * (rows[row] + rows[row - 1])
            gyro[group] += add[:3]
            accel[group] += add[3:]
    return replace(merged, gyro=gyro, accel=accel)


def _message(record: ImuRecord, found: Sequence[Stretch], step: float) -> str:
    changes = [
        f"{1.0 / s.pace:.4g} Hz from row {s.first + 1} (t = {record.time[s.first]:.3f} s) on" for s in found[1:4]
    ]
    more = "" if len(found) <= 4 else f", and {len(found) - 4} more changes"
    return (
        f"the rate of the rows changes: {1.0 / found[0].pace:.4g} Hz first, {', '.join(changes)}{more}; the log is read as "
        f"increments over {step:.4g} s throughout"
    )
