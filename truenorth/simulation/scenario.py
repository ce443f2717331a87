"""Scenarios: a motion, an IMU and its aiding sensors in one YAML file, simulated by one call.

A file holds quantities with their units, and what it leaves out has the defaults of :class:`Scenario`:

    name: van
    duration: 600 s
    position: {lat: 48.1 deg, lon: 11.6 deg}
    motion: {kind: ring, radius: 200 m, speed: 15 m/s}
    imu: industrial
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from difflib import get_close_matches
from functools import cached_property
from importlib import resources
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field, PrivateAttr, field_validator

from truenorth.core.errors import DataError, TruenorthError, UsageError
from truenorth.core.paths import as_path, is_file
from truenorth.core.position import Position
from truenorth.core.schema import Angle, Frequency, Length, Strict, Time, validated
from truenorth.core.yaml_file import read_mapping
from truenorth.records.flexure import FlexureSpec
from truenorth.records.motion import Moving
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import IdealLog, Simulation, given_errors, ideal_log, simulate
from truenorth.simulation.aiding import Aided, AidingSpec, simulate_sensor
from truenorth.simulation.encoder import EncoderSpec
from truenorth.simulation.flexure import Flexed
from truenorth.simulation.indexer import Indexed
from truenorth.simulation.motion import Motion
from truenorth.simulation.scenario_courses import RouteMotion
from truenorth.simulation.scenario_motion import Disturbance, MotionModel, disturbed
from truenorth.simulation.scenario_sensors import AIDING, IndexerModel
from truenorth.simulation.streams import stream

MOTION_STREAM = 200  # of the motion's own draws, and one more for each disturbance
LONGEST = 1e7  # s; motions lay their knots over all of it
SHIPPED = resources.files("truenorth.simulation") / "scenarios"


class Place(Strict):
    """Where it happens, geodetic."""

    lat: Angle
    lon: Angle = 0.0
    alt: Length = 0.0


class Scenario(Strict):
    """What a scenario file holds.

    Attributes
    ----------
    name, description : str
    seed : int
    duration, start : float, s
    rate : float, Hz
        Of the IMU.
    position : Place
        Where the motion begins; not needed by a route, which has its own.
    motion, disturbances
        See :mod:`truenorth.simulation.scenario_motion`.
    lever_arm : (3,) floats, m
        From the motion's centre to the IMU, body axes.
    imu : preset, file or mapping
        See :func:`truenorth.imu_spec`; an ideal IMU when left out.
    output : {"increments", "rates"}
    errors : mapping
        Errors of the IMU that are given, not drawn; see :func:`truenorth.simulation.given_errors`.
    indexer : IndexerModel
        The IMU turns in the body.
    flexure : mapping
        The IMU's seat bends; see :class:`truenorth.simulation.FlexureSpec`.
    odometer, velocity_log, gnss, height, master : mapping
        Aiding sensors, on the rigid body; see the specifications of :mod:`truenorth.simulation`. An empty one is ideal.
    """

    name: str = Field(min_length=1)
    description: str = ""
    seed: int = Field(0, ge=0)
    duration: Time
    start: Time = 0.0
    rate: Frequency = 100.0
    position: Place | None = None
    motion: MotionModel
    disturbances: tuple[Disturbance, ...] = ()
    lever_arm: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    imu: str | dict[str, Any] | None = None
    output: Literal["increments", "rates"] = "increments"
    errors: dict[str, Any] | None = None
    indexer: IndexerModel | None = None
    flexure: dict[str, Any] | None = None
    odometer: dict[str, Any] | None = None
    velocity_log: dict[str, Any] | None = None
    gnss: dict[str, Any] | None = None
    height: dict[str, Any] | None = None
    master: dict[str, Any] | None = None
    _folder: Path = PrivateAttr(default_factory=Path)
    _source: str = PrivateAttr(default="scenario")

    @field_validator("duration", "rate")
    @classmethod
    def _positive(cls, value: float) -> float:
        if not value > 0:
            raise ValueError(f"{value:g}; expected a positive value")
        return value

    @field_validator("duration")
    @classmethod
    def _of_this_life(cls, value: float) -> float:
        if value > LONGEST:
            raise ValueError(f"{value:g} s; expected {LONGEST:g} s ({LONGEST / 86400:.0f} days) at most")
        return value

    @cached_property
    def imu_spec(self) -> ImuSpec:
        """The IMU, in SI: what is not named is not simulated."""
        if self.imu is None:
            return ImuSpec(name="ideal")
        if isinstance(self.imu, str) and is_file(self._folder / self.imu):
            return replace(imu_spec(self._folder / self.imu), unsaid=())
        return replace(imu_spec(self.imu), unsaid=())

    def build_motion(self, seed: int | None = None, run: int = 0, number: int = 0) -> Motion:
        """The motion of a run.

        Raises
        ------
        DataError
            A motion that no vehicle can make; the message names the key.
        """
        return self._built(self._generators(self.seed if seed is None else seed, run, number))

    @cached_property
    def is_drawn(self) -> bool:
        """Whether the motion differs from run to run: whether building it draws anything."""
        used, fresh = self._generators(0, 0, 0), self._generators(0, 0, 0)
        self._built(used)
        return any(a.random() != b.random() for a, b in zip(used, fresh, strict=True))

    def _generators(self, seed: int, run: int, number: int) -> list[np.random.Generator]:
        """One for the motion, one for each disturbance."""
        return [stream(seed, number, run, MOTION_STREAM + k) for k in range(1 + len(self.disturbances))]

    def _built(self, generators: list[np.random.Generator]) -> Motion:
        if self.position is None and self.motion.kind != "route":
            raise DataError(f"{self._source}: position is missing; expected position: {{lat: 45 deg, lon: 10 deg}}")
        where = "position"
        try:
            place = Position(0.0) if self.position is None else Position(**self.position.__dict__)
            where = "motion"
            motion = self.motion.build(place, self.lever_arm, generators[0], self._folder)
        except UsageError as error:
            raise DataError(f"{self._source}: {where}: {error}") from None
        try:
            return disturbed(motion, self.disturbances, generators[1:])
        except UsageError as error:
            raise DataError(f"{self._source}: {error}") from None

    def imu_motion(self, body: Motion, seed: int | None = None, run: int = 0, number: int = 0) -> Moving:
        """The motion of the IMU on a body: where its seat bends and it turns, as it does.

        Raises
        ------
        DataError
            An indexer or a flexure that cannot be; the message names the key.
        """
        moving: Moving = body
        span = {"duration": self.duration, "start": self.start}
        if self.flexure is not None:
            spec = FlexureSpec.from_mapping(self.flexure, f"{self._source}: flexure")
            moving = Flexed(moving, spec, seed=self.seed if seed is None else seed, run=run, scenario=number, **span)
        if self.indexer is not None:
            try:
                moving = Indexed(moving, self.indexer.build(self.start + self.duration))
            except UsageError as error:
                raise DataError(f"{self._source}: indexer: {error}") from None
        return moving

    def ideal(self, seed: int | None = None, run: int = 0, number: int = 0) -> IdealLog:
        """What an ideal IMU measures on a run's motion."""
        motion = self.imu_motion(self.build_motion(seed, run, number), seed, run, number)
        return ideal_log(motion, rate=self.rate, duration=self.duration, start=self.start)

    def simulate(
        self, *, seed: int | None = None, run: int = 0, number: int = 0, ideal: IdealLog | None = None
    ) -> Simulation:
        """Simulate one run of the IMU.

        Parameters
        ----------
        seed : int, optional
            The scenario's own when left out.
        run, number : int
            Of the run, and of the scenario among others: the same three give the same bits.
        ideal : IdealLog, optional
            Made before by :meth:`ideal`, where all runs share the motion.
        """
        seed = self.seed if seed is None else seed
        return simulate(
            self.ideal(seed, run, number) if ideal is None else ideal,
            imu=self.imu_spec,
            seed=seed,
            run=run,
            scenario=number,
            kind=self.output,
            errors=None if self.errors is None else given_errors(self.errors, f"{self._source}: errors"),
        )

    def simulate_aiding(self, *, seed: int | None = None, run: int = 0, number: int = 0) -> dict[str, Aided[Any]]:
        """Simulate the aiding sensors of a run, by their key; with an indexer also its `encoder`.

        Raises
        ------
        DataError
            A specification with a mistake, or a sensor that has nothing to say in the time; the message names the key.
        """
        seed = self.seed if seed is None else seed
        draw: dict[str, Any] = {
            "seed": seed,
            "run": run,
            "scenario": number,
            "duration": self.duration,
            "start": self.start,
        }
        body = self.build_motion(seed, run, number)
        logs: dict[str, Aided[Any]] = {}
        for key, spec in self.aiding_specs.items():
            try:
                logs[key] = simulate_sensor(body, spec, **draw)
            except UsageError as error:
                raise DataError(f"{self._source}: {key}: {error}") from None
        if self.indexer is not None:
            indexer = self.indexer.build(self.start + self.duration)
            logs["encoder"] = simulate_sensor(indexer, self._encoder(self.indexer), **draw)
        return logs

    def _encoder(self, indexer: IndexerModel) -> EncoderSpec:
        return indexer.encoder_spec(self.rate, f"{self._source}: indexer.encoder")

    @cached_property
    def aiding_specs(self) -> dict[str, AidingSpec[Any]]:
        """Specifications of the aiding sensors that the scenario has."""
        given = {key: getattr(self, key) for key in AIDING}
        return {
            key: AIDING[key].from_mapping(content, f"{self._source}: {key}")
            for key, content in given.items()
            if content is not None
        }

    def to_mapping(self) -> dict[str, Any]:
        """The scenario with all its defaults, as a file that needs no other file and reads back to the same bits."""
        resolved = self.model_dump(mode="json", exclude_none=True)
        if isinstance(self.motion, RouteMotion):
            resolved["motion"] = self.motion.with_points(self._folder).model_dump(mode="json", exclude_none=True)
        if isinstance(self.imu, str) and is_file(self._folder / self.imu):
            resolved["imu"] = read_mapping(self._folder / self.imu)
        return resolved


