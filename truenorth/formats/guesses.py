"""What a reader takes a log for: guesses with their evidence, and the question where two readings explain it equally."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

from truenorth.core.errors import DataError, UsageError
from truenorth.formats.behaviour import SURE, Reading
from truenorth.records import Guess, ImuRecord


class UnsureError(DataError):
    """Several readings explain a log; the caller has to say which.

    Attributes
    ----------
    question : str
        What is not known and why.
    options : sequence of mapping
        The reader's options that answer it, one for each reading.
    guesses : sequence of Guess
        What was found before.
    """

    def __init__(self, question: str, options: Sequence[Mapping[str, Any]], guesses: Sequence[Guess] = ()) -> None:
        self.question, self.options, self.guesses = question, tuple(options), tuple(guesses)
        super().__init__(f"{question}; say which: {' or '.join(map(in_words, options))}")


def in_words(option: Mapping[str, Any]) -> str:
    """An option as it stands in a layout file, on one line."""
    parts = []
    for key, value in option.items():
        if isinstance(value, Mapping):
            value = "{" + ", ".join(f"{name}: {text}" for name, text in value.items()) + "}"
        parts.append(f"{key}: {value}")
    return ", ".join(parts)


def layout_of(guesses: Sequence[Guess]) -> dict[str, Any]:
    """What a layout file says, that makes a reader take a log for the same without a guess."""
    layout: dict[str, Any] = {}
    for guess in guesses:
        for key, value in guess.option.items():
            layout[key] = {**layout.get(key, {}), **value} if isinstance(value, Mapping) else value
    return layout


def write_layout(
    record: ImuRecord, path: str | PathLike[str], target: str | PathLike[str] | None = None, *, replace: bool = False
) -> Path:
    """Write what a reader took a log for as ``LOG.yaml`` next to it, which the reader then obeys.

    Parameters
    ----------
    record : ImuRecord
    path : path
        Of the log.
    target : path, optional
        Another place for the file: the ``LOG.yaml`` of another log of the same kind.
    replace : bool
        Write over a file that is there.

    Raises
    ------
    UsageError
        There is such a file, which is not replaced; a name that does not end in ``.yaml``.
    """
    import yaml

    from truenorth.core.atomic import atomic_path, write_text

    target = Path(path).with_suffix(".yaml") if target is None else Path(target)
    if target.suffix.lower() != ".yaml":
        raise UsageError(
            f"{target}: no name of a layout; expected one that ends in .yaml, and is that of a log otherwise"
        )
    if target.exists() and not replace:
        raise UsageError(
            f"{target}: is there already and is kept; edit it by hand, name another file, or replace it by "
            "`replace=True`"
        )
    with atomic_path(target) as temporary:
        write_text(temporary, yaml.safe_dump(layout_of(record.taken_for), sort_keys=False, allow_unicode=True))
    return target


def take(
    what: str,
    readings: Sequence[Reading],
    options: Sequence[Mapping[str, Any]],
    source: str,
    guesses: list[Guess],
    sure: float = SURE,
) -> Reading:
    """The most likely reading, noted among the guesses.

    Raises
    ------
    UnsureError
        It is not sure.
    """
    best = readings[0]
    if best.probability < sure:
        why = "; ".join(f"{r.unit} ({100 * r.probability:.0f} %): {r.why}" for r in readings[:2])
        raise UnsureError(f"{source}: the {what} is not sure: {why}", options[:2], guesses)
    guesses.append(Guess(what, best.unit, best.why, best.probability, options[0]))
    return best
