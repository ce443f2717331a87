"""JSON as a table: an array of objects, or objects one below the other; what is nested has its path for a name.

``{"accel": {"x": 0.1, ..}}`` and ``{"accel": [0.1, ..]}`` are columns ``accel.x``, .. Each row stays on the line where its object
begins, where that is a line of its own, so that messages name lines of the file. Flat JSON lines of numbers are labelled values
(:mod:`truenorth.formats.labelled`).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from truenorth.core.errors import DataError
from truenorth.formats.columns import Columns
from truenorth.formats.content import first_bytes, text_of
from truenorth.formats.dialect import Dialect
from truenorth.formats.labelled import TIME
from truenorth.formats.text import MOST_COLUMNS, TextTable

BEGINS = re.compile(rb'(?:\xef\xbb\xbf)?\s*(\[\s*)?\{\s*"')
BETWEEN = re.compile(r"[\s,\[]*")
DEEPEST, LONGEST = 4, 16  # levels of names, numbers of a list that are columns
FEWEST = 2  # objects
SPARSE = 10  # times as many cells as there are values: objects with names of their own are no rows of a table
LAST = 32  # characters from the end, where a text that is cut shows it: ``9.`` is damaged at its point


def is_one(path: Path) -> bool:
    """Whether a text begins as JSON does that is more than flat lines of numbers."""
    head = first_bytes(path)
    begins = BEGINS.match(head)
    if begins is None or begins[1] is not None:
        return begins is not None
    first = head.splitlines()[0].removeprefix(b"\xef\xbb\xbf")
    try:
        value = json.loads(first)
    except (ValueError, RecursionError):
        return b"{" in first[first.find(b"{") + 1 :] or not first.rstrip().endswith((b"}", b"},"))
    return not all(_is_plain(cell) for cell in value.values())


def _is_plain(cell: Any) -> bool:
    """Whether a value may stand in a line of labelled values."""
    if isinstance(cell, str):
        return re.fullmatch(TIME, cell) is not None
    return cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool))


def columns(path: Path) -> Columns:
    """The columns of such a text.

    Raises
    ------
    DataError
        JSON that is damaged, or of another form, with the line; more columns than a table has.
    """
    content, note = text_of(path)
    text = content.decode("utf-8", "replace")
    notes = ["JSON objects", *([note] if note else [])]
    rows: list[tuple[int, dict[str, str]]] = []
    names: dict[str, None] = {}
    for line, value in _objects(path.name, text, notes):
        row = dict(_cells(value))
        names |= dict.fromkeys(row)
        if len(names) > MOST_COLUMNS:
            raise _other(path.name, line)
        rows.append((line, row))
    if len(rows) < FEWEST or len(rows) * len(names) > SPARSE * sum(len(row) for _, row in rows):
        raise _other(path.name, 1)
    lines: list[str] = []
    for line, row in rows:
        lines += [""] * (line - 1 - len(lines))
        lines.append(",".join(row.get(name, "") for name in names))
    table = TextTable(path, ("\n".join(lines) + "\n").encode(), list(names), True, Dialect(",", "."), rows[0][0] - 1)
    return Columns(
        path,
        table.names,
        table.read,
        lru_cache(maxsize=2)(table.column),
        table.place,
        True,
        tuple(notes),
        "it is an array of objects, or an object on each line",
    )


def _objects(source: str, text: str, notes: list[str]) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """The objects with the lines on which they begin; a last one that is cut is left out, with a note."""
    decoder = json.JSONDecoder()
    end, at, line, count = len(text.rstrip(" \t\r\n]\0")), 0, 1, 0
    while (begin := BETWEEN.match(text, at).end()) < end:  # type: ignore[union-attr]
        line += text.count("\n", at, begin)
        try:
            value, after = decoder.raw_decode(text, begin)
        except RecursionError:
            raise _other(source, line) from None
        except json.JSONDecodeError as error:
            if count >= FEWEST and (error.pos >= end - LAST or error.msg.startswith("Unterminated")):
                notes.append("the last object is cut: left out")
                return
            raise DataError(
                f"{source}: line {error.lineno}: JSON that is damaged ({error.msg}); mend or remove it"
            ) from None
        except ValueError as error:
            raise DataError(f"{source}: line {line}: JSON that is damaged ({error}); mend or remove it") from None
        if not isinstance(value, dict):
            raise _other(source, line)
        yield line, value
        count += 1
        line, at = line + text.count("\n", begin, after), after


def _other(source: str, line: int) -> DataError:
    return DataError(
        f"{source}: line {line}: JSON of another form; expected an array of objects, or an object on each line, with numbers under "
        f"up to {MOST_COLUMNS} names: write the samples so, or as CSV"
    )


def _cells(value: Any, name: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    """Names and cells of what an object holds; longer lists, and what is nested deeper, are left out."""
    if isinstance(value, dict) and depth < DEEPEST:
        for key, inner in value.items():
            yield from _cells(inner, f"{name}.{key}" if name else key, depth + 1)
    elif isinstance(value, list) and len(value) <= LONGEST and not any(isinstance(one, dict | list) for one in value):
        for k, inner in enumerate(value):
            yield from _cells(inner, f"{name}.{'xyz'[k]}" if len(value) == 3 else f"{name}[{k}]", depth + 1)
    elif isinstance(value, bool):
        yield name, str(int(value))
    elif isinstance(value, str):
        yield name, re.sub(r'[\s,"]+', " ", value).strip()
    elif value is None or isinstance(value, int | float):
        yield name, "" if value is None else repr(value)
