"""Tables in text, in whatever dialect (:mod:`truenorth.formats.dialect`): lines above the header, the header itself, the rows.

Arrow reads the columns; the lines are looked at one by one only to say where a fault is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.arrow import to_numpy
from truenorth.formats.content import REMARKS_BYTES, first_piece, text_of
from truenorth.formats.dialect import (
    DELIMITERS,
    EITHER,
    SAMPLE,
    Dialect,
    dialect_of,
    is_remark,
    notes_on_other_rows,
    with_points,
)
from truenorth.formats.header import SENTENCE, header_of
from truenorth.formats.labelled import table_of_labels
from truenorth.formats.line_ends import without_ends_in_quotes
from truenorth.formats.quotes import without_outer_quotes, without_stray_quotes

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]

LONGEST_LINE = 65536
MOST_COLUMNS = 2000
LONGEST_HEAD = 1 << 22
LINE = re.compile(rb"([^\r\n]*)(?:\r\n|\r|\n|\Z)")  # and its end
MONITOR = re.compile(rb"^(\d{1,2}:\d\d:\d\d[.,]\d+) -> ?", re.MULTILINE)
REMARK = re.compile(rb"(?m)^[ \t]*(?:#|%|//)")
AT_ONCE, FEW = 1 << 26, 16  # bytes and columns of a text that is read in one pass, whatever is asked for
HEADER_LINES = 400  # more lines than this above the numbers are no header


@dataclass(frozen=True)
class TextTable:
    """Where the numbers of a text stand."""

    path: Path
    text: bytes  # the whole log
    names: list[str]  # of the columns; ``1, 2, ...`` where the log has no header
    named: bool  # whether the log has a header
    dialect: Dialect
    skip: int  # lines above the numbers
    header: str = ""  # the line of the names; empty without one
    above: tuple[str, ...] = ()  # those lines that are not the header
    notes: tuple[str, ...] = ()  # what was left out or mended

    def read(self, wanted: Sequence[str], gaps: bool = False) -> Array:
        """The columns of these names, (N, len(wanted)); what stands in others does not matter.

        An empty cell is NaN where `gaps` are allowed.

        Raises
        ------
        DataError
            No rows, a cell that is no number, a line that is too short or too long: with line and column.
        """
        import pyarrow as pa

        names = list(dict.fromkeys(wanted))
        if (numbers := self._numbers(wanted, gaps)) is not None:
            return numbers
        try:
            table = self._table(names, dict.fromkeys(names, pa.float64()), [""] if gaps else [])
        except pa.ArrowInvalid as error:
            raise self._first_fault(names, gaps) or DataError(
                f"{self.path.name}: not a table of numbers ({error})"
            ) from None
        return to_numpy([table.column(str(names.index(name))) for name in wanted])

    def column(self, name: str) -> pa.ChunkedArray:
        """One column in the type that its cells show: whole numbers, numbers, dates, times of day or text.

        Raises
        ------
        DataError
            As for :meth:`read`.
        """
        import pyarrow as pa

        if self._whole is not None:
            return self._whole.column(str(self.names.index(name)))
        try:
            return self._table([name], {}, [""]).column("0")
        except pa.ArrowInvalid as error:
            raise self._first_fault([name], True) or DataError(
                f"{self.path.name}: not a table of numbers ({error})"
            ) from None

    @cached_property
    def _whole(self) -> pa.Table | None:
        """All columns in the types that their cells show; None of a long text, or one that has to be read by the column."""
        import pyarrow as pa

        if len(self.text) > AT_ONCE or len(self.names) > FEW or len(set(self.names)) < len(self.names):
            return None
        try:
            return self._table(self.names, {}, [""])
        except pa.ArrowInvalid:
            return None

    def _numbers(self, names: Sequence[str], gaps: bool) -> Array | None:
        """Columns (N, n) of what has been read, where all of it is numbers with a point."""
        import pyarrow as pa

        if self._whole is None:
            return None
        columns = [self._whole.column(str(self.names.index(name))) for name in names]
        # Whole numbers are read again: a cast would load Arrow's kernels, which takes longer, and lose the sign of -0.
        if not all(pa.types.is_float64(column.type) for column in columns):
            return None
        return None if any(c.null_count for c in columns) and not gaps else to_numpy(columns)

    def place(self, row: int) -> str:
        """Where row `row` (0 is the first) stands in the file, in words."""
        rows = (number for number, _ in self.lines())
        return f"line {next((number for k, number in enumerate(rows) if k == row), self.skip + row + 1)}"

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """The lines that hold the rows, numbered as an editor does; empty ones and remarks are left out."""
        for number, raw in enumerate(self.text.splitlines(), start=1):
            line = raw.strip()
            if number > self.skip and line and not (self._remarks and line.startswith(REMARKS_BYTES)):
                yield number, raw

    @cached_property
    def _remarks(self) -> bool:
        """Whether remarks stand among the rows."""
        # One byte is found at once, two are not.
        return (
            any(self.text.find(mark[:1], self.begin) >= 0 and mark in self.text for mark in REMARKS_BYTES)
            and REMARK.search(self.text, self.begin) is not None
        )

    @cached_property
    def begin(self) -> int:
        """Where in the text the first row begins."""
        return max((line.end() for line in islice(_lines(self.text), self.skip)), default=0)

    @cached_property
    def _body(self) -> bytes | memoryview:
        """The rows as Arrow wants them; no copy where they are so: of a long log that takes longer than to look through it."""
        ends = self.text.find(b"\n", self.begin) >= 0 or self.text.find(b"\r", self.begin) < 0
        if ends and not self._remarks and self.dialect.delimiter is not None:
            return memoryview(self.text)[self.begin :]
        body = self.text[self.begin :]
        if self._remarks:
            body = re.sub(rb"(?m)^[ \t]*(?:#|%|//).*$", b"", body)
        if self.dialect.delimiter is None:
            body = re.sub(rb"(?m)^[ \t]+|[ \t]+$", b"", body.replace(b"\r\n", b"\n"))
            body = re.sub(rb"[ \t]+", b" ", body)
        if body.rfind(b"\r") >= 0 and b"\n" not in body:
            body = body.replace(b"\r", b"\n")
        return body

    def _table(self, names: Sequence[str], types: dict[str, Any], nulls: list[str]) -> pa.Table:
        import pyarrow as pa
        import pyarrow.csv as pc

        labels = [f"other {i}" for i in range(len(self.names))]
        for k, name in enumerate(names):
            labels[self.names.index(name)] = str(k)
        wanted = [str(k) for k in range(len(names))]
        if re.search(rb"\S", self._body) is None:
            raise DataError(f"{self.path.name}: a header and no rows; expected numbers below it")
        table = pc.read_csv(
            pa.BufferReader(self._body),
            read_options=pc.ReadOptions(use_threads=False, column_names=labels),
            parse_options=pc.ParseOptions(delimiter=self.dialect.delimiter or " "),
            convert_options=pc.ConvertOptions(
                column_types={str(k): types[name] for k, name in enumerate(names) if name in types},
                include_columns=wanted,
                null_values=nulls,
                quoted_strings_can_be_null=False,
                decimal_point=self.dialect.decimal,
            ),
        )
        return table

    def _first_fault(self, names: Sequence[str], gaps: bool) -> DataError | None:
        source, columns = self.path.name, [self.names.index(name) for name in names]
        for number, raw in self.lines():
            try:
                cells = self.dialect.cells(raw.decode("utf-8"))
            except UnicodeDecodeError:
                cells = self.dialect.cells(raw.decode("latin-1"))
            if len(cells) != len(self.names):
                return DataError(
                    f"{source}: line {number}: {len(cells)} columns; expected {len(self.names)} as in the header or the "
                    "first row: the line is cut short or holds a stray separator"
                )
            for i in columns:
                cell = cells[i]
                if not self.dialect.is_number(cell) and (cell or not gaps):
                    comma = self.dialect.decimal == ","
                    mark = f"a number with a decimal {'comma' if comma else 'point'}, as in most rows: write all with one mark"
                    other = replace(self.dialect, decimal="." if comma else ",").is_number(cell)
                    hint = mark if other else "a number: remove the line or repair the cell"
                    return DataError(f"{source}: line {number}, column {self.names[i]}: {cell!r}; expected {hint}")
        return None


def open_table(path: Path) -> TextTable:
    """Find the table in a text.

    Raises
    ------
    DataError
        No line of numbers, lines that fit no dialect, or a header of another number of columns.
    """
    _head(path, first_piece(path))  # a line of gigabytes is refused before they are unpacked
    text, note = text_of(path)
    text, joined = without_ends_in_quotes(text)
    text = _with_stamps_apart(without_outer_quotes(text))
    head = _head(path, text)
    if not head:
        raise DataError(f"{path.name}: no header and no numbers; the file holds empty lines only")
    if (labelled := table_of_labels(path.name, text, [line for _, line in head])) is not None:
        said = tuple(one for one in (note, joined, *labelled.notes) if one is not None)
        return without_a_cut_end(
            TextTable(
                path, labelled.text, labelled.names, True, Dialect(",", "."), labelled.skip, "", labelled.above, said
            )
        )
    dialect, count = dialect_of(head)
    text, mended = without_stray_quotes(
        path.name, text, dialect.delimiter, count, lambda cells: _are_row(dialect, cells, count)
    )
    head = _head(path, text) if mended else head
    no_row = [is_remark(line) or SENTENCE.fullmatch(line.strip()) is not None for _, line in head]
    rows = [not no and _are_row(dialect, dialect.cells(line), count) for no, (_, line) in zip(no_row, head)]
    first = rows.index(True) if any(rows) else None
    notes = tuple(said for said in (note, joined, mended) if said is not None)
    if first is None:
        return _without_rows(path, text, head, notes)
    names, used = header_of(path, dialect, head[:first], count, first_cells=dialect.cells(head[first][1]))
    above = tuple(line for k, (_, line) in enumerate(head[:first]) if k not in used)
    named = bool(used)
    notes += notes_on_other_rows(path.name, dialect, head[:first], used, count)
    header = head[min(k for k in used if k >= 0)][1] if named else ""
    names = names if named else [str(i + 1) for i in range(count)]
    if dialect.decimal == EITHER:
        text = with_points(path.name, text, head[first][0] - 1, names, dialect)
        dialect = replace(dialect, decimal=".")
        notes += ("decimal points in some columns, commas in others",)
    return without_a_cut_end(TextTable(path, text, names, named, dialect, head[first][0] - 1, header, above, notes))


def _with_stamps_apart(text: bytes) -> bytes:
    """The text with a separator behind the stamps of a serial monitor, which writes ``10:11:12.345 -> `` before each line."""
    lines = [line[1] for line in islice(_lines(text), SAMPLE) if line[1].strip()]
    marked = [line for line in lines if MONITOR.match(line)]
    if len(marked) < 0.8 * len(lines) or not marked:
        return text
    rest = marked[-1][MONITOR.match(marked[-1]).end() :]  # type: ignore[union-attr]
    mark = next((mark for mark in (b",", b";", b"\t") if mark in rest), b" ")
    return MONITOR.sub(rb"\1" + mark, text)


def _lines(text: bytes) -> Iterator[re.Match[bytes]]:
    """The lines of the head one by one, each with its end and, as group 1, without; an empty one may follow the last."""
    return LINE.finditer(text, 0, LONGEST_HEAD)


def _head(path: Path, text: bytes) -> list[tuple[int, str]]:
    """The first lines that are not empty, numbered from 1."""
    lines: list[tuple[int, str]] = []
    for number, raw in enumerate((line[1] for line in _lines(text)), start=1):
        if len(lines) == HEADER_LINES + SAMPLE:
            break
        if b"\0" in raw:
            raise DataError(f"{path.name}: line {number}: holds binary data; expected text: give the file's format")
        try:
            line = raw.decode("utf-8")
        except UnicodeDecodeError:
            line = raw.decode("latin-1")  # names of columns in another encoding; the numbers are the same in all
        if not line.strip():
            continue
        if not is_remark(line) and (
            len(line) > LONGEST_LINE or max(line.count(mark or " ") for mark in DELIMITERS) > MOST_COLUMNS
        ):
            raise DataError(
                f"{path.name}: line {number}: longer than {LONGEST_LINE >> 10} KiB, or of more than {MOST_COLUMNS} columns; "
                "expected a table, a row on each line: keep the columns of the sensor"
            )
        lines.append((number, line))
    return lines


def _are_row(dialect: Dialect, cells: Sequence[str], count: int) -> bool:
    """Whether cells are a row of the table: as many, half of them numbers; with empty ones, more than half of the others."""
    if len(cells) != count or dialect.share(cells) < 0.5 or not any(map(dialect.is_number, cells)):
        return False
    said = [cell for cell in cells if cell]  # a spreadsheet fills up lines above a header: ``Rate,100,,,``
    return len(said) == count or dialect.share(said) > 0.5


def _without_rows(path: Path, text: bytes, head: list[tuple[int, str]], notes: tuple[str, ...]) -> TextTable:
    number, line = next(((n, line) for n, line in reversed(head) if not is_remark(line)), head[-1])
    cells = [Dialect(delimiter, ".").cells(line) for delimiter in DELIMITERS]
    names = max(cells, key=len)
    if len(names) < 2:
        raise DataError(f"{path.name}: no line of numbers among the first {len(head)}; expected a table")
    return TextTable(path, text, names, True, Dialect(DELIMITERS[cells.index(names)], "."), number, line, (), notes)


def _end_of(text: bytes, blanks: bytes) -> int:
    """Where a text ends, but for blanks: without a copy of it."""
    tail = text[-LONGEST_LINE:]
    ended = tail.rstrip(blanks)
    return len(text) - len(tail) + len(ended) if ended else len(text.rstrip(blanks))


def without_a_cut_end(table: TextTable) -> TextTable:
    """Leave out a last line that a logger did not finish: too few cells, or no line end and a cell shorter than above."""
    blanks = b" \t" if table.dialect.delimiter != "\t" else b" "
    text, end = table.text, _end_of(table.text, b"\r\n" + blanks)
    start = max(text.rfind(mark, max(0, end - LONGEST_LINE - 1), end) for mark in (b"\n", b"\r")) + 1
    if start <= table.begin:
        return table  # the first row, which stays to be complained about
    whole = end < _end_of(text, blanks)
    last = table.dialect.cells(text[start:end].decode("latin-1"))
    count = len(table.names)
    if len(last) >= count:
        if whole or len(last) > count:
            return table
        previous = [table.dialect.cells(line.decode("latin-1")) for line in text[:start].splitlines()[-20:]]
        lengths = [len(cells[-1]) for cells in previous if len(cells) == count]
        if not lengths or len(last[-1]) >= min(lengths):
            return table
    if last and text[start:end].lstrip().startswith(REMARKS_BYTES):
        return table
    note = (
        f"the last line holds {len(last)} of {count} columns: cut, left out"
        if len(last) < count
        else ("the last line is cut: left out")
    )
    return replace(table, text=table.text[:start], notes=(*table.notes, note))
