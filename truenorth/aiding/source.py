"""Measurements that aid an INS, of any sensor, in one form that the closed loop takes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.body_velocity import BODY_VELOCITY
from truenorth.aiding.height import HEIGHT
from truenorth.aiding.position import POSITION
from truenorth.aiding.rest import ROTATION
from truenorth.aiding.row import Row
from truenorth.aiding.velocity import VELOCITY
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.errors import DataError, UsageError
from truenorth.errors.group import Group
from truenorth.state.limits import limit

Array = NDArray[np.float64]
Role = Literal["lever arm", "scale", "mounting", "bias", "lag", "flexure", "own", "filter"]
Does = Literal["measurement", "disturbance", "place"]

KINDS: dict[str, Row] = {row.name: row for row in (POSITION, VELOCITY, BODY_VELOCITY, HEIGHT, ROTATION)}
NO_GATE = math.inf
LEAST_TURN = 1e-12  # rad: a sigma is positive


@dataclass(frozen=True)
class Aiding:
    """Measurements of one kind from one sensor.

    Attributes
    ----------
    name : str
        Such as "GNSS position"; the states it adds are named after it ("odometer scale").
    kind : str or Row
        "position" (lat, lon in rad, height in m), "velocity" (east, north, up), "body velocity" (right, forward, up),
        "height", "rotation" (the base does not turn); or a row of one's own.
    time : (M,) array, s
        When the measurement holds, on the IMU's clock; any order.
    measured : (M, k) array
        NaN where absent; of as many numbers as its row takes.
    sigma : (M, 3) array
        One-sigma noise; of a position in metres (east, north, up), of a rotation the angle, rad, at both ends of its mean rate.
    lever_arm : (3,) array, m
        IMU to sensor, body axes.
    C_mb : (3, 3) array
        Body to the sensor's axes.
    states : mapping of role to Group
        What of the sensor is estimated: "lever arm" (3), "scale" (1), "mounting" (2: about x and z), "bias" (3; 1 of a
        height), "lag" (1).
    gate : float
        Probability of rejecting a sound measurement by its normalised innovation squared; 0: no gate.
    loop : float, s
        Of heights: time constant of a third-order loop that takes the place of the Kalman gain; 0: none.
    figures : sequence of float
        Of a row of one's own: what it needs beyond arm and axes, eight numbers at most.
    retimed : bool
        Taken at its stamp less the delay as known at the time (its "lag"), not at its stamp.
    patience : int
        With `opens`: so many rejections in a row are a jump that is believed.
    opens : str, int or None
        The group, or the first state, that takes up a jump; None: none is believed.
    does : {"measurement", "disturbance", "place"}
        "disturbance" adds to the covariance (velocity by `measured`, attitude by the square of `sigma`); "place" puts the
        vehicle where a position says.
    output : bool or (M,) array of bool
        Put out the state after each row, or after these.
    """

    name: str
    kind: str | Row
    time: Array
    measured: Array
    sigma: Array
    lever_arm: Array = field(default_factory=lambda: np.zeros(3))
    C_mb: Array = field(default_factory=lambda: np.eye(3))
    states: Mapping[Role, Group] = field(default_factory=dict)
    gate: float = limit("gate")
    loop: float = 0.0
    figures: Sequence[float] = ()
    retimed: bool = False
    patience: int = 0
    opens: str | int | None = None
    does: Does = "measurement"
    output: bool | NDArray[np.bool_] = False

    def __post_init__(self) -> None:
        if isinstance(self.kind, str) and self.kind not in KINDS:
            raise UsageError(f"{self.name}: kind {self.kind!r} is not known; choose one of {', '.join(KINDS)}")
        count, width = len(np.atleast_1d(self.time)), self.row.width
        for name, shape in (
            ("time", (count,)),
            ("measured", (count, width)),
            ("sigma", (count, 3)),
            ("lever_arm", (3,)),
            ("C_mb", (3, 3)),
        ):
            try:
                array = np.ascontiguousarray(np.broadcast_to(np.asarray(getattr(self, name), np.float64), shape))
            except ValueError:
                found = np.shape(getattr(self, name))
                raise DataError(f"{self.name}: {name} has the shape {found}; expected {shape}") from None
            object.__setattr__(self, name, array)
        if not np.all(np.isfinite(self.time)):
            row = int(np.flatnonzero(~np.isfinite(self.time))[0])
            raise DataError(f"{self.name}: row {row + 1}, column time: {self.time[row]}; expected a finite number")
        given = np.isfinite(self.measured) if width == 3 else np.isfinite(self.measured[:, :1])
        bad = given[:, : self.row.rows] & ~((self.sigma > 0.0) & np.isfinite(self.sigma))[:, : self.row.rows]
        if bad.any():
            row, column = np.argwhere(bad)[0]
            raise DataError(
                f"{self.name}: row {row + 1}: sigma {self.sigma[row, column]}; expected a positive one-sigma noise"
            )
        for role, group in self.states.items():
            length = self.row.sizes.get(role, 0)
            if len(group.sigma) != length:
                raise UsageError(f"{self.name}: {role} has {len(group.sigma)} states; expected {length}")

    @classmethod
    def disturbance(cls, name: str, time: ArrayLike = (), push: ArrayLike = 0.0, turn: ArrayLike = 0.0) -> Aiding:
        """What may have happened to an IMU unseen, no measurement: an addition to the covariance.

        Parameters
        ----------
        time : (M,) array, s
        push, turn : (M, 1) arrays, m/s and rad
            One sigma of the velocity and of the attitude that came in, each axis.
        """
        push, turn = np.asarray(push, np.float64), np.maximum(np.asarray(turn, np.float64), LEAST_TURN)
        # The kernel's form: variance of velocity as measured, of attitude as variance.
        return cls(name, "velocity", np.asarray(time, np.float64), push**2, turn, does="disturbance")

    @property
    def row(self) -> Row:
        """Its compiled row."""
        return KINDS[self.kind] if isinstance(self.kind, str) else self.kind

    @property
    def instant(self) -> bool:
        """Whether its rows need the rate at their very time."""
        on_an_arm = bool(self.lever_arm.any()) or "lever arm" in self.states
        shows_swing = self.row.swings and ("lag" in self.states or not self.row.swings_late)
        return self.row.instant or (shows_swing and on_an_arm)

    @property
    def over_ground(self) -> bool:
        """Whether it shows velocity or place along east and north, which turn with the azimuth; that nothing moves does not."""
        along = self.row.over_ground and self.does == "measurement"
        return along and not (len(self.time) > 0 and not np.nan_to_num(self.measured).any())

    def gates(self) -> Array:
        """(3,) limits of the normalised innovation squared of one, two and three rows."""
        if self.gate <= 0.0:
            return np.full(3, NO_GATE)
        return np.array([chi_square_limit(float(self.gate), dof) for dof in (1, 2, 3)])


def state(
    name: str, role: Role, sigma: ArrayLike, correlation_time: float = math.inf, walk: float = 0.0
) -> dict[Role, Group]:
    """One estimated property of the sensor of this name, for `Aiding.states`."""
    return {role: Group(f"{name} {role}", np.atleast_1d(np.asarray(sigma, np.float64)), correlation_time, walk)}
