"""A reader, a method, a motion, an aid and error states (errors.py) of one's own: found by entry points, see pyproject.toml."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import truenorth as tn
from truenorth.aiding.source import Aiding
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import turn


def read(path: Path, layout: Any) -> tn.ImuRecord:
    """Rows ``t;wx;wy;wz;fx;fy;fz`` in rad/s and m/s^2, axes right, forward, up."""
    t, *columns = np.loadtxt(path, delimiter=";").T
    return tn.ImuRecord(t, np.stack(columns[:3], axis=1), np.stack(columns[3:], axis=1), source=str(path))


def align(request: tn.Request) -> tn.Alignment:
    """The library's own means, under another name: a method returns an Alignment."""
    answer = tn.align(request.record, request.place, request.imu, method="analytic")
    return replace(answer, method="triad", method_reason="the example's own")


def spiral(position: tn.Position, arm: Any, rng: np.random.Generator, *, speed: float = 10.0) -> Any:
    """A level circle of ten turns."""
    return course(position, turn(np.radians(3600.0), np.radians(6.0)), speed=speed, lever_arm=arm)


@dataclass(frozen=True)
class Fixes:
    """Positions of a total station, ``time,lat,lon,alt`` in seconds, degrees and metres, good to 2 cm."""

    rows: np.ndarray
    key: ClassVar[str] = "fixes"
    record: None = None

    @classmethod
    def read(cls, path: Path) -> "Fixes":
        """From a file."""
        return cls(np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2))

    def sources(self, altitude: str) -> list[Aiding]:
        """One source of positions; groups of error states would go into its `states`."""
        place = np.column_stack([np.radians(self.rows[:, 1:3]), self.rows[:, 3]])
        return [Aiding("fixes", "position", self.rows[:, 0], place, np.full(place.shape, 0.02))]
