"""Is an estimator as good as it says? NEES, NIS, sigma ratios and whiteness, each with its chi-square band.

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4; G. M. Ljung, G. E. P. Box, On a measure of lack of fit in time series models, Biometrika 65, 1978.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import DataError, UsageError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Consistency:
    """A chi-square statistic averaged over runs, with the band it must keep to.

    Parameters
    ----------
    mean : (K,) array
        Mean over runs; expected to be `dof`.
    dof : (K,) array
        Degrees of freedom of one run.
    low, high : (K,) arrays
        Band of the mean.
    level : float
        Probability of the band.
    inside : float
        Share of epochs inside; about `level` for a consistent estimator (epochs of one run are correlated, so that
        the share itself scatters more than a binomial).
    """

    mean: Array
    dof: Array
    low: Array
    high: Array
    level: float
    inside: float


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of innovations, and the portmanteau test that they are white."""

    autocorrelation: Array  # (L, m): of each row at lags 1 to L epochs; not centred, so that a bias shows too
    band: Array  # (L, m): half-width of the band of each
    statistic: float  # Ljung and Box's sum over lags and rows, chi-square with `dof` degrees of freedom
    dof: int
    p_value: float  # probability of so much colour, or more, from white innovations
    white: bool  # whether ``p_value > 1 - level``


def chi_square_quantile(probability: ArrayLike, dof: ArrayLike) -> Array:
    """Value that a chi-square variable stays below with the given probability; 0 for no degrees of freedom."""
    from scipy.special import chdtri  # scipy.stats would cost .7 s of import

    dof = np.asarray(dof, dtype=np.float64)
    return np.where(dof > 0, chdtri(np.maximum(dof, 1), 1.0 - np.asarray(probability, dtype=np.float64)), 0.0)


def chi_square_band(dof: ArrayLike, runs: int = 1, level: float = 0.95) -> tuple[Array, Array]:
    """Two-sided band of the mean of a chi-square statistic over independent runs.

    Parameters
    ----------
    dof : array_like
        Degrees of freedom of one run.
    runs : int
    level : float
        Probability of the band.

    Returns
    -------
    low, high : arrays like `dof`
    """
    if not 0.0 < level < 1.0:
        raise UsageError(f"level is {level}, expected a probability between 0 and 1")
    if runs < 1:
        raise UsageError(f"runs is {runs}, expected at least 1")
    total = runs * np.asarray(dof, dtype=np.float64)
    tail = (1.0 - level) / 2.0
    return chi_square_quantile(tail, total) / runs, chi_square_quantile(1.0 - tail, total) / runs


def nees(error: ArrayLike, P: ArrayLike) -> Array:
    """Normalised estimation error squared, ``e' P^-1 e``.

    Parameters
    ----------
    error : (..., n) array
        Estimated minus true; in the units of `P`.
    P : (..., n, n) array

    Returns
    -------
    (...) array
        Chi-square with n degrees of freedom if the errors are as `P` says.

    Raises
    ------
    DataError
        `P` is not positive definite.
    """
    e = standardised(error, P)
    return np.sum(e**2, axis=-1)


def nis(innovation: ArrayLike, covariance: ArrayLike) -> tuple[Array, NDArray[np.int64]]:
    """Normalised innovation squared, and its degrees of freedom: the rows that are not NaN.

    Parameters
    ----------
    innovation : (..., m) array
    covariance : (..., m, m) array

    Returns
    -------
    nis : (...) array
    dof : (...) array
    """
    e = standardised(innovation, covariance)
    return np.nansum(e**2, axis=-1), np.sum(np.isfinite(e), axis=-1)


def standardised(innovation: ArrayLike, covariance: ArrayLike) -> Array:
    """Innovations as independent standard normals: ``L^-1 nu``, with ``L L'`` their covariance.

    Parameters
    ----------
    innovation : (..., m) array
        NaN where a row is absent; it stays NaN and the others do without it.
    covariance : (..., m, m) array

    Returns
    -------
    (..., m) array

    Raises
    ------
    DataError
        A covariance is not positive definite.
    """
    nu = np.asarray(innovation, dtype=np.float64)
    W = np.asarray(covariance, dtype=np.float64)
    if W.shape[-2:] != (nu.shape[-1], nu.shape[-1]):
        raise UsageError(f"covariance has shape {W.shape}, expected (..., m, m) with m = {nu.shape[-1]}")
    absent = np.isnan(nu)
    # An absent row becomes one of its own, uncorrelated with the others. Scaled, so that units do not matter.
    sigma = np.sqrt(np.diagonal(W, axis1=-2, axis2=-1))
    sigma = np.where(absent, 1.0, sigma)
    apart = absent[..., :, None] | absent[..., None, :]
    correlation = np.where(apart, np.eye(nu.shape[-1]), W / (sigma[..., :, None] * sigma[..., None, :]))
    try:
        L = np.linalg.cholesky(correlation)
    except np.linalg.LinAlgError:
        raise DataError("a covariance is not positive definite: leave out states or rows known exactly") from None
    e = np.linalg.solve(L, np.where(absent, 0.0, nu / sigma)[..., None])[..., 0]
    return np.where(absent, np.nan, e)


