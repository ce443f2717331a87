"""How late is a master, before any filter: its rates and forces held against the slave's at all shifts of time.

Rates compare axis by axis where the master gives attitude: a constant bias and a mounting of some degrees do not matter.
Where it gives velocity alone, the length of the specific force compares; that needs acceleration of the vehicle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.records import ImuRecord, MasterRecord
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

GRID = 0.02  # s; finer rows of a master are not used
WINDOW = {"rate": 0.2, "force": 1.0}  # s over which the signals are averaged
SHORTEST = 10.0  # s that both must have in common
SURE = 0.5  # correlation below this is no agreement
# Log-likelihood by which the peak must exceed another elsewhere; signals taken as white beyond their window
UNIQUE = 20.0
MORE = (
    1.2  # times the changes of motion that a shift brings together: what a mirrored log must show to be taken for one
)
CHANCE = 5.0  # sigmas by which a correlation must exceed that of unrelated signals

FEWEST = 3.0  # windows that must move: the first row of a turn at the end of a log agrees with any row of it


class Found(NamedTuple):
    """A delay that the motion itself shows."""

    delay: float  # s; of the master's stamps behind the slave's clock
    correlation: float  # of the signals at that shift
    rival: float  # the highest correlation elsewhere
    sure: bool  # the correlation is high, no chance, and the only one
    gain: float = 0.0  # log-likelihood of the agreement at that shift
    shared: float = 0.0  # changes of motion that both logs show there: sum of their products
    agree: bool = False  # the correlation is high and no chance, whether it is the only one or not


def find_delay(slave: ImuRecord, master: MasterRecord, C_mb: Array, *, mirrored: bool = False) -> Found:
    """Find the delay of a master by correlation, the likeliest of all at which both logs have 10 s in common.

    Where a manoeuvre lies upon the next one, logs agree as well as where all lie upon themselves, or by chance better, but have
    less in common: it is the likelihood of an agreement that says how much it is worth.

    Parameters
    ----------
    C_mb : (3, 3) array
        Slave to master axes, within some ten degrees.
    mirrored : bool
        Whether the slave's rows are taken in reversed order, under the stamps that they have.

    Returns
    -------
    Found
        Not sure, with NaN, where the logs are too short.
    """
    both = _compared(slave, master, C_mb, mirrored=mirrored)
    if both is None:
        return Found(math.nan, 0.0, 0.0, False)
    kind, step, a, b, shifts, score, common = both
    # Shift k puts row j of the master on row j + k of the slave: delay = (start of master) - (start of slave) - k step.
    offset = float(master.time[0] - slave.time[0])
    gains = _gains(score, common) * step / WINDOW[kind] * a.shape[1]
    near = np.abs(shifts - shifts[int(np.argmax(gains))]) * step <= WINDOW[kind]
    k = int(np.argmax(np.where(near, score, -np.inf)))  # a row more in common is no better agreement
    peak = float(score[k])
    fraction, _ = _peak(score, k)
    elsewhere = np.abs(shifts - shifts[k]) * step > 2.0 * WINDOW[kind]
    rival = float(np.max(score[elsewhere], initial=0.0))
    independent = float(common[k]) * step / WINDOW[kind] * a.shape[1]
    better = float(gains[k] - np.max(gains[elsewhere], initial=0.0))
    lasting = min(_lasting(a), _lasting(b)) * step > FEWEST * WINDOW[kind]
    agree = lasting and peak > max(SURE, CHANCE / math.sqrt(independent))
    shared = _changes(a, b, round(shifts[k]), max(1, round(WINDOW[kind] / step)))
    return Found(
        float(offset - step * (shifts[k] + fraction)),
        peak,
        rival,
        agree and better > UNIQUE,
        float(gains[k]),
        shared,
        agree,
    )


def _gains(score: Array, common: Array) -> Array:
    """Log-likelihood of the agreement of so many independent values, at each shift, over that of unrelated signals."""
    return np.asarray(-0.5 * common * np.log(np.maximum(1.0 - np.maximum(score, 0.0) ** 2, 1e-12)))


def delay_by_arm(slave: ImuRecord, master: MasterRecord, arm: Array, sigma: float) -> float:
    """By how much (s) an arm moves the delay at which the lengths of both forces agree best; nothing where rates are compared.

    What the arm adds to the slave's force, ``D r = w' x r + w x (w x r)``, moves the best agreement by the part of it that looks
    like the force of another moment: ``<f', u D r>/<f', f'>``, with u the direction of the force and f its length.

    Parameters
    ----------
    arm, sigma : (3,) array and float, m
        From the master to the slave, slave axes, and its one-sigma along each axis: the whole arm counts, as no force is put right
        by it before.
    """
    if master.C_nb is not None:
        return 0.0
    force, rate = _slave_means(slave, "force", GRID), _slave_means(slave, "rate", GRID)
    length = np.linalg.norm(force, axis=1)
    slope, spin = np.gradient(length, GRID), np.gradient(rate, GRID, axis=0)
    window = np.full(round(WINDOW["force"] / GRID), GRID / WINDOW["force"])
    power = float(slope @ slope)
    if len(length) < len(window) or power == 0.0:
        return 0.0
    towards = force / np.maximum(length, 1e-12)[:, None]
    added = [np.sum(towards * (np.cross(spin, e) + np.cross(rate, np.cross(rate, e))), axis=1) for e in np.eye(3)]
    moved = np.array([slope @ np.convolve(one, window, "same") for one in added]) / power
    return abs(float(moved @ arm)) + sigma * float(np.linalg.norm(moved))


def agreement(slave: ImuRecord, master: MasterRecord, C_mb: Array, delay: float) -> float:
    """Correlation of both logs' motion where the master is late by this delay, s; -1 where they have nothing in common there."""
    both = _compared(slave, master, C_mb)
    if both is None:
        return -1.0
    _, step, _, _, shifts, score, _ = both
    near = np.abs(shifts - (float(master.time[0] - slave.time[0]) - delay) / step) < 2.0
    if not near.any():
        return -1.0
    first = int(np.argmax(near))
    return _peak(score, first + int(np.argmax(score[near])))[1]


