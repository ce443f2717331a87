"""Angles of an indexer at any time: an encoder's rows, and between them the gyros of the IMU that it carries.

An encoder of 10 Hz has no row within a start or stop of a slew, and its last row lies before the log's end: straight lines are off
by tenths of a degree there, and so is the body's attitude. The gyros see each turn as it is. What they see more is the turn of the
body, which is smooth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.indexing import DIRECTIONS, C_bs_from_angles
from truenorth.quality.encoder_steps import ROUNDED, resolution
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

COVER = 0.05  # s by which an encoder's log may begin late or end early
ROUNDING = 1e-3  # of a row, by which stamps of one moment differ: beyond the edges the gyros say nothing
FEWEST = 4  # rows that a spline needs
MOST_DIFFERENCES = 8
NONE = (np.empty(0), np.empty((0, 0)), np.empty((0, 0)), np.empty(0))
PASSES = 2  # the direction of an outer axis in the IMU is known by straight lines at first


@dataclass(frozen=True)
class CarriedAngles:
    """Angles of an indexer at each row of the IMU that it carries.

    Attributes
    ----------
    record : EncoderRecord
        At the edges of the IMU's rows.
    last : float, s
        The encoder's own last row: beyond it the gyros alone carry the angles, and take what the body does for what it did.
    step : float, s
        Between its rows.
    swing : float, rad/s^2
        RMS of the body's angular acceleration about the axes, which they do not know of there.
    noise : float, rad
        White noise of the encoder's rows, steps of its resolution included while it turns.
    time : (N,) array, s
        Of the encoder's rows.
    by_gyros, turned : (N, A) arrays, rad
        There by how much the gyros turn about the axes, and the angles more than these: the turn of the body.
    steps : (A,) array, rad
        Of the encoder's resolution, zero where its angles show none. Where an axis rests a part of a step is an error of the angle
        that each row repeats.
    """

    record: EncoderRecord
    last: float
    step: float
    swing: float
    noise: float
    time: Array
    by_gyros: Array
    turned: Array
    steps: Array

    def sigma(self, time: float) -> float:
        """One sigma at a time (s), rad: noise of rows or a part of a step, and what the body may have turned since the last one.

        Beyond it the angle goes on by the spline's tangent, the slope of a cubic through its last four rows,
        ``(11/6, -3, 3/2, -1/3)/step``, with their noise.
        """
        beyond = max(time - self.last, 0.0)
        rows = beyond / self.step * np.array([11.0 / 6.0, -3.0, 1.5, -1.0 / 3.0]) + (1.0, 0.0, 0.0, 0.0)
        rounded = ROUNDED * float(self.steps.max(initial=0.0))
        part = math.sqrt(max(rounded**2 - self.noise**2, 0.0))  # noise has the rest of it
        return math.hypot(self.noise * float(np.linalg.norm(rows)), part, 0.5 * self.swing * beyond**2)


def carried_angles(encoder: EncoderRecord, record: ImuRecord, axes: Sequence[str], late: float = 0.0) -> CarriedAngles:
    """Angles at each row of the IMU: the encoder's own at its rows, carried between them and beyond by the gyros.

    The turn rate of the IMU in the body is ``J(angles) d angles/dt``, the columns of ``J`` being the axes as the IMU sees them.
    What the gyros have turned about these axes is the angle, less what the body turns about them: that is smooth, and is read from
    the encoder's rows by a spline.

    Parameters
    ----------
    encoder : EncoderRecord
    record : ImuRecord
    axes : sequence of {"x", "y", "z"}
        The outermost first.
    late : float, s
        By which the encoder's stamps are, which is taken off.

    Raises
    ------
    DataError, UsageError
        As :func:`angles_at`.
    """
    from scipy.interpolate import CubicSpline

    dtheta, _ = increments(record)
    edges = np.append(record.time[0] - record.interval, record.time)
    angles = angles_at(encoder, edges, axes, late)
    slack, stamps = ROUNDING * record.interval, encoder.time - late
    rows = (stamps >= edges[0] - slack) & (stamps <= edges[-1] + slack)
    if np.count_nonzero(rows) < FEWEST:
        return CarriedAngles(
            replace(encoder, time=edges, angles=_shaped(angles)), float(stamps[-1]), math.inf, 0.0, 0.0, *NONE
        )
    time = stamps[rows]
    given = angles_at(encoder, time, axes, late)
    for _ in range(PASSES):
        J = _axes_seen(axes, 0.5 * (angles[1:] + angles[:-1]))
        turned = np.einsum("kai,ki->ka", _inverse(J, axes), dtheta)
        by_gyros = np.concatenate([np.zeros((1, len(axes))), np.cumsum(turned, axis=0)])
        at_rows = np.stack([np.interp(time, edges, column) for column in by_gyros.T], axis=-1)
        own = np.unwrap(given - at_rows, axis=0)  # the gyros know by how many turns
        of_body = CubicSpline(time, own)
        # Beyond its ends on along its tangents: its cubics would run away.
        inside = np.clip(edges, time[0], time[-1])
        angles = by_gyros + of_body(inside) + (edges - inside)[:, None] * of_body(inside, 1)
    swing = float(np.sqrt(np.max(np.mean(of_body(time, 2) ** 2, axis=0))))
    noise, step = _white(own), float(np.median(np.diff(time)))
    carried = replace(encoder, time=edges, angles=_shaped(angles))
    return CarriedAngles(carried, float(time[-1]), step, swing, noise, time, at_rows, own, resolution(given, own))


def _white(y: Array) -> float:
    """White noise of the noisiest column of a smooth motion, by its differences: each order shows noise, and less of motion."""
    orders = range(2, min(MOST_DIFFERENCES, len(y) - 1) + 1)
    return math.sqrt(
        min(float(np.mean(np.diff(y, n, axis=0) ** 2, axis=0).max()) / math.comb(2 * n, n) for n in orders)
    )


def _axes_seen(axes: Sequence[str], angles: Array) -> Array:
    """(K, 3, A) directions of an indexer's axes as its IMU sees them, at angles (K, A)."""
    seen = [
        np.swapaxes(C_bs_from_angles(axes[i + 1 :], angles[:, i + 1 :]), -1, -2) @ np.array(DIRECTIONS[axis])
        for i, axis in enumerate(axes)
    ]
    return np.stack(seen, axis=-1)


