"""Options of sensors of attitude, which `align` on the move and `navigate` take: an external attitude, a magnetometer."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.fields import Fields, Sets, angles_with_sigma, given
from truenorth.cli.options import option
from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from truenorth.core.position import Position
    from truenorth.records import ImuRecord


def attitude_sigmas(text: str, option: str) -> Fields:
    """Noise, slow error and its time of an attitude."""
    import numpy as np

    said = numbers_of(text, option, 3 if text.count(",") == 2 else 1, "deg, or deg,deg,s")
    return dict(zip(("noise", "slow", "slow_time"), [*np.radians(said[:2]).tolist(), *said[2:]]))


def iron(text: str, option: str) -> Fields:
    """Hard and soft iron."""
    parts = numbers_of(text, option, 2, "hard,soft in % of the earth's field")
    return dict(zip(("hard_iron", "soft_iron"), (0.01 * x for x in parts)))


AttitudeSigma = Annotated[
    str | None,
    option("Its one-sigma noise; and its slow error, and the time of that: '0.1' or '0.1,0.3,300', deg and s."),
    Sets("attitude", attitude_sigmas),
]
AttitudeMounting = Annotated[
    str | None,
    option("Heading,pitch,roll of the IMU against that system, and one sigma of them, deg."),
    Sets("attitude", angles_with_sigma),
]
MagnetometerAxes = Annotated[str | None, option("Where its x, y and z point, such as FRD; RFU without it.")]
MagnetometerIron = Annotated[
    str | None,
    option("One sigma of hard and soft iron, % of the earth's field; '10,3' (not calibrated) without it."),
    Sets("magnetometer", iron),
]

FIRST_DATE = 1e9  # s since 1970: a clock beyond it holds dates


@dataclass(frozen=True)
class OfAttitude:
    """Sensors of attitude."""

    PANEL: ClassVar = "Sensors of attitude"
    attitude: Annotated[
        Path | None, option("Log of heading, pitch and roll of another system; needs --attitude-sigma.")
    ] = None
    attitude_sigma: AttitudeSigma = None
    attitude_mounting: AttitudeMounting = None
    magnetometer: Annotated[
        Path | None, option("Log of a magnetometer; north by the World Magnetic Model of place and --date.")
    ] = None
    magnetometer_axes: MagnetometerAxes = None
    magnetometer_iron: MagnetometerIron = None
    date: Annotated[str | None, option("Of the log, YYYY-MM-DD; its clock's own where that counts from 1970.")] = None

    @property
    def keys(self) -> list[str]:
        """The sensors that are named."""
        return [key for key in ("attitude", "magnetometer") if getattr(self, key) is not None]

    @property
    def named(self) -> bool:
        """Whether a sensor is named."""
        return bool(self.keys)

    def aids(self, record: ImuRecord, place: Position | None) -> list[Any]:
        """The sensors that are named; `place` is where the earth's field is taken."""
        return [*self._attitude(), *self._magnetometer(record, place)]

    def _attitude(self) -> list[Any]:
        from truenorth.aiding.attitude import Attitude
        from truenorth.formats import read_master

        if self.attitude is None:
            return []
        return [Attitude(read_master(self.attitude), **of_attitude(self))]

    def _magnetometer(self, record: ImuRecord, place: Position | None) -> list[Any]:
        from truenorth.aiding.magnetometer import Magnetometer, earth_field
        from truenorth.core.errors import UsageError
        from truenorth.formats.magnetometer import read_magnetometer

        if self.magnetometer is None:
            return []
        if place is None:
            raise UsageError("--magnetometer without a place; expected --lat and --lon, or positions of GNSS")
        if self.date is not None:
            date = date_of(self.date)
        elif record.time[0] > FIRST_DATE:
            date = dt.datetime.fromtimestamp(float(record.time[0]), dt.UTC).date()
        else:
            raise UsageError("--magnetometer without a date; expected --date YYYY-MM-DD: north of the needle moves")
        log = read_magnetometer(self.magnetometer, axes=self.magnetometer_axes)
        return [Magnetometer(log, earth_field(place, date), **given(self, "magnetometer"))]


def of_attitude(group: Any) -> Fields:
    """What a group of options says of another system's attitude.

    Raises
    ------
    UsageError
        It does not say how good that is.
    """
    from truenorth.core.errors import UsageError

    said = given(group, "attitude")
    if "noise" not in said:
        raise UsageError("--attitude without --attitude-sigma; expected how good it is, such as 0.1, or 0.1,0.3,300")
    return said


def date_of(text: str) -> dt.date:
    """A day, as `--date` says it."""
    from truenorth.core.errors import UsageError

    try:
        return dt.date.fromisoformat(text)
    except ValueError:
        raise UsageError(f"--date {text!r}; expected a date such as 2025-06-01") from None
