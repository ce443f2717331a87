"""Datasheet quantities: ``"0.01 deg/h"`` to SI and back.

A parser of some forty units, since what general unit libraries read into ``deg/sqrt(h)``, ``ug`` or ``mg`` is wrong in
this field. Angle is a dimension of its own, so that ``deg/h`` is never a frequency; ``g`` is standard gravity (9.80665
m/s^2), never a gram. Exactly one finite number and one unit are accepted: no arithmetic, no bare number.

A unit is one of the names below or of their usual spellings, joined by ``*`` and ``/`` from left to right, with powers
(``s^2``, ``m/s2``, ``s²``, ``h^0.5``), roots (``sqrt(h)``, ``√h``, ``√(h)``) and parentheses (``(deg/h)/sqrt(Hz)``).
"""

from __future__ import annotations

import math
import re
from difflib import get_close_matches
from fractions import Fraction

from truenorth.core.errors import UsageError

STANDARD_GRAVITY = 9.80665  # m/s^2
DEG_PER_HOUR = math.radians(1.0) / 3600.0  # rad/s
FOOT = 0.3048  # m
MICRO_G = 1e-6 * STANDARD_GRAVITY  # m/s^2

Dimension = tuple[Fraction, ...]  # exponents of angle, length, time, temperature, magnetic flux density

# Factor to SI, and exponents of rad, m, s, K, T; zeros at the end left out.
_ATOMS: dict[str, tuple[float, tuple[int, ...]]] = {
    "rad": (1.0, (1, 0, 0, 0)),
    "mrad": (1e-3, (1, 0, 0, 0)),
    "urad": (1e-6, (1, 0, 0, 0)),
    "deg": (math.pi / 180, (1, 0, 0, 0)),
    "arcmin": (math.pi / 180 / 60, (1, 0, 0, 0)),
    "arcsec": (math.pi / 180 / 3600, (1, 0, 0, 0)),
    "mdeg": (1e-3 * math.pi / 180, (1, 0, 0, 0)),
    "rev": (2 * math.pi, (1, 0, 0, 0)),
    "dps": (math.pi / 180, (1, 0, -1, 0)),
    "mdps": (1e-3 * math.pi / 180, (1, 0, -1, 0)),
    "dph": (math.pi / 180 / 3600, (1, 0, -1, 0)),
    "rpm": (2 * math.pi / 60, (1, 0, -1, 0)),
    "m": (1.0, (0, 1, 0, 0)),
    "cm": (1e-2, (0, 1, 0, 0)),
    "mm": (1e-3, (0, 1, 0, 0)),
    "km": (1e3, (0, 1, 0, 0)),
    "nmi": (1852.0, (0, 1, 0, 0)),
    "ft": (FOOT, (0, 1, 0, 0)),
    "mi": (1609.344, (0, 1, 0, 0)),
    "kn": (1852.0 / 3600, (0, 1, -1, 0)),
    "s": (1.0, (0, 0, 1, 0)),
    "ms": (1e-3, (0, 0, 1, 0)),
    "us": (1e-6, (0, 0, 1, 0)),
    "ns": (1e-9, (0, 0, 1, 0)),
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
    "T": (1.0, (0, 0, 0, 0, 1)),
    "mT": (1e-3, (0, 0, 0, 0, 1)),
    "uT": (1e-6, (0, 0, 0, 0, 1)),
    "nT": (1e-9, (0, 0, 0, 0, 1)),
    "gauss": (1e-4, (0, 0, 0, 0, 1)),
    "mgauss": (1e-7, (0, 0, 0, 0, 1)),
    "ppm": (1e-6, (0, 0, 0, 0)),
    "%": (1e-2, (0, 0, 0, 0)),
    "1": (1.0, (0, 0, 0, 0)),
}

