"""How the base moves, read from what a first fit leaves of its velocity: white motion and oscillators by maximum likelihood.

Each axis by itself. The number of oscillators and their order are chosen by Schwarz's criterion, which is slower than Akaike's to
take a piece of white noise for an oscillator: the density at zero frequency would be claimed too low. Frequencies and damping are
searched with the debiased Whittle likelihood: the expected periodogram of a tapered series is computed from the model's
autocovariance, so that lines narrower than the resolution, and their leakage, are what they are. The best is then
polished with the exact likelihood, with a smooth trend and the sensors' random walks besides it.

Sources: G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6, 1978; A. M. Sykulski, S. C. Olhede et al., The
debiased Whittle likelihood, Biometrika 106 (2), 2019.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.motion_likelihood import FINER, LOWEST_BIN, Series, finer_grids, motion_of, parameters
from truenorth.errors.sway import AxisMotion, Oscillator

Array = NDArray[np.float64]

LEAST_DAMPING, MOST_DAMPING = 1e-10, 0.7
QUIETEST = 1e-7  # m/s: white motion of a base that does not move
CLEAR = 10.0  # times what the sensors' random walks make there: a peak that is the base's
PEAK_WIDTH = 4  # bins on either side of a peak that belong to it
# Damping with which the search for a sea begins: it narrows as it goes on, but never leaves a single line of a sea's many.
BROAD = (0.1, 0.3)
LINE = 1e-8  # damping with which the search for a line begins
SCORINGS, TRIALS, POLISHES = 25, 6, 12  # iterations at most
DIFFERENCE = 1e-5  # of a logarithm, for derivatives
LONGEST = 2.0  # step of a logarithm, or of a phase in rad
SHORTEST = 1e-4  # part of a step that is tried
WIDER = 1e-3  # difference for second derivatives
LEAST_LEVENBERG = (
    1e-13  # of the diagonal: with less than rounding leaves, two parameters that do the same make a singular matrix
)
CLOSE = 0.02  # of twice the log-likelihood: nearer than this is the maximum
FARTHEST = 30.0  # rad: phase over the log by which a search may move a frequency
MOST = 12.0  # by which it may move any logarithm


def with_guess(series: Series, best: AxisMotion, guess: AxisMotion | None) -> AxisMotion:
    """The likelier of what a search from nothing has found, and what a good guess leads to."""
    return best if guess is None else min(best, climb(series, guess, POLISHES), key=series.score)


def search(series: Series, most: int, start: AxisMotion | None = None) -> AxisMotion:
    """One oscillator after the other, as long as the criterion falls; from nothing, or besides those of a good guess."""
    white = AxisMotion(max(float(np.std(series.detrended)), QUIETEST))
    best = climb(series, white if start is None else start, POLISHES)
    if not series.periodogram[LOWEST_BIN:].any():  # nothing moves: no peak to begin from
        return best
    score = series.score(best)
    for count in range(len(best.oscillators) + 1, most + 1):
        chosen = climb(series, min(_candidates(series, best, count), key=series.score), POLISHES)
        found = series.score(chosen)
        if found >= score:
            break
        best, score = chosen, found
    return best


def _candidates(series: Series, best: AxisMotion, count: int) -> list[AxisMotion]:
    """Motions of so many oscillators, polished: the best of the broad ones, and all lines."""
    broad = [_with_one_more(best, series, order) for order in (1, 2)]
    lines = [_with_one_more(best, series, 1, LINE)]
    if count > 1:  # also all of them anew, each at a peak of its own
        broad += [_at_peaks(series, count, order) for order in (1, 2)]
        lines += [_at_peaks(series, count, 1, LINE)]
    scored = sorted((_score(series, guess) for guess in broad), key=series.score)
    # Whittle's likelihood loses a line's phase: lines are polished from the peak itself.
    return [climb(series, guess, TRIALS) for guess in (*scored[:1], *lines)]


def _with_one_more(motion: AxisMotion, series: Series, order: int, damping: float | None = None) -> AxisMotion:
    """Another oscillator where the periodogram stands out most from what is expected."""
    orders, logs = parameters(motion)
    over = series.periodogram / series.expected(orders, logs[None])[0]
    over[: LOWEST_BIN + 1] = 0.0
    peak = int(np.argmax(over * np.sqrt(series.periodogram)))
    rest = np.delete(series.periodogram, np.r_[:LOWEST_BIN, _near(series, peak)])
    white = min(_white(rest), motion.white)
    return AxisMotion(max(white, QUIETEST), (*motion.oscillators, _oscillator_at(series, peak, order, damping)))


def _at_peaks(series: Series, count: int, order: int, damping: float | None = None) -> AxisMotion:
    """So many oscillators at the highest maxima of the smoothed periodogram."""
    smooth, walked = (
        np.convolve(x, np.ones(PEAK_WIDTH + 1) / (PEAK_WIDTH + 1), "same") for x in (series.periodogram, series.walked)
    )
    smooth[: LOWEST_BIN + 1] = 0.0
    clear = smooth >= CLEAR * walked
    if clear.any():
        smooth[~clear] = 0.0
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(smooth, PEAK_WIDTH), 2 * PEAK_WIDTH + 1)
    peaks = np.flatnonzero((smooth >= windows.max(axis=1)) & (smooth > 0))
    peaks = peaks[np.argsort(smooth[peaks])[::-1]][:count]
    near = np.concatenate([_near(series, int(peak)) for peak in peaks])
    rest = np.delete(series.periodogram, np.r_[:LOWEST_BIN, near])
    items = tuple(_oscillator_at(series, int(peak), order, damping) for peak in peaks)
    return AxisMotion(max(_white(rest), QUIETEST), items)


def _near(series: Series, peak: int) -> NDArray[np.int64]:
    return np.arange(max(peak - PEAK_WIDTH, LOWEST_BIN), min(peak + PEAK_WIDTH + 1, len(series.periodogram)))


def _white(periodogram: Array) -> float:
    """Sigma of the white part of a periodogram: its median's, which exponential scatter puts at log 2 of the mean."""
    return math.sqrt(float(np.median(periodogram)) / math.log(2.0)) if len(periodogram) else QUIETEST


