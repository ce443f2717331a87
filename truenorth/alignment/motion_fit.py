"""How the base moves, read from what a first fit leaves of its velocity: white motion and oscillators by maximum likelihood.

Each axis by itself. The number of oscillators and their order are chosen by Schwarz's criterion, which is slower than Akaike's to
take a piece of white noise for an oscillator: the density at zero frequency would be claimed too low. Frequencies and damping are
searched with the debiased Whittle likelihood: the expected periodogram of a tapered series is computed from the model's
autocovariance, so that lines narrower than the resolution, and their leakage, are what they are. The best is then
polished with the exact likelihood, with a smooth trend and the sensors' random walks beside it.

Sources: G. Schwarz, Estimating the dimension of a model, Ann. Statist. 6, 1978; A. M. Sykulski, S. C. Olhede et al., The
debiased Whittle likelihood, Biometrika 106 (2), 2019.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.windowed import hann
from truenorth.filters.scalar import deviance
from truenorth.models.disturbance import AxisMotion, Oscillator
from truenorth.models.swaying import MOST_OSCILLATORS

Array = NDArray[np.float64]

TREND = 4  # degree of the polynomial that takes what the first fit missed
LEAST_DAMPING, MOST_DAMPING = 1e-10, 0.7
QUIETEST = 1e-7  # m/s: white motion of a base of stone
LOWEST_BIN = 3  # slower than this is the trend's
PEAK_WIDTH = 4  # bins on either side of a peak that belong to it
LINE = 1e-8  # damping with which the search for a line begins
SCORINGS, TRIALS, POLISHES = 25, 6, 12  # iterations at most
DIFFERENCE = 1e-5  # of a logarithm, for derivatives
LONGEST = 2.0  # step of a logarithm, or of a phase in rad
SHORTEST = 1e-4  # part of a step that is tried
WIDER = 1e-3  # difference for second derivatives
CLOSE = 0.02  # of twice the log-likelihood: nearer than this is the maximum
FARTHEST = 30.0  # rad: phase over the log by which a search may move a frequency


@dataclass(frozen=True)
class Walks:
    """Random walks that reach the velocity beside the base's motion: of the accelerometers, and of the gyros through gravity.

    Attributes
    ----------
    velocity : float, m/s/sqrt(s)
    tilt : float, m/s^2/sqrt(s)
        Random walk of angle times gravity.
    """

    velocity: float
    tilt: float

    def blocks(self, interval: float) -> tuple[Array, Array]:
        """Transition and noise of velocity and acceleration."""
        T, q, r = interval, self.velocity**2, self.tilt**2
        return (
            np.array([[1.0, T], [0.0, 1.0]]),
            np.array([[q * T + r * T**3 / 3, r * T**2 / 2], [r * T**2 / 2, r * T]]),
        )


def fit_motion(
    residual: Array,
    interval: float,
    walks: Walks,
    start: AxisMotion | None = None,
    most: int = MOST_OSCILLATORS,
) -> AxisMotion:
    """The motion along one axis.

    Parameters
    ----------
    residual : (K,) array, m/s
        Mean velocity of the base over each interval, but for a smooth trend.
    interval : float, s
    walks : Walks
    start : AxisMotion, optional
        A good guess: its oscillators are kept, and only polished.
    most : int
        Oscillators.

    Returns
    -------
    AxisMotion
    """
    series = _Series(residual, interval, walks)
    if start is not None:
        return _climb(series, start, POLISHES)
    best = _climb(series, AxisMotion(max(float(np.std(series.detrended)), QUIETEST)), POLISHES)
    score = series.score(best)
    for count in range(1, most + 1):
        chosen = _climb(series, min(_candidates(series, best, count), key=series.score), POLISHES)
        found = series.score(chosen)
        if found >= score:
            break
        best, score = chosen, found
    return best


def _candidates(series: _Series, best: AxisMotion, count: int) -> list[AxisMotion]:
    """Motions of so many oscillators, polished: the best of the broad ones, and all lines."""
    broad = [_with_one_more(best, series, order) for order in (1, 2)]
    lines = [_with_one_more(best, series, 1, LINE)]
    if count > 1:  # also all of them anew, each at a peak of its own
        broad += [_at_peaks(series, count, order) for order in (1, 2)]
        lines += [_at_peaks(series, count, 1, LINE)]
    scored = sorted((_score(series, guess) for guess in broad), key=series.score)
    # Whittle's likelihood loses a line's phase: lines are polished from the peak itself.
    return [_climb(series, guess, TRIALS) for guess in (*scored[:1], *lines)]


class _Series:
    """One axis: the data in the two forms in which the likelihoods take it."""

    def __init__(self, residual: Array, interval: float, walks: Walks) -> None:
        K = len(residual)
        basis = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, K), min(TREND, max(K - 8, 0)))
        self.interval, self.walks = interval, walks
        self.columns = np.column_stack([residual, basis])
        self.detrended = residual - basis @ np.linalg.lstsq(basis, residual, rcond=None)[0]
        taper = hann(K)
        taper /= math.sqrt(float(np.sum(taper**2)))
        self.taper_weights = taper
        spectrum = np.fft.rfft(taper, 2 * K)
        self.taper = np.fft.irfft(np.abs(spectrum) ** 2)[:K]  # its autocorrelation
        self.periodogram = np.abs(np.fft.rfft(taper * self.detrended)) ** 2
        self.frequencies = 2 * np.pi * np.fft.rfftfreq(K, interval)
        self.lags: Array = interval * np.arange(K, dtype=np.float64)

    def expected(self, motion: AxisMotion) -> Array:
        """Expected periodogram of the tapered series."""
        acf = sum((autocovariance(item, self.lags) for item in motion.oscillators), np.zeros(len(self.lags)))
        acf[0] += motion.white**2
        both = self.taper * acf
        # Sum over lags -(K-1) .. K-1 of acf taper exp(-i w lag), at the frequencies of the series' own transform.
        folded = both + np.concatenate([[0.0], both[:0:-1]])
        return np.maximum(np.fft.rfft(folded).real, 1e-30)

    def whittle(self, expected: Array) -> float:
        """Minus twice the debiased Whittle log-likelihood, of an expected periodogram."""
        f = expected[LOWEST_BIN:]
        return float(np.sum(np.log(f) + self.periodogram[LOWEST_BIN:] / f))

    def exact(self, motion: AxisMotion) -> float:
        """Minus twice the restricted log-likelihood."""
        n = motion.states
        Phi, Q, P, h = np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2)), np.zeros((n + 2, n + 2)), np.zeros(n + 2)
        Phi[:n, :n], Q[:n, :n], P[:n, :n], h[:n] = motion.blocks(self.interval)
        Phi[n:, n:], Q[n:, n:] = self.walks.blocks(self.interval)
        h[n] = 1.0
        return deviance(Phi, Q, P, h, motion.white**2, self.columns)

    def score(self, motion: AxisMotion) -> float:
        """Schwarz's criterion."""
        return self.exact(motion) + math.log(len(self.lags)) * (1 + 3 * len(motion.oscillators))