_SPELLINGS = {
    "°": "deg",
    "º": "deg",  # the ordinal sign, which many a datasheet has in place of the degree sign
    "′": "arcmin",
    "'": "arcmin",
    "″": "arcsec",
    '"': "arcsec",
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "hr": "h",
    "hrs": "h",
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
    "µT": "uT",
    "μT": "uT",
    "Gauss": "gauss",
    "mG": "mgauss",
    "µg": "ug",
    "μg": "ug",
    "µrad": "urad",
    "μrad": "urad",
    "µs": "us",
    "μs": "us",
    "°C": "degC",
    "percent": "%",
}


def _dimension(
    angle: int = 0, length: int = 0, time: Fraction | int = 0, temperature: int = 0, field: int = 0
) -> Dimension:
    return tuple(Fraction(exponent) for exponent in (angle, length, time, temperature, field))


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
    "flux_density": (_dimension(field=1), "50 uT"),
    "acceleration_density": (_dimension(0, 2, -3), "0.01 g^2/Hz"),
    "rate_per_acceleration": (_dimension(1, -1, 1), "1 deg/h/g"),
    "rate_per_temperature": (_dimension(1, time=-1, temperature=-1), "0.1 deg/h/degC"),
    "ratio_per_temperature": (_dimension(temperature=-1), "5 ppm/degC"),
    "temperature_rate": (_dimension(time=-1, temperature=1), "1 degC/min"),
    "acceleration_per_temperature": (_dimension(0, 1, -2, -1), "10 ug/degC"),
}

_QUANTITY = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)", re.DOTALL)
_ZERO = re.compile(r"[+-]?0+(?:\.0*)?")
_SUPERSCRIPTS = str.maketrans("⁻¹²³⁴", "-1234")
_NAME = re.compile(r"°C|[°º′″'\"%]|[A-Za-zµμ]+|1(?![\d.])")
_POWER = re.compile(r"\^?([-+]?\d(?:\.\d+)?)(?!\d)|\^\(([-+]?\d)/([1-9])\)")
_ROOT = re.compile(r"sqrt(?=\()|√")


def significant(value: float, digits: int = 3) -> str:
    """A number for people: rounded to some digits, without an exponent up to a million (``1000``, not ``1e+03``)."""
    return f"{float(f'{value:.{digits}g}'):g}"


def parse_unit(text: str) -> tuple[float, Dimension]:
    """Factor to SI and dimension of a unit, such as ``deg/sqrt(h)``.

    Raises
    ------
    UsageError
        A unit that is not known.
    """
    plain = re.sub("[⁻¹²³⁴]+", lambda match: "^" + match[0].translate(_SUPERSCRIPTS), text.strip())
    plain = re.sub(r"\s*([*/()^])\s*", r"\1", plain.replace("·", "*").replace("⋅", "*"))
    if not plain:
        raise UsageError(f"{text!r} names no unit")
    factor, dimension, rest = _product(plain, text)
    if rest:
        raise UsageError(
            f"unit {text!r} is not understood at {rest!r}; write it like deg/h, deg/sqrt(h) or ug/sqrt(Hz)"
        )
    return factor, dimension


def _product(rest: str, text: str) -> tuple[float, Dimension, str]:
    """Factors joined by * and /, from left to right; also what is left of the text."""
    factor, dimension, rest = _power(rest, text)
    while rest[:1] in ("*", "/"):
        sign = 1 if rest[0] == "*" else -1
        other, exponents, rest = _power(rest[1:], text)
        factor *= other**sign
        dimension = _sum(dimension, exponents, sign)
    return factor, dimension, rest


def _power(rest: str, text: str) -> tuple[float, Dimension, str]:
    """A name or a parenthesis, with its root or power."""
    root = _ROOT.match(rest)
    rest = rest[root.end() :] if root else rest
    name = _NAME.match(rest)
    if name is not None:
        factor, dimension = _atom(name[0], text)
        rest = rest[name.end() :]
    elif rest.startswith("("):
        factor, dimension, rest = _product(rest[1:], text)
        if not rest.startswith(")"):
            raise UsageError(f"unit {text!r}: a parenthesis is not closed")
        rest = rest[1:]
    else:
        raise UsageError(f"unit {text!r}: the name of a unit is expected {f'at {rest!r}' if rest else 'at its end'}")
    power = _HALF if root else Fraction(1)
    match = _POWER.match(rest)
    if match is not None:
        power *= Fraction(match[1]) if match[1] else Fraction(int(match[2]), int(match[3]))
        rest = rest[match.end() :]
    return factor ** float(power), _sum(_dimension(), dimension, power), rest


