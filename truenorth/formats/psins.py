"""PSINS ``.imu`` text: the toolbox's compact log file, or its array ``imu`` as plain rows.

The compact form begins with a line that names itself a PSINS-format SIMU log. Three rows follow: attitude and velocity;
latitude, longitude, height, t0 (s), sampling interval (ms), g; the size of one count of each sensor (arcsec, ug s). Then come
whole counts, with the dither of the sampling time (us) in a seventh column or without (G. Yan, PSINS toolbox,
imufile.m). The plain form has rows of gx gy gz ax ay az [t], increments in rad and m/s. Axes right-forward-up.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from truenorth.core.errors import DataError
from truenorth.core.units import parse_unit
from truenorth.formats.content import REMARKS
from truenorth.formats.layout import Layout
from truenorth.formats.table import finish
from truenorth.formats.text import TextTable, open_table
from truenorth.records import ImuRecord

EXPECTED = "rows of gx gy gz ax ay az [t], increments in rad and m/s"
ARCSEC = parse_unit("arcsec")[0]
COLUMNS = ["gx", "gy", "gz", "ax", "ay", "az", "t"]


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a PSINS log; six plain columns need a rate.

    Raises
    ------
    DataError
        Another number of columns, a header of other names, text in a number, NaN, time going back: with the line.
    """
    table = open_table(path)
    count = len(table.names)
    if count not in (6, 7):
        raise DataError(f"{path.name}: {count} columns; expected 6 or 7: {EXPECTED}")
    if (
        table.named
        and not table.header.lstrip().startswith(REMARKS)
        and [n[:1].lower() for n in table.names[:6]] != list("gggaaa")
    ):
        raise DataError(f"{path.name}: the header {table.header.strip()!r} is not {EXPECTED}; read it as csv")
    compact = any("PSINS" in line and "SIMU" in line for line in (*table.above, table.header))
    table = replace(table, names=COLUMNS[:count])
    if compact:
        return _compact(table, layout)
    values = table.read(table.names)
    time = values[:, 6] if count == 7 else None
    if time is not None and not np.all(np.diff(time) > 0) and np.all(np.diff(values[:, 0]) > 0):
        raise DataError(f"{path.name}: time stands in the first column; expected {EXPECTED}: read it as kf-gins")
    return finish(
        time, values[:, :3], values[:, 3:6], layout.kind or "increments", layout, path.name,
        labels=("t", *COLUMNS[:6]), place=table.place,
    )  # fmt: skip


def _compact(table: TextTable, layout: Layout) -> ImuRecord:
    source = table.path.name
    numbers = [number for number, _ in zip((n for n, _ in table.lines()), range(3))]
    if len(numbers) < 3:
        raise DataError(f"{source}: the three header rows of a PSINS log are not complete; the file is cut short")
    rows = [
        [float(cell) for cell in table.dialect.cells(line.decode())] for _, (_, line) in zip(range(3), table.lines())
    ]
    t0, interval, g = rows[1][3], rows[1][4] * 1e-3, rows[1][5]
    if not (interval > 0.0 and 9.0 < g < 10.0):
        raise DataError(
            f"{source}: line {numbers[1]}: sampling interval {interval * 1e3:g} ms and gravity {g:g} m/s^2 cannot be; "
            "expected latitude, longitude, height, t0, interval (ms) and g as PSINS writes them"
        )
    data = replace(table, skip=numbers[2])
    counts = data.read(data.names)
    time = t0 + interval * np.arange(1.0, len(counts) + 1)
    if len(data.names) == 7:
        time = time + 1e-6 * np.cumsum(counts[:, 6])
    gyro = counts[:, :3] * (np.array(rows[2][:3]) * ARCSEC)
    accel = counts[:, 3:6] * (np.array(rows[2][3:6]) * 1e-6 * g)
    labels = ("dt", *COLUMNS[:6])
    return finish(time, gyro, accel, "increments", layout, source, labels=labels, place=data.place)
