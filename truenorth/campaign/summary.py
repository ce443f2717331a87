"""Statistics over the runs of a campaign: how large the errors are, how sure that is, and whether sigma is honest.

Source of the bands: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001,
section 5.4; of the intervals: B. Efron, R. J. Tibshirani, *An Introduction to the Bootstrap*, 1993, ch. 13 (percentiles).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.consistency import chi_square_band

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
RESAMPLES = 1000
REMEMBERED = 2000  # values, of which the resamplings are kept: 16 MB
LEVEL = 0.95
KEYS = ["case", "method", "time_s", "quantity"]
STATISTICS = ["unit", "runs", "failed", "rms", "mean", "median", "p95", "max", "rms_low", "rms_high"]
STATISTICS += ["sigma", "rms_over_sigma", "ratio_low", "ratio_high"]


def summarise(table: pd.DataFrame, names: Mapping[int, str] | None = None, level: float = LEVEL) -> pd.DataFrame:
    """One row for each case, method, time and quantity.

    Parameters
    ----------
    table : DataFrame
        Rows of a campaign.
    names : mapping, optional
        Of the cases by number.
    level : float
        Of intervals and bands.

    Returns
    -------
    DataFrame
        ``runs`` (with a value), ``failed``; ``rms`` with its bootstrap interval ``rms_low, rms_high``; ``mean, median, p95, max``
        (the last three of the magnitude); ``sigma`` (root mean square of what was claimed), ``rms_over_sigma`` (of the errors
        each over its own sigma) and its band ``ratio_low, ratio_high`` for honest sigmas. For `nees`, ``mean`` over runs and their
        components (two where the heading was refused) and its band; for `nis`, over all innovations, as if they were independent.
        The band of `level`, of two tilts, is for equal sigmas of both.
    """
    import pandas as pd

    outcomes = table[table["quantity"] == "outcome"]
    failed = (outcomes["status"] == "failed").groupby([outcomes[k] for k in KEYS[:3]], observed=True).sum()
    headings = table.loc[table["quantity"] == "phi_u", [*KEYS[:3], "run"]]
    with_heading = set(headings.itertuples(index=False, name=None))
    rows = []
    for key, group in _groups(table[table["quantity"] != "outcome"]):
        values, sigmas = group["value"].to_numpy(float), group["sigma"].to_numpy(float)
        rows.append(
            dict(zip(KEYS, key, strict=True))
            | {"unit": str(group["unit"].iloc[0]), "runs": len(values), "failed": int(failed.get(key[:3], 0))}
            | (
                _of_squares(values, _sizes(key, group, with_heading), level)
                if key[3] in ("nees", "nis")
                else _statistics(values, sigmas, 2 if key[3] == "level" else 1, level)
            )
        )
    result = pd.DataFrame(rows, columns=[*KEYS, *STATISTICS])
    if names is not None:
        result.insert(1, "name", result["case"].map(dict(names)))
    return result


def outcomes(table: pd.DataFrame, names: Mapping[int, str] | None = None) -> pd.DataFrame:
    """How many runs ended how: one row for each case, method, time and status, with the commonest reason."""
    import pandas as pd

    rows = table[table["quantity"] == "outcome"]
    result = []
    for key, group in rows.groupby(["case", "method", "time_s", "status"], observed=True, sort=False):
        reasons = group["reason"].value_counts()
        result.append((*key, len(group), reasons.index[0] if len(reasons) else ""))
    frame = pd.DataFrame(result, columns=["case", "method", "time_s", "status", "runs", "reason"])
    if names is not None:
        frame.insert(1, "name", frame["case"].map(dict(names)))
    return frame


def time_to_converge(table: pd.DataFrame, quantity: str, limit: float) -> pd.DataFrame:
    """For each case, method and run the first planned time from which on the error stays within a limit.

    A time without an answer (a run that failed, a heading that was refused) is not within it.

    Parameters
    ----------
    table : DataFrame
    quantity : str
    limit : float
        In the quantity's unit.

    Returns
    -------
    DataFrame
        case, method, run, time_s (infinite where it never does).
    """
    import pandas as pd

    keys = ["case", "method", "run", "time_s"]
    asked = table[keys].drop_duplicates()
    rows = asked.merge(table.loc[table["quantity"] == quantity, [*keys, "value"]], how="left", on=keys)
    result = []
    for (case, method, run), group in rows.groupby(["case", "method", "run"], observed=True, sort=False):
        ordered = group.sort_values("time_s")
        times = ordered["time_s"].to_numpy(float)
        outside = np.flatnonzero(~(np.abs(ordered["value"].to_numpy(float)) <= limit))  # no answer is not inside
        first = outside[-1] + 1 if outside.size else 0
        result.append((case, method, run, times[first] if first < times.size else math.inf))
    return pd.DataFrame(result, columns=["case", "method", "run", "time_s"])


@lru_cache(maxsize=4)
def _resampled(size: int) -> NDArray[np.int64]:
    """(RESAMPLES, size) how often each value is drawn."""
    rng = np.random.default_rng(size)
    return rng.multinomial(size, np.full(size, 1 / size), size=RESAMPLES)


def bootstrap_rms(values: Array, level: float = LEVEL) -> tuple[float, float]:
    """Percentile interval of the root mean square; the resampling has a seed of its own, so that it repeats."""
    if values.size < 2:
        return math.nan, math.nan
    counts = (_resampled if values.size <= REMEMBERED else _resampled.__wrapped__)(values.size)
    squares = counts @ values**2 / values.size
    low, high = np.quantile(squares, [0.5 - 0.5 * level, 0.5 + 0.5 * level])
    return math.sqrt(low), math.sqrt(high)


def _groups(rows: pd.DataFrame) -> Iterator[tuple[tuple[Any, ...], pd.DataFrame]]:
    for key, group in rows.groupby(KEYS, observed=True, sort=False):
        yield tuple(key) if isinstance(key, tuple) else (key,), group


def _sizes(key: tuple[Any, ...], group: pd.DataFrame, with_heading: set[tuple[Any, ...]]) -> Array:
    """Of how many components each normalised square is the mean."""
    if key[3] == "nis":  # its sigma is the scatter of the mean of so many
        return np.rint(2.0 / group["sigma"].to_numpy(float) ** 2)
    return np.array([3.0 if (*key[:3], run) in with_heading else 2.0 for run in group["run"]])


def _of_squares(values: Array, sizes: Array, level: float) -> dict[str, float]:
    """Statistics of normalised squares, each the mean over as many components as its size says."""
    result = _magnitudes(values, level)
    total = int(sizes.sum())
    low, high = chi_square_band(total, level=level)
    mean = float(values @ sizes) / total
    return result | {"mean": mean, "ratio_low": float(low) / total, "ratio_high": float(high) / total}


def _statistics(values: Array, sigmas: Array, components: int, level: float) -> dict[str, float]:
    """Statistics of errors that are the length of so many independent components of equal sigma."""
    result = _magnitudes(values, level)
    if not np.all(sigmas > 0):
        return result
    total = components * values.size
    low, high = chi_square_band(total, level=level)
    return result | {
        "sigma": float(np.sqrt(np.mean(sigmas**2))),
        "rms_over_sigma": float(np.sqrt(np.mean((values / sigmas) ** 2))),
        "ratio_low": math.sqrt(float(low) / total),
        "ratio_high": math.sqrt(float(high) / total),
    }


def _magnitudes(values: Array, level: float) -> dict[str, float]:
    magnitude = np.abs(values)
    result = {
        "rms": float(np.sqrt(np.mean(values**2))),
        "mean": float(np.mean(values)),
        "median": float(np.median(magnitude)),
        "p95": float(np.quantile(magnitude, 0.95)),
        "max": float(np.max(magnitude)),
    }
    result["rms_low"], result["rms_high"] = bootstrap_rms(values, level)
    return result