def _atom(name: str, text: str) -> tuple[float, Dimension]:
    known = _SPELLINGS.get(name, name)
    if known not in _ATOMS:
        near = get_close_matches(known, _ATOMS, n=3, cutoff=0.5)
        hint = f"; did you mean {', '.join(near)}?" if near else ""
        raise UsageError(f"unit {name!r} in {text!r} is not known{hint}")
    factor, exponents = _ATOMS[known]
    return factor, _dimension(*exponents)


def _sum(a: Dimension, b: Dimension, times: Fraction | int) -> Dimension:
    return tuple(x + times * y for x, y in zip(a, b))


def parse_quantity(text: str) -> tuple[float, Dimension]:
    """Value in SI and dimension of a datasheet string.

    Raises
    ------
    UsageError
        Not one finite number and one known unit.
    """
    if not isinstance(text, str):
        raise UsageError(f"{text!r} has no unit; write it as text with one, such as '0.01 deg/h'")
    match = _QUANTITY.fullmatch(text.strip().replace("\N{MINUS SIGN}", "-"))
    if match is None:
        raise UsageError(
            f"{text!r} does not begin with a number; expected one number and one unit, such as '0.01 deg/h'"
        )
    number, unit = match.groups()
    if not unit:
        raise UsageError(f"{text!r} has no unit; add one, such as '{number} deg/h'")
    if unit[0] in "+-*/.,^" or (unit[0].isdigit() and unit != "1" and not unit.startswith("1/")):
        raise UsageError(f"{text!r} is not one number (with a decimal point, no arithmetic) and one unit")
    factor, dimension = parse_unit(unit)
    value = float(number) * factor
    if not math.isfinite(value):
        raise UsageError(f"{text!r} is not a finite number")
    return value, dimension


def parse(text: str, dimension: str) -> float:
    """Value in SI of a datasheet string that must have a given dimension.

    Parameters
    ----------
    text : str
        Such as ``"0.001 deg/sqrt(h)"``.
    dimension : str
        A key of `DIMENSIONS`.

    Raises
    ------
    UsageError
        Not a quantity, or one of another dimension; the message gives an example of the right one. A bare zero is one of
        every dimension.
    """
    wanted, example = DIMENSIONS[dimension]
    words = dimension.replace("_", " ")
    if isinstance(text, str) and _ZERO.fullmatch(text.strip()):
        return 0.0  # the same in every unit
    try:
        value, found = parse_quantity(text)
    except UsageError as error:
        what = str(error) if repr(text) in str(error) else f"{text!r}: {error}"
        raise UsageError(f"{what} (a quantity of {words} is expected, such as {example!r})") from None
    if found != wanted:
        names = [name.replace("_", " ") for name, (d, _) in DIMENSIONS.items() if d == found]
        what = f" is a quantity of {names[0]}" if names else " has another dimension"
        raise UsageError(f"{text!r}{what}; a quantity of {words} is expected, such as {example!r}")
    return value


def format(value: float, unit: str, digits: int | None = 6) -> str:
    """An SI value as a datasheet string: ``format(4.848e-8, "deg/h") == "0.00999974 deg/h"``.

    Parameters
    ----------
    value : float
        In SI.
    unit : str
    digits : int or None
        Significant digits; None takes the fewest that `parse` reads back to the same value, to rounding (1e-15).
    """
    factor, _ = parse_unit(unit)
    number = value / factor
    if digits is None:
        rounded = (float(f"{number:.{n}g}") for n in range(1, 18))
        nearest = next((r for r in rounded if math.isclose(r, number, rel_tol=1e-15)), number)
        return f"{repr(nearest).removesuffix('.0')} {unit}"
    return f"{number:.{digits}g} {unit}"
