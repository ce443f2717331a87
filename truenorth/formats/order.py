"""Rows of an aiding log that stand after later ones: put in order within a bound, refused beyond it. Rows written twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.checks import check_order
from truenorth.formats.quantities import Found
from truenorth.records import IN_ORDER, Late

Array = NDArray[np.float64]

# Messages of several sensors overtake each other by what a link or an acoustic fix takes; a clock that was set back, or a
# second log that was appended, goes farther and cannot be put in order.
LONGEST_LATE = 10.0  # s
MOST_TWICE = 0.2  # of the rows: more than this is a clock of few digits, whose rows may be samples of their own


def put_in_order(
    time: Array, label: str, source: str, place: Callable[[int], str]
) -> tuple[NDArray[np.intp] | None, Late]:
    """How rows have to be taken to stand in order of time.

    Parameters
    ----------
    time : (N,) array, s
    label : str
        What the log calls it.
    place : callable
        Where a row stands in the file, in words.

    Returns
    -------
    order : (N,) array or None
        None where they stand in order.
    late : Late

    Raises
    ------
    DataError
        A row later than `LONGEST_LATE`, or two of one time: with the place in the file.
    """
    order, late = None, IN_ORDER
    if np.any(np.diff(time) < 0.0):
        behind = np.maximum.accumulate(time) - time
        beyond = np.flatnonzero(behind > LONGEST_LATE)
        if beyond.size:
            k = int(beyond[0])
            raise DataError(
                f"{source}: {place(k)}, column {label}: time goes back ({time[k] + behind[k]:.15g}, then {time[k]:.15g}), by "
                f"{behind[k]:.6g} s; expected rows late by {LONGEST_LATE:g} s at most, which are put in order: sort the log, or "
                "split it where its clock was set"
            )
        order, late = np.argsort(time, kind="stable"), Late(int(np.sum(behind > 0.0)), float(behind.max()))
        stood, time = place, time[order]
        place = lambda row: stood(int(order[row]))  # noqa: E731  # the rows' places in the file, as they are taken now
    check_order(time, label, source, place)
    return order, late


def taken_once(found: Found) -> Found:
    """A log without rows that are, in time and in all that is read, the row before: a logger wrote those twice.

    As it is where many are so.
    """
    time = found.values["time"]
    same = np.diff(time) == 0.0
    for column in found.values.values() if same.any() else ():
        same &= (column[1:] == column[:-1]) | (np.isnan(column[1:]) & np.isnan(column[:-1]))
    if len(found.values) < 2 or not same.any() or np.mean(same) > MOST_TWICE:
        return found
    keep = np.flatnonzero(np.concatenate([[True], ~same]))
    values = {name: column[keep] for name, column in found.values.items()}
    return replace(found, values=values, place=lambda row: found.place(int(keep[row])))


def ordered(found: Found) -> Found:
    """A log whose rows stand in order of time, each once.

    Raises
    ------
    DataError
        As for :func:`put_in_order`.
    """
    found = taken_once(found)
    order, late = put_in_order(found.values["time"], found.labels["time"], found.source, found.place)
    if order is None:
        return found
    return replace(
        found,
        values={name: values[order] for name, values in found.values.items()},
        place=lambda row: found.place(int(order[row])),
        late=late,
    )
