"""Options that are fields of a model: which field of which model an option sets, and how its text is read.

An option of a group carries the mark ``Sets("wheel", arm)``: its value is a field of the model that stands for the wheel. A
command takes the model as it usually is, and puts in what was given::

    wheel = replace(WHEEL, **given(group, "wheel"))

`MODELS` names the model of each part. Models load NumPy and are imported by their names where a command runs: help does not
wait for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, get_type_hints

from truenorth.cli.reading import numbers_of

MODELS = {
    "antenna": "truenorth.state.mounting:Mounting",
    "wheel": "truenorth.state.mounting:Mounting",
    "odometer": "truenorth.state.mounting:Mounting",  # the wheel's, of what counts alone
    "log": "truenorth.errors.log:LogErrors",
    "baro": "truenorth.aiding.aids:Barometer",
    "attitude": "truenorth.aiding.attitude:Attitude",
    "magnetometer": "truenorth.aiding.magnetometer:Magnetometer",
    "master": "truenorth.aiding.aids:Master",
    "on master": "truenorth.state.mounting:Mounting",
    "indexer": "truenorth.aiding.aids:Indexer",
    "positions": "truenorth.aiding.aids:Positions",
    "damping": "truenorth.damping.options:Damper",
}

Fields = dict[str, Any]
Read = Callable[[Any, str], Fields]


@dataclass(frozen=True)
class Sets:
    """A mark of an option: it sets fields of a model.

    Attributes
    ----------
    part : str
        Key of `MODELS`.
    read : callable
        From the option's value and its name to the model's fields, in the model's units.
    """

    part: str
    read: Read


def marks(group: Any) -> list[tuple[str, Sets]]:
    """Names of the fields of a group of options that set something, with their marks."""
    hints = get_type_hints(group if isinstance(group, type) else type(group), include_extras=True)
    return [
        (field.name, mark)
        for field in fields(group)
        for mark in getattr(hints[field.name], "__metadata__", ())
        if isinstance(mark, Sets)
    ]


def given(group: Any, part: str) -> Fields:
    """What the options of a group say of a part: fields of its model; of two that set one field the later holds.

    Raises
    ------
    UsageError
        An option that does not read as its field.
    """
    said: Fields = {}
    for name, mark in marks(group):
        if mark.part == part and (value := getattr(group, name)) is not None:
            said |= mark.read(value, f"--{name.replace('_', '-')}")
    return said


def plain(field: str) -> Read:
    """A field that the option gives as it is."""
    return lambda value, option: {field: value}


def quantity(field: str, dimension: str) -> Read:
    """A field with its unit, such as ``0.3 deg``; see :func:`truenorth.core.units.parse`."""

    def read(text: str, option: str) -> Fields:
        from truenorth.core.units import parse

        return {field: parse(text, dimension)}

    return read


def quantity_and_time(field: str, dimension: str, time: str, **alone: None) -> Read:
    """A figure, and after a comma the time of it: ``0.5 m/s, 3 h``; `alone` is what the figure says without a time."""

    def read(text: str, option: str) -> Fields:
        from truenorth.core.units import parse

        first, _, second = text.partition(",")
        return {field: parse(first, dimension)} | ({time: parse(second, "time")} if second.strip() else alone)

    return read


def degrees(field: str) -> Read:
    """A number of degrees."""
    return lambda value, option: {field: math.radians(value)}


def arm(text: str, option: str) -> Fields:
    """A lever arm that is known: from the IMU, right, forward, up."""
    return {"lever_arm": _three(text, option), "lever_arm_sigma": 0.0}


def arm_to_imu(text: str, option: str) -> Fields:
    """A lever arm to the IMU; the library's is from the IMU."""
    return {"lever_arm": -_three(text, option)}


def arm_of_master(text: str, option: str) -> Fields:
    """The same from a master, known to what a tape measures on a vehicle unless something else is said."""
    from truenorth.alignment.transfer import LEVER_ARM_SIGMA

    return arm_to_imu(text, option) | {"lever_arm_sigma": LEVER_ARM_SIGMA}


def _three(text: str, option: str) -> Any:
    import numpy as np

    return np.array(numbers_of(text, option, 3, "right,forward,up in metres"))


def angles(text: str, option: str) -> Fields:
    """``C_mb`` of heading, pitch and roll of the IMU on the vehicle."""
    from truenorth.state.mounting import mounting_angles

    said = numbers_of(text, option, 3, "heading,pitch,roll in degrees")
    return {"C_mb": mounting_angles(*map(math.radians, said))}


def angles_with_sigma(text: str, option: str) -> Fields:
    """A mounting: its angles, and one sigma of them."""
    from truenorth.state.mounting import Mounting, mounting_angles

    *sits, sigma = map(math.radians, numbers_of(text, option, 4, "heading,pitch,roll,sigma in degrees"))
    return {"mounting": Mounting(C_mb=mounting_angles(*sits), angle_sigma=sigma)}


def second_antenna(text: str, option: str) -> Fields:
    """The direction of a second antenna is the forward axis of ``C_mb``."""
    from truenorth.state.mounting import mounting_angles

    angle, sigma = map(math.radians, numbers_of(text, option, 2, "heading and one sigma in degrees"))
    return {"C_mb": mounting_angles(-angle), "angle_sigma": sigma}


def known_latency(value: float, option: str) -> Fields:
    """A latency that is not estimated."""
    return {"latency": value, "latency_sigma": 0.0}


def axes(text: str, option: str) -> Fields:
    """Axes such as ``z,x``."""
    return {"axes": tuple(text.replace(" ", "").lower().replace(",", ""))}


def bending(text: str, option: str) -> Fields:
    """A flexure: one sigma of each axis, and its correlation time."""
    from truenorth.core.errors import UsageError
    from truenorth.core.units import parse
    from truenorth.records.flexure import FlexureSpec

    first, comma, second = text.partition(",")
    if not comma:
        raise UsageError(f"{option} {text!r}: expected an angle and a time, such as '3 arcmin,5 s'")
    return {"flexure": FlexureSpec(sigma=(parse(first, "angle"),) * 3, correlation_time=parse(second, "time"))}