def autocovariance(item: Oscillator, lags: Array) -> Array:
    """Of an oscillator's velocity at lags (K,) s, (m/s)^2."""
    decay = item.damping * item.frequency
    turn = item.frequency * math.sqrt(1.0 - item.damping**2)
    c, s = np.cos(turn * lags), np.sin(turn * lags)
    if item.order == 1:
        shape = c - decay / turn * s
    else:
        shape = _second_order_shape(item, decay, turn, lags, c, s)
    return np.asarray(item.sigma**2 * np.exp(-decay * lags) * shape)


def _second_order_shape(item: Oscillator, decay: float, turn: float, t: Array, c: Array, s: Array) -> Array:
    w, damp = item.frequency, 2.0 * decay
    A = np.array([[0, 1, 0, 0], [-(w**2), -damp, 0, 0], [0, 0, 0, 1], [0, 1, -(w**2), -damp]], dtype=float)
    column = item.stationary[:, 3] / item.sigma**2
    derivatives = []
    for _ in range(4):
        derivatives.append(column[3])
        column = A @ column
    # f = Re[(alpha + beta t) e^(lam t)], f^(k)(0) = Re[alpha lam^k + k beta lam^(k-1)]
    lam = complex(-decay, turn)
    M = np.zeros((4, 4))
    for k in range(4):
        first, second = lam**k, k * lam ** (k - 1) if k else 0.0
        M[k] = first.real, -first.imag, complex(second).real, -complex(second).imag
    a, b, d, e = np.linalg.solve(M, derivatives)
    return (a + d * t) * c - (b + e * t) * s


