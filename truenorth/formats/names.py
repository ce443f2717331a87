"""What the headings of an IMU's log mean: ``wx``, ``gyroX``, ``Acc_X [g]``, ``w_RS_S_x [rad s^-1]``, ``linear_acceleration.z``.

A heading is a stem and an axis, with a unit in brackets or at its end. What stands before the stem (``imu0_``, ``field.``,
``raw_``) distinguishes several sensors of a log, and nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from truenorth.core.units import DIMENSIONS, parse_unit
from truenorth.formats.layout import BLOCKS
from truenorth.formats.units import split, unit_in

STEMS = {
    "dtheta": r"d(?:elta)?_?(?:theta|tht|ang(?:le)?|th)|(?:theta|angle|ang|gyro|ori)_?inc(?:rement)?s?",
    "dvel": r"d(?:elta)?_?v(?:el(?:ocity)?)?|(?:v|vel|velocity|acc|accel)_?inc(?:rement)?s?",
    "gyro": r"gyro(?:scope|s|_?rotation|_?rate)?|gyrs?|(?:body_?|turn_?)?rates?|ang(?:ular)?_?(?:vel(?:ocity)?|rate)|omega|ω|"
    r"w(?:_?rs_?s|_?ib_?b|_?ib|_?b|m)?|g|(?:motion_?)?rot(?:ation)?(?:_?rate)?",
    "accel": r"(?:accelerometer_?)?acc(?:e|l|el(?:eration|erometer|erometers|s)?)?s?|lin(?:ear)?_?acc(?:el(?:eration)?)?|"
    r"spec(?:ific)?_?force|sf|f(?:_?ib_?b|_?ib|_?b|m)?|a(?:_?rs_?s|_?ib_?b|_?ib|_?b|m)?|g_?f",
}
BEFORE = re.compile(
    r"(?:(?:imu|ins|field|sensors?|raw|calib(?:rated)?|cal|uncal(?:ibrated)?|body|data|device|meas(?:ured)?|output|inertial|combined|b|mems|fog|rlg|left|right|main|primary|scaled|shimmer(?:_(?=\w*\d)[0-9a-f]{1,4}(?=_)(?:_(?!acc)[a-f]{1,3}(?=_))?)?|\d++)(?:_?\d++)?_?)+"
)
CHIPS = (  # as Android names its sensors: ``accelerometer_lsm6ds3_c``
    r"(?:lsm|lis|ism|bm[aigx]|ic[mg]|iim|mpu|adxl|adis|mma|kx|l3g|itg|fx[ao]s|stk|ak[mg]?)_?\d\w*"
)
AFTER = rf"raw|cal|calibrated|body|b|meas|out|sensor|imu\d*|adc|smooth|ln|wr|{CHIPS}"
BEHIND = re.compile(r"_(?:raw|cal|uncal|out)$")  # the axis: ``Gyro_X_CAL``, ``XGYRO_OUT``
RATES = re.compile(
    r"acceleration|angular_?(?:vel(?:ocity)?|rate)|rotation_rate|turn_rate"
)  # names of nothing but rates
NOT_FORCE = ("free", "user", "gravity", "mag")  # accelerations without gravity, gravity alone, magnetometers
AXES = {"x": "x", "y": "y", "z": "z"}
ROLL_RATES = {"p": "x", "q": "y", "r": "z"}  # of aircraft
CLOCK = re.compile(
    r"(?:(?:imu|gps|gnss|utc|unix|epoch|posix|ros|time|logging|location|system|sys|sample|device|sensor|host|pc|log|rec|header|field|elapsed|mono|"
    r"monotonic|recv|receive|start|loggingtime|locationtime|of|since|relative|boot|offset|itow|sow|seconds|motion|accelerometer|gyro)_?)*"
    r"(?:time(?:_?stamp|_?of_?week|_?of_?day|_?boot|_?startup|_?fine)?|t|stamp|timestamp|ts|tow|itow|sow|clock|epoch|seconds?|secs?|"
    r"sampletimefine|datetime|date_?time|utc|elapsed|seconds_elapsed|timestamp_unix)"
    r"(?:_(?P<unit>s|ms|us|ns|secs?|msecs?|usecs?|nsecs?|seconds?|millis(?:econds)?|micros(?:econds)?|nanos(?:econds)?|since_?1970|since_?reboot))?"
)
BEFORE_CLOCK = re.compile(  # at the beginning: a prefix that is a word, and the number behind it
    r"^(?:(?:imu|ins|sensors?|raw|body|data|device|output|inertial|combined|mems|fog|rlg|main|primary|scaled|"
    r"shimmer(?:_(?=\w*\d)[0-9a-f]{1,4}(?=_)(?:_[a-f]{1,3}(?=_))?)?)\d*_)+"
)
WHOLE_CLOCKS = {  # of Arduino, of AndroSensor, of recorders of sensors
    "millis": "ms", "micros": "us", "time_since_start_in_ms": "ms", "milliseconds": "ms"
}  # fmt: skip
TENTH_MS = ("sampletimefine", "sample_time_fine")  # of Xsens: counts of .1 ms


@dataclass(frozen=True)
class Heading:
    """What a heading means: the sensor, the axis, the sensor's family, and the unit it names."""

    name: str
    sensor: str
    axis: str
    family: str
    unit: str | None


