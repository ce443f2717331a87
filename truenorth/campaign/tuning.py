"""Tuning: the noise figures to give a method in a scenario, searched by Optuna and judged on data it never saw.

name: harbour
scenario: quay
method: kalman
search:
gyro.random_walk: [0.0001 deg/sqrt(h), 0.1 deg/sqrt(h)]
accel.random_walk: [1 ug/sqrt(Hz), 1000 ug/sqrt(Hz)]
runs: 20
trials: 40
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from truenorth.alignment.procedure import Method
from truenorth.campaign.aligning import align_runs
from truenorth.campaign.plan import Plan, read_plan
from truenorth.campaign.rows import table_of
from truenorth.campaign.summary import summarise
from truenorth.core.errors import DataError, UsageError
from truenorth.core.schema import Strict, validated
from truenorth.core.shown import Shown
from truenorth.core.units import format as format_quantity
from truenorth.core.units import parse
from truenorth.core.yaml_file import read_mapping, unknown_key
from truenorth.records.spec_keys import KEYS
from truenorth.records.specs import ImuSpec, imu_spec

if TYPE_CHECKING:
    import pandas as pd

HELD_OUT = 1  # added to the seed for the data that judge
OUTSIDE = 10.0  # a trial counts as so many times worse for each factor e by which it is out of its bands


class Search(Strict):
    """What a tuning file holds.

    Attributes
    ----------
    name : str
    scenario : name, file or mapping
    method : str
        As :func:`truenorth.align` takes it.
    search : mapping of term to (lowest, highest)
        Terms of the specification that the method is given; searched on a logarithmic scale. The others are the simulated IMU's.
    quantity : str
        Whose RMS is to be smallest.
    runs, trials, seed : int
    """

    name: str = Field(min_length=1)
    scenario: str | dict[str, Any]
    method: Method = "kalman"
    search: dict[str, tuple[str, str]] = Field(min_length=1)
    quantity: Literal["phi_u", "phi_e", "phi_n", "level"] = "phi_u"
    runs: int = Field(20, ge=2)
    trials: int = Field(40, ge=1)
    seed: int = Field(0, ge=0)


@dataclass(frozen=True, repr=False)
class Tuned(Shown):
    """The outcome of a search."""

    search: Search
    spec: ImuSpec  # the best found
    trials: pd.DataFrame  # terms (SI), rms, nees and whether it is in its band, one row a trial
    # the best and the simulated IMU's own specification on runs of another seed, which the search never saw: rms with its
    # interval, rms_over_sigma, nees with its band
    judged: pd.DataFrame

    def in_brief(self) -> dict[str, str]:
        """The search and how many trials it took."""
        return {"name": self.search.name, "method": self.search.method, "trials": str(len(self.trials))}

    def to_frame(self) -> pd.DataFrame:
        """The trials; see `trials`."""
        return self.trials


def read_search(source: str | PathLike[str] | Mapping[str, Any]) -> Search:
    """A search from a YAML file or a mapping.

    Raises
    ------
    UsageError, DataError
        The file cannot be opened; a key, a term of the specification, a unit or a range that is wrong.
    """
    where, content = ("search", source) if isinstance(source, Mapping) else (str(source), read_mapping(source))
    search = validated(Search, dict(content), where)
    known = {f"{group}.{key}": entry.dimension for group, keys in KEYS.items() for key, entry in keys.items()}
    for term, limits in search.search.items():
        if term not in known:
            raise DataError(unknown_key(f"{where}: search", term, known))
        try:
            low, high = (parse(text, known[term]) for text in limits)
        except UsageError as error:
            raise DataError(f"{where}: search.{term}: {error}") from None
        if not 0 < low < high:
            raise DataError(
                f"{where}: search.{term}: {limits[0]} to {limits[1]}; expected two positive values, the smaller first"
            )
    return search


def tune(
    source: Search | str | PathLike[str] | Mapping[str, Any], *, progress: Callable[[int, int], None] | None = None
) -> Tuned:
    """Search for the specification with which a method errs least, its sigma and NEES inside their bands.

    The sampler has the search's seed: the same search gives the same answer.

    Parameters
    ----------
    source : Search, path or mapping
    progress : callable, optional
        Called with the trials done and the trials in all.

    Raises
    ------
    UsageError
        Optuna is not installed.
    DataError
        A search with a mistake, or no trial that gave an answer.
    """
    try:
        import optuna
    except ImportError:
        raise UsageError("tuning needs Optuna: pip install 'truenorth[tune]'") from None
    import pandas as pd

    search = source if isinstance(source, Search) else read_search(source)
    tell = progress or (lambda done, total: None)
    bench = _Bench(search)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=search.seed))
    rows: list[dict[str, Any]] = []

    def objective(trial: Any) -> float:
        values = {term: trial.suggest_float(term, low, high, log=True) for term, (low, high) in bench.limits.items()}
        result = bench.judge(bench.spec_with(values), search.seed)
        rows.append({**values, **result})
        tell(len(rows), search.trials)
        return _score(result, search.runs)

    start = {
        term: value for term, value in bench.usual.items() if bench.limits[term][0] <= value <= bench.limits[term][1]
    }
    if len(start) == len(bench.limits):
        study.enqueue_trial(start)
    study.optimize(objective, n_trials=search.trials)
    if not math.isfinite(study.best_value):
        raise DataError(f"search {search.name!r}: no trial gave an answer; is the scenario one that can be aligned?")
    best = bench.spec_with(study.best_params)
    held_out = search.seed + HELD_OUT
    judged = [
        {"specification": name, "seed": held_out, **bench.judge(spec, held_out)}
        for name, spec in (("tuned", best), ("simulated IMU's own", bench.own))
    ]
    return Tuned(search, best, pd.DataFrame(rows), pd.DataFrame(judged))


class _Bench:
    """A scenario and a method, ready to be tried with any specification."""

    def __init__(self, search: Search) -> None:
        self.search = search
        case = self._plan("simulated", search.seed).cases[0]
        self.own = case.built.imu_spec
        self.limits = {
            term: tuple(parse(text, KEYS[term.split(".")[0]][term.split(".")[1]].dimension) for text in limits)
            for term, limits in search.search.items()
        }
        self.usual = {term: float(getattr(self.own, term.replace(".", "_"))) for term in self.limits}

    def _plan(self, imu: str | dict[str, Any], seed: int) -> Plan:
        method = {"name": "tried", "method": self.search.method, "imu": imu}
        return read_plan(
            {
                "name": self.search.name,
                "runs": self.search.runs,
                "seed": seed,
                "scenarios": [self.search.scenario],
                "methods": [method],
            }
        )

    @cached_property
    def _base(self) -> dict[str, Any]:
        return self.own.to_mapping()

    def spec_with(self, values: Mapping[str, float]) -> ImuSpec:
        """The simulated IMU's specification with some terms (SI) changed."""
        mapping = copy.deepcopy(self._base)
        for term, value in values.items():
            group, key = term.split(".")
            mapping.setdefault(group, {})[key] = format_quantity(value, KEYS[group][key].unit, digits=4)
        return imu_spec(mapping | {"name": "tuned"})

    def judge(self, spec: ImuSpec, seed: int) -> dict[str, Any]:
        """Statistics of the runs of a seed with a specification."""
        plan = self._plan(spec.to_mapping(), seed)
        rows = align_runs(plan, plan.cases[0], range(self.search.runs))
        table = summarise(table_of(rows).to_pandas()).set_index("quantity")
        if self.search.quantity not in table.index:
            return {"answers": 0, "rms": math.inf, "nees": math.nan, "in_band": False}
        errors, nees = (table.loc[name].to_dict() for name in (self.search.quantity, "nees"))
        honest_nees = nees["ratio_low"] <= nees["mean"] <= nees["ratio_high"]
        honest_sigma = errors["ratio_low"] <= errors["rms_over_sigma"] <= errors["ratio_high"]
        return {
            "answers": errors["runs"],
            **{
                name: errors[name]
                for name in ("rms", "rms_low", "rms_high", "rms_over_sigma", "ratio_low", "ratio_high")
            },
            "nees": nees["mean"],
            "nees_low": nees["ratio_low"],
            "nees_high": nees["ratio_high"],
            "in_band": bool(honest_nees and honest_sigma),
        }


def _score(result: Mapping[str, Any], runs: int) -> float:
    """RMS, made worse where sigma or NEES is out of its band, and where runs have no answer.

    Without the last a specification that refuses the hard runs would win.
    """
    if not result["answers"]:
        return math.inf
    nees, ratio = result["nees"], result["rms_over_sigma"]
    out = max(
        1.0,
        result["nees_low"] / nees,
        nees / result["nees_high"],
        result["ratio_low"] / ratio,
        ratio / result["ratio_high"],
    )
    return float(result["rms"] * (1 + OUTSIDE * math.log(out)) * (runs / result["answers"]) ** 2)