def _peak(score: Array, k: int) -> tuple[float, float]:
    """Where the parabola through a highest score and its neighbours is highest, in steps from it, and how high, 1 at the most.

    A score on a slope, with a higher neighbour, stands as it is: the top of its parabola is elsewhere.
    """
    peak = float(score[k])
    if not (0 < k < len(score) - 1 and min(score[k - 1], score[k + 1]) > -1.0):
        return 0.0, peak
    left, right = float(score[k - 1]), float(score[k + 1])
    bend = left - 2.0 * peak + right
    if bend >= 0.0 or max(left, right) > peak:
        return 0.0, peak
    return 0.5 * (left - right) / bend, min(peak - (left - right) ** 2 / (8.0 * bend), 1.0)


def runs_backwards(slave: ImuRecord, master: MasterRecord, C_mb: Array, delay: float, slack: float) -> bool:
    """Whether one log in reversed order fits the other under the stamps as they are better than any shift does.

    A turn looks the same from both ends. The logs of a flight with two turns, one log reversed, agree at a shift that brings one
    turn upon itself, and leaves the other out. Reversed back they agree as well, in more of the motion, and no clock is off. So the
    mirrored agreement must be the likelier one by as much as a peak must be, show `MORE` changes of motion, and lie at the delay
    that was said (`delay` within `slack`, s): a single turn changes no more mirrored, and a clock that is off is at no such delay.
    """
    straight, mirrored = find_delay(slave, master, C_mb), find_delay(slave, master, C_mb, mirrored=True)
    # Of a master that is reversed, the mirrored slave is as late as the middles of the logs are apart, twice.
    middles = float(master.time[0] + master.time[-1] - slave.time[0] - slave.time[-1])
    slack += WINDOW["rate" if master.C_nb is not None else "force"]
    return (
        mirrored.sure
        and mirrored.gain - straight.gain > UNIQUE
        and mirrored.shared > MORE * straight.shared
        and min(abs(mirrored.delay - delay), abs(mirrored.delay - (middles - delay))) < slack
    )


def _compared(
    slave: ImuRecord, master: MasterRecord, C_mb: Array, *, mirrored: bool = False
) -> tuple[str, float, Array, Array, Array, Array, Array] | None:
    """Kind and step (s) of both signals, these, shifts, their correlation there, rows in common; None without `SHORTEST` s of any.

    A shift at which less is in common has -1.
    """
    kind = "rate" if master.C_nb is not None else "force"
    step = max(GRID, master.interval) if master.interval < WINDOW[kind] else 0.5 * WINDOW[kind]
    a, b = _slave_signal(slave, kind, step), _master_signal(master, C_mb, kind, step)
    a = a[::-1] if mirrored else a
    least = round(SHORTEST / step)
    if len(a) < least or len(b) < least:
        return None
    shifts, score, common = _correlations(a, b)
    possible = common >= least
    return (kind, step, a, b, shifts, np.where(possible, score, -1.0), common) if possible.any() else None


