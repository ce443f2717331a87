"""Fixes in the tables of phones: Sensor Logger, phyphox, AndroSensor, Physics Toolbox, by the names of their columns.

A phone says how good a fix is by the radius that holds 68 % of the errors along the level, and by 68 % of those of height, speed
and bearing; a negative number says that it knows none. Apps that write all sensors in one table repeat the last fix on each row
until the next one comes. A fix that is written a hundred times is one fix: the rows where it changes are taken. The first row's
fix is left out: nobody knows when it came.

Source: Android, Location; Apple, CLLocation; the apps' own headers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.devices.gnsslogger import OF_68
from truenorth.formats.names import heading_of
from truenorth.formats.quantities import Found, Quantity

Array = NDArray[np.float64]

DEGREES = ("°", "deg")  # what phyphox writes over metres: ``Vertical Accuracy (°)``
PHONE = (
    Quantity("ground_velocity", "speed", "m/s", ("location_speed", "velocity")),
    Quantity("bearing", "angle", "deg", ("direction", "location_orientation")),
    Quantity(
        "accuracy",
        "length",
        "m",
        ("horizontal_accuracy", "horizontalaccuracy", "location_accuracy"),
        miswritten=DEGREES,
    ),
    Quantity("vertical_accuracy", "length", "m", ("verticalaccuracy",), miswritten=DEGREES),
    Quantity("speed_accuracy", "speed", "m/s", ("speedaccuracy",)),
    Quantity("bearing_accuracy", "angle", "deg", ("bearingaccuracy",)),
)
OF_A_FIX = ("lat", "lon", "alt", "speed", "course", *(quantity.name for quantity in PHONE))
FAST = 0.05  # s, from row to row: no receiver of a vehicle has fixes so often that say the same
REPEATED = 0.5  # of the rows, from which on the table repeats its fixes


def speed_and_bearing(found: Found) -> tuple[Array, Array] | None:
    """Speed and course over ground, (N,) each, of a phone; None where the table has none, or names of a receiver's own.

    NaN where the phone knows none of them.
    """
    speed, course = found.values.get("speed", found.values.get("ground_velocity")), found.values.get("bearing")
    if speed is None or course is None or found.has("course"):
        return None
    return np.where(speed < 0.0, np.nan, speed), np.where(course < 0.0, np.nan, course)


def accuracies(found: Found) -> tuple[Array | None, Array | None]:
    """Standard deviations (N, 3) of place and velocity by what a phone says; None where it says nothing of them.

    What it does not know of a bearing has no part in the velocity's; across the course it is the speed times that of the bearing.
    """
    level, up = found.values.get("accuracy"), found.values.get("vertical_accuracy")
    place = None
    if level is not None:
        place = np.column_stack([level / OF_68, level / OF_68, np.full(len(level), np.nan) if up is None else up])
    along, track = found.values.get("speed_accuracy"), speed_and_bearing(found)
    if along is None or track is None:
        return place, None
    turned = np.maximum(np.nan_to_num(found.values.get("bearing_accuracy", np.zeros(len(along)))), 0.0)
    whole = np.where(along > 0.0, np.hypot(along, track[0] * turned), np.nan)
    return place, np.column_stack([whole, whole, whole])


def new_fixes(found: Found, names: Sequence[str]) -> Found:
    """The rows where a fix is new, of a table that repeats it on the rows of other sensors.

    Parameters
    ----------
    found : Found
        Of the receiver, in order of time.
    names : sequence of str
        All columns of the table.

    Raises
    ------
    DataError
        A fix that never changes: it is one, and nobody knows when it came.
    """
    said = found.stack(*OF_A_FIX)
    time = found.values["time"]
    if said is None or not found.has("lat", "lon") or len(time) < 3:
        return found
    gyros = any(heading is not None and heading.sensor == "gyro" for heading in map(heading_of, names))
    if not gyros and float(np.median(np.diff(time))) > FAST:
        return found
    new = np.any((said[1:] != said[:-1]) & np.isfinite(said[1:]), axis=1)
    if np.mean(~new) < REPEATED:
        return found
    rows = 1 + np.flatnonzero(new)
    if len(rows) < 2:
        raise DataError(
            f"{found.source}: the fix changes {len(rows)} times in {len(time)} rows, columns "
            f"{', '.join(found.labels[name] for name in OF_A_FIX if found.has(name))}; expected new fixes in two rows at least: "
            "the receiver had no view of the sky, or the app shows its last place: record outdoors, or leave this sensor out"
        )
    values = {name: column[rows] for name, column in found.values.items()}
    return replace(found, values=values, place=lambda row: found.place(int(rows[row])))