def _oscillator_at(series: Series, peak: int, order: int, damping: float | None = None) -> Oscillator:
    near = _near(series, peak)
    power, w = series.periodogram[near], series.frequencies[near]
    centre = float(np.sum(w * power) / np.sum(power))
    width = math.sqrt(float(np.sum((w - centre) ** 2 * power) / np.sum(power)))
    sigma = math.sqrt(2.0 * float(np.sum(power)) / len(series.detrended))
    if damping is None:
        return Oscillator(order, sigma, centre, float(np.clip(0.5 * width / centre, *BROAD)))
    return Oscillator(order, sigma, _line_frequency(series, centre), damping)


def _line_frequency(series: Series, guess: float) -> float:
    """Where the tapered series' transform is largest: three grids, each finer than the last."""
    tapered, spacing = series.taper_weights * series.detrended, series.frequencies[1]
    for turned in finer_grids(len(series.lags), series.interval):
        grid = guess + spacing * FINER
        power = np.abs(np.sum(turned * (np.exp(-1j * guess * series.lags) * tapered), axis=1))
        guess, spacing = float(grid[np.argmax(power)]), spacing / 10.0
    return guess


class _Scale:
    """Bounds of the logarithms about a guess; a step of a frequency is measured by the phase that it makes over the log."""

    def __init__(self, guess: AxisMotion, duration: float) -> None:
        self.orders, self.centre = parameters(guess)
        size = len(self.centre)
        self.step, self.low, self.high = np.ones(size), np.full(size, -MOST), np.full(size, MOST)
        self.low[0] = min(math.log(QUIETEST) - self.centre[0], 0.0)
        for j, item in enumerate(guess.oscillators):
            self.step[2 + 3 * j] = 1.0 / (item.frequency * duration)
            farthest = min(FARTHEST, MOST / self.step[2 + 3 * j])
            self.low[2 + 3 * j], self.high[2 + 3 * j] = -farthest, farthest
            self.low[3 + 3 * j] = math.log(LEAST_DAMPING / item.damping)
            self.high[3 + 3 * j] = math.log(MOST_DAMPING / item.damping)

    def logs(self, u: Array) -> Array:
        """Logarithms (..., size) at steps (..., size) from the guess."""
        return self.centre + self.step * u

    def motion(self, u: Array) -> AxisMotion:
        return motion_of(self.orders, self.logs(u))

    def clipped(self, u: Array) -> Array:
        return np.minimum(np.maximum(u, self.low), self.high)


