"""Units as headers of logs write them: ``[rad s^-1]``, ``(m/s²)``, ``_dps``, ``_m_s2``."""

from __future__ import annotations

import re
from functools import lru_cache

from truenorth.core.errors import UsageError
from truenorth.core.units import parse_unit

BRACKETS = re.compile(r"(.*?)\s*[\[({]\s*([^\])}]*?)\s*[\])}]\s*")
NESTED = re.compile(r"(.*?)\s*(?:\[\s*([^\[\]]*?)\s*\]|\(\s*([^()]*\([^()]*\)[^()]*?)\s*\))\s*")  # ``[m/(s^2)]``
WRITTEN = {
    "kmh": "km/h", "kph": "km/h", "mps": "m/s", "m_s": "m/s", "mps2": "m/s^2", "m_s2": "m/s^2", "ms2": "m/s^2", "m_s_2": "m/s^2",
    "mss": "m/s^2", "knots": "kn", "sec": "s", "secs": "s", "msec": "ms", "millis": "ms", "milliseconds": "ms", "usec": "us",
    "micros": "us", "microseconds": "us", "nsec": "ns", "nanos": "ns", "nanoseconds": "ns", "rad_s": "rad/s", "rads": "rad/s",
    "radps": "rad/s", "deg_s": "deg/s", "degs": "deg/s", "degps": "deg/s", "deg_h": "deg/h", "degph": "deg/h", "gs": "g",
    "radians": "rad", "milli_g": "mg", "gal": "cm/s^2", "nanosec": "ns", "microsec": "us", "millisec": "ms",
    "kts": "kn", "mph": "mi/h", "unix time": "s",
    "x8004": "g", "x8005": "rad/s", "x8007": "rad", "x8008": "g*s",  # fields of MicroStrain's packets, as its CSV names them
}  # fmt: skip


@lru_cache(maxsize=1024)
def unit_in(text: str) -> str | None:
    """A unit as a header writes it, in our spelling; None where it is not a unit."""
    plain = re.sub(r"[\s_]*per[\s_]*", "/", text.strip()).strip()
    plain = WRITTEN.get(plain.casefold().replace("-", "_"), plain)
    plain = re.sub(r"(?<=[A-Za-z\d²°])[ .](?=[A-Za-z])", "*", plain)  # rad s^-1
    for candidate in (plain, plain.casefold()):
        try:
            parse_unit(candidate)
        except UsageError:
            continue
        return candidate
    return None


def split(name: str) -> tuple[str, str | None]:
    """A header cell without its unit in brackets, and that unit; the index of an array is not a unit."""
    match = BRACKETS.fullmatch(name.strip()) or NESTED.fullmatch(name.strip())
    if match is None or not match[1]:
        return name, None
    unit = match[2] if match[2] is not None else match[3]
    return (name, None) if unit.isdigit() else (match[1], unit)
