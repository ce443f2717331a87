"""What columns of a log are that are no gyro and no accelerometer: by their names, by their units, and by what they do.

Where the names of the sensors are not known, three columns next to each other may be anything: roll, pitch and yaw next to
accelerometers look like gyros, a place like a specific force in some unit, three parts of a quaternion like gravity in g.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.core.units import DIMENSIONS, parse_unit
from truenorth.formats.names import plain
from truenorth.formats.units import split, unit_in

Array = NDArray[np.float64]

WORDS = re.compile(
    r"roll|pitch|yaw|heading|hdg|azi|azimuth|euler|angles?|attitude|orient\w*|ori|d?quat\w*|d?q[0-3wxyz]?|vector|matrix|rotmat|dcm|"
    r"lat|latitude|lon|long|lng|longitude|alt|altitude|height|hgt|depth|pos|position|dpos|odom\w*|east|north|up|easting|northing|"
    r"ecef|vel|velocity|speed|spd|v[neud]|course|cog|mag|magn|magnet|magnetic|magnetometer|compass|magx|magy|magz|m[xyz]|h[xyz]|"
    r"temp|temperature|pres|press|pressure|baro|humidity|light|proximity|volt|voltage|vdd|batt|battery|current|hdop|vdop|pdop|tdop|"
    r"sats?|satellites|numsats|status|flags?|cov|covariance|std|sigma|motor|servo|throttle|setpoint|rc|debug|gravity|grav|dt|"
    r"week|day|month|year|hour|minute|second|utc|index|count|counter|seq|id|frame"
)
TURN_OR_FORCE = re.compile(
    r"rate|gyr|rot(?!(?:ation)?_?(?:vec|mat|quat))|omega|ang(?:ular)?_?vel|acc(?!ur)|force|inc(?:rement)?s?(?:_|$)|del(?:ta)?_?|_?dv|d?_?theta"
)
FORCE = re.compile(r"acc(?!ur)|force")
PART_OF_QUATERNION = re.compile(r"(?:^|_)d?q_?[0-3wxyz]$|quat")
DIMENSIONS_OF_IMU = ("angular_rate", "angle", "acceleration", "speed")
UNIT_NORM = 2e-3  # by which the norm of a quaternion differs from one, as logs round it
PART = (2.0 * UNIT_NORM) ** 0.5  # a rate of this size next to forces of one g has another norm


def is_other(name: str) -> bool:
    """Whether a heading names what no IMU measures: an attitude, a place, a magnetic field, a temperature."""
    bare, unit = split(name)
    said = None if unit is None else unit_in(unit)
    if said is not None and parse_unit(said)[1] not in [DIMENSIONS[kind][0] for kind in DIMENSIONS_OF_IMU]:
        return True
    words = plain(bare)
    if (
        said is not None
        and parse_unit(said)[1] == DIMENSIONS["angle"][0]
        and re.search(r"rot|ang(?!.*(?:vel|rate|inc))", words)
    ):
        return True
    if PART_OF_QUATERNION.search(words):
        return True
    if TURN_OR_FORCE.search(words):
        return False
    parts = words.split("_")
    return any(WORDS.fullmatch(word) or WORDS.fullmatch(word.rstrip("0123456789")) for word in (*parts, words)) or any(
        WORDS.fullmatch(part[:-1]) for part in parts if part[-1:] in ("x", "y", "z") and len(part) > 3
    )


def are_forces(names: Sequence[str]) -> bool:
    """Whether headings say accelerations, which are no rates."""
    return all(FORCE.search(plain(split(name)[0])) is not None for name in names)


def quaternions(numbers: dict[str, Array]) -> set[str]:
    """Columns that are four parts of a quaternion: their norm is one in all rows, and that of three in a row is not."""
    names = list(numbers)
    found: set[str] = set()
    for k in range(len(names) - 3):
        four = names[k : k + 4]
        if found & set(four):
            continue
        values = np.column_stack([numbers[name] for name in four])
        norm = np.linalg.norm(values, axis=1)
        whole = norm > 0.5  # a logger writes zeros until there is an attitude
        if np.mean(whole) < 0.5 or not np.all(np.abs(norm[whole] - 1.0) < UNIT_NORM):
            continue
        if np.max(np.abs(values[:, 0])) > PART and np.max(np.abs(values[:, 3])) > PART:
            found |= set(four)
    return found
