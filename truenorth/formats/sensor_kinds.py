"""What the name of a sensor means, in a log whose rows or files have one: ``ACCE``, ``bmi160_gyroscope``, Android's number 4.

Sources: Android, ``Sensor.TYPE_*``; the remarks at the top of GetSensorData's logs; Apple, CMDeviceMotion.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from truenorth.formats.names import plain
from truenorth.formats.units import split

ACCELERATION = r"acc(?:e|l|el(?:eration|erometer|erometers)?)?"
KINDS = {
    "gyro": r"gyr(?:o(?:scope|scopes|s|meter)?)?|(?:rotation|turn)_?rate|ang(?:ular)?_?(?:vel(?:ocity)?|rate)",
    "accel": rf"(?:total_?)?{ACCELERATION}",
    "linear": rf"(?:lin(?:ear)?|user)_?{ACCELERATION}|lacc|{ACCELERATION}_?(?:linear|without_gravity)",
    "gravity": r"grav(?:ity)?(?:_?vector)?",
    "mag": r"mag(?:n|s|neto(?:meter)?|netic(?:_?field)?|net)?",
    "gnss": r"gps|gnss|location",
    "other": r"(?:geomagnetic_|game_)?rotation_?vector|(?:device_)?orientation|attitude|ahrs|quaternion|euler|baro(?:meter)?|"
    r"pres(?:sure)?|ligh(?:t)?|prox(?:imity)?|(?:ambient_)?temp(?:erature)?|(?:relative_)?humi(?:dity)?|step\w*|wifi|ble\w*|"
    r"sou(?:nd?)?|rfid|posi|imu[xl]|heart_?rate|battery|activity|altimeter|significant_motion|compass|heading|network|annotation",
}
# Before the sensor, and behind it; digits are taken whole, or a name of hundreds of them would be tried in all ways.
FIRST = r"(?:(?:android|sensor|type|raw|cal|calibrated|uncal|uncalibrated|phone|watch|imu)_)*(?:[a-z]*\d\w*_)?"
LAST = r"(?:_?(?:data|readings?|sensor|raw|cal|calibrated|uncal|uncalibrated|\d++|(?:non_)?wakeup))*"
OF_ANDROID = re.compile(r"(?:android\.sensor\.|type_)", re.IGNORECASE)  # whose units are SI
USER = re.compile(
    rf"{FIRST}user_?acc(?:el(?:eration)?)?{LAST}"
)  # as Core Motion has it; Flutter's is userAccelerometer
ANDROID = {1: "accel", 2: "mag", 4: "gyro", 9: "gravity", 10: "linear", 14: "mag", 16: "gyro", 35: "accel"}
UNCALIBRATED = (14, 16, 35)
LARGEST_TYPE, VENDORS = 42, 0x10000  # of Android's numbers; makers count on from there


def kind_of(name: str) -> str | None:
    """What a sensor of some name is: one of `KINDS`; None where that is not known."""
    if not name[:1].isalpha():
        return None
    words = plain(split(name)[0])  # ``Gyroscope (rad/s)``
    return next((kind for kind, p in KINDS.items() if re.fullmatch(rf"{FIRST}(?:{p}){LAST}", words)), None)


def kind_of_number(name: str) -> str | None:
    """What the sensor of a number of Android's is."""
    if not name.isdecimal() or not (0 < int(name) <= LARGEST_TYPE or int(name) >= VENDORS):
        return None
    return ANDROID.get(int(name), "other")


def calibrated(names: Sequence[str]) -> list[str]:
    """Names of calibrated sensors, where there are some."""
    best = [n for n in names if "uncal" not in n.casefold() and not (n.isdecimal() and int(n) in UNCALIBRATED)]
    return best or list(names)
