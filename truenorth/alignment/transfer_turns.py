"""How a slave turns at the rows of a master, known well enough to tell a delay.

An attitude row tells a delay by ``-w tau``. The tilt that gyros walk between two rows hides slow changes of that product, so what
tells it is the change of `w` from row to row; and of a noisy gyro that is noise. Its squares count as knowledge: a consumer
gyro at 100 Hz, on a ship that rolls, knew the delay to 1.5 ms where one with a tenth of its noise knew it to 4, and was nine of
these off. A velocity row tells it by the master's acceleration, which is the slave's less that of the arm between them,
``w' x r``: at 30 m four samples of that gyro make 4 m/s^2 of noise.

So rate and spin are means over as long as it takes until they stand out; where none does, such a row tells of no delay. A mean
that looks ahead and behind makes the column too small in a fast roll, which costs knowledge and no truth: rows are taken at the
delay found so far. The rule is ours.

A rate that vibrates stands out, and its phase is unknown where the delay is (:mod:`truenorth.alignment.transfer_shaken`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from truenorth.core.remembered import remembered
from truenorth.records import ImuRecord
from truenorth.state.limits import limit
from truenorth.strapdown.increments import increments, interval_lengths

Array = NDArray[np.float64]

INSTANT = 0.85  # variance of the rate at an epoch, of that of a sample (`describe_instant`)
HALVES = (0.05, 0.1, 0.2, 0.4, 0.8)  # s, before and after
SHARE = 0.01  # of what tells the delay, that may be noise
ASKEW = 5e-4  # s: of a false delay, by what the noise of a spin and of a velocity's arm have in common
SLOPE = 0.2  # s over which derivatives of the slave's rate and force are taken, before and after
SHARP, APART = 0.05, 4.0  # s, and sigmas: where such a short time differs by more from that, it is believed
# The acceleration of a velocity row: by the master or the instant, by a mean spin, or not.
KNOWN, MEAN, UNKNOWN = 0.0, 1.0, 2.0
# Points of the fast part a row: a straight line from one to the next is a tone of five rows a period within 1 %.
FINER = 4


class Split:
    """A slave's rates, split at a frequency: what a delay tells the phase of, and the rest.

    All passes of a filter over a slave ask for the same; each part is worked out once, where it is asked for.

    Parameters
    ----------
    rates : (N, 3) array, rad/s
        Means over intervals that are all alike.
    begins, interval : float, s
        The middle of the first interval, and its length.
    edge : float, Hz
        What is slower is slow, what is faster than twice of it is not.
    """

    def __init__(self, rates: Array, begins: float, interval: float, edge: float) -> None:
        self.begins, self.interval, self.edge, self.rows = begins, interval, edge, len(rates)
        self._whole = np.fft.rfft(np.concatenate([rates, rates[::-1]]), axis=0)  # there and back: no jump at the ends
        self._f = np.arange(len(self._whole))[:, None] / (2.0 * len(rates) * interval)
        self._passed = 0.5 * (1.0 + np.cos(math.pi * np.clip(self._f / edge - 1.0, 0.0, 1.0)))

    @property
    def _beyond(self) -> NDArray[np.complex128]:
        return np.asarray(self._whole * (1.0 - self._passed))

    @cached_property
    def variance(self) -> float:
        """Of what is beyond the frequency, (rad/s)^2."""
        return float(np.mean(np.abs(self._beyond[1:]) ** 2)) / (2.0 * self.rows)

    @cached_property
    def slow(self) -> Array:
        """(FINER N, 3) rad/s, FINER points a row."""
        return self._points(self._whole * self._passed)

    @cached_property
    def spin(self) -> Array:
        """(FINER N, 3) rad/s^2: the derivative of `slow`."""
        return self._points(self._whole * self._passed * (2j * math.pi * self._f))

    @cached_property
    def fast(self) -> Array:
        """(FINER N, 3) rad/s: what is beyond."""
        return self._points(self._beyond)

    @cached_property
    def quarter(self) -> Array:
        """(FINER N, 3) rad/s: the same, a quarter of a period later."""
        return self._points(-1j * self._beyond)

    def _points(self, spectrum: NDArray[np.complex128]) -> Array:
        count = self.rows * FINER
        return np.asarray(np.fft.irfft(spectrum, 2 * count, axis=0)[:count] * FINER)

    def at(self, points: Array, times: Array) -> Array:
        """(M, 3) a part at some times, s."""
        then = self.begins + np.arange(len(points)) * self.interval / FINER
        return np.stack([np.interp(times, then, axis) for axis in points.T], axis=1)


class Shaken:
    """What a slave's rates are at the rows of a master, rad/s, (M, 3) each, body axes.

    Parameters
    ----------
    split : Split
    times : (M,) array, s
        When the rows held.
    """

    def __init__(self, split: Split, times: Array) -> None:
        self.split, self.times = split, times

    def alike(self, rates: Array) -> Shaken:
        """Other rates (N, 3) of the same samples, split at the same frequency."""
        own = self.split
        return Shaken(Split(rates, own.begins, own.interval, own.edge), self.times)

    @property
    def slow(self) -> Array:
        """Of which the delay tells the phase."""
        return self.split.at(self.split.slow, self.times)

    @property
    def spin(self) -> Array:
        """Its derivative, rad/s^2."""
        return self.split.at(self.split.spin, self.times)

    @property
    def fast(self) -> Array:
        """The rest."""
        return self.split.at(self.split.fast, self.times)

    @property
    def quarter(self) -> Array:
        """The same, a quarter of a period later."""
        return self.split.at(self.split.quarter, self.times)


def turns_at(slave: ImuRecord, times: Array, walk: float, sigma: float) -> tuple[Array | None, float]:
    """(M, 3) mean rates about some times, s, and the variance of a component; the rate of the instant does where they are None.

    An infinite variance: no mean stands out of its noise.

    Parameters
    ----------
    walk : float, rad/sqrt(s)
        Angular random walk of the gyros.
    sigma : float, rad
        Noise of a row, which hides what the gyros walk until that is as much.
    """
    if walk == 0.0 or len(times) < 2:
        return None, 0.0
    T, apart = slave.interval, float(np.median(np.diff(times)))
    rows = max(1, min(len(times) // 4, round(2.0 * (sigma / walk) ** 2 / apart)))
    apart *= rows

    def stands_out(rate: Array, variance: float, length: float) -> bool:
        inside = (times > slave.time[0] + length) & (times < slave.time[-1] - length)
        changes = rate[inside][rows:] - rate[inside][:-rows]
        # Means that overlap have the noise in common that both hold.
        noise = 6.0 * variance * min(1.0, apart / length)
        return len(changes) > 0 and noise < SHARE * float(np.mean(np.sum(changes**2, axis=1)))

    if stands_out(_mean_rate(slave, times, 2.0 * T), INSTANT * walk**2 / T, T):
        return None, INSTANT * walk**2 / T
    for half in HALVES:
        rate, variance = _mean_rate(slave, times, half), walk**2 / (2.0 * half)
        if half > 2.0 * T and stands_out(rate, variance, 2.0 * half):
            return rate, variance
    return None, math.inf


def spins_at(slave: ImuRecord, times: Array, walk: float, arm: float, push: float) -> tuple[Array | None, float]:
    """(M, 3) mean derivatives of the rate about some times, and how the acceleration of a velocity row is known.

    Parameters
    ----------
    walk : float, rad/sqrt(s)
    arm : float, m
        Length of the lever arm.
    push : float, m/s^2
        RMS of the master's acceleration.
    """
    T, enough = slave.interval, SHARE * push**2
    if 2.0 * arm**2 * 0.25 * walk**2 / T**3 <= enough:
        return None, KNOWN
    for half in HALVES:
        # What a spin has in common with a rate off its middle is as a part of it: walk^2 / half^2.
        common = (walk * arm / half) ** 2
        if half > 2.0 * T and 4.0 * common / half < enough and common < ASKEW * push**2:
            return spins_of(slave, times, half), MEAN
    return None, UNKNOWN


def spins_of(slave: ImuRecord, times: Array, half: float) -> Array:
    """(M, 3) mean derivatives of the rate about some times, over so long before and after, rad/s^2."""
    late, early = (_mean_rate(slave, times + s, 0.5 * half) for s in (0.5 * half, -0.5 * half))
    return np.asarray((late - early) / half)


def rates_at(slave: ImuRecord, times: Array) -> Array:
    """(M, 3) rates at some times, rad/s: means over two samples before and after."""
    return _mean_rate(slave, times, 2.0 * slave.interval)


def slopes_at(slave: ImuRecord, times: Array) -> Array:
    """(M, 6) derivatives of the slave's rate and specific force; NaN at the ends.

    From means over `SLOPE` before and after; where those over `SHARP` differ by more than their noise, these: a mean that looks
    ahead would see a manoeuvre begin before it does, and take the agreement of both forces until then for knowledge of the delay.
    """
    edges = np.append(slave.time[0] - slave.steps[0], slave.time)
    whole = np.vstack([np.zeros(6), np.cumsum(np.column_stack(increments(slave)), axis=0)])

    def over(h: float) -> Array:
        before, now, after = (
            np.column_stack([np.interp(times + shift, edges, column) for column in whole.T]) for shift in (-h, 0.0, h)
        )
        return np.asarray((after - 2.0 * now + before) / h**2)

    smooth, sharp = over(SLOPE), over(max(SHARP, slave.interval))
    inside = (times - SLOPE >= edges[0]) & (times + SLOPE <= edges[-1])
    apart = np.abs(sharp - smooth)
    noise = 1.4826 * np.median(apart[inside], axis=0) if inside.any() else 0.0
    moved = np.any(apart > APART * noise, axis=1)[:, None]  # all six alike: their columns tell delay from arm
    return np.where(inside[:, None], np.where(moved, sharp, smooth), np.nan)


def push_of(time: Array, v_n: Array) -> float:
    """RMS acceleration, m/s^2, of velocities (M, 3), over a second each."""
    rows = max(1, min(len(time) - 1, round(1.0 / float(np.median(np.diff(time)))))) if len(time) > 1 else 0
    known = np.isfinite(v_n).all(axis=1)
    if rows == 0 or np.count_nonzero(known) <= rows:
        return 0.0
    t, v = time[known], v_n[known]
    return math.sqrt(float(np.mean(np.sum(((v[rows:] - v[:-rows]) / (t[rows:] - t[:-rows])[:, None]) ** 2, axis=1))))


def shaken(slave: ImuRecord, times: Array, walk: float, delay_sigma: float) -> Shaken | None:
    """Rates at some times, s, by what a delay of this sigma tells of their phase; None where they hardly have a fast part.

    Parameters
    ----------
    walk : float, rad/sqrt(s)
        Angular random walk of the gyros.
    delay_sigma : float, s
    """
    T = slave.interval
    edge = 1.0 / (2.0 * math.pi * delay_sigma) if delay_sigma > 0.0 else math.inf  # Hz: a radian of phase
    if 2.0 * edge >= 0.5 / T:
        return None
    split = _split(slave)(edge)
    return None if split.variance < limit("vibrates") * walk**2 / T else Shaken(split, times)


@remembered
def _split(slave: ImuRecord) -> Callable[[float], Split]:
    """A slave's rates, split at a frequency in Hz; the last answer is remembered."""
    rates, begins, T = *_even_rates(slave), slave.interval
    return lru_cache(maxsize=1)(lambda edge: Split(rates, begins, T, edge))  # which does not hold the slave


def _even_rates(slave: ImuRecord) -> tuple[Array, float]:
    """(N, 3) mean rates over intervals that are all alike, rad/s, and the middle of the first one, s.

    Where rows are lost, what turned in their time is spread over it: rows that are counted without it would put the rest of a log
    too early.
    """
    T = slave.interval
    knots = np.append(slave.time[0] - interval_lengths(slave)[0], slave.time)
    turned = np.vstack([np.zeros(3), np.cumsum(increments(slave)[0], axis=0)])
    even = knots[0] + T * np.arange(round((knots[-1] - knots[0]) / T) + 1)
    angles = np.stack([np.interp(even, knots, axis) for axis in turned.T], axis=1)
    return np.diff(angles, axis=0) / T, float(knots[0] + 0.5 * T)


def _mean_rate(slave: ImuRecord, times: Array, half: float) -> Array:
    """(M, 3) over so long before and after."""
    edges = np.append(slave.time[0] - slave.steps[0], slave.time)
    angle = np.vstack([np.zeros(3), np.cumsum(increments(slave)[0], axis=0)])
    late, early = (np.stack([np.interp(times + s, edges, a) for a in angle.T], axis=1) for s in (half, -half))
    return np.asarray((late - early) / (2.0 * half))