def consistency(values: ArrayLike, dof: ArrayLike, level: float = 0.95) -> Consistency:
    """Hold NEES or NIS of many runs against its band.

    Parameters
    ----------
    values : (runs, K) array
        Statistic of each run and epoch.
    dof : int or (K,) array
        Degrees of freedom of one run; epochs without any are left out.
    level : float
        Probability of the band, two-sided.
    """
    v = np.asarray(values, dtype=np.float64)
    if v.ndim != 2:
        raise UsageError(f"values have shape {v.shape}, expected (runs, epochs)")
    degrees = np.broadcast_to(np.asarray(dof, dtype=np.float64), v.shape[1:]).copy()
    low, high = chi_square_band(degrees, len(v), level)
    mean = v.mean(axis=0)
    counted = degrees > 0
    inside = (low <= mean) & (mean <= high)
    return Consistency(mean, degrees, low, high, level, float(inside[counted].mean()) if counted.any() else np.nan)


def sigma_ratio(error: ArrayLike, sigma: ArrayLike, level: float = 0.95) -> tuple[Array, float, float]:
    """RMS over runs of error over sigma, with its band: 1 for an honest sigma, above it for a boastful one.

    Parameters
    ----------
    error, sigma : (runs, ...) arrays
    level : float

    Returns
    -------
    ratio : (...) array
    low, high : float
        Band, if the errors are normal and runs independent.
    """
    e = np.asarray(error, dtype=np.float64) / np.asarray(sigma, dtype=np.float64)
    low, high = chi_square_band(1, len(e), level)
    return np.sqrt(np.mean(e**2, axis=0)), float(np.sqrt(low)), float(np.sqrt(high))


def whiteness(innovation: ArrayLike, covariance: ArrayLike, lags: int = 20, level: float = 0.95) -> Whiteness:
    """Test whether the innovations of one run are white in time; absent rows are left out.

    Parameters
    ----------
    innovation : (K, m) array
    covariance : (K, m, m) array
    lags : int
        Longest lag, epochs.
    level : float
        Probability with which white innovations pass.

    Raises
    ------
    UsageError
        Fewer than two epochs for each lag.
    """
    from scipy.special import chdtrc, ndtri

    if not 0.0 < level < 1.0:
        raise UsageError(f"level is {level}, expected a probability between 0 and 1")
    e = standardised(innovation, covariance)
    if e.ndim != 2:
        raise UsageError(f"innovation has shape {e.shape}, expected (epochs, rows): one run")
    if lags < 1 or len(e) < 2 * lags:
        raise UsageError(f"{len(e)} epochs are too few for {lags} lags: expected at least two a lag")
    present = np.isfinite(e)
    e = np.where(present, e, 0.0)
    count = present.sum(axis=0)
    energy = np.sum(e**2, axis=0)
    pairs = np.array([np.sum(present[k:] & present[:-k], axis=0) for k in range(1, lags + 1)])
    products = np.array([np.sum(e[k:] * e[:-k], axis=0) for k in range(1, lags + 1)])
    # Of white normal e: E (sum e e)^2 = pairs, E (sum e^2)^2 = N (N + 2).
    variance = pairs / np.maximum(count * (count + 2.0), 1.0)
    r = np.divide(products, energy, out=np.zeros_like(products), where=energy > 0.0)
    known = (pairs > 0) & (energy > 0.0)
    statistic = float(np.sum(np.divide(r**2, variance, out=np.zeros_like(r), where=known)))
    dof = int(known.sum())
    p_value = float(chdtrc(dof, statistic)) if dof else 1.0
    band = float(ndtri(0.5 + level / 2.0)) * np.sqrt(variance)
    return Whiteness(r, band, statistic, dof, p_value, p_value > 1.0 - level)
