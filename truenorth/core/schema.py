"""What the models of our YAML files are made of: quantities with units, and errors that name the key's path and the fix."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, PlainSerializer, ValidationError

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import DIMENSIONS, parse
from truenorth.core.units import format as format_quantity
from truenorth.core.yaml_file import unknown_key


class Strict(BaseModel):
    """A mapping of known keys only. Where several kinds can stand in one place, the key ``kind`` tells which."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class _Unit(str):
    """Marks an annotation as a quantity: an example for messages."""


def _quantity(dimension: str, unit: str, si: str) -> Any:
    """The annotation of a value given as text with a unit: SI inside, `unit` when it is written again.

    What is written reads back to the same bits: in SI where `unit` would round.
    """

    def read(text: Any) -> float:
        try:
            return parse(text, dimension)
        except UsageError as error:
            raise ValueError(str(error)) from None

    def write(value: float) -> str:
        text = format_quantity(value, unit, digits=None)
        return text if parse(text, dimension) == value else f"{value!r} {si}"

    return Annotated[float, BeforeValidator(read), PlainSerializer(write), _Unit(DIMENSIONS[dimension][1])]


Angle = _quantity("angle", "deg", "rad")
AngularRate = _quantity("angular_rate", "deg/s", "rad/s")
Length = _quantity("length", "m", "m")
Speed = _quantity("speed", "m/s", "m/s")
Acceleration = _quantity("acceleration", "m/s^2", "m/s^2")
AccelerationDensity = _quantity("acceleration_density", "g^2/Hz", "m^2/s^3")
Time = _quantity("time", "s", "s")
Frequency = _quantity("frequency", "Hz", "Hz")
Ratio = _quantity("ratio", "%", "1")

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
        # Keys that nothing reads first: a misspelt key is often what another one that is missing was meant to be.
        problems = sorted(error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden")
        more = f" ({len(problems) - 1} more after this)" if len(problems) > 1 else ""
        raise DataError(_message(model, content, problems[0], where) + more) from None


def _message(model: type[BaseModel], content: Any, problem: Any, where: str) -> str:
    path, siblings, field = _locate(model, content, problem["loc"])
    kind = problem["type"]
    if kind == "extra_forbidden":
        parent = path[: path.rfind(".") + 1]
        return unknown_key(where, path, [parent + key for key in siblings])
    if kind == "missing":
        example = next((str(x) for x in getattr(field, "metadata", ()) if isinstance(x, _Unit)), None)
        such = f", such as {path.rpartition('.')[2]}: {example}" if example else ""
        return f"{where}: {path} is missing; give it{such}"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        kinds = ", ".join(repr(_kind(m)) for m in models_in(getattr(field, "annotation", None)))
        tag = problem["ctx"].get("tag")
        found = f"{path}.kind is missing" if tag is None else f"{path}.kind: {tag!r} is not known"
        return f"{where}: {found}; expected one of {kinds}"
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        keys = ", ".join(_fields(getattr(field, "annotation", None)))
        return f"{where}: {path}: {problem['input']!r}; expected a mapping of the keys {keys}"
    text = problem["msg"].removeprefix("Value error, ")
    for prefix in ("Input should be a valid ", "Input should be ", "String should have "):
        if text.startswith(prefix):
            text = f"{problem['input']!r}; expected {text.removeprefix(prefix)}"
    return f"{where}: {path}: {text}" if path else f"{where}: {text}"


def _locate(model: type[BaseModel], content: Any, loc: tuple[int | str, ...]) -> tuple[str, list[str], Any]:
    """Path of a key as a person writes it, the keys known next to it, and its field, if there is one.

    The library's location holds the tag of each union that it went through; the path of a person does not.
    """
    path, siblings, field = "", list(model.model_fields), None
    at: list[type[BaseModel]] = [model]
    for step in loc:
        if len(at) > 1 and isinstance(content, Mapping) and step == content.get("kind"):
            at = [m for m in at if _kind(m) == step]
            continue
        path += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if path else step
        if isinstance(step, str):
            siblings = list(dict.fromkeys(name for m in at for name in m.model_fields))
            field = next((m.model_fields[step] for m in at if step in m.model_fields), None)
            at = [] if field is None else list(models_in(field.annotation))
        try:
            content = content[step]
        except (KeyError, IndexError, TypeError):
            content = None
    return path, siblings, field


def models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models that can stand where an annotation is."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        if issubclass(annotation, BaseModel):
            yield annotation
        return
    for part in get_args(annotation):
        yield from models_in(part)


def _fields(annotation: Any) -> list[str]:
    return list(dict.fromkeys(name for m in models_in(annotation) for name in m.model_fields))


def _kind(model: type[BaseModel]) -> Any:
    field = model.model_fields.get("kind")
    return None if field is None else next(iter(get_args(field.annotation)), None)


@contextmanager
def numbered(key: str, number: int) -> Iterator[None]:
    """Lead the message of a UsageError by the place of the entry in its list, counted from one as all our messages do."""
    try:
        yield
    except UsageError as error:
        raise UsageError(f"{key}[{number}]: {error}") from None
