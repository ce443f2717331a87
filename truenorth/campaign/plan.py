"""The plan of a campaign: scenarios x parameter grid x methods x runs.

name: which_gyro
runs: 200
scenarios: [static_kalman]
grid:
imu.gyro.bias: [0.003 deg/h, 0.01 deg/h, 0.03 deg/h]
methods: [kalman, oba]
times: [120 s, 300 s]
"""

from __future__ import annotations

import copy
import hashlib
import itertools
import json
import math
import re
from collections.abc import Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, get_args

from pydantic import Field, PrivateAttr, field_validator

from truenorth.alignment.assumptions import MOVING
from truenorth.alignment.procedure import Method
from truenorth.core.errors import DataError, TruenorthError
from truenorth.core.paths import as_path, is_file
from truenorth.core.plugins import plugins
from truenorth.core.schema import Angle, Strict, Time, validated
from truenorth.core.yaml_file import read_mapping
from truenorth.records.presets import PRESETS
from truenorth.simulation.scenario import Scenario, read_scenario

# A path into a scenario, motion.legs[2].rate: entries of a list count from one, as in our messages.
_PATH = re.compile(r"[^.\[\]]+(\[\d+\])*(\.[^.\[\]]+(\[\d+\])*)*")
_KEY = re.compile(r"([^.\[\]]+)|\[(\d+)\]")


class MethodPlan(Strict):
    """A method of alignment under a name of its own.

    Attributes
    ----------
    name : str
    method : str
        As :func:`truenorth.align` takes it, published filters too (those on the move by the odometer alone); or ``in_motion``,
        by the odometer and the GNSS receiver that the scenario has.
    imu : "simulated", "none", preset, file or mapping
        The specification that the method is given: that of the simulated IMU, none (it then asks the log), or another one.
    """

    name: str = Field(min_length=1)
    method: str
    imu: str | dict[str, Any] = "simulated"

    @property
    def moves(self) -> bool:
        """Whether it aligns on the move."""
        return self.method in ("in_motion", *MOVING)

    @field_validator("method")
    @classmethod
    def _known(cls, value: str) -> str:
        own = (*get_args(Method), "in_motion", *MOVING)
        if value not in own and value not in plugins("truenorth.methods"):
            raise ValueError(f"{value!r}; expected {', '.join(map(repr, (*own, *plugins('truenorth.methods'))))}")
        return value


class Case(Strict):
    """A scenario at one point of the grid.

    Attributes
    ----------
    number : int
    scenario_number : int
        Of the scenario in the plan: points of the grid share its random numbers, so that they compare like with like.
    parameters : dict
        Values of the grid, by path.
    scenario : dict
        The scenario as it stands in a file.
    """

    number: int
    scenario_number: int
    parameters: dict[str, Any]
    scenario: dict[str, Any]

    @property
    def name(self) -> str:
        """In words, for tables and figures."""
        values = [f"{path.rpartition('.')[2]} {value}" for path, value in self.parameters.items()]
        return ", ".join([str(self.scenario["name"]), *values])

    @cached_property
    def built(self) -> Scenario:
        """The scenario, validated."""
        return read_scenario(self.scenario)


