"""Which value of a parameter meets what is wanted? Heading RMS and claimed sigma over each parameter of the grid, as numbers.

Figures and the report draw the same lines from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

    from truenorth.campaign.plan import Plan
    from truenorth.campaign.run import Campaign

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Line:
    """One method in one case, over the values of the parameter; arcmin, NaN where it has no answer."""

    name: str  # the case without the parameter, and the method
    rms: Array
    low: Array  # ends of the RMS's 95 % interval
    high: Array
    sigma: Array  # claimed

    @property
    def bars(self) -> tuple[Array, Array]:
        """How far the interval reaches below and above the RMS."""
        return np.maximum(self.rms - self.low, 0.0), np.maximum(self.high - self.rms, 0.0)


@dataclass(frozen=True)
class Requirement:
    """What heading error each value of a parameter leads to."""

    path: str  # of the parameter in the scenario
    words: str  # path and unit, for an axis
    values: Array
    lines: tuple[Line, ...]  # those with an answer


def heading_at_end(campaign: Campaign) -> pd.DataFrame:
    """Heading of each method in each case at the end of the log, with a method's answers only; rows of `summary`."""
    summary = campaign.summary
    heading = summary[(summary["quantity"] == "phi_u") & summary["rms"].notna()]
    return heading.sort_values("time_s").groupby(["case", "method"], observed=True).tail(1)


def requirements(campaign: Campaign) -> list[Requirement]:
    """Of each parameter of the grid that has several values, all of them numbers."""
    last = heading_at_end(campaign).set_index(["case", "method"])
    found = []
    for path, said in campaign.plan.grid.items():
        values = [_number(value) for value in said]
        if len(values) > 1 and None not in values:
            units = {str(value).partition(" ")[2] for value in said}
            unit = units.pop() if len(units) == 1 else "in their own units"
            words = f"{path}, {unit}" if unit else path
            found.append(Requirement(path, words, np.array(values, float), _lines(campaign.plan, path, last)))
    return found


def _lines(plan: Plan, path: str, last: pd.DataFrame) -> tuple[Line, ...]:
    others: dict[str, list[int]] = {}
    for case in plan.cases:
        fixed = [f"{k.rpartition('.')[2]} {v}" for k, v in case.parameters.items() if k != path]
        others.setdefault(", ".join([str(case.scenario["name"]), *fixed]), []).append(case.number)
    found = []
    for name, cases in others.items():
        for method in plan.method_names:
            rows = last.reindex([(case, method) for case in cases])
            of = (rows[column].to_numpy(float) for column in ("rms", "rms_low", "rms_high", "sigma"))
            line = Line(f"{name}, {method}", *of)
            if np.isfinite(line.rms).any():
                found.append(line)
    return tuple(found)


def _number(text: object) -> float | None:
    try:
        return float(str(text).split()[0])
    except (ValueError, IndexError):
        return None
