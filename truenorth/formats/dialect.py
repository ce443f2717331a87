"""The dialect of a table in text: what stands between its columns, and its decimal mark.

It is the one in which most lines of the log's head split into as many numbers. Some loggers write the decimals of one column
with a point and those of others with a comma (``0.004;-0,08``): then a table has points throughout before it is read, where each
column keeps to one mark.
"""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from truenorth.core.errors import DataError
from truenorth.formats.content import REMARKS
from truenorth.formats.quotes import is_open, plain_cells

NUMBER = re.compile(r"[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|inf(?:inity)?)", re.IGNORECASE | re.ASCII)
STAMP = re.compile(
    r"(?:\d{2,4}[-/.]\d{1,2}[-/.]\d{2,4}[T ]?)?(?:\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?)?(?:Z|[+-]\d\d:?\d\d)?", re.ASCII
)
DELIMITERS = (",", ";", "\t", "|", None)  # None: blanks
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(?:[.,]\d{3})+", re.ASCII)
QUOTED = re.compile(r'"\s*([+-]?\d+,\d+)\s*"', re.ASCII)  # a decimal comma between columns that commas divide
EITHER = ".,"  # decimal points in some columns, commas in others
SAMPLE = 40  # lines by which the dialect is judged
FEWEST_CELLS = 3  # of a line that may be a row of another table
BROKEN = re.compile(r"[+-]?(?:\d+[.,]|[.,]\d)")  # as a number begins, in digits of any script
MOST_BELOW, MOST_ABOVE = 1, 10  # of such lines that may stand below a header, and above it: a cut row, a matrix


@dataclass(frozen=True)
class Dialect:
    """How the lines of a table are cut into cells: `delimiter` (None: blanks) and the `decimal` mark, which may be `EITHER`."""

    delimiter: str | None
    decimal: str

    def cells(self, line: str) -> list[str]:
        """The cells of a line, without blanks and quotes around them."""
        if self.delimiter is None:
            return [cell.strip('"') for cell in line.split()]
        if '"' not in line:
            return [cell.strip() for cell in line.split(self.delimiter)]
        if is_open(line, self.delimiter):
            return plain_cells(line, self.delimiter)
        row = next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True), [])
        return [cell.strip().strip('"').strip() for cell in row]

    def is_number(self, cell: str) -> bool:
        """Whether a cell is a number in this dialect."""
        if self.decimal == EITHER:
            cell = cell.replace(",", ".", 1)
        elif self.decimal == ",":
            return "." not in cell and NUMBER.fullmatch(cell.replace(",", ".", 1)) is not None
        return NUMBER.fullmatch(cell) is not None

    def share(self, cells: Sequence[str]) -> float:
        """Share of cells that are numbers, dates or times; an empty one counts a little less."""
        if not cells:
            return 0.0
        return sum(1.0 if self.is_number(c) or (c and STAMP.fullmatch(c)) else 0.9 * (not c) for c in cells) / len(
            cells
        )

    def words(self) -> str:
        """What it is, for people."""
        named = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", None: "blanks"}[self.delimiter]
        return f"{named} between the columns" + (", decimal commas" if self.decimal == "," else "")


def dialect_of(head: list[tuple[int, str]]) -> tuple[Dialect, int]:
    """The dialect of the last lines of the head, and how many cells they have."""
    lines = [line for _, line in head if not is_remark(line)][-SAMPLE:]
    lines = lines[:-1] if len(lines) > 2 else lines  # the last one may be cut
    tabs = bool(lines) and all("\t" in line.strip() for line in lines)
    quoted = bool(lines) and all(any(THOUSANDS.fullmatch(c) is None for c in QUOTED.findall(line)) for line in lines)
    best, count, highest = Dialect(",", "."), 0, -1.0
    for decimal in (".", ",", EITHER):
        for delimiter in DELIMITERS:
            if delimiter == "," and (decimal == EITHER or (decimal == "," and not quoted)):
                continue
            dialect = Dialect(delimiter, decimal)
            rows = [dialect.cells(line) for line in lines]
            size, rows_of_size = Counter(len(row) for row in rows if row).most_common(1)[0] if any(rows) else (0, 0)
            numbers = [dialect.share(row) for row in rows if len(row) == size]
            alone = 0.5 if size < 2 else 1.0  # a table has several columns
            if delimiter is None and tabs:
                alone *= 0.95  # blanks inside cells, such as dates: tabs divide them
            score = alone * rows_of_size / max(1, len(lines)) * (sum(numbers) / max(1, len(numbers)))
            # Of equals the dialect of more columns: a line of one cell is a number in none or in all of them.
            if (score, size) > (highest + 1e-9, 0) or (abs(score - highest) <= 1e-9 and size > count):
                best, count, highest = dialect, size, score
    return best, count


def is_remark(line: str) -> bool:
    """Whether a line is a remark."""
    return line.lstrip().startswith(REMARKS)


