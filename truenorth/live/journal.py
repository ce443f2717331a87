"""The rows as they came, on the disk: Parquet parts, each written whole, so that a killed run loses seconds and goes on.

``rows/000001.parquet`` ... hold the documented columns of an IMU log, ``gnss/000001.parquet`` ... the rows of an aiding sensor in
SI units and radians; pandas and pyarrow read each folder as one table.
"""

from __future__ import annotations

import time as clock
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.arrow import arrow_file
from truenorth.core.atomic import atomic_path, writable_folder
from truenorth.core.errors import DataError, UsageError
from truenorth.live.feed import Feed
from truenorth.live.log import Kind, record_of

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

FOLDER = "rows"
SPAN = 10.0  # s of rows in a part
PAUSE = 1.0  # s by the wall clock between two parts: a fast replay writes larger ones
LARGEST = 50_000  # rows in a part


class Parts:
    """Numbered tables in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = writable_folder(folder)
        self._count = len(self.paths)

    @property
    def paths(self) -> list[Path]:
        """In their order."""
        return sorted(self._folder.glob("[0-9]*.parquet"))

    def write(self, table: pd.DataFrame) -> None:
        """Another one."""
        self._count += 1
        with atomic_path(self._folder / f"{self._count:06d}.parquet") as temporary, arrow_file(temporary, "wb") as file:
            table.to_parquet(file)


class AidJournal:
    """Parts of one aiding sensor.

    Parameters
    ----------
    folder : Path
        Of the run; the parts stand in a folder of the feed's name.
    feed : Feed
        What its rows mean is that of the parts there, if there are any.
    """

    def __init__(self, folder: Path, feed: Feed) -> None:
        self._feed, self._parts = feed, Parts(folder / feed.key)
        self._waiting: deque[Array] = deque()  # another thread adds
        tables = [_read(path) for path in self._parts.paths]
        if tables:
            vars(feed).update({name: tables[-1].attrs[name] for name in feed.says})
        rows = np.vstack([np.empty((0, 1 + len(feed.columns))), *(table.reset_index().to_numpy() for table in tables)])
        self.earlier: Array = rows[np.argsort(rows[:, 0], kind="stable")]

    def add(self, rows: Array) -> None:
        """Take rows ``time, columns`` in, and give them to the feed."""
        self._waiting.append(rows)
        self._feed.add(rows)

    def flush(self) -> None:
        """Write what there is as a part."""
        import pandas as pd

        rows = [self._waiting.popleft() for _ in range(len(self._waiting))]
        if rows:
            table = pd.DataFrame(np.vstack(rows), columns=["time", *self._feed.columns]).set_index("time")
            table.attrs.update(self._feed.meaning)
            self._parts.write(table)


class Journal:
    """Parts of one run.

    Parameters
    ----------
    folder : Path
        Of the run; the parts stand in ``rows`` within.
    feeds : sequence of Feed
        Whose rows are kept as well.
    resume : bool
        Go on after the parts that are there.

    Raises
    ------
    UsageError
        There are parts, and they are not to be gone on with.
    DataError
        A part of an aiding sensor that is damaged.
    """

    def __init__(self, folder: Path, feeds: Sequence[Feed] = (), *, resume: bool = False) -> None:
        self._parts = Parts(folder / FOLDER)
        if self._parts.paths and not resume:
            raise UsageError(f"{folder}: holds the rows of an earlier run; expected another folder, or resume")
        self.aids = {feed.key: AidJournal(folder, feed) for feed in feeds}
        self._open: list[Array] = []
        self._count = 0  # rows in it
        self._written = -np.inf

    def earlier(self) -> Iterator[tuple[Kind, Array]]:
        """Kind and rows of each part that is there.

        Raises
        ------
        DataError
            A part that is damaged.
        """
        from truenorth.formats import read_imu

        for path in self._parts.paths:
            try:
                record = read_imu(path)
            except DataError as error:
                raise _damaged(path, error) from None
            yield record.kind, np.column_stack([record.time, record.gyro, record.accel])

    def taker(self, kind: Kind) -> Callable[[Array], None]:
        """What takes the rows of a run that are of this kind."""
        return lambda rows: self.add(rows, kind)

    def add(self, rows: Array, kind: Kind) -> None:
        """Take rows in; write a part when there is enough for one."""
        if len(rows):
            self._open.append(rows)
            self._count += len(rows)
        if not self._open:
            return
        span = self._open[-1][-1, 0] - self._open[0][0, 0]
        rested = clock.monotonic() - self._written >= PAUSE
        if (span >= SPAN and rested) or self._count >= LARGEST:
            self.flush(kind)

    def flush(self, kind: Kind) -> None:
        """Write what there is, in the order of time; aiding sensors first: they may come late, and never lack."""
        for aid in self.aids.values():
            aid.flush()
        rows = np.vstack(self._open) if self._open else np.empty((0, 7))
        if len(rows) < 2:
            return
        self._open, self._count, self._written = [], 0, clock.monotonic()
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        self._parts.write(record_of(rows, kind).to_frame())


def _read(path: Path) -> pd.DataFrame:
    import pandas as pd

    try:
        with arrow_file(path) as file:
            return pd.read_parquet(file)
    except Exception as error:  # whatever a damaged file raises
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> DataError:
    return DataError(f"{path}: the part is damaged ({error}); remove it and those after it")
