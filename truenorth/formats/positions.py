"""Positions in text without named columns of ours: RTKLIB's ``.pos`` and the GNSS files of KF-GINS."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats import vbo
from truenorth.formats.columns import Columns
from truenorth.formats.long_shape import shape_of
from truenorth.formats.text import TextTable, open_table

Array = NDArray[np.float64]

RTKLIB = {
    "latitude(deg)": "lat [deg]", "longitude(deg)": "lon [deg]", "height(m)": "alt [m]", "Q": "quality", "sdn(m)": "sigma_N [m]",
    "sde(m)": "sigma_E [m]", "sdu(m)": "sigma_U [m]", "vn(m/s)": "VN [m/s]", "ve(m/s)": "VE [m/s]", "vu(m/s)": "VU [m/s]",
    "sdvn": "sigma_VN [m/s]", "sdve": "sigma_VE [m/s]", "sdvu": "sigma_VU [m/s]",
}  # fmt: skip
KF_GINS = ["time [s]", "lat [deg]", "lon [deg]", "alt [m]", "sigma_N [m]", "sigma_E [m]", "sigma_U [m]"]
KF_GINS_VELOCITY = ["VN [m/s]", "VE [m/s]", "VD [m/s]", "sigma_VN [m/s]", "sigma_VE [m/s]", "sigma_VU [m/s]"]
LARGEST_SIGMA = 1e4  # m


def columns_of_positions(path: Path) -> Columns | None:
    """The columns of such a file; None where it is of another kind; a DataError where its times are no times."""
    if vbo.is_one(path) or shape_of(path) is not None:
        return None  # a table of named columns
    table = open_table(path)
    header = next(
        (line for line in (*table.above, table.header) if "latitude(deg)" in line and "longitude(deg)" in line), None
    )
    if header is not None:
        return _rtklib(table, header)
    if not table.named and len(table.names) in (7, 13):
        names = KF_GINS if len(table.names) == 7 else [*KF_GINS, *KF_GINS_VELOCITY]
        renamed = replace(table, names=names)
        head = renamed.read(names)
        fits = (
            np.all(np.abs(head[:, 1]) <= 90.0)
            and np.all(np.abs(head[:, 2]) <= 360.0)
            and np.all(np.diff(head[:, 0]) > 0.0)
        )
        if fits and np.all((head[:, 4:7] > 0.0) & (head[:, 4:7] < LARGEST_SIGMA)):
            return Columns(path, names, renamed.read, renamed.column, renamed.place)
    return None


def _rtklib(table: TextTable, header: str) -> Columns:
    mark = table.dialect.delimiter
    marked = mark is not None and mark in header  # the option out-fieldsep
    words = [word.strip() for word in header.lstrip("% \t").split(mark if marked else None)]
    # The time is a date and a time of day, or a week and its seconds; between other marks than blanks a date is one column.
    whole = marked and len(words) == len(table.names)
    names = [*(["time"] if whole else ["first", "second"]), *(RTKLIB.get(word, word) for word in words[1:])]
    if len(names) != len(table.names):
        raise DataError(
            f"{table.path.name}: a header of {len(words)} names above rows of {len(table.names)} columns; expected as many columns "
            "as names, or one more, of the time"
        )
    table = replace(table, names=names)
    if whole:
        return Columns(table.path, names, table.read, table.column, table.place)

    def column(name: str) -> Any:
        if name != "time":
            return table.column(name)
        import pyarrow as pa

        first, second = (table.column(part).to_pylist() for part in ("first", "second"))
        if isinstance(first[0], int | float):  # week and time of week
            return pa.chunked_array([pa.array([float(tow) for tow in second])])
        return pa.chunked_array([pa.array([f"{day} {time}" for day, time in zip(first, second)])])

    return Columns(table.path, ["time", *names[2:]], table.read, column, table.place)