def plain(text: str) -> str:
    """A heading as words in lower case with underscores between them: ``gyroX`` and ``Gyro X`` are ``gyro_x``."""
    text = re.sub(r"(?<=[a-z\d])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", text.strip())
    return re.sub(r"[^0-9a-zω]+", "_", text.casefold()).strip("_")


def heading_of(name: str) -> Heading | None:
    """What a heading means; None where it is no sensor's of an IMU."""
    bare, unit = split(name)
    match = re.fullmatch(r"(.*?)\s*\[([0-5])\]", bare.strip())  # a column of an array: ``gyroADC[0] (deg/s)``
    if match is not None:
        bare = f"{match[1]}_{'xyz'[int(match[2]) % 3]}"
        if int(match[2]) > 2:
            return None
    words = plain(bare)
    said = None if unit is None else unit_in(unit)
    for base, ending in _without_unit(words):
        found = _stem(base)
        if found is not None:
            sensor, axis, family, inner = found
            return Heading(name, sensor, axis, family, said or ending or inner)
    return None


def _without_unit(words: str) -> list[tuple[str, str | None]]:
    """The words, and the words before each ending that is a unit."""
    parts = words.split("_")
    results: list[tuple[str, str | None]] = [(words, None)]
    for count in (1, 2, 3, 4):
        if len(parts) > count:
            ending = unit_in("_".join(parts[-count:])) or unit_in("/".join(parts[-count:]))
            if ending is not None and parts[-count] not in AXES:
                results.append(("_".join(parts[:-count]), ending))
    return results


def _stem(words: str) -> tuple[str, str, str, str | None] | None:
    """Sensor, axis, family, and unit before the axis, of a heading without the unit at its end."""
    if words in ROLL_RATES:
        return "gyro", ROLL_RATES[words], "pqr", None
    words = re.sub(r"_?axis(?=_|$)|^axis_", "", words)
    if any(word in words for word in NOT_FORCE):
        return None
    short = BEHIND.sub("", words)
    cut = [(whole[:-1].rstrip("_"), whole[-1:]) for whole in dict.fromkeys((words, short))]
    if re.match(r"[xyz](?:_|gyro|acc)", short):
        cut.append((short[1:].lstrip("_"), short[0]))
    for body, axis in cut:
        for stem, unit in _without_unit(body) if axis in AXES else ():
            for bare in dict.fromkeys((stem, BEFORE.sub("", stem, count=1) if BEFORE.match(stem) else stem)):
                for sensor, pattern in STEMS.items():
                    if re.fullmatch(rf"(?:{pattern})(?:_?\d+)?(?:_?(?:{AFTER}))?", bare):
                        return sensor, AXES[axis], body, unit
    return None


def _from_zero(name: str, names: Sequence[str]) -> str:
    """A column of an array that is counted from 1, counted from 0: ``dv[1]`` where there are ``dv[3]`` and no ``dv[0]``."""
    match = re.fullmatch(r"(.*?)\[([1-3])\]", name.strip())
    if match is None or f"{match[1]}[0]" in names or f"{match[1]}[3]" not in names:
        return name
    return f"{match[1]}[{int(match[2]) - 1}]"


def clock_of(name: str) -> tuple[bool, str | None]:
    """Whether a heading is a clock's, and the unit it names."""
    bare, unit = split(name)
    words = BEHIND.sub("", plain(bare))
    if words in TENTH_MS:
        return True, "0.1 ms"
    if words in WHOLE_CLOCKS:
        return True, WHOLE_CLOCKS[words]
    match = CLOCK.fullmatch(words) or CLOCK.fullmatch(BEFORE_CLOCK.sub("", words, count=1))
    said = unit_in(unit) if unit else None
    other = said is not None and parse_unit(said)[1] != DIMENSIONS["time"][0]
    if match is None or (other and re.search("time|stamp", words) is None):  # ``T (degC)``
        return False, None
    ending = match["unit"]
    if said is None and ending is not None and words not in ("seconds", "secs", "second", "sec"):
        said = unit_in(ending) if not ending.startswith("since") else None
    if said is not None and parse_unit(said)[1] != DIMENSIONS["time"][0]:
        said = None
    return True, said


def is_plain_clock(name: str) -> bool:
    """Whether a heading is a clock's without a word before it."""
    words = BEHIND.sub("", plain(split(name)[0]))
    return words in (*TENTH_MS, *WHOLE_CLOCKS) or CLOCK.fullmatch(words) is not None


def says_rates(names: Sequence[str]) -> bool:
    """Whether names of both sensors are those of rates: ``linear_acceleration``, ``angular_velocity``."""
    return all(RATES.search(plain(split(name)[0])) is not None for name in names)


def families(names: Sequence[str]) -> dict[str, list[dict[str, Heading]]]:
    """By sensor, the sets of three headings, x, y and z, that the log has."""
    sets: dict[tuple[str, str], dict[str, Heading]] = {}
    for name in names:
        heading = heading_of(_from_zero(name, names))
        if heading is not None:
            heading = replace(heading, name=name)
            sets.setdefault((heading.sensor, heading.family), {}).setdefault(heading.axis, heading)
    result: dict[str, list[dict[str, Heading]]] = {sensor: [] for pair in BLOCKS.values() for sensor in pair}
    for (sensor, _), axes in sets.items():
        if len(axes) == 3:
            result[sensor].append(axes)
    return result
