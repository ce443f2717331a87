"""Courses of vehicles as a scenario file describes them: rings, manoeuvres one after the other, routes of way-points.

Built as the motions of :mod:`truenorth.simulation.scenario_motion`.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from truenorth.core.position import Position
from truenorth.core.schema import Acceleration, Angle, AngularRate, Length, Speed, Strict, Time, numbered
from truenorth.simulation import manoeuvres
from truenorth.simulation.course import Leg, check_leg, course, ring
from truenorth.simulation.motion import Motion
from truenorth.simulation.route import Driving, WayPoint, route
from truenorth.simulation.waypoints import read_waypoints

Arm = tuple[float, float, float]
Rng = np.random.Generator


class RingMotion(Strict):
    """A vehicle on a ring track."""

    kind: Literal["ring"]
    radius: Length
    speed: Speed
    heading: Angle = 0.0
    clockwise: bool = True
    wait: Time = 0.0
    acceleration: Acceleration = 1.0

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        own = {name: value for name, value in self.__dict__.items() if name != "kind"}
        return ring(position, lever_arm=arm, **own)


class _Manoeuvre(Strict):
    """What becomes legs by the function of :mod:`truenorth.simulation.manoeuvres` that its kind names, with its own fields."""

    kind: str

    def legs(self, speed: float) -> list[Leg]:
        """The manoeuvre as legs, begun at a speed (m/s)."""
        own = {name: value for name, value in self if name != "kind"}
        legs: list[Leg] = getattr(manoeuvres, self.kind)(**own)
        return legs


class Straight(_Manoeuvre):
    """Straight on, or standing, for a time."""

    kind: Literal["straight"]
    duration: Time


class Turn(_Manoeuvre):
    """A level turn, clockwise positive."""

    kind: Literal["turn"]
    angle: Angle
    rate: AngularRate
    bank: Literal["flat", "coordinated"] = "flat"
    onset: Time = 2.0


class STurn(Turn):
    """Out to one side and back, to the other and back."""

    kind: Literal["s_turn"]  # type: ignore[assignment]  # the discriminator
    times: int = Field(1, ge=1)
    bank: Literal["flat", "coordinated"] = "coordinated"


class Accelerate(_Manoeuvre):
    """To another speed, higher or lower."""

    kind: Literal["accelerate"]
    to: Speed
    acceleration: Acceleration
    onset: Time = 2.0

    def legs(self, speed: float) -> list[Leg]:
        """The manoeuvre as legs, begun at a speed (m/s)."""
        return manoeuvres.accelerate(self.to, self.acceleration, speed, self.onset)


class Climb(_Manoeuvre):
    """Up (or down) at a slope for a time, and level again."""

    kind: Literal["climb"]
    slope: Angle
    duration: Time
    rate: AngularRate = math.radians(2.0)
    onset: Time = 1.0


class WingRock(_Manoeuvre):
    """Straight on, rolling from side to side."""

    kind: Literal["wing_rock"]
    duration: Time
    amplitude: Angle
    period: Time

    def legs(self, speed: float) -> list[Leg]:
        """The manoeuvre as legs, begun at a speed (m/s); the rolling comes on top."""
        return manoeuvres.straight(self.duration)


Manoeuvre = Annotated[Straight | Turn | STurn | Accelerate | Climb | WingRock, Field(discriminator="kind")]


class LegsMotion(Strict):
    """Manoeuvres one after the other: a flight, a ship under way, a drive."""

    kind: Literal["legs"]
    heading: Angle = 0.0
    speed: Speed = 0.0
    legs: tuple[Manoeuvre, ...] = Field(min_length=1)

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        legs: list[Leg] = []
        rocks: list[tuple[int, float, WingRock]] = []
        speed = self.speed
        for number, item in enumerate(self.legs, 1):
            if isinstance(item, WingRock):
                rocks.append((number, manoeuvres.length(legs), item))
            with numbered("legs", number):
                own = item.legs(speed)
                for leg in own:
                    check_leg(leg, speed)
            legs += own
            speed = next((leg.speed for leg in reversed(legs) if leg.speed is not None), self.speed)
        motion: Motion = course(position, legs, heading=self.heading, speed=self.speed, lever_arm=arm)
        for number, start, rock in rocks:
            with numbered("legs", number):
                motion = manoeuvres.wing_rock(motion, start, start + rock.duration, rock.amplitude, rock.period)
        return motion


class Point(Strict):
    """A way-point."""

    lat: Angle
    lon: Angle
    alt: Length = 0.0
    speed: Speed | None = None
    stop: Time = 0.0


class DrivingStyle(Strict):
    """See :class:`truenorth.simulation.route.Driving`."""

    speed: Speed = Driving.speed
    acceleration: Acceleration = Driving.acceleration
    lateral_acceleration: Acceleration = Driving.lateral_acceleration
    radius: Length = Driving.radius
    smallest_radius: Length = Driving.smallest_radius
    onset: Time = Driving.onset


class RouteMotion(Strict):
    """A land vehicle along way-points, given here or in a CSV or GPX file; the scenario's position is not used."""

    kind: Literal["route"]
    points: tuple[Point, ...] = ()
    file: str | None = None
    spacing: Length | None = None
    driving: DrivingStyle = DrivingStyle()
    wait: Time = 0.0

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if bool(self.points) == (self.file is not None):
            raise ValueError("expected points, or the file (.csv or .gpx) that holds them")
        return self

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        points = [WayPoint(**point.__dict__) for point in self.with_points(folder).points]
        return route(points, Driving(**self.driving.__dict__), wait=self.wait, lever_arm=arm)

    def with_points(self, folder: Path) -> Self:
        """The same route, its points read from the file."""
        if self.file is None:
            return self
        points = tuple(Point.model_construct(**vars(p)) for p in read_waypoints(folder / self.file, self.spacing))
        return self.model_copy(update={"points": points, "file": None, "spacing": None})
