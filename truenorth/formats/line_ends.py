"""Line ends inside quoted cells, which CSV allows: taken out, so that a row is a line.

Scripts that write what a device said next to its numbers, as one quoted cell, leave that text's own line ends in the cell. Remarks
of an operator hold some, too. A cell is mended only where that makes a row of as many cells as the others have. A stray quote,
which would take in rows, stays and is dealt with later (:mod:`truenorth.formats.quotes`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import islice

from truenorth.formats.content import REMARKS_BYTES
from truenorth.formats.dialect import NUMBER, SAMPLE, Dialect, dialect_of

# A quoted cell, whole, with a line end in it.
CELL = re.compile(rb"""(?m)(?<=[,;\t|])[ ]?"(?:[^"\r\n]|"")*[\r\n](?:[^"]|"")*"(?=[ ]?(?:[,;\t|]|\r?$))""")
CELL_FIRST = re.compile(rb"""(?m)^[ ]?"(?:[^"\r\n]|"")*[\r\n](?:[^"]|"")*"(?=[ ]?(?:[,;\t|]|\r?$))""")
END = re.compile(rb"\r\n|\r|\n")
REMOVED = b"\0"  # a line end, until its row has ended
LONGEST = 20  # lines of a cell; what a stray quote takes in has no end
ROW = 3  # numbers from which on a line inside of quotes may be a row


def without_ends_in_quotes(text: bytes) -> tuple[bytes, str | None]:
    """Take the line ends out of quoted cells; and a note of how many cells they were.

    Behind a row an empty line is left for each of them, so that lines keep their numbers.
    """
    if b'"' not in text or REMOVED in text or not any(line.count(b'"') % 2 for line in text.splitlines()):
        return text, None
    folded, count = text, 0
    for cell in (CELL_FIRST, CELL):
        folded, found = cell.subn(_folded, folded)
        count += found
    if REMOVED not in folded:
        return text, None
    lines = folded.splitlines(keepends=True)
    dialect, size = dialect_of(list(enumerate(islice(_sample(lines), 2 * SAMPLE))))
    kept, count = [], 0
    for line in lines:
        ends = line.count(REMOVED)
        if ends and _is_whole(line, dialect, size):
            kept.append(_without_marks(line) + b"\n" * ends)
            count += 1
        else:
            kept.append(line.replace(REMOVED, b"\n"))
    return (b"".join(kept), f"rows with line ends in quoted cells: {count}") if count else (text, None)


def _folded(cell: re.Match[bytes]) -> bytes:
    """A cell on one line, with a mark for each line end; as it is where it holds what may be rows."""
    parts = END.split(cell[0])
    return cell[0] if len(parts) > LONGEST or any(map(_may_be_row, parts[1:])) else REMOVED.join(parts)


def _may_be_row(part: bytes) -> bool:
    cells = re.split(rb"[,;\t|]", part.strip(b' "'))
    numbers = sum(NUMBER.fullmatch(cell.strip(b' "').decode("latin-1")) is not None for cell in cells)
    return numbers >= ROW and numbers >= 0.5 * len(cells)


def _sample(lines: Iterable[bytes]) -> Iterator[str]:
    """The lines that may be rows, in text."""
    for line in lines:
        if line.strip() and not line.lstrip().startswith(REMARKS_BYTES):
            yield _without_marks(line).decode("latin-1").rstrip("\r\n")


def _is_whole(line: bytes, dialect: Dialect, size: int) -> bool:
    return len(dialect.cells(_without_marks(line).decode("latin-1").rstrip("\r\n"))) == size


def _without_marks(line: bytes) -> bytes:
    """A line with blanks for its marks; without those at the edges of cells."""
    bare = re.sub(rb'(?<=") *\0[\0 ]*|[\0 ]*\0 *(?=")', b"", line)
    return re.sub(rb" *\0[\0 ]*", b" ", bare)