def _with_one_more(motion: AxisMotion, series: _Series, order: int, damping: float | None = None) -> AxisMotion:
    """Another oscillator where the periodogram stands out most from what is expected."""
    over = series.periodogram / series.expected(motion)
    over[: LOWEST_BIN + 1] = 0.0
    peak = int(np.argmax(over * np.sqrt(series.periodogram)))
    rest = np.delete(series.periodogram, np.r_[:LOWEST_BIN, _near(series, peak)])
    white = min(_white(rest), motion.white)
    return AxisMotion(max(white, QUIETEST), (*motion.oscillators, _oscillator_at(series, peak, order, damping)))


def _at_peaks(series: _Series, count: int, order: int, damping: float | None = None) -> AxisMotion:
    """So many oscillators at the highest maxima of the smoothed periodogram."""
    smooth = np.convolve(series.periodogram, np.ones(PEAK_WIDTH + 1) / (PEAK_WIDTH + 1), "same")
    smooth[: LOWEST_BIN + 1] = 0.0
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(smooth, PEAK_WIDTH), 2 * PEAK_WIDTH + 1)
    peaks = np.flatnonzero((smooth >= windows.max(axis=1)) & (smooth > 0))
    peaks = peaks[np.argsort(smooth[peaks])[::-1]][:count]
    near = np.concatenate([_near(series, int(peak)) for peak in peaks])
    rest = np.delete(series.periodogram, np.r_[:LOWEST_BIN, near])
    items = tuple(_oscillator_at(series, int(peak), order, damping) for peak in peaks)
    return AxisMotion(max(_white(rest), QUIETEST), items)


def _near(series: _Series, peak: int) -> NDArray[np.int64]:
    return np.arange(max(peak - PEAK_WIDTH, LOWEST_BIN), min(peak + PEAK_WIDTH + 1, len(series.periodogram)))


def _white(periodogram: Array) -> float:
    """Sigma of the white part of a periodogram: its median's, which exponential scatter puts at log 2 of the mean."""
    return math.sqrt(float(np.median(periodogram)) / math.log(2.0)) if len(periodogram) else QUIETEST


def _oscillator_at(series: _Series, peak: int, order: int, damping: float | None = None) -> Oscillator:
    near = _near(series, peak)
    power, w = series.periodogram[near], series.frequencies[near]
    centre = float(np.sum(w * power) / np.sum(power))
    width = math.sqrt(float(np.sum((w - centre) ** 2 * power) / np.sum(power)))
    sigma = math.sqrt(2.0 * float(np.sum(power)) / len(series.detrended))
    if damping is None:
        return Oscillator(order, sigma, centre, float(np.clip(0.5 * width / centre, 1e-3, 0.3)))
    return Oscillator(order, sigma, _line_frequency(series, centre), damping)


def _line_frequency(series: _Series, guess: float) -> float:
    """Where the tapered series' transform is largest: three grids, each finer than the last."""
    tapered, spacing = series.taper_weights * series.detrended, series.frequencies[1]
    for _ in range(3):
        grid = guess + spacing * np.linspace(-1.0, 1.0, 21)
        power = np.abs(np.sum(np.exp(-1j * np.outer(grid, series.lags)) * tapered, axis=1))
        guess, spacing = float(grid[np.argmax(power)]), spacing / 10.0
    return guess


def _parameters(motion: AxisMotion) -> Array:
    x = [math.log(motion.white)]
    for item in motion.oscillators:
        x += [math.log(item.sigma), math.log(item.frequency), math.log(item.damping)]
    return np.array(x)


def _motion(x: Array, like: AxisMotion) -> AxisMotion:
    values = np.exp(x)
    items = [
        Oscillator(item.order, *values[first : first + 3].tolist())
        for item, first in zip(like.oscillators, range(1, len(x), 3), strict=True)
    ]
    return AxisMotion(float(values[0]), tuple(items))


