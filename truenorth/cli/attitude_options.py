"""Options of sensors of attitude, which `align` on the move and `navigate` take: an external attitude, a magnetometer."""

from __future__ import annotations

import datetime as dt
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.options import option
from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from truenorth.core.position import Position
    from truenorth.records import ImuRecord

FIRST_DATE = 1e9  # s since 1970: a clock beyond it holds dates


@dataclass(frozen=True)
class OfAttitude:
    """Sensors of attitude."""

    PANEL: ClassVar = "Sensors of attitude"
    attitude: Annotated[
        Path | None, option("Log of heading, pitch and roll of another system; needs --attitude-sigma.")
    ] = None
    attitude_sigma: Annotated[
        str | None,
        option("Its one-sigma noise; and its slow error, and the time of that: '0.1' or '0.1,0.3,300', deg and s."),
    ] = None
    attitude_mounting: Annotated[
        str | None, option("Heading,pitch,roll of the IMU against that system, and one sigma of them, deg.")
    ] = None
    magnetometer: Annotated[
        Path | None, option("Log of a magnetometer; north by the World Magnetic Model of place and --date.")
    ] = None
    magnetometer_axes: Annotated[str | None, option("Where its x, y and z point, such as FRD; RFU without it.")] = None
    magnetometer_iron: Annotated[
        str | None,
        option("One sigma of hard and soft iron, % of the earth's field; '10,3' (not calibrated) without it."),
    ] = None
    date: Annotated[str | None, option("Of the log, YYYY-MM-DD; its clock's own where that counts from 1970.")] = None

    @property
    def given(self) -> bool:
        """Whether a sensor is named."""
        return self.attitude is not None or self.magnetometer is not None

    def aids(self, record: ImuRecord, place: Position | None) -> list[Any]:
        """The sensors that are named; `place` is where the earth's field is taken."""
        return [*self._attitude(), *self._magnetometer(record, place)]

    def _attitude(self) -> list[Any]:
        import numpy as np

        from truenorth.aiding.attitude import Attitude
        from truenorth.core.errors import UsageError
        from truenorth.formats import read_master
        from truenorth.state.mounting import Mounting, mounting_angles

        if self.attitude is None:
            return []
        if self.attitude_sigma is None:
            raise UsageError(
                "--attitude without --attitude-sigma; expected how good it is, such as 0.1, or 0.1,0.3,300"
            )
        count = self.attitude_sigma.count(",") + 1
        told = numbers_of(self.attitude_sigma, "--attitude-sigma", 3 if count == 3 else 1, "deg, or deg,deg,s")
        sigmas = dict(zip(("noise", "slow", "slow_time"), [*np.radians(told[:2]), *told[2:]]))
        mounting = Mounting()
        if self.attitude_mounting is not None:
            angles = numbers_of(self.attitude_mounting, "--attitude-mounting", 4, "heading,pitch,roll,sigma in degrees")
            *sits, sigma = (math.radians(x) for x in angles)
            mounting = Mounting(C_mb=mounting_angles(*sits), angle_sigma=sigma)
        return [Attitude(read_master(self.attitude), mounting=mounting, **sigmas)]

    def _magnetometer(self, record: ImuRecord, place: Position | None) -> list[Any]:
        from truenorth.aiding.magnetometer import Magnetometer, earth_field
        from truenorth.core.errors import UsageError
        from truenorth.formats.magnetometer import read_magnetometer

        if self.magnetometer is None:
            return []
        if place is None:
            raise UsageError("--magnetometer without a place; expected --lat and --lon, or positions of GNSS")
        if self.date is not None:
            try:
                date = dt.date.fromisoformat(self.date)
            except ValueError:
                raise UsageError(f"--date {self.date!r}; expected a date such as 2025-06-01") from None
        elif record.time[0] > FIRST_DATE:
            date = dt.datetime.fromtimestamp(float(record.time[0]), dt.UTC).date()
        else:
            raise UsageError("--magnetometer without a date; expected --date YYYY-MM-DD: north of the needle moves")
        iron: dict[str, Any] = {}
        if self.magnetometer_iron is not None:
            parts = numbers_of(self.magnetometer_iron, "--magnetometer-iron", 2, "hard,soft in % of the earth's field")
            iron = dict(zip(("hard_iron", "soft_iron"), (0.01 * x for x in parts)))
        log = read_magnetometer(self.magnetometer, axes=self.magnetometer_axes)
        return [Magnetometer(log, earth_field(place, date), **iron)]