def read_scenario(source: str | PathLike[str] | Mapping[str, Any] | Scenario) -> Scenario:
    """A scenario from a file, from the name of one that ships with the library, or from a mapping.

    Raises
    ------
    UsageError
        A name that is neither.
    DataError
        An unknown key, a wrong unit, a value out of range: the message names the file and the path of the key.
    """
    if isinstance(source, Scenario):
        return source
    if isinstance(source, Mapping):
        return _checked(source, "scenario", Path())
    path = as_path(source, "scenario")
    if path.suffix in (".yaml", ".yml") or is_file(path):
        return _checked(read_mapping(path), str(path), path.parent)
    with resources.as_file(SHIPPED) as folder:
        names = sorted(file.stem for file in folder.glob("*.yaml"))
    if str(source) not in names:
        near = get_close_matches(str(source), names, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"those that ship with us: {', '.join(names)}"
        raise UsageError(f"scenario {str(source)!r} is neither a file that can be read nor known by name; {hint}")
    with resources.as_file(SHIPPED / f"{source}.yaml") as file:
        return _checked(read_mapping(file), f"{source}.yaml", file.parent)


def shipped() -> dict[str, str]:
    """Name and description of the scenarios that ship with the library."""
    with resources.as_file(SHIPPED) as folder:
        return {file.stem: str(read_mapping(file).get("description", "")) for file in sorted(folder.glob("*.yaml"))}


def _checked(content: Mapping[str, Any], source: str, folder: Path) -> Scenario:
    scenario = validated(Scenario, dict(content), source)
    scenario._folder, scenario._source = folder, source
    # Read now, so that mistakes are found before the work.
    try:
        scenario.imu_spec  # noqa: B018
    except TruenorthError as error:
        raise DataError(f"{source}: imu: {error}") from None
    scenario.aiding_specs  # noqa: B018
    if scenario.errors is not None:
        given_errors(scenario.errors, f"{source}: errors")
    if scenario.indexer is not None:
        scenario._encoder(scenario.indexer)
    if scenario.flexure is not None:
        FlexureSpec.from_mapping(scenario.flexure, f"{source}: flexure")
    return scenario
