"""What the models of our YAML files are made of: quantities with units, and errors that name the key's path and the fix."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, PlainSerializer, ValidationError

from truenorth.errors import DataError, UsageError
from truenorth.units import DIMENSIONS, parse
from truenorth.units import format as format_quantity
from truenorth.yaml_file import unknown_key


class Strict(BaseModel):
    """A mapping of known keys only. Where several kinds can stand in one place, the key ``kind`` tells which."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class _Unit(str):
    """Marks an annotation as a quantity: an example for messages."""


def _quantity(dimension: str, unit: str) -> Any:
    """The annotation of a value given as text with a unit: SI inside, `unit` when it is written again."""

    def read(text: Any) -> float:
        try:
            return parse(text, dimension)
        except UsageError as error:
            raise ValueError(str(error)) from None

    def write(value: float) -> str:
        return format_quantity(value, unit, digits=None)

    return Annotated[float, BeforeValidator(read), PlainSerializer(write), _Unit(DIMENSIONS[dimension][1])]


Angle = _quantity("angle", "deg")
AngularRate = _quantity("angular_rate", "deg/s")
Length = _quantity("length", "m")
Speed = _quantity("speed", "m/s")
Acceleration = _quantity("acceleration", "m/s^2")
AccelerationDensity = _quantity("acceleration_density", "g^2/Hz")
Time = _quantity("time", "s")
Frequency = _quantity("frequency", "Hz")
Ratio = _quantity("ratio", "1")

M = TypeVar("M", bound=BaseModel)


def validated(model: type[M], content: Any, where: str) -> M:
    """A model filled from what a file holds.

    Raises
    ------
    DataError
        The first thing that is wrong, with `where` (the file's name), the path of the key and what was expected.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        problems = error.errors(include_url=False)
        more = f" ({len(problems) - 1} more after this)" if len(problems) > 1 else ""
        raise DataError(_message(model, content, problems[0], where) + more) from None


def _message(model: type[BaseModel], content: Any, problem: Any, where: str) -> str:
    path, known, example = _locate(model, content, problem["loc"])
    if problem["type"] == "extra_forbidden":
        return unknown_key(where, path, [path[: path.rfind(".") + 1] + key for key in known])
    if problem["type"] == "missing":
        such = f", such as {example!r}" if example else ""
        return f"{where}: {path} is missing; expected {path.rpartition('.')[2]}: ...{such}"
    if problem["type"] in ("union_tag_invalid", "union_tag_not_found"):
        kinds = problem["ctx"].get("expected_tags", ", ".join(map(repr, known)))
        found = (
            f"{path}.kind: {problem['ctx']['tag']!r} is not known"
            if "tag" in problem["ctx"]
            else f"{path}.kind is missing"
        )
        return f"{where}: {found}; expected one of {kinds}"
    text = problem["msg"].removeprefix("Value error, ")
    if text.startswith("Input should be "):
        text = f"{problem['input']!r}; expected {text.removeprefix('Input should be ')}"
    return f"{where}: {path}: {text}" if path else f"{where}: {text}"


def _locate(model: type[BaseModel], content: Any, loc: tuple[int | str, ...]) -> tuple[str, list[str], str | None]:
    """Path of a key as a person writes it, the keys known beside it, and an example of its value.

    The library's location holds the tag of each union that it went through; the path of a person does not.
    """
    path, known, example = "", list(model.model_fields), None
    at: Any = model
    for step in loc:
        if isinstance(content, Mapping) and step == content.get("kind") and step not in _fields(at):
            at = next((m for m in _models(at) if _kind(m) == step), at)
            known = _fields(at)
            continue
        known = _fields(at) or known
        path += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if path else str(step)
        field = next((m.model_fields[step] for m in _models(at) if step in m.model_fields), None)
        if field is not None:
            example = next((str(x) for x in field.metadata if isinstance(x, _Unit)), None)
            at = field.annotation
        elif not isinstance(step, int):
            at = None
        try:
            content = content[step]
        except (KeyError, IndexError, TypeError):
            content = None
    return path, known, example


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that can stand where an annotation is."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        if issubclass(annotation, BaseModel):
            yield annotation
        return
    for part in get_args(annotation):
        yield from _models(part)


def _fields(annotation: Any) -> list[str]:
    return list(dict.fromkeys(name for m in _models(annotation) for name in m.model_fields))


def _kind(model: type[BaseModel]) -> Any:
    field = model.model_fields.get("kind")
    return None if field is None else next(iter(get_args(field.annotation)), None)
