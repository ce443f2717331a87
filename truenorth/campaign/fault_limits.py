"""What no log can show: faults after which the data are those of another, sound log, and why.

A fault is here only with a derivation; all others that pass in silence are defects.
"""

from __future__ import annotations

import re
from typing import NamedTuple

LEVEL = (
    "on a level base at rest gyros see two things, the earth's rate along the vertical and the length of that along north: both "
    "stay as they are"
)

ON_A_SIDE = (
    "an IMU that lies on another side has the same gravity; where nothing is said of its gyros, a bias explains what the earth's "
    "rate contradicts, and heading is refused"
)

BODY = (
    "wheels speak of body axes: a turn about the vertical that a bias makes is a turn like any other, and the earth's rate shows "
    "heading before and after to no better than the answer's sigma"
)

SHORT_ARM = (
    "an arm shows in turns alone: with fixes good to a metre and some turns of 90 deg its sigma is .4 m, and less than 3.5 of "
    "these is no contradiction"
)


class Unseen(NamedTuple):
    """A fault that the data of a procedure cannot show."""

    procedures: tuple[str, ...]
    fault: str
    size: str  # regular expression of the drawn sizes that it is true of
    why: str


REST = ("still", "unspecified")
UNSEEN: tuple[Unseen, ...] = (
    Unseen(REST, "gyro axes exchanged", "yxz", LEVEL),
    Unseen(REST, "gyro sign", "[xy] ", LEVEL),
    Unseen(("unspecified",), "accel axes exchanged", "(?!yxz)", ON_A_SIDE),
    Unseen(("unspecified",), "accel sign", "z ", ON_A_SIDE),
    Unseen(("odometer",), "gyro bias step", "z ", BODY),
    Unseen(("odometer",), "gyro bias ramp", "z ", BODY),
    Unseen(("navigate",), "wrong arm", "1\\.", SHORT_ARM),
    Unseen(("rotary",), "zero of the outer angle", "", "it defines the body's axes: heading is as far off as the zero"),
)


def unseen(procedure: str, fault: str, size: str) -> Unseen | None:
    """Why this fault cannot be seen, or None."""
    return next((u for u in UNSEEN if procedure in u.procedures and fault == u.fault and re.match(u.size, size)), None)
