"""Whether velocities that are handed in change as the IMU says; and if not, in which axes they would.

Over a second or two an INS drifts by next to nothing, whatever its velocity is off by: from one measured velocity and the IMU's
own change of it the next one follows. Where it does not, and does with other axes, those were meant.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Gnss, Odometer, VelocityLog
from truenorth.core.errors import DataError
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, Trajectory, VelocityRecord
from truenorth.state.layout import BA, BG, PHI
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start

Array = NDArray[np.float64]

# Of the log, what shows axes: at most this long, and until an INS without aiding has tilted or drifted so far.
LONGEST, MOST_TILT, MOST_DRIFT = 1800.0, 0.02, 5000.0  # s, rad, m
SHORTEST = 20.0  # s
STEP, VERTICAL_STEP = 2.0, 20.0  # s, from one velocity to the next; roads climb slowly
LEAST_PAIRS = 20
ALIKE = 1.5  # times the squares that the best axes leave: as good
BETTER = 4.0  # times smaller squares that other axes must leave
EXPLAINED = 0.3  # of the squares of the changes, that they may leave at most

NORTH_EAST = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
DOWN = np.diag([1.0, 1.0, -1.0])
FORWARD_LEFT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
TURNED = np.diag([-1.0, -1.0, 1.0])
EXPECTED = {"body": "right, forward, up", "navigation": "east, north, up"}
# What else they may be: axes, frame, and what turns them into ours.
OTHERS: dict[str, list[tuple[str, str, Array]]] = {
    "navigation": [
        ("north, east, down", "navigation", NORTH_EAST @ DOWN),
        ("north, east, up", "navigation", NORTH_EAST),
        ("right, forward, up of the body", "body", np.eye(3)),
        ("forward, right, down of the body", "body", NORTH_EAST @ DOWN),
    ],
    "body": [
        ("forward, right, down", "body", NORTH_EAST @ DOWN),
        ("forward, left, up", "body", FORWARD_LEFT),
        ("counted the other way, backward and left", "body", TURNED),
        ("east, north, up", "navigation", np.eye(3)),
        ("north, east, down", "navigation", NORTH_EAST @ DOWN),
    ],
    "odometer": [("counted the other way, backward", "body", TURNED)],
}


def check_axes(
    record: GnssRecord | VelocityRecord | OdometerRecord, free: Trajectory, latency: float, C_mb: Array
) -> None:
    """Compare the changes of measured velocities with the IMU's own.

    Parameters
    ----------
    record : GnssRecord, VelocityRecord or OdometerRecord
    free : Trajectory
        Mechanised without aiding.
    latency : float, s
        By which the record's stamps are late.
    C_mb : (3, 3) array
        Body to the sensor's axes.

    Raises
    ------
    DataError
        They change otherwise, and with other axes as the IMU says: with both, and what to do.
    """
    kind, frame, velocity = _velocities(record)
    rows = np.flatnonzero(np.isfinite(velocity[:, :2]).all(axis=1) & free.covers(record.time - latency, np.inf))
    if rows.size <= LEAST_PAIRS:
        return
    track = free.at(record.time[rows] - latency)
    measured = _Measured(track.time, track.v_n, track.C_nb @ C_mb.T, np.nan_to_num(velocity[rows]))
    given, dv = measured.left(frame, np.eye(3), STEP)
    tried = [(name, measured.left(of, R, STEP)[0]) for name, of, R in OTHERS[kind]]
    other = min((left for _, left in tried), key=_squares)
    # A vehicle that hardly slides or climbs does not tell left from right: all that fit are named.
    name = " or ".join(name for name, left in tried if _squares(left) <= ALIKE * _squares(other))
    expected = "forward" if kind == "odometer" else EXPECTED[frame]
    said = f"{record.source}: velocities change otherwise than the IMU says, by"
    if _better(other[:, :2], given[:, :2], dv[:, :2]):
        raise DataError(
            f"{said} {_rms(given[:, :2]):.2g} m/s in {STEP:g} s; taken for {name} by {_rms(other[:, :2]):.2g} m/s: "
            f"expected {expected}; name the columns as what they are, or turn them"
        )
    if not np.isfinite(velocity[rows, 2]).all():
        return
    given, dv = measured.left(frame, np.eye(3), VERTICAL_STEP)
    other, _ = measured.left(frame, DOWN, VERTICAL_STEP)
    if not len(dv):
        return
    # A bias of the accelerometers changes velocity by as much in each step: 1.6 m/s of an industrial one.
    given, other, dv = (changes - changes.mean(axis=0) for changes in (given, other, dv))
    if _better(other[:, 2:], given[:, 2:], dv[:, 2:]):
        column = "VD" if frame == "navigation" else "v_down"
        raise DataError(
            f"{said} {_rms(given[:, 2:]):.2g} m/s vertically in {VERTICAL_STEP:g} s; counted downwards by "
            f"{_rms(other[:, 2:]):.2g} m/s: expected {expected}; name the column {column}, or turn its sign"
        )


@dataclass(frozen=True)
class _Measured:
    """Times (N,), the IMU's own velocities (N, 3) and attitudes ``C_nm`` (N, 3, 3), and the measured velocities (N, 3)."""

    time: Array
    v_n: Array
    C_nm: Array
    velocity: Array

    def left(self, frame: str, R: Array, step: float) -> tuple[Array, Array]:
        """What other axes leave of each change over about a step, and the change of the IMU's velocity, (n, 3) each."""
        away = max(1, round(step / float(np.median(np.diff(self.time)))))
        close = self.time[away:] - self.time[:-away] < 1.5 * step
        close &= close.sum() >= LEAST_PAIRS
        v = self.velocity @ R.T
        dv = self.v_n[away:] - self.v_n[:-away]
        if frame == "navigation":
            return (v[away:] - v[:-away] - dv)[close], dv[close]
        v_n = np.einsum("kij,kj->ki", self.C_nm[:-away], v[:-away]) + dv
        return (v[away:] - np.einsum("kji,kj->ki", self.C_nm[away:], v_n))[close], dv[close]


