"""`figures.csv`: one tidy table for all published systems, ours beside the paper's figure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.summary import bootstrap_rms

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
STATISTICS = (
    "rms",
    "sigma",
    "rms_over_sigma",
    "mean",
    "max",
    "min",
    "median",
    "p95",
    "value",
    "win_rate",
    "ratio",
    "slope",
)
UNITS = ("arcmin", "arcsec", "deg", "m", "m/s", "s", "min", "deg/h", "ug", "1")


class Figure(NamedTuple):
    """A figure of a study; NaN or empty where a column is not meant.

    Attributes
    ----------
    case, method : str
    noise : {"per_sample", "random_walk", ""}
        Which reading of the paper's noise.
    window_start_s : float
        For figures over a window that ends at `time_s`.
    time_s : float
    quantity, statistic : str
    value, ci_low, ci_high : float
    unit : str
    paper : float
        The paper's figure in the same unit.
    runs : int
    """

    case: str
    method: str
    noise: str
    window_start_s: float
    time_s: float
    quantity: str
    statistic: str
    value: float
    ci_low: float
    ci_high: float
    unit: str
    paper: float
    runs: int


def figure(
    case: str,
    method: str,
    quantity: str,
    statistic: str,
    value: float,
    unit: str,
    *,
    time: float = math.nan,
    window_start: float = math.nan,
    noise: str = "",
    interval: tuple[float, float] = (math.nan, math.nan),
    paper: float = math.nan,
    runs: int = 1,
) -> Figure:
    """A figure, its words checked against those of the table."""
    if statistic not in STATISTICS or unit not in UNITS:
        raise ValueError(f"{statistic!r} in {unit!r} is no figure of the table")
    return Figure(
        case, method, noise, window_start, time, quantity, statistic, float(value), *interval, unit, paper, runs
    )


def of_errors(
    case: str,
    method: str,
    quantity: str,
    errors: Array,
    sigmas: Array | None,
    unit: str,
    *,
    time: float,
    noise: str,
    paper: float = math.nan,
) -> list[Figure]:
    """RMS with its interval, sigma and their ratio, of the errors of all runs (N,) and their claimed sigmas (N,)."""

    def one(statistic: str, value: float, unit: str, **more: object) -> Figure:
        return figure(case, method, quantity, statistic, value, unit, time=time, noise=noise, runs=len(errors), **more)  # type: ignore[arg-type]

    figures = [
        one("rms", float(np.sqrt(np.mean(errors**2))), unit, interval=bootstrap_rms(errors), paper=paper),
        one("max", float(np.max(np.abs(errors))), unit),
    ]
    if sigmas is not None:
        figures.append(one("sigma", float(np.sqrt(np.mean(sigmas**2))), unit))
        figures.append(one("rms_over_sigma", float(np.sqrt(np.mean((errors / sigmas) ** 2))), "1"))
    return figures


def to_frame(figures: Iterable[Figure]) -> pd.DataFrame:
    """The table, with the documented columns."""
    import pandas as pd

    return pd.DataFrame(list(figures), columns=list(Figure._fields))


def write_figures(figures: Sequence[Figure], path: Path) -> None:
    """Write figures.csv; empty cells where a column is not meant."""
    to_frame(figures).to_csv(path, index=False, float_format="%.6g")
