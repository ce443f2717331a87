"""Signals that tell motion from noise: even-rate means, white noise, wander of the angle, acceleration.

A few passes over the samples.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import length_of, normalised, quaternion_from_rotation_vector, quaternion_product, rotate
from truenorth.core.compiled import compiled
from truenorth.core.errors import DataError
from truenorth.core.remembered import remembered
from truenorth.records import ImuRecord
from truenorth.records.one_pass import passed, rows_of_cell

Array = NDArray[np.float64]

ARCSEC = np.pi / (180.0 * 3600.0)
WINDOW = 10  # s, over which the angle's wander and the gain of speed are judged
LEVEL_WINDOW = 31  # s, odd; the direction of gravity is the median over it
# Three arcseconds are what spoils north by a degree in 15 s of static averaging.
STILL_ANGLE = 3.0 * ARCSEC
SEEN_TURN = np.radians(2.0)  # of gravity in body axes within WINDOW: accelerometers that shake still see it
MOST_CELLS = 10_000_000  # eleven days
QUARTER_TURN = np.radians(90.0)
UNTURNED = 0.1  # part of the turn that gyros show, below which gravity has not turned at all
SCATTERED = 0.5  # length of the mean of unit vectors, below which gravity has no one direction
MISALIGNED = 0.1  # rad: of the gyros and of a turntable's axis, at the most
SURE_BIAS = float(np.radians(0.1))  # rad/s; any sensor may have as much
LARGEST_BIAS = np.radians(3.0)  # rad/s; above this a constant rate is a turn, whatever the sensor


@remembered
def even_rates(record: ImuRecord) -> tuple[float, Array]:
    """Cell length (about 0.1 s) and (6, cells) mean rates and specific forces on an even grid.

    Raises
    ------
    DataError
        A log of a few rows over so long a time that the grid does not fit into memory: it names the longest gap. Rows that came
        in blocks, stamped one right after the other.
    """
    rows_a_cell = rows_of_cell(record)
    interval = rows_a_cell * record.interval
    if not record.gaps.size and abs(record.duration / len(record) - record.interval) < 0.01 * record.interval:
        mean = passed(record).cells
        return interval, mean if record.kind == "rates" else mean / record.interval
    data = np.hstack([record.gyro, record.accel])
    # Uneven time: integrals to the cell edges, no rate inside a gap other than the mean of its ends.
    steps = np.minimum(record.steps, 1.5 * record.interval)[:, None]
    cumulated = np.cumsum(data * steps if record.kind == "rates" else data, axis=0)
    clock = np.cumsum(steps)
    cells = int(record.duration / interval)
    if cells > MOST_CELLS + 100 * len(record):
        widest = int(np.argmax(record.steps))
        raise DataError(
            f"{record.source}: row {widest + 1}, column time: {record.steps[widest]:.0f} s after the row before, in a log of "
            f"{len(record)} rows; expected rows of one run: take the part before or after (`record.between`)"
        )
    edges = record.time[0] - record.interval + interval * np.arange(cells + 1)
    covered = np.interp(edges, record.time, clock, left=0.0)
    length = np.diff(covered)
    full = length > 0.5 * interval
    if not full.any():
        raise DataError(
            f"{record.source}: column time: half of the rows come {record.interval:.3g} s after the row before, but {len(record)} "
            f"rows take {record.duration:.0f} s; expected the times of the samples: rows that arrive in blocks were stamped as "
            "they arrived"
        )
    rates = np.empty((6, cells))
    middle = 0.5 * (edges[1:] + edges[:-1])
    for channel in range(6):
        integral = np.interp(covered, np.append(0.0, clock), np.append(0.0, cumulated[:, channel]))
        rates[channel] = np.interp(middle, middle[full], np.diff(integral)[full] / length[full])
    return interval, rates


def second_means(signal: Array, per_second: int) -> Array:
    """(k, seconds) means of (k, cells)."""
    return np.asarray(signal.reshape(len(signal), -1, per_second) @ np.ones(per_second) / per_second)


def white_noise(record: ImuRecord) -> Array:
    """(6,) random walk of the quiet quarter of the record: the least ``sigma(tau) sqrt(tau)`` of several tau.

    The least, because the angle of a disturbed base is bounded: its Allan deviation falls faster than white
    noise's at averaging times above the disturbance's period, and stays small far below it.
    """
    return passed(record).white_noise


def angle_wander(rates: Array, interval: float, per_second: int) -> Array:
    """(3, windows) RMS of the angle about its straight line, in windows of 10 s that start at each second."""
    seconds = rates.shape[1] // per_second
    count = min(WINDOW, seconds)
    sums, found = np.empty((3, 4, seconds)), np.empty((3, seconds - count + 1))
    _wander(np.ascontiguousarray(rates), interval, per_second, count, sums, found)
    return found


@compiled
def _wander(rates: Any, interval: float, per_second: int, count: int, sums: Any, found: Any) -> None:
    """:func:`angle_wander` (3, windows) of `count` seconds; of each second sums (3, 4, seconds) stand about the angle before it."""
    length = count * per_second
    square_of_line = length * (length * length - 1.0) / 12.0
    for i in range(len(rates)):
        angle = 0.0
        for s in range(sums.shape[2]):
            each = square = place = since = 0.0
            for k in range(per_second):
                since += rates[i, s * per_second + k] * interval
                each += since
                square += since * since
                place += k * since
            sums[i, 0, s], sums[i, 1, s], sums[i, 2, s], sums[i, 3, s] = each, square, place, angle
            angle += since
        for first in range(found.shape[1]):
            total = energy = moment = 0.0
            for s in range(first, first + count):
                before = (
                    sums[i, 3, s] - sums[i, 3, first]
                )  # about the angle at the window's beginning: no digits are lost
                each = sums[i, 0, s] + per_second * before
                total += each
                energy += sums[i, 1, s] + before * (2.0 * sums[i, 0, s] + per_second * before)
                moment += (
                    sums[i, 2, s] + before * (0.5 * per_second * (per_second - 1)) + (s - first) * per_second * each
                )
            mean, slope = total / length, moment - 0.5 * (length - 1) * total
            found[i, first] = np.sqrt(
                max(energy / length - mean * mean - slope * slope / (length * square_of_line), 0.0)
            )


def rate_bias(rates: Array, wander: Array, per_second: int, angle_noise: Array) -> Array:
    """(3,) constant part of the rate: mean over the windows of 10 s, those of little motion counting most.

    The largest bias believed grows with the noise, as it does in the market: 50 sigma of a one-second mean,
    at least 0.1 deg/s, at most 3 deg/s. A constant turn slower than that is indistinguishable from bias.
    """
    length = min(WINDOW * per_second, rates.shape[1])
    seconds = np.ascontiguousarray(rates).reshape(3, -1, per_second) @ np.ones(per_second)
    mean = _neighbours(seconds, length // per_second) / length
    limit = min(max(50.0 * length_of(angle_noise), SURE_BIAS), LARGEST_BIAS)
    bias = _constant_part(mean, wander)
    if length_of(bias) < limit:
        return bias
    believable = np.linalg.norm(mean, axis=0) < limit
    if not believable.any():
        return np.zeros(3)
    bias = _constant_part(mean[:, believable], wander[:, believable])
    return bias if length_of(bias) < limit else np.zeros(3)


def _constant_part(mean: Array, wander: Array) -> Array:
    """(3,) mean of windows (3, windows), those of little motion counting most."""
    off = mean - median_of_rows(mean)
    drift = np.einsum("cw,cw->w", off, off) * (WINDOW**2 / 12.0)
    weight = 1.0 / (wander.max(axis=0) ** 2 + drift + STILL_ANGLE**2)
    return np.asarray(mean @ weight / weight.sum())


def median_of_rows(values: Array) -> Array:
    """(k, 1) median of each row: :func:`numpy.median`, which takes longer to begin."""
    half = values.shape[1] // 2
    before = half if values.shape[1] % 2 else half - 1
    parted = values.copy()
    parted.partition((before, half), axis=1)
    return np.asarray(0.5 * (parted[:, half : half + 1] + parted[:, before : before + 1]))


def bias_by_gravity(rate: Array, force: Array) -> Array | None:
    """(3,) mean rate of gyros that turn while gravity does not: a bias, however large; None where gravity may have turned.

    A body that turned by the part of that rate across gravity would see gravity's direction turn. A turn about the vertical
    leaves gravity where it is: that part is a bias only in company of the other, which is more than a misalignment of it.

    Parameters
    ----------
    rate, force : (3, m) arrays
        Means of seconds.
    """
    mean = rate.mean(axis=1)
    up = force / np.maximum(np.linalg.norm(force, axis=0), 1e-9)
    vertical = up.mean(axis=1)
    if length_of(vertical) < SCATTERED:
        return None
    along = vertical * (mean @ vertical) / (vertical @ vertical)
    across = length_of(mean - along)
    if across < MISALIGNED * length_of(along):
        return None
    lag = min(WINDOW, max(1, int(QUARTER_TURN / max(across, 1e-9))))
    if across * lag < SEEN_TURN or rate.shape[1] < 2 * lag:
        return None
    turned = np.linalg.norm(up[:, lag:] - up[:, :-lag], axis=0)
    return mean if float(np.quantile(turned, 0.9)) < UNTURNED * across * lag else None


def unturned(angles: Array, vectors: Array) -> Array:
    """(3, n) vectors of a body after each of its rotations (3, n), in the axes that it had before the first."""
    found = np.empty(vectors.shape)
    _unturn(np.ascontiguousarray(angles), np.ascontiguousarray(vectors), found)
    return found


@compiled
def _unturn(angles: Any, vectors: Any, found: Any) -> None:
    q = (1.0, 0.0, 0.0, 0.0)
    for k in range(angles.shape[1]):
        turn = quaternion_from_rotation_vector((angles[0, k], angles[1, k], angles[2, k]))
        q = normalised(quaternion_product(q, turn))
        found[0, k], found[1, k], found[2, k] = rotate(q, (vectors[0, k], vectors[1, k], vectors[2, k]))


def acceleration(steady: Array, body: Array) -> tuple[Array, Array, Array]:
    """(m,) acceleration of each second, (m,) its norm averaged, as a vector, over 10 s, and (m,) the least of that by any level.

    The smallest of three deviations of the specific force over 31 s: in axes that do not turn, from the
    median and from a line (a gyro bias makes the level drift); in body axes, from the median (there, a turned
    accelerometer bias stays constant). What neither drift, tilt nor bias explains is acceleration.
    """
    level, slope = _running_level(steady)
    drifting = steady - slope
    deviations = np.stack([steady - level, drifting, body - _running_median(body)])
    size = np.linalg.norm(deviations, axis=1)
    over = np.where(size[0] < size[1], deviations[0], drifting)
    gain = _lengths(box_mean(over, WINDOW))
    least = np.minimum(gain, np.minimum(_lengths(_beyond(steady)), _lengths(_beyond(drifting))))
    return size.min(axis=0), gain, least


def _lengths(x: Array) -> Array:
    """(m,) of vectors (3, m)."""
    return np.asarray(np.linalg.norm(x, axis=0))


def _beyond(signal: Array) -> Array:
    """(3, m) mean of some 10 s around each second over that of the rest of the 31 s around it; of a short record over zero.

    A level that is a median is off where few values come again and again: of a sway of 4 s, whose seconds have as many, by up to
    its amplitude. That is in both means. A mean over 10 s leaves an eighth of a sway of 4 s, that of means over 5 and
    then 6 s a third of that, and of a start as much as the one over 10 s: of 90 bases that start by .1 to 2.5 m/s^2 over 2 to 12 s
    the same 68 are seen to move, of 240 that sway by centimetres fewer.
    """
    seconds = signal.shape[1]
    if seconds < LEVEL_WINDOW:
        return box_mean(signal, WINDOW)
    five = _neighbours(signal, WINDOW // 2) / (WINDOW // 2)
    inner = (_neighbours(five, WINDOW // 2 + 1) / (WINDOW // 2 + 1)).take(offset(seconds, WINDOW), axis=1)
    rest = (LEVEL_WINDOW * box_mean(signal, LEVEL_WINDOW) - WINDOW * inner) / (LEVEL_WINDOW - WINDOW)
    return np.asarray(inner - rest)


def _running_level(signal: Array) -> tuple[Array, Array]:
    """(3, m) median, and line through the medians of both halves, of the 31 s around each second.

    At the ends the window is the 31 s that fit.
    """
    seconds = signal.shape[1]
    width = min(LEVEL_WINDOW, seconds)
    first = offset(seconds, width)
    within = np.arange(seconds) - first
    half = width // 2
    halves = _medians(signal, half)
    early, late = halves.take(first, axis=1), halves.take(first + (width - half), axis=1)
    line = early + (late - early) * (within - (half - 1) / 2.0) / (width - half)
    return _running_median(signal), line


def _running_median(signal: Array) -> Array:
    """(3, m) median of the 31 s around each second."""
    width = min(LEVEL_WINDOW, signal.shape[1])
    return _medians(signal, width).take(offset(signal.shape[1], width), axis=1)


def _medians(signal: Array, width: int) -> Array:
    """(3, m - width + 1) medians of all windows of so many neighbours."""
    found = np.empty((len(signal), signal.shape[1] - width + 1))
    _sliding_medians(np.ascontiguousarray(signal), np.empty(width), found)
    return found


@compiled
def _sliding_medians(signal: Any, ordered: Any, found: Any) -> None:
    """Medians (c, m - w + 1) of windows of w; `ordered` (w,) is worked in: a value leaves it and the next one finds its place."""
    width = len(ordered)
    for i in range(signal.shape[0]):
        for k in range(signal.shape[1]):
            place = k
            if k >= width:
                place = 0
                for m in range(width - 1):
                    place += ordered[m] < signal[i, k - width]
                while place < width - 1 and ordered[place + 1] < signal[i, k]:
                    ordered[place] = ordered[place + 1]
                    place += 1
            while place > 0 and ordered[place - 1] > signal[i, k]:
                ordered[place] = ordered[place - 1]
                place -= 1
            ordered[place] = signal[i, k]
            if k >= width - 1:
                found[i, k - width + 1] = 0.5 * (ordered[(width - 1) // 2] + ordered[width // 2])


@lru_cache(maxsize=16)
def offset(seconds: int, width: int) -> NDArray[np.intp]:
    """(m,) first second of the window of `width` seconds around each second, kept inside the record; nobody writes to it."""
    first = np.clip(np.arange(seconds) - width // 2, 0, seconds - width)
    first.flags.writeable = False
    return first


def box_mean(signal: Array, width: int) -> Array:
    """(k, m) mean over `width` seconds around each second; at the ends over the last `width` that fit."""
    seconds = signal.shape[1]
    width = min(width, seconds)
    return np.asarray(_neighbours(signal, width).take(offset(seconds, width), axis=1) / width)


def _neighbours(signal: Array, count: int) -> Array:
    """(k, m - count + 1) sums of so many neighbours; twice as many at a time, so that no large sum is taken from another."""
    total = np.zeros((len(signal), signal.shape[1] - count + 1))
    _add_neighbours(np.array(signal, order="C"), count, total)
    return total


@compiled
def _add_neighbours(sums: Any, count: int, total: Any) -> None:
    """Add to zeros (k, m - count + 1) :func:`_neighbours` of `sums` (k, m), which become sums of twice as many at each step."""
    for i in range(sums.shape[0]):
        done, width, last = 0, 1, sums.shape[1]
        while True:
            if count & width:
                for k in range(total.shape[1]):
                    total[i, k] += sums[i, done + k]
                done += width
            if done == count:
                break
            last -= width
            for k in range(last):
                sums[i, k] += sums[i, k + width]
            width *= 2


# ------------------------------------------------------------------------------------------- classification
