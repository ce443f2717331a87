"""An attitude from elsewhere: an AHRS, a star tracker, the solution of another INS on the same vehicle.

The row is that of a master's attitude (:mod:`truenorth.aiding.master`); how the sensor sits, and its own slow error, are groups.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from truenorth.aiding.master import MASTER_ATTITUDE
from truenorth.aiding.source import Aiding, Role
from truenorth.core.attitude import quaternion_from_dcm
from truenorth.core.errors import UsageError
from truenorth.errors.group import Group
from truenorth.records import MasterRecord
from truenorth.state.mounting import Mounting


@dataclass(frozen=True)
class Attitude:
    """An external attitude.

    Attributes
    ----------
    record : MasterRecord
        With ``C_nb`` of the *sensor's* axes.
    noise : float, rad
        White, one sigma about each axis: an attitude says nothing of it itself.
    slow : float, rad
        One sigma of its own slow error about east, north and up; 0: none.
    slow_time : float, s
        Correlation time of that.
    mounting : Mounting
        ``C_mb``: IMU's to the sensor's axes; `angle_sigma`: how far off that may be, about each axis; its latency.
    """

    record: MasterRecord
    noise: float
    slow: float = 0.0
    slow_time: float = 300.0
    mounting: Mounting = field(default_factory=Mounting)
    key: ClassVar[str] = "attitude"

    def __post_init__(self) -> None:
        if self.record.C_nb is None:
            raise UsageError(f"{self.record.source}: no attitude in it; expected heading, pitch and roll")
        if not self.noise > 0.0:
            raise UsageError(f"noise of the attitude {self.noise:g} rad; expected one sigma above zero")

    def sources(self, altitude: str) -> list[Aiding]:
        """Attitudes."""
        m, C = self.mounting, self.record.C_nb
        assert C is not None  # asked before
        q = np.zeros((len(C), 10))  # linearised with what it says, by the rate of the instant
        q[:, :4], q[:, 7:] = np.array([quaternion_from_dcm(each) for each in C]), np.nan
        states: dict[Role, Group] = {}
        if m.angle_sigma > 0.0:
            states["mounting"] = Group("attitude mounting", np.full(3, m.angle_sigma), rotation=True, unit="rad")
        if self.slow > 0.0:
            states["bias"] = Group("attitude bias", np.full(3, self.slow), self.slow_time, unit="rad")
        if m.latency_sigma > 0.0:
            states["lag"] = Group("attitude lag", np.array([m.latency_sigma]), unit="s")
        return [
            Aiding(
                "attitude",
                MASTER_ATTITUDE,
                self.record.time - m.latency,
                q,
                np.full((len(q), 3), self.noise),
                C_mb=m.C_mb,
                states=states,
                gate=m.gate,
            )
        ]