def _velocities(record: GnssRecord | VelocityRecord | OdometerRecord) -> tuple[str, str, Array]:
    """What others the axes may be, frame, and (N, 3) velocities."""
    if isinstance(record, OdometerRecord):
        speed = record.speed
        return "odometer", "body", np.stack([0.0 * speed, speed, np.full_like(speed, np.nan)], axis=1)
    if isinstance(record, GnssRecord):
        v_n = np.full((len(record), 3), np.nan) if record.v_n is None else record.v_n
        return "navigation", "navigation", v_n
    return record.frame, record.frame, record.velocity


def _better(other: Array, given: Array, change: Array) -> bool:
    """Whether other axes explain the changes, and those given do not; never without any."""
    return BETTER * _squares(other) < _squares(given) and _squares(other) < EXPLAINED * _squares(change)


def _squares(values: Array) -> float:
    return float(np.sum(values**2))


def _rms(values: Array) -> float:
    """Of the lengths of rows."""
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))


def check_velocities(record: ImuRecord, start: Start, model: InsModel, given: Iterable[Any], interval: float) -> None:
    """Refuse velocities in other axes, by the IMU's own changes of velocity over the log's first part.

    Parameters
    ----------
    record : ImuRecord
    start : Start
    model : InsModel
    given : aids
    interval : float, s
        Of the INS that runs without them.

    Raises
    ------
    DataError
        As :func:`check_axes`.
    """
    seen = [a for a in given if isinstance(a, Gnss | Odometer | VelocityLog)]
    if not seen:
        return
    sigma = np.sqrt(np.diag(start.P))
    tilt = float(sigma[PHI][:2].max())
    # A tilt pushes, too; once velocity is off by some 50 m/s the height runs away, to kilometres below the ground.
    pushed = math.hypot(sigma[BA].max(), STANDARD_GRAVITY * tilt)
    trusted = min(LONGEST, MOST_TILT / sigma[BG].max(), math.sqrt(2.0 * MOST_DRIFT / pushed))
    if trusted < SHORTEST or tilt > MOST_TILT:
        return
    part = record.between(None, record.time[0] + trusted)
    free = navigate_track(part, start, model, interval=interval, every=1, covariance=False)
    lat, lon, alt = free.position.T
    own = Trajectory(free.time, free.C_nb, free.v_n, lat, lon, alt, source=record.source)
    for a in seen:
        mounting = a.mounting or Mounting()
        check_axes(a.record, own, mounting.latency, mounting.C_mb)
