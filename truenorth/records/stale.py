"""Fixes that a receiver, or the logger behind it, writes again while the vehicle has gone on: they are no measurements.

A receiver that hangs repeats its last fix with new stamps; a logger that is faster than the receiver writes the last fix into every
row. A receiver that holds its fix at a standstill repeats it as well, and is right. So a run of rows with one place is stale where

- the velocities of these very rows say that the vehicle has gone on, or
- the next fix is so far away that the way there, at the pace of the fixes around, must have begun when the run did.

Where most places come again so, or with their velocities, to the last digit, each repeat is a copy: noise never does that. A run
whose velocities are its own, and say that it stands, stands: its receiver lets go of the fix from time to time. Nor is a gap after
a run asked about, in which a vehicle goes anywhere. Velocities and headings of stale rows that are those of the row before are as
old as the place; others are measurements and stay.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.core.position import eastward
from truenorth.records.gnss import GnssRecord

Array = NDArray[np.float64]

LEAST_WAY = 1.0  # m, that the velocities of a run must say
LEAST_LEAP = 3.0  # m, to the fix after a run
STEPS = 5.0  # of the resolution of the places, as either must be besides
SLOWEST = 0.3  # m/s: a receiver at rest may say so much
LONGEST_WAIT = 5.0  # rows, to the fix after a run
FEWEST = 10  # places, of a log of which this can be said
USUAL = 0.5  # of the runs, as which none is a receiver that holds its fix
ON_GRID = 0.01  # of a step: rounding of far places
FASTER = 3.0  # times the pace around, that the leap after a run would need


def without_stale(record: GnssRecord) -> GnssRecord:
    """The record without places and velocities that are written again on the move; rows of which nothing is left are left out.

    Parameters
    ----------
    record : GnssRecord

    Returns
    -------
    GnssRecord
        The same one where nothing is stale; ``stale`` counts the rows.
    """
    rows = np.flatnonzero(record.has_position)
    if len(rows) < 2:
        return record
    height = record.alt[rows]
    same = (record.lat[rows][1:] == record.lat[rows][:-1]) & (record.lon[rows][1:] == record.lon[rows][:-1])
    same &= (height[1:] == height[:-1]) | np.isnan(height[1:] + height[:-1])
    if not same.any():
        return record
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    if len(starts) < FEWEST:
        return record
    time, away, fine = record.time[rows], *_places(record, rows)
    ends = np.append(starts[1:], len(rows))
    said, speed = _said_velocity(record, rows)
    pace, leap, wait = _leaps(time, away, starts, ends, speed)
    # The way of a run by its own velocities, by trapezoids.
    ways = np.zeros_like(away)
    ways[1:] = np.cumsum(0.5 * (said[1:] + said[:-1]) * np.diff(time)[:, None], axis=0)
    way, lasts = np.linalg.norm(ways[ends - 1] - ways[starts], axis=1), time[ends - 1] - time[starts]
    gone_on = (way > max(LEAST_WAY, STEPS * fine)) & (way > SLOWEST * lasts)
    own = _own_velocities(said, starts)
    stands = own & (np.maximum.reduceat(speed, starts) < SLOWEST)
    leapt = (leap > max(LEAST_LEAP, STEPS * fine)) & (leap > FASTER * pace * wait)
    gone_on |= leapt & ~stands & (wait < LONGEST_WAIT * float(np.median(np.diff(time))))
    repeats = ends - starts > 1
    # A logger that is faster than its receiver: what it writes again of a slow vehicle is no fix, either.
    copied = repeats & ~own & (leap > STEPS * fine)
    faster = np.mean(copied) > USUAL or np.mean(gone_on[repeats]) > USUAL
    again = np.repeat(repeats if faster else gone_on, ends - starts)
    again[starts] = False
    return _without(record, rows[again]) if again.any() else record


def _places(record: GnssRecord, rows: NDArray[np.intp]) -> tuple[Array, float]:
    """(N, 2) metres east and north of the first fix, and the resolution of the places, m."""
    lat, lon = record.lat[rows], record.lon[rows]
    meridian, prime = radii(lat[0])
    away = np.column_stack([eastward(lon, lon[0]) * prime * np.cos(lat[0]), (lat - lat[0]) * meridian])
    return away, max(_resolution(away[:, 0]), _resolution(away[:, 1]))


def _resolution(away: Array) -> float:
    """The step of which all places are multiples, in whatever unit they were written, m; nothing where there is none."""
    steps = np.diff(np.unique(away))
    if not len(steps):
        return 0.0
    counts = steps / steps.min()
    return float(steps.min()) if np.all(np.abs(counts - np.round(counts)) < ON_GRID) else 0.0


def _own_velocities(said: Array, starts: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which runs have velocities of their own: not those of their first row."""
    other = np.concatenate([[False], np.any(said[1:] != said[:-1], axis=1)])
    other[starts] = False
    return np.asarray(np.add.reduceat(other, starts) > 0)


def _said_velocity(record: GnssRecord, rows: NDArray[np.intp]) -> tuple[Array, Array]:
    """(N, 2) m/s east and north that each row says, nothing where it says none; and its size."""
    if record.v_n is None:
        return np.zeros((len(rows), 2)), np.zeros(len(rows))
    said = np.nan_to_num(record.v_n[rows, :2])
    return said, np.hypot(said[:, 0], said[:, 1])


def _leaps(
    time: Array, away: Array, starts: NDArray[np.intp], ends: NDArray[np.intp], speed: Array
) -> tuple[Array, Array, Array]:
    """Of each run of one place: the pace around it (m/s), how far the next fix is away (m), and how long after the run (s)."""
    begun, places = time[starts], away[starts]
    leap = np.append(np.linalg.norm(np.diff(places, axis=0), axis=1), 0.0)
    wait = np.append(time[starts[1:]] - time[ends[:-1] - 1], 0.0)
    paces = leap[:-1] / np.diff(begun)  # as if no place had been held
    before, after = np.append(0.0, paces), np.append(paces[1:], [0.0, 0.0])
    said = np.append(speed[starts[1:]], 0.0)
    return np.maximum(np.maximum(before, after[: len(starts)]), said), leap, wait


def _without(record: GnssRecord, stale: NDArray[np.intp]) -> GnssRecord:
    """Without the places of `stale` rows, and without velocities and headings that are those of the row before."""
    changes = {name: getattr(record, name).copy() for name in ("lat", "lon", "alt")}
    for values in changes.values():
        values[stale] = np.nan
    for name in ("v_n", "heading"):
        values = getattr(record, name)
        if values is not None:
            now, before = values[stale].reshape(len(stale), -1), values[stale - 1].reshape(len(stale), -1)
            old = np.all((now == before) | np.isnan(now), axis=1)
            changes[name] = values.copy()
            changes[name][stale[old]] = np.nan
    left = replace(record, **changes, stale=len(stale))
    holds = left.has_position | left.has_velocity | left.has_heading
    if holds.all():
        return left
    names = [name for name in ("time", *record.groups()) if getattr(left, name) is not None]
    return replace(left, **{name: getattr(left, name)[holds] for name in names})
