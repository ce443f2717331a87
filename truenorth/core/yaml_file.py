"""YAML files of a few known keys, whose values carry their units: read strictly, with errors that name file and key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

from truenorth.core.atomic import noted
from truenorth.core.errors import DataError, TruenorthError, UsageError
from truenorth.core.paths import is_file
from truenorth.core.units import parse

LARGEST = 1 << 20  # bytes
DEEPEST = 20
LONGEST = 1000  # characters of a value
MOST_NODES = 100_000  # with every alias counted as what it stands for


def _check_size(text: str) -> None:
    """Refuse a text that is deep or, with its aliases written out, large: by its events, before anything is built.

    Raises
    ------
    ValueError
        In words.
    """
    import yaml

    sizes: dict[str, int] = {}
    open_nodes: list[tuple[str | None, int]] = []
    count = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        where = f"line {event.start_mark.line + 1}" if event.start_mark else "a line"
        if isinstance(event, yaml.CollectionStartEvent):
            open_nodes.append((event.anchor, count))
            if len(open_nodes) > DEEPEST:
                raise ValueError(f"{where}: nested more than {DEEPEST} deep")
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = open_nodes.pop()
            if anchor is not None:
                sizes[anchor] = count - before
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor not in sizes:
                raise ValueError(f"{where}: *{event.anchor} stands for nothing, or for itself")
            count += sizes[event.anchor]
        elif isinstance(event, yaml.ScalarEvent):
            if len(event.value) > LONGEST:
                raise ValueError(f"{where}: a value of {len(event.value)} characters")
            if event.anchor is not None:
                sizes[event.anchor] = 1
        count += 1
        if count > MOST_NODES:
            raise ValueError(f"more than {MOST_NODES} entries")


def read_mapping(path: str | PathLike[str]) -> dict[Any, Any]:
    """The keys and values of a YAML file; an empty file has none.

    Raises
    ------
    UsageError
        The file cannot be opened.
    DataError
        Not YAML, a key given twice, or no mapping: the message names the file and the line.
    """
    import yaml

    class Loader(yaml.SafeLoader):
        """The safe loader, but a key given twice is an error: YAML forbids it, the library would take the last."""

        def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
            seen = set()
            for key, _ in node.value:
                if not isinstance(key.value, str):
                    raise yaml.constructor.ConstructorError(None, None, "a key that is no word", key.start_mark)
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(None, None, f"key {key.value!r} twice", key.start_mark)
                seen.add(key.value)
            return super().construct_mapping(node, deep=deep)

    try:
        if not is_file(Path(path)):
            raise UsageError(f"{path}: cannot be read (No such file)")
        with Path(path).open("rb") as file:
            raw = file.read(LARGEST + 1)
        if len(raw) > LARGEST:
            raise DataError(f"{path}: larger than {LARGEST >> 20} MiB; expected a few keys")
        text = raw.decode("utf-8")
        noted(path)
        _check_size(text)
        content = yaml.load(text, Loader)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from None
    except TruenorthError:
        raise
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        why = getattr(error, "problem", None) or str(error).splitlines()[0]
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise DataError(f"{path}{line}: not a YAML file ({why})") from None
    except (
        ValueError,
        OverflowError,
        TypeError,
        KeyError,
        AttributeError,
    ) as error:  # a date or a number that cannot be
        raise DataError(f"{path}: {error}") from None
    if content is None:
        return {}
    if not isinstance(content, Mapping):
        raise DataError(f"{path}: expected lines such as 'key: value', found {type(content).__name__}")
    return dict(content)


def quantity(text: Any, dimension: str, where: str) -> float:
    """Value in SI of a text with a unit; `where` (file and key) leads the message of the DataError."""
    try:
        return parse(text, dimension)
    except UsageError as error:
        raise DataError(f"{where}: {error}") from None


def unknown_key(where: str, key: Any, known: Iterable[str]) -> str:
    """The message for a key that nothing reads: the nearest known one, or all of them."""
    names = list(known)
    near = get_close_matches(str(key), names, n=1, cutoff=0.75)
    advice = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}"
    return f"{where}: key {key!r} is not known; {advice}"
