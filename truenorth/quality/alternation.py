"""Rows that alternate: two or three sensors, or converters of one, in turn.

What keeps its phase at half the rate of rows over a whole log is no motion: a vibration there is off by some hundredths of a
hertz, and turns over in the log. The alternating part of each accelerometer is looked at in stretches, with motion taken off by
fourth differences (gain one at half the rate, ``sin^4`` below). Of forces of which one in two is turned, it is half of what the
turn makes of gravity, and so much is the mean of both turned against either sensor.

Where gravity moves in the axes of the IMU, as on an indexer, the difference moves with it: a turn theta of one against the mean
alternates as ``theta x f``. It is found by least squares over the log, and each part of it that can must show it.

Three sensors in turn, or one in three, have the same at a third of the rate, where the fourth differences have the gain 9/16: a
size with a phase, a complex number. One sensor in three that is turned by an angle stands 2/3 of it from the mean of all.

One in five shows at a fifth and at two fifths of the rate, at both by 2/5 of its turn; it stands 4/5 of it from the mean. Engines
and mains hum at a fifth of some rate as well, seldom at two fifths, too, and as steadily: both must show it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.blocks import levels_of, row_blocks
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.core.remembered import remembered
from truenorth.quality.other_counts import counts_in_turn, has_many_levels
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

# Of the log: a vibration whose beat goes round once in each of these stretches, and leaves as much in all, does not in those.
STRETCHES = (32, 40)
SHORTEST = 32  # rows of one
PARTS = 8  # of the log, that must all agree
# Rows in which sensors take their turns; of four every second row differs, too, and of six.
PERIODS = {2: "record.alternates", 3: "record.in_turn", 5: "record.in_turn"}
ROUNDING = 1e-12  # of the largest value: differences of a channel that stands on one value are its rounding
COUNTS = 1.0  # steps of a coarse counter: it alternates by half of one by itself


class _Stretches(NamedTuple):
    """What n stretches of a log say: means and products of what the channels do once in so many rows, and of the rest of them."""

    quick: Any  # (n, 3) means of what alternates
    slow: Array  # (n, 3) means of the rest, f
    turns: Any  # (n, 3) sums of q x f
    products: Array  # (3, 3, n) sums of f f'
    periods: int  # of a stretch


def alternation(record: ImuRecord, period: int = 2, stretches: int = STRETCHES[0]) -> Array:
    """(3,) size of what each accelerometer does once in so many rows, of two: half of what one has more than the other.

    Zero where chance may give it.
    """
    return _alternation(record, _stretches(record, period, stretches))


def _alternation(record: ImuRecord, seen: _Stretches | None) -> Array:
    """The same, of what the stretches say."""
    found = np.zeros(3)
    if seen is None:
        return found
    for channel, x in enumerate(record.accel.T):
        means = seen.quick[:, channel]
        size = float(abs(means.mean()))
        if _keeps(means) and size > COUNTS * _step(x):
            found[channel] = size
    return found


def turn_in_turn(record: ImuRecord, period: int = 2, stretches: int = STRETCHES[0]) -> float:
    """By how much (rad) forces of one in so many rows are turned against the mean; zero where not all of the log shows it."""
    return _off_the_mean(period) * _turn(record, _stretches(record, period, stretches))


def _off_the_mean(period: int) -> float:
    """How far one sensor in so many stands from the mean of all, in parts of what it does once in so many rows.

    Turned by an angle, it stands ``(N - 1) / N`` of it from the mean, and does ``2 / N`` of it at each multiple of ``1 / N``.
    """
    return max(1.0, 0.5 * (period - 1.0))


def _turn(record: ImuRecord, seen: _Stretches | None) -> float:
    """The same, of what the stretches say."""
    if seen is None:
        return 0.0
    # Of each stretch, as A: normal equations of q = theta x f.
    z, products = seen.turns, seen.products
    square = np.einsum("iik->k", products)
    A = square[:, None, None] * np.eye(3) - products.transpose(2, 0, 1)
    theta = np.linalg.pinv(A.sum(axis=0), rcond=limit("alternating turn"), hermitian=True) @ z.sum(axis=0)
    force = math.sqrt(float(square.sum()) / (len(z) * seen.periods))
    shows, expected = np.real(z @ theta.conj()), np.real(np.einsum("i,kij,j->k", theta.conj(), A, theta))
    size = float(np.linalg.norm(theta))
    # A vibration alternates where no force is turned, too.
    left = seen.quick - np.cross(theta, seen.slow)
    explains = float(np.sum(abs(left) ** 2)) < float(expected.sum()) / seen.periods
    if not (explains and _shown(shows, expected)):
        return 0.0
    return size if size * force > COUNTS * max(_step(x) for x in record.accel.T) else 0.0


def _stretches(record: ImuRecord, period: int, stretches: int, times: int = 1) -> _Stretches | None:
    """What stretches say of what happens so many times in the period; None of a log that is too short.

    Of a long log some stretches at a time are in memory.
    """
    length = (len(record) - 4) // stretches // period * period
    if length < SHORTEST:
        return None
    parts = []
    for rows in row_blocks(stretches * length, length):
        columns = [x[rows.start : rows.stop + 4] for x in record.accel.T]
        q = [_periodic(x, period, times).reshape(-1, length // period) for x in columns]
        f = [_smooth(x, period).reshape(-1, length // period) for x in columns]
        parts.append(
            (
                np.stack([x.mean(axis=1) for x in q], axis=1),
                np.stack([x.mean(axis=1) for x in f], axis=1),
                np.stack([(f[j] * q[k] - f[k] * q[j]).sum(axis=1) for j, k in ((1, 2), (2, 0), (0, 1))], axis=1),
                np.array([[(a * b).sum(axis=1) for b in f] for a in f]).transpose(2, 0, 1),
            )
        )
    quick, slow, turns, products = (np.concatenate(part) for part in zip(*parts, strict=True))
    return _Stretches(quick, slow, turns, products.transpose(1, 2, 0), length // period)


def _periodic(x: Array, period: int, times: int) -> Any:
    """Size and phase of what a channel does so many times in each period, of two rows a real number."""
    turn = 2.0 * math.pi * times / period
    quick = (x[:-4] - 4.0 * x[1:-3] + 6.0 * x[2:-2] - 4.0 * x[3:-1] + x[4:]) / (2.0 * math.sin(0.5 * turn)) ** 4
    rows = quick.reshape(-1, period)
    if period == 2:
        return 0.5 * (rows[:, 0] - rows[:, 1])
    return rows @ np.exp(-1j * turn * np.arange(period)) * (2.0 / period)


def _smooth(x: Array, period: int) -> Array:
    """The rest of it, at the same rows."""
    slow = (x[:-4] + 4.0 * x[1:-3] + 6.0 * x[2:-2] + 4.0 * x[3:-1] + x[4:]) / 16.0
    rows = slow.reshape(-1, period)
    return np.asarray(sum(rows[:, i] for i in range(period)) / period)


def _keeps(means: Any) -> bool:
    """Whether means of stretches have a mean beyond chance, and all parts of the log have it."""
    mean, spread = means.mean(), float(means.std(ddof=1))
    parts = means.reshape(PARTS, -1).mean(axis=1)
    steady = float(parts.std()) < limit("alternates alike") * abs(mean) and bool(
        np.all(np.real(parts * mean.conj()) > 0.0)
    )
    return steady and float(abs(mean)) > limit("alternates") * spread / math.sqrt(len(means))


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


@remembered
def alternation_evidence(record: ImuRecord) -> list[Evidence]:
    """That the rows of the accelerometers alternate, and by how much the mean of two sensors is turned against either."""
    found = []
    for period, key in PERIODS.items():
        turned = _turned(record, period, STRETCHES[0])
        if turned > 0.0:  # few logs come so far
            turned = min(turned, _turned(record, period, STRETCHES[1]))
        if turned == 0.0 and counts_in_turn(record, period):
            turned, key = _by_means(record, period), "record.other_counts"
            figures: dict[str, Figure] = {"rows": period, "level": turned}
        elif turned > 0.0:
            size = turned * GRAVITY_EQUATOR * period / (period - 1.0)
            rows: dict[str, Figure] = {"rows": period} if period > 2 else {}
            figures = {"size": size, "level": turned, **rows}
        if turned > 0.0:
            found.append(Evidence(key, figures, "known", Effect(heading=turned, level=turned), ("rows_of_one",)))
        if found:  # what is so at half the rate is at others, too
            break
    return found


def _by_means(record: ImuRecord, period: int) -> float:
    """The same of rows that have other counts: what their means say, with its sigma, chance or not."""
    unit = record.interval if record.kind == "increments" else 1.0
    seen = _stretches(record, period, STRETCHES[0])
    means = [] if seen is None else seen.quick.T
    square = sum(float(abs(x.mean()) ** 2 + x.var() / len(x)) for x in means)
    return _off_the_mean(period) * math.sqrt(square) / GRAVITY_EQUATOR / unit


def _turned(record: ImuRecord, period: int, stretches: int) -> float:
    """By how much (rad) the mean is turned against one in so many rows, by the larger of both figures.

    All multiples of the rate of the period up to half the rate of rows must show it.
    """
    unit = record.interval if record.kind == "increments" else 1.0
    least = math.inf
    for times in range(1, period // 2 + 1):
        seen = _stretches(record, period, stretches, times)
        offset = float(np.linalg.norm(_alternation(record, seen)))
        least = min(least, max(offset / GRAVITY_EQUATOR / unit, _turn(record, seen)))
        if least == 0.0:
            break
    return _off_the_mean(period) * least


def _step(values: Array) -> float:
    """The smallest step between two values of a channel that is written in few levels; of another one that of its rounding."""
    rounding = ROUNDING * float(np.abs(values).max())
    if has_many_levels(values, 0.25):
        return rounding
    levels, _ = levels_of(values)
    return float(np.diff(levels).min()) if 1 < len(levels) < len(values) // 4 else rounding