def notes_on_other_rows(
    source: str, dialect: Dialect, above: Sequence[tuple[int, str]], used: Collection[int], count: int
) -> tuple[str, ...]:
    """What to say of lines of numbers above the first whole row, which are not read.

    Parameters
    ----------
    source : str
        The file's name.
    dialect : Dialect
    above : sequence of (int, str)
        The lines above the first whole row, numbered.
    used : collection of int
        Those of them that are the header; none where there is none.
    count : int
        Columns of the table.

    Raises
    ------
    DataError
        So many of them that they are rows: with the first one's line.
    """
    header = max(used, default=-1)
    _refuse_broken_rows(source, dialect, above, header, count)
    notes: list[str] = []
    for below in (True, False):
        lines = [
            (n, dialect.cells(line))
            for k, (n, line) in enumerate(above)
            if (k > header) == below and not is_remark(line)
        ]
        plain = [(n, cells) for n, cells in lines if cells and all(map(dialect.is_number, cells))]
        rows = [(n, cells) for n, cells in lines if len(cells) >= FEWEST_CELLS and _are_numbers(dialect, cells)]
        if len(rows) > (MOST_BELOW if below and header >= 0 else MOST_ABOVE):
            number, cells = rows[0]
            raise DataError(
                f"{source}: line {number}: {len(cells)} columns, as in {len(rows)} lines above the rows of {count} columns; "
                "expected one table: save each part as a log of its own, or remove the lines that are cut"
            )
        said = sorted({n for n, _ in [*(plain if below else []), *rows]})
        if said:
            where = "lines of numbers that are no whole row" if below else "lines of numbers above the header"
            notes.append(f"{where} left out: {len(said)}, the first is line {said[0]}")
    return tuple(notes)


def _refuse_broken_rows(
    source: str, dialect: Dialect, above: Sequence[tuple[int, str]], header: int, count: int
) -> None:
    """Rows whose numbers are broken are no header, and none of those below it is left out; `header`: its place, -1 without one."""
    found = [(number, cell) for number, line in above if (cell := _broken(dialect, line, count)) is not None]
    if any(_broken(dialect, line, count) is not None for _, line in above[max(header, 0) :]):
        number, cell = found[0]
        raise DataError(
            f"{source}: line {number}: {cell!r} is no number, in a row of numbers; expected digits 0 to 9: put such rows right, "
            "or remove them"
        )


def _broken(dialect: Dialect, line: str, count: int) -> str | None:
    """The first broken number of a row of the table; None where a line is no such row."""
    cells = [] if is_remark(line) else dialect.cells(line)
    broken = [cell for cell in cells if BROKEN.match(cell) and not (dialect.is_number(cell) or _has_letters(cell))]
    whole = len(cells) == count and len(broken) + sum(map(dialect.is_number, cells)) > 0.5 * count
    return broken[0] if broken and whole else None


def _has_letters(cell: str) -> bool:
    """As a name or a unit has; ``1.#QNAN`` is neither."""
    return "#" not in cell and any(map(str.isalpha, cell))


def _are_numbers(dialect: Dialect, cells: Sequence[str]) -> bool:
    return dialect.share(cells) >= 0.5 and sum(map(dialect.is_number, cells)) > 0.5 * len(cells)


def with_points(source: str, text: bytes, skip: int, names: Sequence[str], dialect: Dialect) -> bytes:
    """The text with a decimal point in all rows, of a table whose columns have points or commas.

    Parameters
    ----------
    source : str
        The file's name.
    text : bytes
    skip : int
        Lines above the rows.
    names : sequence of str
        Of the columns.
    dialect : Dialect

    Raises
    ------
    DataError
        A column with both marks, or with a mark that may stand between thousands: with line and column.
    """
    marks: dict[
        int, tuple[str, str, int]
    ] = {}  # of a column: its mark, and the first cell with it, and that cell's line
    shown: set[int] = set()  # columns whose mark can only be a decimal one
    lines = text.splitlines(keepends=True)
    for number, raw in enumerate(lines[skip:], start=skip + 1):
        line = raw.decode("utf-8", "replace")
        if is_remark(line):
            continue
        for column, cell in enumerate(dialect.cells(line)):
            mark = next((mark for mark in EITHER if mark in cell), None)
            if mark is None or column >= len(names) or not dialect.is_number(cell):
                continue
            before, first, at = marks.setdefault(column, (mark, cell, number))
            if before != mark:
                raise DataError(
                    f"{source}: line {number}, column {names[column]}: {cell!r}, and {first!r} in line {at}; expected one decimal "
                    "mark in a column: write all numbers of the log with decimal points"
                )
            if THOUSANDS.fullmatch(cell) is None:
                shown.add(column)
        lines[number - 1] = raw.replace(b",", b".")
    for column, (_, cell, number) in marks.items():
        if column not in shown and len(marks) > 1:
            raise DataError(
                f"{source}: line {number}, column {names[column]}: {cell!r} may be a decimal number or one of thousands, as other "
                "columns have the other mark; expected one decimal mark in the whole log: write all numbers with decimal points"
            )
    return b"".join(lines)
