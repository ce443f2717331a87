"""Two methods on the same data: who is nearer to the truth, how often, by how much, and whether that could be chance."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


def compare(
    table: pd.DataFrame,
    *,
    methods: Sequence[str],
    quantities: Sequence[str] = ("phi_u", "level"),
    names: Mapping[int, str] | None = None,
) -> pd.DataFrame:
    """Methods in pairs, on the runs where both have an answer.

    Parameters
    ----------
    table : DataFrame
        Rows of a campaign.
    methods : sequence of str
    quantities : sequence of str
    names : mapping, optional
        Of the cases by number.

    Returns
    -------
    DataFrame
        case, time_s, quantity, method, against, runs; ``win_rate`` (share of runs in which `method` has the smaller error, a tie
        counts half), ``median_difference`` of the errors' magnitudes (negative: `method` is better), ``ratio`` of the RMS,
        ``p_value`` of the sign test, two-sided.
    """
    import pandas as pd

    rows = []
    for quantity in quantities:
        chosen = table[table["quantity"] == quantity]
        for (case, time), group in chosen.groupby(["case", "time_s"], observed=True, sort=False):
            wide = group.pivot_table(index="run", columns="method", values="value", observed=True).abs()
            for method, against in itertools.combinations(methods, 2):
                if method not in wide or against not in wide:
                    continue
                both = wide[[method, against]].dropna()
                rows.append(
                    (case, time, quantity, method, against, *paired(both[method].to_numpy(), both[against].to_numpy()))
                )
    columns = [
        "case",
        "time_s",
        "quantity",
        "method",
        "against",
        "runs",
        "win_rate",
        "median_difference",
        "ratio",
        "p_value",
    ]
    result = pd.DataFrame(rows, columns=columns)
    if names is not None:
        result.insert(1, "name", result["case"].map(dict(names)))
    return result


def paired(a: Sequence[float] | Array, b: Sequence[float] | Array) -> tuple[int, float, float, float, float]:
    """Runs, win rate of `a`, median difference of the magnitudes, ratio of the RMS, and the sign test's p-value."""
    a, b = np.abs(np.asarray(a, dtype=np.float64)), np.abs(np.asarray(b, dtype=np.float64))
    if a.size == 0:
        return 0, math.nan, math.nan, math.nan, math.nan
    difference = a - b
    wins, losses = int(np.sum(difference < 0)), int(np.sum(difference > 0))
    rate = (wins + 0.5 * (a.size - wins - losses)) / a.size
    ratio = float(np.sqrt(np.mean(a**2) / np.mean(b**2))) if np.any(b) else math.nan
    return a.size, rate, float(np.median(difference)), ratio, sign_test(wins, losses)


def sign_test(wins: int, losses: int) -> float:
    """Two-sided p-value of so uneven a count, or a more uneven one, from a fair coin."""
    from scipy.special import bdtr

    n = wins + losses
    return 1.0 if n == 0 else min(1.0, 2.0 * float(bdtr(min(wins, losses), n, 0.5)))
