"""What follows a spike, on the mean: of a knock the opposite of all of it, of an error of a row nothing.

A base that is knocked comes back to rest: of its force nothing is left two seconds later, nor of its turn. With the spikes ``s``
taken off, what is left of a channel is

    x_k = sum_j a_j s_(k-j) + noise,    sum_j a_j = -1 of knocks, 0 of errors of rows.

The answer ``a`` is fitted by least squares on the whole train of spikes: answers that overlap are separated by how the times and
sizes of the spikes scatter. Of spikes that are alike and as regular as a clock, what their answers have in common is the mean of
the channel: sigma then says that the sum is not known.

Spikes that were not found are in x. Of a regular train they are where the others are not, so that x lacks them at the rows of the
spikes: ``a_0`` is too small, and the sum of the rows behind too near to nothing. Both sums have to agree, of all rows and of those
behind.

The answer is a line between knots, one row apart at first and later as far as :data:`APART`; each part of it has an a priori sigma
of one spike. Noise and motion are weighed by their spectrum, that of what the answer leaves, smoothed. The spectra are of a Hann
window, which weighs rows unequally: :data:`WINDOW` allows for that.

Sources: generalised least squares in the frequency domain (P. Whittle, 1953); R. Pintelon and J. Schoukens, *System
Identification: A Frequency Domain Approach*, Wiley 2012, ch. 9. The sum as a test is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LASTS = 2.0  # s, in which a base that was knocked comes back to rest: on springs, on tyres, a hull
HALF = 0.5  # of a spike, between knocks and errors
BEFORE = 3  # rows before a spike, of which its neighbours are made
APART = 0.05  # s between knots: an answer on springs of 4 Hz has five in a period
WIDER = 1.3  # times as far from each other as the two before
SMOOTH = 0.25  # Hz of a spectrum that are one density
LEAST = 32  # frequencies of it at least
MEAN = 3  # first frequencies, in which the mean and the slope of a channel lie
ROUNDS = 3  # of fit and spectrum
WINDOW = 35.0 / 18.0  # mean of w^4 over the square of that of w^2, of a Hann window w


class Sum(NamedTuple):
    """Of an answer, in spikes, and its sigma."""

    size: float
    sigma: float

    def is_knock(self, enough: float) -> bool:
        """Whether it is no error of a row, by so many sigmas."""
        return self.size < -max(HALF, enough * self.sigma)

    def is_error(self, enough: float) -> bool:
        """Whether it is no knock, by so many sigmas."""
        return self.size > -min(HALF, 1.0 - enough * self.sigma)


def sums_of_answer(mended: Array, spikes: Array, interval: float) -> list[Sum]:
    """Sums of the mean answer to a spike: of all of it, and of the rows behind it.

    Parameters
    ----------
    mended : (N,) array
        A channel whose spikes are replaced by what their neighbours say.
    spikes : (N,) array
        What was taken off; zero in all other rows.
    interval : float, s
    """
    from scipy.linalg import matmul_toeplitz

    rows = len(mended)
    reach = min(max(round(LASTS / interval), BEFORE + 1), rows // 4)
    hats, lags = _hats(reach, max(round(APART / interval), 1))
    window = np.hanning(rows + 1)[:-1]
    X, S = np.fft.rfft(window * (mended - mended.mean())), np.fft.rfft(window * spikes)
    band = min(max(round(SMOOTH * rows * interval), LEAST), len(X))
    areas, after = hats.sum(axis=0), hats[lags > 0].sum(axis=0)
    left = X
    for _ in range(ROUNDS):
        weight = 1.0 / (WINDOW * _density(left, band))
        weight[:MEAN] = 0.0
        own = rows * np.fft.irfft(weight * np.abs(S) ** 2, rows)
        across = rows * np.fft.irfft(weight * np.conj(S) * X, rows)
        normal = hats.T @ matmul_toeplitz(own[: len(lags)], hats) + np.diag(areas**2)
        covariance = np.linalg.inv(normal)
        answer = covariance @ (hats.T @ across[lags])
        shape = np.zeros(rows)
        shape[lags] = hats @ answer
        left = X - S * np.fft.rfft(shape)
    return [Sum(float(x @ answer), math.sqrt(float(x @ covariance @ x))) for x in (areas, after)]


def _hats(reach: int, apart: int) -> tuple[Array, NDArray[np.intp]]:
    """(L, K) lines between knots at L lags, that end in nothing, and the lags in rows."""
    knots = list(range(-BEFORE - 1, BEFORE + 1))
    while knots[-1] < reach:
        knots.append(knots[-1] + min(apart, max(1, math.ceil((WIDER - 1.0) * knots[-1]))))
    lags = np.arange(knots[0] + 1, knots[-1])
    hats = [np.interp(lags, knots, np.eye(len(knots))[k]) for k in range(1, len(knots) - 1)]
    return np.stack(hats, axis=1), lags


def _density(X: NDArray[np.complex128], band: int) -> Array:
    """Mean square of neighbouring frequencies, so many."""
    power = np.concatenate([[0.0], np.cumsum(np.abs(X) ** 2)])
    centre = np.arange(len(X))
    low, high = np.maximum(centre - band // 2, 0), np.minimum(centre + band // 2 + 1, len(X))
    return np.asarray((power[high] - power[low]) / (high - low)) + 1e-300
