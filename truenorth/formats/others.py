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
    r"roll|pitch|yaw|heading|hdg|azi|azimuth|euler|angles?|attitude|orient\w*|ori|d?quat\w*|d?q[0-3wxyz]|vector|matrix|rotmat|dcm|"
    r"lat|latitude|lon|long|lng|longitude|alt|altitude|height|hgt|depth|pos|position|dpos|odom\w*|east|north|up|easting|northing|"
    r"ecef|vel|velocity|speed|spd|v[neud]|course|cog|mag|magn|magnet|magnetic|magnetometer|compass|magx|magy|magz|m[xyz]|h[xyz]|"
    r"temp|temperature|pres|press|pressure|baro|humidity|light|proximity|volt|voltage|vdd|batt|battery|current|hdop|vdop|pdop|tdop|"
    r"sats?|satellites|numsats|status|flags?|cov|covariance|std|sigma|motor|servo|throttle|setpoint|rc|debug|gravity|grav|dt|"
    r"week|day|month|year|hour|minute|second|utc|index|count|counter|seq|id|frame"
)
TURN_OR_FORCE = re.compile(
    r"rate|gyr|rot(?!(?:ation)?_?(?:vec|mat|quat))|omega|ang(?:ular)?_?vel|acc(?!ur)|force|inc(?:rement)?s?(?:_|$)|del(?:ta)?_?|_?dv|d?_?theta|"
    r"(?:roll|pitch|yaw|ang(?:ular)?)_?(?:vel|speed|spd|w(?:_|$))|(?:(?:^|_)[vw]|vel|velocity|speed|spd)_?(?:roll|pitch|yaw|ang)|"
    r"^[wfag]_(?:up|down|north|east)$"
)
OF_ANGLES = re.compile(r"rot|ang(?!.*(?:vel|rate|inc))")
DOUBTFUL = re.compile(  # with an axis: what may be a sensor's own name where the log has no other gyros
    r"(?:h|vel|velocity|speed|spd|frame\d*|vector|rc|id|debug|current|index|setpoint|second|motor|(?:\w+_)?grav(?:ity)?)_?[xyz]"
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
    if says_motion(name):
        return False
    if _is_turned(name) or PART_OF_QUATERNION.search(words):
        return True
    if TURN_OR_FORCE.search(words):
        return False
    parts = words.split("_")
    return any(WORDS.fullmatch(word) or WORDS.fullmatch(word.rstrip("0123456789")) for word in (*parts, words)) or any(
        WORDS.fullmatch(part[:-1]) for part in parts if part[-1:] in ("x", "y", "z") and len(part) > 3
    )


def says_motion(name: str) -> bool:
    """Whether a heading has a unit of angular rate or acceleration, in brackets or at its end: it wins over any word."""
    bare, unit = split(name)
    words = plain(bare).split("_")
    said = [None if unit is None else unit_in(unit)]
    if "grav" in plain(bare):  # gravity alone
        return False
    said += [unit_in("_".join(words[-count:])) for count in (1, 2, 3, 4) if unit is None and len(words) > count]
    wins = [DIMENSIONS[kind][0] for kind in ("angular_rate", "acceleration")]
    found = [one for one in said if one is not None and one.casefold() != "g" and parse_unit(one)[1] in wins]
    return bool(found) or (unit is not None and said[0] in ("g", "G") and re.search("mag|field", plain(bare)) is None)


def _is_turned(name: str) -> bool:
    """Whether a heading says an angle by its unit and its words: ``rotX (deg)``."""
    bare, unit = split(name)
    said = None if unit is None else unit_in(unit)
    angle = said is not None and parse_unit(said)[1] == DIMENSIONS["angle"][0]
    return angle and OF_ANGLES.search(plain(bare)) is not None


def is_doubtful(name: str) -> bool:
    """Whether a heading of something else may be a sensor's all the same."""
    return _is_turned(name) or DOUBTFUL.fullmatch(plain(split(name)[0])) is not None


def needs_a_question(names: Sequence[str], others: Sequence[str]) -> bool:
    """Whether columns that alone may be gyros say angles or velocities; ``vel`` next to ``acel`` is Spanish for a rate."""
    if any(_is_turned(name) for name in names):
        return True
    spanish = any(plain(name).startswith("acel") for name in others)
    return not spanish and any(re.match("vel|speed|spd", plain(name)) for name in names)


def others_of(names: Sequence[str], threes: Sequence[Sequence[str]]) -> set[str]:
    """Of the headings those that are of something else; never one or two of a three, nor one of three of the same first word."""
    found = {name for name in names if is_other(name)}
    for three in threes:
        if not set(three) <= found:
            found -= set(three)
    first: dict[str, list[str]] = {}
    for name in names:
        if "_" in plain(name):
            first.setdefault(plain(name).partition("_")[0], []).append(name)
    for same in first.values():
        if len(same) == 3 and len(found & set(same)) == 1:
            found -= set(same)
    return found


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
