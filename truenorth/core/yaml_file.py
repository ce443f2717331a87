"""YAML files of a few known keys, whose values carry their units: read strictly, with errors that name file and key."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any

from truenorth.core.errors import DataError, UsageError
from truenorth.core.units import parse


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
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(None, None, f"key {key.value!r} twice", key.start_mark)
                seen.add(key.value)
            return super().construct_mapping(node, deep=deep)

    try:
        content = yaml.load(Path(path).read_text(encoding="utf-8"), Loader)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read ({error.strerror})") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark is not None else ""
        raise DataError(f"{path}{line}: not a YAML file ({getattr(error, 'problem', None) or error})") from None
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
