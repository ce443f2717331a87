"""Latitudes and longitudes without a sign, whose half of the earth stands in a column of its own: ``N/S`` and ``E/W``.

Loggers with chips of MediaTek, Columbus and Holux write them so, as NMEA does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.formats.columns import Columns
from truenorth.formats.names import plain

Array = NDArray[np.float64]

BEHIND = r"(?:dir(?:ection)?|hemi(?:sphere)?|ref|sign|ind(?:icator)?|{0})"
HALVES = {
    "lat": ("NS", re.compile(rf"(?:gps_|gnss_)?(?:n_?s(?:_ind(?:icator)?)?|lat(?:itude)?_?{BEHIND.format('n_?s')})")),
    "lon": (
        "EW",
        re.compile(rf"(?:gps_|gnss_)?(?:e_?w(?:_ind(?:icator)?)?|lo?ng?(?:itude)?_?{BEHIND.format('e_?w')})"),
    ),
}


def with_signs(columns: Columns, values: Mapping[str, Array]) -> dict[str, Array]:
    """The values, with latitudes and longitudes negative where such a column says south or west.

    Raises
    ------
    DataError
        Another letter in such a column, or one that a sign contradicts.
    """
    signed = dict(values)
    for ours, (letters, name_of_half) in HALVES.items():
        name = next((name for name in columns.names if name_of_half.fullmatch(plain(name))), None)
        if ours not in values or name is None:
            continue
        cells = columns.column(name).to_pylist()
        halves = [cell.strip().upper()[:1] if isinstance(cell, str) else "" for cell in cells]
        if len(halves) != len(values[ours]) or not any(halves):
            continue  # a number is no half of the earth
        wrong = next((k for k, half in enumerate(halves) if half and half not in letters), None)
        if wrong is not None:
            raise DataError(
                f"{columns.path.name}: {columns.place(wrong)}, column {name}: {cells[wrong]!r}; expected "
                f"{letters[0]} or {letters[1]}, the half of the earth of the {'latitude' if ours == 'lat' else 'longitude'}"
            )
        first, second = (np.equal(halves, letter) for letter in letters)
        if (against := first & (values[ours] < 0.0)).any():
            row = int(np.argmax(against))
            raise DataError(
                f"{columns.path.name}: {columns.place(row)}, column {name}: {letters[0]}, of a negative number; expected a number "
                "without a sign, or none of these letters"
            )
        signed[ours] = np.where(second, -np.abs(values[ours]), values[ours])
    return signed