def _bounded(step: Array) -> Array:
    """No longer than is allowed: `np.clip` takes thrice as long to begin as this takes."""
    return np.minimum(np.maximum(step, -LONGEST), LONGEST)


def _score(series: Series, guess: AxisMotion) -> AxisMotion:
    """Fisher scoring of the Whittle likelihood, damped as Levenberg's."""
    scale = _Scale(guess, float(series.lags[-1]))
    size = len(scale.centre)
    u, damping = np.zeros(size), 1e-2
    unit = np.eye(size)
    around, least = DIFFERENCE * unit, 1e-6 * unit
    periodogram = series.periodogram[LOWEST_BIN:]

    def expected(points: Array) -> Array:
        return series.expected(scale.orders, scale.logs(points))

    f = expected(u[None])[0]
    cost = series.whittle(f)
    for _ in range(SCORINGS):
        J = ((expected(u + around) - f) / (DIFFERENCE * f)).T[LOWEST_BIN:]
        slope = J.T @ (1.0 - periodogram / f[LOWEST_BIN:])
        fisher = J.T @ J
        diagonal = unit * fisher + least
        before = cost
        while True:
            step = np.linalg.solve(fisher + damping * diagonal, slope)
            trial = scale.clipped(u - _bounded(step))
            f = expected(trial[None])[0]  # nearby ones where the search goes on from there
            cost = series.whittle(f)
            if cost < before:
                u, damping = trial, max(0.2 * damping, LEAST_LEVENBERG)
                break
            if slope @ step < CLOSE:  # nor would a shorter step gain more
                return scale.motion(u)
            damping *= 5.0
        if before - cost < CLOSE:
            break
    return scale.motion(u)


def climb(series: Series, guess: AxisMotion, iterations: int) -> AxisMotion:
    """Quasi-Newton (BFGS) on the exact likelihood."""
    scale = _Scale(guess, float(series.lags[-1]))
    size = len(scale.centre)
    around = np.vstack([np.zeros(size), DIFFERENCE * np.eye(size)])
    farther = WIDER * np.vstack([np.eye(size), -np.eye(size)])

    def cost(points: Array) -> Array:
        return series.exact(scale.orders, scale.logs(points))

    def with_slope(u: Array) -> tuple[float, Array]:
        values = cost(u + around)  # in the lanes of one pass
        there = np.isfinite(values).all()
        return float(values[0]), (values[1:] - values[0]) / DIFFERENCE if there else np.full(size, np.nan)

    def inverse_curvatures(u: Array, value: float) -> Array:
        """Of the axes; no curvature so small that a step would leave all bounds."""
        above, below = cost(u + farther).reshape(2, size)
        return np.diag(1.0 / np.maximum(np.abs(above + below - 2.0 * value) / WIDER**2, 0.1))

    u = np.zeros(size)
    value, slope = with_slope(u)
    if not np.isfinite(slope).all():  # the guess stands at the edge of what is a model at all: nothing says where to go
        return guess
    inverse = inverse_curvatures(u, value)
    for _ in range(iterations):
        held = ((u <= scale.low) & (slope > 0)) | ((u >= scale.high) & (slope < 0))
        step = -np.where(held, 0.0, inverse @ np.where(held, 0.0, slope))
        step = _bounded(step)
        if step @ slope >= 0:
            inverse = inverse_curvatures(u, value)
            step = _bounded(-np.where(held, 0.0, inverse @ slope))
        length = 1.0
        while length > SHORTEST:
            trial = scale.clipped(u + length * step)
            found, after = with_slope(trial)
            if found < value + 1e-4 * slope @ (trial - u):
                break
            length *= 0.3
        else:
            break
        gain = value - found
        s, y = trial - u, after - slope
        u, value, slope = trial, found, after
        if gain < CLOSE or not np.isfinite(y).all():  # at the edge of what is a model at all
            break
        if s @ y > 1e-10:
            rho = 1.0 / (s @ y)
            left = np.eye(size) - rho * np.outer(s, y)
            inverse = left @ inverse @ left.T + rho * np.outer(s, s)
    motion = scale.motion(u)
    series.known[motion] = value
    return motion
