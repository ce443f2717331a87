"""The table of a study: `figures.csv`, ours with the paper's figure next to it, and the single runs that rules test."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.campaign.summary import bootstrap_rms
from truenorth.core.errors import UsageError
from truenorth.papers.errors import AttitudeErrors, level

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]
ARCMIN = math.radians(1.0) / 60.0
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
# Statistics of a rule, computed from the single runs, which the last axis counts.
OF_RUNS: dict[str, Callable[[Array], Any]] = {
    "rms": lambda x: np.sqrt(np.mean(x**2, axis=-1)),
    "mean": lambda x: np.mean(x, axis=-1),
    "median": lambda x: np.median(np.abs(x), axis=-1),
    "max": lambda x: np.max(np.abs(x), axis=-1),
    "p95": lambda x: np.quantile(np.abs(x), 0.95, axis=-1),
}


class Figure(NamedTuple):
    """A figure of a study; NaN or empty where a column is not meant."""

    case: str
    method: str
    noise: str  # which reading of the paper's noise
    window_start_s: float  # for figures over a window that ends at `time_s`
    time_s: float
    quantity: str
    statistic: str
    value: float
    ci_low: float
    ci_high: float
    unit: str
    paper: float  # the paper's figure in the same unit
    runs: int


class Reference(NamedTuple):
    """A number of the table, written ``case[/noise] method quantity[@[start-]end] [statistic]``; times in s, or in h as ``6h``."""

    case: str
    noise: str | None
    method: str
    quantity: str
    start: float
    time: float
    statistic: str

    @classmethod
    def read(cls, text: str) -> Reference:
        """Of its text.

        Raises
        ------
        UsageError
            A text of another form.
        """
        words = text.split()
        if len(words) not in (3, 4):
            raise UsageError(f"{text!r}: expected a case, a method, a quantity and perhaps a statistic")
        case, _, noise = words[0].partition("/")
        quantity, _, window = words[2].partition("@")
        start, _, end = window.rpartition("-")
        statistic = words[3] if len(words) == 4 else "rms"
        return cls(case, noise or None, words[1], quantity, _seconds(start), _seconds(end), statistic)

    def __str__(self) -> str:
        """In words."""
        since = "" if math.isnan(self.start) else f"{_clock(self.start)} to "
        at = "" if math.isnan(self.time) else f" at {since}{_clock(self.time)}"
        return f"{self.case} {self.method}, {self.quantity}{at}".replace("_", " ")


class Sample(NamedTuple):
    """Errors (N,) of the single runs with their claimed sigmas (N,) or None, and their unit."""

    errors: Array
    sigmas: Array | None
    unit: str

    def of(self, statistic: str) -> Array | None:
        """What a statistic is computed from: errors, sigmas or errors over sigmas; None where they are not known."""
        if statistic not in ("sigma", "rms_over_sigma"):
            return self.errors
        if self.sigmas is None or statistic == "sigma":
            return self.sigmas
        return self.errors / self.sigmas


class Table:
    """Figures of a study, and the single runs behind them."""

    def __init__(self) -> None:
        self.figures: list[Figure] = []
        self.samples: dict[tuple[Any, ...], Sample] = {}

    def value(
        self,
        case: str,
        method: str,
        quantity: str,
        statistic: str,
        value: float,
        unit: str,
        *,
        time: float = math.nan,
        start: float = math.nan,
        noise: str = "",
        interval: tuple[float, float] = (math.nan, math.nan),
        paper: float = math.nan,
        runs: int = 1,
    ) -> None:
        """Add a figure, its words checked against those of the table."""
        if statistic not in STATISTICS or unit not in UNITS:
            raise ValueError(f"{statistic!r} in {unit!r} is no figure of the table")
        self.figures.append(
            Figure(case, method, noise, start, time, quantity, statistic, float(value), *interval, unit, paper, runs)
        )

    def errors(
        self,
        case: str,
        method: str,
        quantity: str,
        errors: Array,
        unit: str,
        sigmas: Array | None = None,
        *,
        statistics: Sequence[str] = ("rms", "max"),
        time: float = math.nan,
        start: float = math.nan,
        noise: str = "",
        paper: float = math.nan,
    ) -> None:
        """Keep the errors (N,) of all runs and add statistics of them; with claimed sigmas (N,) those and the ratio too.

        `paper` stands next to the first statistic.
        """
        errors = np.asarray(errors, dtype=np.float64)
        self.samples[case, noise, method, quantity, *_times(start, time)] = Sample(errors, sigmas, unit)
        common: dict[str, Any] = {"time": time, "start": start, "noise": noise, "runs": len(errors)}
        for statistic in statistics:
            interval = bootstrap_rms(errors) if statistic == "rms" else (math.nan, math.nan)
            found = float(OF_RUNS[statistic](errors))
            self.value(case, method, quantity, statistic, found, unit, interval=interval, paper=paper, **common)
            paper = math.nan
        if sigmas is not None:
            self.value(case, method, quantity, "sigma", float(OF_RUNS["rms"](sigmas)), unit, **common)
            ratio = float(OF_RUNS["rms"](errors / sigmas))
            self.value(case, method, quantity, "rms_over_sigma", ratio, "1", **common)

    def attitude(
        self,
        case: str,
        method: str,
        errors: AttitudeErrors,
        *,
        paper: Sequence[float] = (math.nan,) * 3,
        statistics: Sequence[str] = ("rms", "max"),
        **common: Any,
    ) -> None:
        """Errors of attitude of N runs in arcmin, as phi_e, phi_n, heading and level, with sigmas and NEES where claimed."""
        phi, sigma = errors.phi / ARCMIN, errors.sigma / ARCMIN if np.isfinite(errors.sigma).all() else None
        for i, name in enumerate(("phi_e", "phi_n", "heading")):
            claimed = None if sigma is None else sigma[:, i]
            self.errors(
                case, method, name, phi[:, i], "arcmin", claimed, statistics=statistics, paper=paper[i], **common
            )
        claimed = None if sigma is None else level(sigma)
        self.errors(case, method, "level", level(phi), "arcmin", claimed, statistics=statistics, **common)
        if np.isfinite(errors.nees).all():
            self.errors(case, method, "nees", errors.nees, "1", statistics=("mean",), **common)

    def sample(self, reference: Reference) -> Sample | None:
        """The single runs of a reference; None where the table has a figure only."""
        wanted = (reference.method, reference.quantity, *_times(reference.start, reference.time))
        found = [
            sample
            for (case, noise, *rest), sample in self.samples.items()
            if case == reference.case and tuple(rest) == wanted and reference.noise in (None, noise)
        ]
        return found[0] if found else None

    def number(self, reference: Reference) -> tuple[float, str, int]:
        """A number with its unit and runs: of the single runs, or the figure as it stands.

        Raises
        ------
        UsageError
            There is no such number.
        """
        of_runs = reference.statistic in (*OF_RUNS, "sigma", "rms_over_sigma")
        for f in () if of_runs else self.figures:  # a number of its own, which single runs may stand next to
            if _means(f, reference):
                return f.value, f.unit, f.runs
        sample = self.sample(reference)
        if sample is not None and (values := sample.of(reference.statistic)) is not None:
            kind = reference.statistic if reference.statistic in OF_RUNS else "rms"
            unit = "1" if reference.statistic == "rms_over_sigma" else sample.unit
            return float(OF_RUNS[kind](values)), unit, len(values)
        for f in self.figures:
            if _means(f, reference):
                return f.value, f.unit, f.runs
        raise UsageError(f"the table has no {reference.statistic} of {reference}")

    def number_of(self, text: str) -> float:
        """A number by the text of its reference."""
        return self.number(Reference.read(text))[0]

    def to_frame(self) -> pd.DataFrame:
        """The figures, with the documented columns."""
        return to_frame(self.figures)


def _means(f: Figure, reference: Reference) -> bool:
    """Whether a figure is what a reference names."""
    names = (reference.case, reference.method, reference.quantity, reference.statistic)
    times = _times(f.window_start_s, f.time_s) == _times(reference.start, reference.time)
    return (f.case, f.method, f.quantity, f.statistic) == names and times and reference.noise in (None, f.noise)


def _times(*times: float) -> tuple[float | None, ...]:
    return tuple(None if math.isnan(t) else t for t in times)


def _seconds(text: str) -> float:
    if not text:
        return math.nan
    return float(text[:-1]) * 3600.0 if text.endswith("h") else float(text)


def _clock(seconds: float) -> str:
    return f"{seconds / 3600.0:g} h" if seconds >= 7200.0 else f"{seconds:g} s"


def to_frame(figures: Iterable[Figure]) -> pd.DataFrame:
    """The table, with the documented columns."""
    import pandas as pd

    return pd.DataFrame(list(figures), columns=list(Figure._fields))


def write_figures(figures: Sequence[Figure], path: Path) -> None:
    """Write figures.csv; empty cells where a column is not meant."""
    to_frame(figures).to_csv(path, index=False, float_format="%.6g")
