"""Datasheet quantities: ``"0.01 deg/h"`` to SI and back.

A parser of two dozen units, since what general unit libraries read into ``deg/sqrt(h)``, ``ug`` or ``mg`` is wrong in this
field. Angle is a dimension of its own, so that ``deg/h`` is never a frequency; ``g`` is standard gravity (9.80665
m/s^2), never a gram. Exactly one finite number and one unit are accepted: no arithmetic, no bare number.
"""

from __future__ import annotations

import math
import re
from difflib import get_close_matches
from fractions import Fraction

from truenorth.errors import UsageError

STANDARD_GRAVITY = 9.80665  # m/s^2

Dimension = tuple[Fraction, Fraction, Fraction, Fraction]  # exponents of angle, length, time, temperature

# Factor to SI, and exponents of rad, m, s, K.
_ATOMS: dict[str, tuple[float, tuple[int, int, int, int]]] = {
    "rad": (1.0, (1, 0, 0, 0)),
    "mrad": (1e-3, (1, 0, 0, 0)),
    "urad": (1e-6, (1, 0, 0, 0)),
    "deg": (math.pi / 180, (1, 0, 0, 0)),
    "arcmin": (math.pi / 180 / 60, (1, 0, 0, 0)),
    "arcsec": (math.pi / 180 / 3600, (1, 0, 0, 0)),
    "rev": (2 * math.pi, (1, 0, 0, 0)),
    "m": (1.0, (0, 1, 0, 0)),
    "cm": (1e-2, (0, 1, 0, 0)),
    "mm": (1e-3, (0, 1, 0, 0)),
    "km": (1e3, (0, 1, 0, 0)),
    "nmi": (1852.0, (0, 1, 0, 0)),
    "ft": (0.3048, (0, 1, 0, 0)),
    "kn": (1852.0 / 3600, (0, 1, -1, 0)),
    "s": (1.0, (0, 0, 1, 0)),
    "ms": (1e-3, (0, 0, 1, 0)),
    "us": (1e-6, (0, 0, 1, 0)),
    "min": (60.0, (0, 0, 1, 0)),
    "h": (3600.0, (0, 0, 1, 0)),
    "d": (86400.0, (0, 0, 1, 0)),
    "Hz": (1.0, (0, 0, -1, 0)),
    "kHz": (1e3, (0, 0, -1, 0)),
    "g": (STANDARD_GRAVITY, (0, 1, -2, 0)),
    "mg": (1e-3 * STANDARD_GRAVITY, (0, 1, -2, 0)),
    "ug": (1e-6 * STANDARD_GRAVITY, (0, 1, -2, 0)),
    "mGal": (1e-5, (0, 1, -2, 0)),
    "K": (1.0, (0, 0, 0, 1)),
    "degC": (1.0, (0, 0, 0, 1)),  # differences of temperature only
    "ppm": (1e-6, (0, 0, 0, 0)),
    "%": (1e-2, (0, 0, 0, 0)),
    "1": (1.0, (0, 0, 0, 0)),
}

_SPELLINGS = {
    "°": "deg",
    "′": "arcmin",
    "'": "arcmin",
    "″": "arcsec",
    '"': "arcsec",
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "hr": "h",
    "hour": "h",
    "hours": "h",
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "minute": "min",
    "minutes": "min",
    "metre": "m",
    "metres": "m",
    "meter": "m",
    "meters": "m",
    "knot": "kn",
    "knots": "kn",
    "kt": "kn",
    "hz": "Hz",
    "G": "g",
    "µg": "ug",
    "μg": "ug",
    "µrad": "urad",
    "μrad": "urad",
    "µs": "us",
    "μs": "us",
    "°C": "degC",
    "percent": "%",
}


def _dimension(angle: int = 0, length: int = 0, time: Fraction | int = 0, temperature: int = 0) -> Dimension:
    return Fraction(angle), Fraction(length), Fraction(time), Fraction(temperature)


_HALF = Fraction(1, 2)
DIMENSIONS: dict[str, tuple[Dimension, str]] = {
    "angle": (_dimension(1), "5 arcsec"),
    "angular_rate": (_dimension(1, time=-1), "0.01 deg/h"),
    "angle_random_walk": (_dimension(1, time=-_HALF), "0.001 deg/sqrt(h)"),
    "rate_random_walk": (_dimension(1, time=-_HALF - 1), "0.01 deg/h/sqrt(h)"),
    "angular_acceleration": (_dimension(1, time=-2), "10 deg/s^2"),
    "length": (_dimension(0, 1), "0.5 m"),
    "speed": (_dimension(0, 1, -1), "0.1 m/s"),
    "acceleration": (_dimension(0, 1, -2), "50 ug"),
    "velocity_random_walk": (_dimension(0, 1, -_HALF - 1), "10 ug/sqrt(Hz)"),
    "acceleration_random_walk": (_dimension(0, 1, -_HALF - 2), "1 ug/sqrt(h)"),
    "time": (_dimension(time=1), "300 s"),
    "frequency": (_dimension(time=-1), "100 Hz"),
    "ratio": (_dimension(), "100 ppm"),
    "temperature": (_dimension(temperature=1), "20 degC"),
    "rate_per_acceleration": (_dimension(1, -1, 1), "1 deg/h/g"),
    "rate_per_temperature": (_dimension(1, time=-1, temperature=-1), "0.1 deg/h/degC"),
    "acceleration_per_temperature": (_dimension(0, 1, -2, -1), "10 ug/degC"),
}

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_FACTOR = re.compile(r"(sqrt\(|√\(?)?([^\W\d_²³]+|[°′″'\"%µμ]+[^\W\d_²³]*|1)(?:\^?([-+]?\d+)|([²³]))?(\))?")


