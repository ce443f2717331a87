"""Rows that alternate: two sensors, or two converters of one, in turn.

What keeps its phase at half the rate of rows over a whole log is no motion: a vibration there is off by some hundredths of a
hertz, and turns over in the log. The alternating part of each accelerometer is looked at in stretches, with motion taken off by
fourth differences (gain one at half the rate, ``sin^4`` below). Of forces of which one in two is turned, it is half of what the
turn makes of gravity, and so much is the mean of both turned against either sensor.

Where gravity moves in the axes of the IMU, as on an indexer, the difference moves with it: a turn theta of one against the mean
alternates as ``theta x f``. It is found by least squares over the log, and each part of it that can must show it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.core.remembered import remembered
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

STRETCHES = 32  # of the log
SHORTEST = 32  # rows of one
PARTS = 8  # of the log, that must all agree
COUNTS = 1.0  # steps of a coarse counter: it alternates by half of one by itself


@remembered
def alternation(record: ImuRecord) -> Array:
    """(3,) half of what every second row of each accelerometer has more than the others; zero where chance may give it."""
    length = _length(record)
    found = np.zeros(3)
    if length < SHORTEST:
        return found
    for channel, x in enumerate(record.accel.T):
        means = _alternating(x, length).mean(axis=1)
        size = float(means.mean())
        if _keeps(means) and abs(size) > COUNTS * _step(x):
            found[channel] = size
    return found


@remembered
def turn_in_turn(record: ImuRecord) -> float:
    """By how much (rad) every second row of forces is turned against the mean of all; zero where not all of the log shows it."""
    length = _length(record)
    if length < SHORTEST:
        return 0.0
    columns = record.accel.T
    q = np.stack([_alternating(x, length) for x in columns], axis=2)
    f = np.stack([_smooth(x, length) for x in columns], axis=2)
    z = np.cross(f, q).sum(axis=1)  # of each stretch, as A: normal equations of q = theta x f
    A = np.sum(f * f, axis=(1, 2))[:, None, None] * np.eye(3) - np.einsum("kni,knj->kij", f, f)
    theta = np.linalg.pinv(A.sum(axis=0), rcond=limit("alternating turn"), hermitian=True) @ z.sum(axis=0)
    force = math.sqrt(float(np.mean(f**2)) * 3.0)
    counter = max(_step(x) for x in columns)
    shows, expected = z @ theta, np.einsum("i,kij,j->k", theta, A, theta)
    size = float(np.linalg.norm(theta))
    left = np.mean(q - np.cross(theta, f), axis=1)  # a vibration alternates where no force is turned, too
    explains = float(np.sum(left**2)) < float(expected.sum()) / q.shape[1]
    return size if size * force > COUNTS * counter and explains and _shown(shows, expected) else 0.0


def _length(record: ImuRecord) -> int:
    """Rows of a stretch, an even number."""
    return (len(record) - 4) // STRETCHES // 2 * 2


def _alternating(x: Array, length: int) -> Array:
    """(STRETCHES, length / 2) alternating part of a channel, of two rows each."""
    quick = (x[:-4] - 4.0 * x[1:-3] + 6.0 * x[2:-2] - 4.0 * x[3:-1] + x[4:]) / 16.0
    pairs = quick[: STRETCHES * length].reshape(STRETCHES, length // 2, 2)
    return np.asarray(0.5 * (pairs[:, :, 0] - pairs[:, :, 1]))


def _smooth(x: Array, length: int) -> Array:
    """The rest of it, at the same rows."""
    slow = (x[:-4] + 4.0 * x[1:-3] + 6.0 * x[2:-2] + 4.0 * x[3:-1] + x[4:]) / 16.0
    return np.asarray(slow[: STRETCHES * length].reshape(STRETCHES, length // 2, 2).mean(axis=2))


def _keeps(means: Array) -> bool:
    """Whether means of stretches have a mean beyond chance, and all parts of the log have it."""
    size, spread = float(means.mean()), float(means.std(ddof=1))
    parts = means.reshape(PARTS, -1).mean(axis=1)
    steady = float(parts.std()) < limit("alternates alike") * abs(size) and bool(np.all(parts * size > 0.0))
    return steady and abs(size) > limit("alternates") * spread / math.sqrt(len(means))


def _shown(shows: Array, expected: Array) -> bool:
    """Whether stretches show what a turn makes them show, and all parts of the log that can show as much as each other.

    A turn about the vertical moves the force only where the vehicle turns or gathers way: no stretch counts for more than it
    should show. Where fewer than `PARTS` of them show it all, a vibration may keep its phase for as long.
    """
    total = float(expected.sum())
    if total <= 0.0 or total**2 < PARTS * float(np.sum(expected**2)):
        return False
    part = (PARTS * (np.cumsum(expected) - 0.5 * expected) / total).astype(np.int64)
    sums = np.bincount(part, shows, PARTS) / np.maximum(np.bincount(part, expected, PARTS), 1e-300)
    steady = float(sums.std()) < limit("alternates alike") and bool(np.all(sums > 0.0))
    n = len(shows)
    return steady and float(shows.sum()) > limit("alternates") * math.sqrt(
        n / (n - 1) * float(np.sum((shows - expected) ** 2))
    )


def alternation_evidence(record: ImuRecord) -> list[Evidence]:
    """That the rows of the accelerometers alternate, and by how much the mean of two sensors is turned against either."""
    offset = float(np.linalg.norm(alternation(record)))
    unit = record.interval if record.kind == "increments" else 1.0
    turned = max(offset / GRAVITY_EQUATOR / unit, turn_in_turn(record))
    if turned == 0.0:
        return []
    figures: dict[str, Figure] = {"size": 2.0 * turned * GRAVITY_EQUATOR, "level": turned}
    return [Evidence("record.alternates", figures, "known", Effect(heading=turned, level=turned), ("rows_of_one",))]


def _step(values: Array) -> float:
    """The smallest step between two values of a channel that is written in few levels; zero of one that has as many as rows."""
    levels = np.unique(values)
    return float(np.diff(levels).min()) if 1 < len(levels) < len(values) // 4 else 0.0