class Plan(Strict):
    """What a plan file holds.

    Attributes
    ----------
    name, description : str
    runs, seed : int
        Run k does not depend on their number.
    block : int
        Runs that are worked on and written together.
    scenarios : list of name, file or mapping
    grid : mapping of path to list
        Dotted paths into the scenario; ``[n]`` is the n-th entry of a list, counted from one.
    methods : list of name or mapping
    times : list of s
        Also align the log up to each of these; the whole of it always.
    heading_limit : float, rad
    converged : float, rad
        A heading error that stays below it has converged.
    """

    name: str = Field(min_length=1)
    description: str = ""
    runs: int = Field(ge=1)
    seed: int = Field(0, ge=0)
    block: int = Field(20, ge=1)
    scenarios: tuple[str | dict[str, Any], ...] = Field(min_length=1)
    grid: dict[str, tuple[Any, ...]] = Field(default_factory=dict)
    methods: tuple[MethodPlan, ...] = Field(min_length=1)
    times: tuple[Time, ...] = ()
    heading_limit: Angle = math.radians(5.0)
    converged: Angle = math.radians(0.1)
    _folder: Path = PrivateAttr(default_factory=Path)
    _source: str = PrivateAttr(default="plan")

    @field_validator("methods", mode="before")
    @classmethod
    def _by_name(cls, value: Any) -> Any:
        if not isinstance(value, list | tuple):
            raise ValueError(f"{value!r}; expected a list of methods")
        return [{"name": item, "method": item} if isinstance(item, str) else item for item in value]

    @field_validator("grid")
    @classmethod
    def _not_empty(cls, value: dict[str, tuple[Any, ...]]) -> dict[str, tuple[Any, ...]]:
        for path, values in value.items():
            if not values:
                raise ValueError(f"{path} has no values; expected a list of one or more")
        return value

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """Every scenario at every point of the grid.

        Raises
        ------
        DataError
            A scenario with a mistake, or a path of the grid that leads nowhere.
        """
        result: list[Case] = []
        for number, source in enumerate(self.scenarios):
            base = self._scenario(source)
            for values in itertools.product(*self.grid.values()):
                parameters = dict(zip(self.grid, values, strict=True))
                scenario = copy.deepcopy(base)
                for path, value in parameters.items():
                    self._put(scenario, path, value)
                case = Case(number=len(result), scenario_number=number, parameters=parameters, scenario=scenario)
                try:
                    built = case.built
                except TruenorthError as error:
                    raise DataError(f"{self._source}: {case.name}: {error}") from None
                for method in self.methods:
                    if method.moves and built.odometer is None and (built.gnss is None or method.method != "in_motion"):
                        lacks = "has neither odometer nor gnss" if method.method == "in_motion" else "has no odometer"
                        raise DataError(
                            f"{self._source}: methods: {method.name!r} aligns in motion, and {case.name} {lacks}; give it one"
                        )
                for time in self.times:
                    if not 0 < time <= built.duration:
                        raise DataError(
                            f"{self._source}: times: {time:g} s; expected a time within the {built.duration:g} s of {case.name}"
                        )
                result.append(case)
        return tuple(result)

    def _scenario(self, source: str | dict[str, Any]) -> dict[str, Any]:
        nearby = self._folder / source if isinstance(source, str) else None
        try:
            scenario = read_scenario(nearby if nearby is not None and is_file(nearby) else source)
        except TruenorthError as error:
            raise DataError(f"{self._source}: scenarios: {error}") from None
        resolved = scenario.to_mapping()
        if isinstance(resolved.get("imu"), str):  # a preset: the grid can then reach its terms
            resolved["imu"] = {"name": resolved["imu"], **copy.deepcopy(PRESETS[resolved["imu"]])}
        return resolved

    def _put(self, scenario: dict[str, Any], path: str, value: Any) -> None:
        at: Any = scenario
        if not _PATH.fullmatch(path):
            raise DataError(f"{self._source}: grid: {path!r} is no path; expected keys such as motion.legs[2].rate")
        *above, last = [key or int(place) - 1 for key, place in _KEY.findall(path)]
        for key in above:
            at = at.get(key) if isinstance(at, dict) else at[key] if _has_entry(at, key) else None
            if not isinstance(at, dict | list):
                raise DataError(
                    f"{self._source}: grid: {path!r} leads nowhere in scenario {scenario['name']!r}: it has no "
                    f"{_words(key)} with keys below it"
                )
        if not (isinstance(last, str) if isinstance(at, dict) else _has_entry(at, last)):
            raise DataError(
                f"{self._source}: grid: {path!r} leads nowhere in scenario {scenario['name']!r}: there is no {_words(last)} in "
                f"{'that mapping' if isinstance(at, dict) else f'a list of {len(at)}'}"
            )
        at[last] = value

    @property
    def method_names(self) -> list[str]:
        """In the order of the plan."""
        return [method.name for method in self.methods]

    def with_runs(self, runs: int) -> Plan:
        """The same plan with another number of runs."""
        other = self.model_copy(update={"runs": runs})
        other._folder, other._source = self._folder, self._source
        return other

    def to_mapping(self) -> dict[str, Any]:
        """The plan with all its defaults, its scenarios written out: a file that needs no other file."""
        resolved = self.model_dump(mode="json")
        resolved["scenarios"] = [self._scenario(source) for source in self.scenarios]
        return resolved

    @cached_property
    def fingerprint(self) -> str:
        """Of all that decides the numbers; the number of runs, the block and the words do not."""
        content = {k: v for k, v in self.to_mapping().items() if k not in ("runs", "block", "name", "description")}
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _words(key: str | int) -> str:
    return repr(key) if isinstance(key, str) else f"entry [{key + 1}]"


def _has_entry(at: Any, key: str | int) -> bool:
    return isinstance(at, list) and isinstance(key, int) and 0 <= key < len(at)


def read_plan(source: str | PathLike[str] | Mapping[str, Any] | Plan) -> Plan:
    """A plan from a YAML file or a mapping.

    Raises
    ------
    UsageError
        The file cannot be opened.
    DataError
        A key, unit or value that is wrong: the message names the file and the key's path.
    """
    if isinstance(source, Plan):
        return source
    if isinstance(source, Mapping):
        plan = validated(Plan, dict(source), "plan")
    else:
        path = as_path(source, "plan")
        plan = validated(Plan, read_mapping(path), str(path))
        plan._folder, plan._source = path.parent, str(path)
    names = [method.name for method in plan.methods]
    for name in names:
        if names.count(name) > 1:
            raise DataError(f"{plan._source}: methods: two are named {name!r}; give each a name of its own")
    for method in plan.methods:
        if method.moves and method.imu == "none":
            raise DataError(
                f"{plan._source}: methods: {method.name!r} aligns in motion without a specification, and a log on the move "
                "cannot be asked for it; expected imu: simulated, a preset or a file"
            )
    plan.cases  # noqa: B018  # built now, so that mistakes are found before the work
    return plan
