"""Autoregressions of the three columns of a motion: what they predict is coloured, and what they do not is white.

    e(k) = x(k) + a(1) x(k - 1) + .. + a(p) x(k - p)

By least squares forwards and backwards (the modified covariance method), which follows lines of any height without the leakage of a
spectrum.

Source: S. Kay, Modern Spectral Estimation, Prentice Hall, 1988, section 7.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK = 32  # rows that are whitened at once: in the processor's cache, and 20 times as fast as lag by lag


@dataclass(frozen=True)
class Whitener:
    """Prediction-error filters of three columns.

    Attributes
    ----------
    a : (p+1, 3) array
        The first row is one.
    sigma : (3,) array
        Of the innovations.
    """

    a: Array
    sigma: Array

    def __call__(self, x: Array) -> Array:
        """Whitened columns (K-p, 3, ...) of (K, 3, ...)."""
        p, shape = len(self.a) - 1, x.shape[1:]
        x = x.reshape(len(x), 3, -1)
        white = np.empty((max(len(x) - p, 0), *x.shape[1:]))
        for j, bands in enumerate(self.bands()):
            for first in range(0, len(white), BLOCK):
                rows = min(BLOCK, len(white) - first)
                white[first : first + rows, j] = bands[:rows, : rows + p] @ x[first : first + rows + p, j]
        return white.reshape(-1, *shape)

    def bands(self) -> Array:
        """(3, B, B+p) what makes a block of whitened rows of those that it needs: one product of matrices."""
        p = len(self.a) - 1
        bands = np.zeros((3, BLOCK, BLOCK + p))
        for row in range(BLOCK):
            bands[:, row, row : row + p + 1] = (self.a / self.sigma)[::-1].T
        return bands


def filtered_back(e: Array, white: Whitener) -> Array:
    """(K, 3, ...) the transpose of the whitening of (K-p, 3, ...)."""
    p, shape = len(white.a) - 1, e.shape[1:]
    e = e.reshape(len(e), 3, -1)
    x = np.zeros((len(e) + p, *e.shape[1:]))
    for j, bands in enumerate(white.bands()):
        for first in range(0, len(e), BLOCK):
            rows = min(BLOCK, len(e) - first)
            x[first : first + rows + p, j] += bands[:rows, : rows + p].T @ e[first : first + rows, j]
    return x.reshape(-1, *shape)


def prediction(x: Array, there: Mask, order: int, noise: float = 0.0) -> Whitener:
    """Autoregressions of the columns of x (K, 3), from the rows that are there with all those before them.

    `noise`: one sigma of white noise that they allow for besides. A line that is lower than that they do not learn.
    """
    a, sigma = np.zeros((order + 1, 3)), np.zeros(3)
    a[0] = 1.0
    whole = np.convolve(there, np.ones(order + 1), "valid") > order + 0.5
    for j in range(3):
        rows = np.lib.stride_tricks.sliding_window_view(x[:, j], order + 1)[whole, ::-1]
        N = rows.T @ rows
        N = N + N[::-1, ::-1]  # backwards, too
        N[np.diag_indices(order + 1)] += 2.0 * len(rows) * noise**2
        a[1:, j] = -np.linalg.lstsq(N[1:, 1:], N[1:, 0], rcond=1e-14)[0]
        left = rows @ a[:, j]
        sigma[j] = math.sqrt(float(left @ left) / max(len(left) - order, 1))
    return Whitener(a, np.maximum(sigma, np.finfo(float).tiny ** 0.25))


def step_energies(u: Array, white: Whitener) -> Array:
    """(K,) sums of squares of a whitened ``u H(t - t0)``, u (K, 3), for t0 at each sample.

    With ``r`` the autocorrelation of the filter they are sums of ``u(s) r(s - s') u(s')`` over all samples from t0 on, less what
    would be behind the end and before the first whole row.
    """
    K, total = len(u), np.zeros(len(u))
    for x, a in zip(u.T, (white.a / white.sigma).T, strict=True):
        p = len(a) - 1
        padded, r = np.append(x, np.zeros(p)), np.correlate(a, a, "full")[p:]
        r[0] *= 0.5
        products = 2.0 * x * np.correlate(padded, r, "valid")
        energy = np.cumsum(products[::-1])[::-1] - float(np.sum(np.convolve(padded, a)[K : K + p] ** 2))
        for t0 in range(max(K - p, 0), K):
            energy[t0] = float(np.sum(np.convolve(x[t0:], a)[: K - t0] ** 2))
        for t0 in range(min(p, K)):
            energy[t0] -= float(np.sum(np.convolve(x[t0 : t0 + p + 1], a)[: p - t0] ** 2))
        total += np.maximum(energy, 0.0)
    return total