def parse_unit(text: str) -> tuple[float, Dimension]:
    """Factor to SI and dimension of a unit, such as ``deg/sqrt(h)``.

    Raises
    ------
    UsageError
        A unit that is not known.
    """
    factor, dimension = 1.0, [Fraction(0)] * 4
    sign, rest = 1, text.strip().replace(" ", "").replace("·", "*")
    if not rest:
        raise UsageError(f"{text!r} names no unit")
    while rest:
        match = _FACTOR.match(rest)
        if match is None or bool(match[1] and match[1].endswith("(")) != bool(match[5]):
            raise UsageError(f"unit {text!r} is not understood at {rest!r}; write it like deg/h, deg/sqrt(h), ug/sqrt(Hz)")
        name = _SPELLINGS.get(match[2], match[2])
        if name not in _ATOMS:
            near = get_close_matches(name, _ATOMS, n=3, cutoff=0.5)
            hint = f"; did you mean {', '.join(near)}?" if near else ""
            raise UsageError(f"unit {match[2]!r} in {text!r} is not known{hint}")
        power = Fraction(int(match[3])) if match[3] else Fraction({"²": 2, "³": 3}.get(match[4] or "", 1))
        power *= sign * (_HALF if match[1] else 1)
        value, exponents = _ATOMS[name]
        factor *= value ** float(power)
        dimension = [d + power * e for d, e in zip(dimension, exponents, strict=True)]
        rest = rest[match.end() :]
        if rest:
            if rest[0] not in "/*":
                raise UsageError(f"unit {text!r} is not understood at {rest!r}; join units with / or *")
            sign, rest = (-1 if rest[0] == "/" else 1), rest[1:]
            if not rest:
                raise UsageError(f"unit {text!r} ends with an operator")
    return factor, (dimension[0], dimension[1], dimension[2], dimension[3])


def parse_quantity(text: str) -> tuple[float, Dimension]:
    """Value in SI and dimension of a datasheet string.

    Raises
    ------
    UsageError
        Not one finite number and one known unit.
    """
    if not isinstance(text, str):
        raise UsageError(f"{text!r} has no unit; write it as text with one, such as '0.01 deg/h'")
    match = _NUMBER.match(text.strip())
    if match is None:
        raise UsageError(f"{text!r} does not begin with a number; expected one number and one unit, such as '0.01 deg/h'")
    number, unit = float(match[0]), text.strip()[match.end() :].strip()
    if not unit:
        raise UsageError(f"{text!r} has no unit; add one, such as '{match[0]} deg/h'")
    if not math.isfinite(number):
        raise UsageError(f"{text!r} is not a finite number")
    factor, dimension = parse_unit(unit)
    return number * factor, dimension


def parse(text: str, dimension: str) -> float:
    """Value in SI of a datasheet string that must have a given dimension.

    Parameters
    ----------
    text : str
        Such as ``"0.001 deg/sqrt(h)"``.
    dimension : str
        A key of `DIMENSIONS`.

    Returns
    -------
    float

    Raises
    ------
    UsageError
        Not a quantity, or one of another dimension; the message gives an example of the right one.
    """
    wanted, example = DIMENSIONS[dimension]
    words = dimension.replace("_", " ")
    try:
        value, found = parse_quantity(text)
    except UsageError as error:
        raise UsageError(f"{error} (a quantity of {words} is expected, such as {example!r})") from None
    if found != wanted:
        names = [name.replace("_", " ") for name, (d, _) in DIMENSIONS.items() if d == found]
        what = f" is a quantity of {names[0]}" if names else " has another dimension"
        raise UsageError(f"{text!r}{what}; a quantity of {words} is expected, such as {example!r}")
    return value


def format(value: float, unit: str, digits: int = 6) -> str:
    """An SI value as a datasheet string: ``format(4.848e-8, "deg/h") == "0.01 deg/h"`` to `digits` significant digits."""
    factor, _ = parse_unit(unit)
    return f"{value / factor:.{digits}g} {unit}"
