"""CSV: a header line with column names, then numbers; comma, semicolon, tab or blanks between."""

from __future__ import annotations

from pathlib import Path

from truenorth.core.errors import DataError
from truenorth.formats.arrow import table_of
from truenorth.formats.layout import Layout
from truenorth.formats.table import choose, finish
from truenorth.formats.text import TextTable, are_numbers, delimiter_of, first_lines, is_comment, split
from truenorth.records import COLUMNS, ImuRecord, Record

IMU_HEADER = ",".join(("time", *COLUMNS["rates"]))


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a CSV log.

    Lines of remarks (# or %) may stand above the header; the header itself may be one. Columns that are not needed may
    hold anything.

    Raises
    ------
    DataError
        No header, a missing column, text in a number, a short row, NaN or inf, time going back: with line and column.
    """
    table = open_table(path)
    choice = choose(table.names, layout, path.name)
    values = table.read(choice.names)
    time = None if choice.time is None else values[:, 0]
    gyro, accel = values[:, -6:-3], values[:, -3:]
    return finish(time, gyro, accel, choice.kind, layout, path.name, labels=choice.labels, place=table.place)


def write(record: Record, path: Path) -> None:
    """Write a record with the documented columns; every number reads back to the same bits."""
    import pyarrow.csv as pc

    table = table_of(record)
    with path.open("wb") as file:
        file.write((",".join(table.column_names) + "\n").encode())
        pc.write_csv(table, file, pc.WriteOptions(include_header=False))


def open_table(path: Path, example: str = IMU_HEADER) -> TextTable:
    """Where the numbers of a CSV file stand, and what its columns are called.

    Raises
    ------
    DataError
        No header of names; the message gives `example`.
    """
    remark = ""
    for number, line in first_lines(path):
        if is_comment(line):
            remark = line.lstrip("#% \t")
            continue
        delimiter = delimiter_of(line)
        names = split(line, delimiter)
        if not are_numbers(names):
            return TextTable(path, names, delimiter, number)
        if len(split(remark, delimiter_of(remark))) == len(names):
            return TextTable(path, split(remark, delimiter_of(remark)), delimiter, number - 1)
        raise DataError(
            f"{path.name}: line {number} holds numbers, not names; expected a header above it such as "
            f"{example}: add one"
        )
    raise DataError(f"{path.name}: no header; expected a line such as {example}, and numbers below it")
