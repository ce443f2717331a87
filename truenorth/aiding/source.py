"""Measurements that aid an INS, of any sensor, in one form that the closed loop takes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding import row
from truenorth.core.errors import DataError, UsageError
from truenorth.errors.group import Group
from truenorth.state.mounting import FALSE_REJECTION

Array = NDArray[np.float64]
Kind = Literal["position", "velocity", "body velocity", "height", "rotation", "disturbance"]
Role = Literal["lever arm", "scale", "mounting", "bias", "lag"]

KINDS: dict[str, int] = {
    "position": row.POSITION,
    "velocity": row.VELOCITY,
    "body velocity": row.BODY_VELOCITY,
    "height": row.HEIGHT,
    "rotation": row.ROTATION,
    "disturbance": row.DISTURBANCE,
}
LENGTHS: dict[str, int] = {"lever arm": 3, "scale": 1, "mounting": 2, "bias": 3, "lag": 1}
COLUMNS: dict[str, int] = {
    "lever arm": row.AT_ARM,
    "scale": row.AT_SCALE,
    "mounting": row.AT_MOUNT,
    "bias": row.AT_BIAS,
    "lag": row.AT_LAG,
}
NO_GATE = math.inf


@dataclass(frozen=True)
class Aiding:
    """Measurements of one kind from one sensor.

    Attributes
    ----------
    name : str
        Such as "GNSS position"; the states it adds are named after it ("odometer scale").
    kind : str
        "position" (lat, lon in rad, height in m), "velocity" (east, north, up), "body velocity" (right, forward, up),
        "height", or "rotation" (the base does not turn).
    time : (M,) array, s
        When the measurement holds, on the IMU's clock; any order.
    measured : (M, 3) array
        NaN where absent.
    sigma : (M, 3) array
        One-sigma noise; of a position in metres (east, north, up).
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
    """

    name: str
    kind: Kind
    time: Array
    measured: Array
    sigma: Array
    lever_arm: Array = field(default_factory=lambda: np.zeros(3))
    C_mb: Array = field(default_factory=lambda: np.eye(3))
    states: Mapping[Role, Group] = field(default_factory=dict)
    gate: float = FALSE_REJECTION
    loop: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise UsageError(f"{self.name}: kind {self.kind!r} is not known; choose one of {', '.join(KINDS)}")
        count = len(np.atleast_1d(self.time))
        for name, shape in (
            ("time", (count,)),
            ("measured", (count, 3)),
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
        bad = np.isfinite(self.measured) & ~((self.sigma > 0.0) & np.isfinite(self.sigma))
        if bad.any():
            row, column = np.argwhere(bad)[0]
            raise DataError(
                f"{self.name}: row {row + 1}: sigma {self.sigma[row, column]}; expected a positive one-sigma noise"
            )
        for role, group in self.states.items():
            length = 1 if role == "bias" and self.kind == "height" else LENGTHS[role]
            if len(group.sigma) != length:
                raise UsageError(f"{self.name}: {role} has {len(group.sigma)} states; expected {length}")

    def gates(self) -> Array:
        """(3,) limits of the normalised innovation squared of one, two and three rows."""
        if self.gate <= 0.0:
            return np.full(3, NO_GATE)
        from scipy.special import chdtri

        return np.asarray(chdtri([1.0, 2.0, 3.0], self.gate), dtype=np.float64)


def state(
    name: str, role: Role, sigma: ArrayLike, correlation_time: float = math.inf, walk: float = 0.0
) -> dict[Role, Group]:
    """One estimated property of the sensor of this name, for `Aiding.states`."""
    return {role: Group(f"{name} {role}", np.atleast_1d(np.asarray(sigma, np.float64)), correlation_time, walk)}