class _Scale:
    """Bounds of the logarithms about a guess; a step of a frequency is measured by the phase that it makes over the log."""

    def __init__(self, guess: AxisMotion, duration: float) -> None:
        self.guess, self.centre = guess, _parameters(guess)
        size = len(self.centre)
        self.step, self.low, self.high = np.ones(size), np.full(size, -12.0), np.full(size, 12.0)
        self.low[0] = min(math.log(QUIETEST) - self.centre[0], 0.0)
        for j, item in enumerate(guess.oscillators):
            self.step[2 + 3 * j] = 1.0 / (item.frequency * duration)
            self.low[2 + 3 * j], self.high[2 + 3 * j] = -FARTHEST, FARTHEST
            self.low[3 + 3 * j] = math.log(LEAST_DAMPING / item.damping)
            self.high[3 + 3 * j] = math.log(MOST_DAMPING / item.damping)

    def motion(self, u: Array) -> AxisMotion:
        return _motion(self.centre + self.step * u, self.guess)

    def clipped(self, u: Array) -> Array:
        return np.clip(u, self.low, self.high)


def _score(series: _Series, guess: AxisMotion) -> AxisMotion:
    """Fisher scoring of the Whittle likelihood, damped as Levenberg's."""
    scale = _Scale(guess, float(series.lags[-1]))
    u, damping = np.zeros(len(scale.centre)), 1e-2
    f = series.expected(scale.motion(u))
    cost = series.whittle(f)
    for _ in range(SCORINGS):
        J = np.empty((len(f), len(u)))
        for j in range(len(u)):
            away = u.copy()
            away[j] += DIFFERENCE
            J[:, j] = (series.expected(scale.motion(away)) - f) / (DIFFERENCE * f)
        J = J[LOWEST_BIN:]
        slope = J.T @ (1.0 - series.periodogram[LOWEST_BIN:] / f[LOWEST_BIN:])
        fisher = J.T @ J
        before = cost
        while damping < 1e6:
            step = np.linalg.solve(fisher + damping * (np.diag(np.diag(fisher)) + 1e-6 * np.eye(len(u))), slope)
            trial = scale.clipped(u - np.clip(step, -LONGEST, LONGEST))
            f_trial = series.expected(scale.motion(trial))
            value = series.whittle(f_trial)
            if value < cost:
                u, f, cost, damping = trial, f_trial, value, 0.2 * damping
                break
            damping *= 5.0
        if before - cost < CLOSE:
            break
    return scale.motion(u)


def _climb(series: _Series, guess: AxisMotion, iterations: int) -> AxisMotion:
    """Quasi-Newton (BFGS) on the exact likelihood."""
    scale = _Scale(guess, float(series.lags[-1]))
    size = len(scale.centre)

    def cost(u: Array) -> float:
        return series.exact(scale.motion(u))

    def gradient(u: Array, value: float) -> Array:
        return np.array([(cost(u + DIFFERENCE * e) - value) / DIFFERENCE for e in np.eye(size)])

    u = np.zeros(size)
    value = cost(u)
    slope, inverse = gradient(u, value), np.diag(1.0 / _curvatures(cost, u, value))
    for _ in range(iterations):
        held = ((u <= scale.low) & (slope > 0)) | ((u >= scale.high) & (slope < 0))
        step = -np.where(held, 0.0, inverse @ np.where(held, 0.0, slope))
        step = np.clip(step, -LONGEST, LONGEST)
        if step @ slope >= 0:
            inverse = np.diag(1.0 / _curvatures(cost, u, value))
            step = np.clip(-np.where(held, 0.0, inverse @ slope), -LONGEST, LONGEST)
        length = 1.0
        while length > SHORTEST:
            trial = scale.clipped(u + length * step)
            found = cost(trial)
            if found < value + 1e-4 * slope @ (trial - u):
                break
            length *= 0.3
        else:
            break
        gain = value - found
        after = gradient(trial, found)
        s, y = trial - u, after - slope
        if s @ y > 1e-10:
            rho = 1.0 / (s @ y)
            left = np.eye(size) - rho * np.outer(s, y)
            inverse = left @ inverse @ left.T + rho * np.outer(s, s)
        u, value, slope = trial, found, after
        if gain < CLOSE:
            break
    return scale.motion(u)


def _curvatures(cost: Callable[[Array], float], u: Array, value: float) -> Array:
    """Magnitudes of the second derivatives along the axes; none so small that a step would leave all bounds."""
    both = [cost(u + WIDER * e) + cost(u - WIDER * e) - 2.0 * value for e in np.eye(len(u))]
    return np.maximum(np.abs(both) / WIDER**2, 0.1)