def _inverse(J: Array, axes: Sequence[str]) -> Array:
    """(K, A, 3) pseudo-inverse of the directions of axes: of two that are perpendicular it is their transpose."""
    upright = len(axes) == len(set(axes)) < 3
    return np.swapaxes(J, 1, 2) if upright else np.asarray(np.linalg.pinv(J))


def _shaped(angles: Array) -> Array:
    """As a record has them: (N,) of a single axis."""
    return angles[:, 0] if angles.shape[1] == 1 else angles


def angles_at(encoder: EncoderRecord, time: ArrayLike, axes: Sequence[str], late: float = 0.0) -> Array:
    """(K, A) angles of an encoder at times (s), rad; straight lines between its rows (see :func:`carried_angles`).

    Its stamps are `late` (s), which is taken off.

    Raises
    ------
    UsageError
        Axes that do not fit its columns.
    DataError
        Times that its log does not cover.
    """
    time = np.asarray(time, dtype=np.float64)
    angles = np.unwrap(encoder.angles if encoder.angles.ndim == 2 else encoder.angles[:, None], axis=0)
    if angles.shape[1] != len(axes) or not set(axes) <= set("xyz"):
        raise UsageError(
            f"axes {','.join(axes)} for {angles.shape[1]} angle(s) in {encoder.source}; expected one of x, y and z for each "
            "angle, the outermost first, such as z,x"
        )
    slack, stamps = _slack(encoder) + abs(late), encoder.time - late
    if time.min() < stamps[0] - slack or time.max() > stamps[-1] + slack:
        raise DataError(
            f"{encoder.source}: angles from {encoder.time[0]:.3f} s to {encoder.time[-1]:.3f} s, wanted from {time.min():.3f} s to "
            f"{time.max():.3f} s: expected the encoder's log to cover the IMU's; cut the IMU's log (`record.between`)"
        )
    columns = [np.interp(time, stamps, column) for column in angles.T]
    # Beyond its ends by a row at most: on along the first or last two rows.
    for column, given in zip(columns, angles.T, strict=True):
        for outside, (a, b) in ((time < stamps[0], (0, 1)), (time > stamps[-1], (-2, -1))):
            slope = (given[b] - given[a]) / (stamps[b] - stamps[a])
            edge = 0 if a == 0 else -1
            column[outside] = given[edge] + slope * (time[outside] - stamps[edge])
    return np.stack(columns, axis=-1)


def _slack(encoder: EncoderRecord) -> float:
    return COVER + 1.5 * float(np.median(np.diff(encoder.time)))


def covered_until(encoder: EncoderRecord) -> float:
    """Time up to which an encoder's log covers an IMU's, s."""
    return float(encoder.time[-1]) + _slack(encoder)


def orders(count: int) -> dict[str, Array]:
    """Columns of angles and their signs, by the name of the reading: (count, count) matrices."""
    own = np.eye(count)
    signs = np.ones(count)
    signs[0] = -1.0
    orders = {"given": own, "first_reversed": own * signs, "last_reversed": own * signs[::-1]}
    return orders if count == 1 else orders | {"exchanged": own[::-1]}


def reading(encoder: EncoderRecord, axes: Sequence[str], order: Array, late: float = 0.0) -> Callable[[Array], Array]:
    """``C_sb`` (K, 3, 3) at times, by the angles in an order, their delay taken off."""
    return lambda time: np.swapaxes(C_bs_from_angles(axes, angles_at(encoder, time, axes, late) @ order.T), -1, -2)