def _changes(a: Array, b: Array, shift: int, apart: int) -> float:
    """What both change within so many rows, at a shift. A steady rate, however long, counts nothing, nor does noise in the mean."""
    first, second = max(shift, 0), max(-shift, 0)
    many = min(len(a) - first, len(b) - second)
    x, y = a[first : first + many], b[second : second + many]
    return float(np.sum((x[apart:] - x[:-apart]) * (y[apart:] - y[:-apart])))


def _lasting(signal: Array) -> float:
    """How many rows carry the power of a signal: about all of one that lasts, one of a single jolt (participation ratio)."""
    power = np.sum((signal - signal.mean(axis=0)) ** 2, axis=1)
    return float(np.sum(power) ** 2 / max(float(np.sum(power**2)), 1e-300))


def _slave_signal(slave: ImuRecord, kind: str, step: float) -> Array:
    mean = _slave_means(slave, kind, step)
    return mean if kind == "rate" else np.linalg.norm(mean, axis=1, keepdims=True)


def _slave_means(slave: ImuRecord, kind: str, step: float) -> Array:
    dtheta, dvel = increments(slave)
    whole = np.vstack([np.zeros((1, 3)), np.cumsum(dtheta if kind == "rate" else dvel, axis=0)])
    time = np.concatenate([[slave.time[0] - slave.interval], slave.time])
    return _means(time, whole, slave.time[0], step, WINDOW[kind])


def _master_signal(master: MasterRecord, C_mb: Array, kind: str, step: float) -> Array:
    if kind == "rate":
        assert master.C_nb is not None
        C = master.C_nb @ C_mb
        turns = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:])
        whole = np.vstack([np.zeros((1, 3)), np.cumsum(turns, axis=0)])
        return _means(master.time, whole, master.time[0], step, WINDOW[kind])
    assert master.v_n is not None
    force = _means(master.time, master.v_n, master.time[0], step, WINDOW[kind])
    force[:, 2] += GRAVITY_EQUATOR
    return np.linalg.norm(force, axis=1, keepdims=True)


def _means(time: Array, whole: Array, start: float, step: float, window: float) -> Array:
    """Mean rates over a window about each time of a grid from `start` on, of integrals `whole` at `time`."""
    count = max(0, math.floor((time[-1] - start) / step) + 1)
    t = start + step * np.arange(count)
    ends = [np.clip(t + sign * 0.5 * window, time[0], time[-1]) for sign in (-1, 1)]
    low, high = (np.stack([np.interp(t, time, column) for column in whole.T], axis=1) for t in ends)
    return np.asarray((high - low) / (ends[1] - ends[0])[:, None])


def _correlations(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """Shifts, correlation coefficient of ``a[j + shift]`` with ``b[j]`` over all columns, and rows in common."""
    from scipy.fft import irfft, next_fast_len, rfft

    length = next_fast_len(len(a) + len(b))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)

    def lagged(x: Array, y: Array) -> Array:
        return np.asarray(irfft(rfft(x, length, axis=0) * np.conj(rfft(y, length, axis=0)), length, axis=0))

    shifts = np.arange(-(len(b) - 1), len(a))
    ones_a, ones_b = np.ones((len(a), 1)), np.ones((len(b), 1))
    at = shifts % length
    common = np.round(lagged(ones_a, ones_b)[at, 0])
    # Means and energies are those of the rows in common at each shift.
    many = np.maximum(common, 1.0)[:, None]
    sum_a, sum_b = lagged(a, ones_b)[at], lagged(ones_a, b)[at]
    power_a, power_b = lagged(a**2, ones_b)[at] - sum_a**2 / many, lagged(ones_a, b**2)[at] - sum_b**2 / many
    product = lagged(a, b)[at] - sum_a * sum_b / many
    scale = np.sqrt(np.maximum(power_a.sum(axis=1), 0.0) * np.maximum(power_b.sum(axis=1), 0.0))
    floor = 1e-12 * math.sqrt(float(np.sum(a**2) * np.sum(b**2)))
    return (
        shifts.astype(np.float64),
        np.divide(product.sum(axis=1), scale, out=np.zeros_like(scale), where=scale > floor),
        common,
    )
