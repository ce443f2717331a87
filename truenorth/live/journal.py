"""The rows as they came, on the disk: Parquet parts, each written whole, so that a killed run loses seconds and goes on.

``rows/000001.parquet`` ... hold the documented columns of an IMU log; pandas and pyarrow read the folder as one table.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.atomic import atomic_path, writable_folder
from truenorth.core.errors import DataError, UsageError
from truenorth.live.log import Kind, record_of

Array = NDArray[np.float64]

FOLDER = "rows"
SPAN = 10.0  # s of rows in a part
LARGEST = 200_000  # rows in a part


class Journal:
    """Parts of one run.

    Parameters
    ----------
    folder : Path
        Of the run; the parts stand in ``rows`` within.
    resume : bool
        Go on after the parts that are there.

    Raises
    ------
    UsageError
        There are parts, and they are not to be gone on with.
    """

    def __init__(self, folder: Path, *, resume: bool = False) -> None:
        self._folder = writable_folder(folder / FOLDER)
        self._count = len(self._parts())
        if self._count and not resume:
            raise UsageError(f"{folder}: holds the rows of an earlier run; expected another folder, or resume")
        self._open: list[Array] = []

    def _parts(self) -> list[Path]:
        return sorted(self._folder.glob("[0-9]*.parquet"))

    def earlier(self) -> Iterator[tuple[Kind, Array]]:
        """Kind and rows of each part that is there.

        Raises
        ------
        DataError
            A part that is damaged.
        """
        from truenorth.formats import read_imu

        for path in self._parts():
            try:
                record = read_imu(path)
            except DataError as error:
                raise DataError(f"{path}: the part is damaged ({error}); remove it and those after it") from None
            yield record.kind, np.column_stack([record.time, record.gyro, record.accel])

    def add(self, rows: Array, kind: Kind) -> None:
        """Take rows in; write a part when there is enough for one."""
        if len(rows):
            self._open.append(rows)
        if not self._open:
            return
        span = self._open[-1][-1, 0] - self._open[0][0, 0]
        if span >= SPAN or sum(map(len, self._open)) >= LARGEST:
            self.flush(kind)

    def flush(self, kind: Kind) -> None:
        """Write what there is as a part, in the order of time."""
        rows = np.vstack(self._open) if self._open else np.empty((0, 7))
        if len(rows) < 2:
            return
        self._open = []
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        self._count += 1
        with atomic_path(self._folder / f"{self._count:06d}.parquet") as temporary:
            record_of(rows, kind).to_frame().to_parquet(temporary)
