"""Specifications of simulated sensors: frozen dataclasses whose values carry units in files and are SI inside."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Self

import numpy as np

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import DIMENSIONS, parse
from truenorth.core.units import format as format_quantity
from truenorth.core.yaml_file import quantity, unknown_key

SI = {"angle": "rad", "length": "m", "speed": "m/s", "time": "s", "frequency": "Hz", "ratio": "1"}


def value(dimension: str, unit: str, default: Any = 0.0, *, sign: str = "zero or more", many: bool = False) -> Any:
    """A field of a specification that has a unit.

    Parameters
    ----------
    dimension : str
        A key of `SI`; several with blanks between for a tuple.
    unit : str
        That files are written in; as many.
    default : float or tuple
        SI.
    sign : {"zero or more", "positive", "any"}
        That is allowed.
    many : bool
        Whether the field is a tuple of such tuples.
    """
    marks = {"dimensions": dimension.split(), "units": unit.split(), "sign": sign, "many": many}
    return field(default=default, metadata=marks)


@dataclass(frozen=True, kw_only=True)
class UnitSpec:
    """A specification of fields made by :func:`value`, and of plain ones with defaults.

    Raises
    ------
    UsageError
        A value of another shape, not finite, or of the wrong sign.
    """

    def __post_init__(self) -> None:
        for item in fields(self):
            if "dimensions" in item.metadata:
                _check(type(self).__name__, item.name, getattr(self, item.name), item.metadata)

    @classmethod
    def from_mapping(cls, content: Any, where: str = "") -> Self:
        """A specification from keys whose values carry units, such as ``{"rate": "10 Hz", "scale": "0.3 %"}``.

        Raises
        ------
        DataError
            An unknown key, a wrong unit, a value out of range; the message begins with `where` and names the key.
        """
        where = where or cls.__name__
        if not isinstance(content, Mapping):
            raise DataError(f"{where}: expected keys such as rate, found {content!r}")
        known = {item.name: item for item in fields(cls)}
        values: dict[str, Any] = {}
        for key, text in content.items():
            if key not in known:
                raise DataError(unknown_key(where, key, known))
            marks = known[key].metadata
            if "dimensions" in marks:
                values[key] = _parsed(text, marks, f"{where}: {key}")
                continue
            if type(text) is not type(known[key].default):
                wanted = "true or false" if isinstance(known[key].default, bool) else "text"
                raise DataError(f"{where}: {key}: {text!r}; expected {wanted}")
            values[key] = text
        try:
            return cls(**values)
        except UsageError as error:
            raise DataError(f"{where}: {error}") from None

    def to_mapping(self) -> dict[str, Any]:
        """The specification as it stands in a file; only what differs from the defaults."""
        result: dict[str, Any] = {}
        for item in fields(self):
            found = getattr(self, item.name)
            if found != item.default:
                result[item.name] = _written(found, item.metadata) if "dimensions" in item.metadata else found
        return result


def _check(kind: str, name: str, found: Any, marks: Mapping[str, Any]) -> None:
    size, sign = len(marks["dimensions"]), marks["sign"]
    rows = found if marks["many"] else (found,)
    for row in rows:
        numbers = row if isinstance(row, tuple | list) else (row,)
        good = len(numbers) == size and all(isinstance(x, int | float | np.floating) for x in numbers)
        if not good or not all(math.isfinite(x) for x in numbers):
            wanted = "a finite number" if size == 1 else f"{size} finite numbers"
            raise UsageError(f"{kind}: {name} is {row!r}; expected {wanted}, SI")
        if _wrong_sign(numbers, sign):
            raise UsageError(f"{kind}: {name} is {row!r}; expected {_WANTED[sign]}")


_WANTED = {"positive": "a positive value", "zero or more": "zero or more"}


def _wrong_sign(numbers: Sequence[float], sign: str) -> bool:
    return (sign == "positive" and min(numbers) <= 0.0) or (sign == "zero or more" and min(numbers) < 0.0)


def _parsed(text: Any, marks: Mapping[str, Any], where: str) -> Any:
    dimensions = marks["dimensions"]

    def one(item: Any, dimension: str, at: str) -> float:
        number = quantity(item, dimension, at)
        if _wrong_sign((number,), marks["sign"]):
            raise DataError(f"{at}: {item!r}; expected {_WANTED[marks['sign']]}")
        return number

    def row(items: Any, at: str) -> Any:
        if len(dimensions) == 1:
            return one(items, dimensions[0], at)
        if not isinstance(items, list | tuple) or len(items) != len(dimensions):
            example = ", ".join(DIMENSIONS[name][1] for name in dimensions)
            raise DataError(f"{at}: {items!r}; expected {len(dimensions)} quantities, such as [{example}]")
        return tuple(one(item, name, at) for item, name in zip(items, dimensions, strict=True))

    if not marks["many"]:
        return row(text, where)
    if not isinstance(text, list | tuple):
        raise DataError(f"{where}: {text!r}; expected a list")
    return tuple(row(items, f"{where}[{number}]") for number, items in enumerate(text, 1))


def _written(found: Any, marks: Mapping[str, Any]) -> Any:
    """What reads back to the same bits: in SI where the datasheet's unit would round."""

    def text(x: float, unit: str, dimension: str) -> str:
        usual = format_quantity(x, unit, digits=None)
        return usual if parse(usual, dimension) == x else f"{float(x)!r} {SI[dimension]}"

    def row(items: Any) -> Any:
        each = [items] if len(marks["units"]) == 1 else items
        texts = [text(*one) for one in zip(each, marks["units"], marks["dimensions"], strict=True)]
        return texts[0] if len(marks["units"]) == 1 else texts

    return [row(items) for items in found] if marks["many"] else row(found)
