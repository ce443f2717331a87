"""Quotes in a table of text that close no cell: taken out where they only stand at a number, refused where a row is unclear.

In CSV a quote at the beginning of a cell holds separators and line ends until the next quote. A stray one so takes in cells
or whole rows. The rule here is ours: a quote was not meant to hold a line that is a row of the table by itself.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence

from truenorth.core.errors import DataError
from truenorth.formats.content import REMARKS_BYTES

NUMBER_OR_STAMP = rb"[+-]?\.?\d[\w.:/+-]*(?: \d\d?:[\d:.]+)?"
# A line that one pair of quotes holds, with its separators.
WHOLE_ROW = re.compile(rb"""(?m)^[ \t]*(["'])([^"'\r\n]*[,;\t| ][^"'\r\n]*)\1[ \t]*(?=\r?$)""")
SINGLE_WITH_COMMA = re.compile(rb"'[+-]?\d+,\d+'")  # a decimal comma inside quotes: not to be cut


def without_outer_quotes(text: bytes) -> bytes:
    """Take off the quotes around whole rows, and single ones at numbers."""
    return without_single_quotes(without_row_quotes(text))


def without_single_quotes(text: bytes) -> bytes:
    """Take out single quotes at the edges of numbers: ``'0.1'``, and ``'0.1`` as spreadsheets mark text."""
    if b"'" not in text or SINGLE_WITH_COMMA.search(text):
        return text
    mark = rb"[,;\t|]" if re.search(rb"[,;\t|]", text) else rb"[ \t]"  # not the blanks inside of cells
    before, after = rb"((?:^|" + mark + rb") *)", rb"(?= *(?:" + mark + rb"|[\r\n]|\Z))"
    number = rb"(" + NUMBER_OR_STAMP + rb")"
    either = before + rb"'" + number + rb"'?" + after + rb"|" + before + number + rb"'" + after
    return re.sub(rb"(?m)" + either, rb"\1\2\3\4", text)


def without_row_quotes(text: bytes) -> bytes:
    """Take off the quotes of a table each of whose rows stands in one pair of them: ``"0.01,1.0,2.0"``.

    By the rules of CSV that is a table of one column of text, which no log is: some loggers write their rows as one cell. All rows
    from the first such line on have to be of it, but for a last one that is cut short.
    """
    first = WHOLE_ROW.search(text) if b'"' in text or b"'" in text else None
    if first is None:
        return text
    above, table = text[: first.start()], text[first.start() :]
    bare, count = WHOLE_ROW.subn(rb"\2", table)
    rows = sum(bool(line.strip()) and not line.lstrip().startswith(REMARKS_BYTES) for line in table.splitlines())
    return above + bare if count >= max(2, rows - 1) else text


def is_open(line: str, delimiter: str | None) -> bool:
    """Whether a quote at the beginning of a cell is not closed on its line."""
    return _begins(delimiter).search(_rest(line, delimiter)) is not None


def plain_cells(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line whose quotes hold nothing; those at the edges of cells are taken off."""
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def without_stray_quotes(
    name: str, text: bytes, delimiter: str | None, count: int, is_row: Callable[[Sequence[str]], bool]
) -> tuple[bytes, str | None]:
    """Take out of the rows the quotes that belong to no quoted cell.

    Parameters
    ----------
    name : str
        Of the file, for messages.
    text : bytes
    delimiter : str or None
        None: blanks.
    count : int
        Columns of the table.
    is_row : callable
        Whether cells are a row of the table.

    Returns
    -------
    text : bytes
        With the same lines.
    note : str or None
        In how many rows quotes were taken out.

    Raises
    ------
    DataError
        A quote that would hold rows, on a line that makes no row without it: with line and column.
    """
    if not _uncommon(text, delimiter):
        return text, None
    lines = text.splitlines(keepends=True)
    mended: list[int] = []
    below, k = False, 0  # whether a row stands above
    while k < len(lines):
        if b'"' not in lines[k] or lines[k].lstrip().startswith(REMARKS_BYTES):
            below = below or is_row(plain_cells(_text(lines[k]), delimiter))
            k += 1
            continue
        line = _text(lines[k]).rstrip("\r\n")
        opened = is_open(line, delimiter)
        closed, holds = _closed(lines, k, delimiter, is_row) if opened else (None, False)
        if closed is not None:
            k, below = closed + 1, True
            continue
        if opened or '"' in _rest(line, delimiter) or _cut(line, delimiter) != count:
            plain = plain_cells(line, delimiter)
            if len(plain) == len(line.split(delimiter)) and is_row(plain) and not _doubtful(line, plain, delimiter):
                end = lines[k][len(lines[k].rstrip(b"\r\n")) :]
                lines[k] = (delimiter or " ").join(plain).encode() + end
                mended.append(k + 1)
            elif holds and below:
                column = next(i for i, cell in enumerate(line.split(delimiter), 1) if cell.strip().startswith('"'))
                raise DataError(
                    f"{name}: line {k + 1}, column {column}: a quote that is not closed would take in the lines below; "
                    "remove the quote"
                )
        below = below or is_row(plain_cells(_text(lines[k]), delimiter))
        k += 1
    if not mended:
        return text, None
    return b"".join(lines), f"rows whose stray quotes were taken out: {len(mended)}, the first in line {mended[0]}"


def _uncommon(text: bytes, delimiter: str | None) -> bool:
    """Whether any quotes are left without those around whole cells that hold no separator."""
    if b'"' not in text:
        return False
    mark = _separator(delimiter).encode()
    inside = rb" \t" if delimiter is None else mark
    return b'"' in re.sub(
        rb"(?m)(?:^|(?<=" + mark + rb'))"[^"\r\n' + inside + rb']*"(?=' + mark + rb"|[\r\n]|\Z)", b"", text
    )


def _text(raw: bytes) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _separator(delimiter: str | None) -> str:
    return r"[ \t]" if delimiter is None else re.escape(delimiter)


def _begins(delimiter: str | None) -> re.Pattern[str]:
    return re.compile(rf'(?:^|{_separator(delimiter)}) *"')


def _rest(line: str, delimiter: str | None) -> str:
    """A line without its whole quoted cells."""
    mark = _separator(delimiter)
    return re.sub(rf'(?:^|(?<={mark})) *"(?:[^"]|"")*" *(?={mark}|$)', "", line.rstrip("\r\n"))


def _cut(line: str, delimiter: str | None) -> int:
    """How many cells a line has where its quotes hold."""
    if delimiter is None:
        return len(line.split())
    return len(next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), []))


def _doubtful(line: str, plain: Sequence[str], delimiter: str | None) -> bool:
    """Whether a quote stands inside a cell, or is all that a cell holds."""
    raw = line.split(delimiter)
    return any('"' in cell or (not cell and '"' in before) for cell, before in zip(plain, raw, strict=True))


def _closed(
    lines: Sequence[bytes], k: int, delimiter: str | None, is_row: Callable[[Sequence[str]], bool]
) -> tuple[int | None, bool]:
    """The line on which a cell of several lines ends that begins on line `k`, None without one; also whether it holds a row."""
    for j in range(k + 1, len(lines)):
        if is_row(plain_cells(_text(lines[j]), delimiter)):
            return None, True
        if b'"' in lines[j]:
            return j, False
    return None, False
