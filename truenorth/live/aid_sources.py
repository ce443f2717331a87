"""Where the rows of aiding sensors come from: a log replayed in step with the IMU's, or a stream of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import TruenorthError, UsageError
from truenorth.core.paths import is_file, is_folder
from truenorth.live.feed import Feed
from truenorth.live.journal import AidJournal
from truenorth.live.listening import READERS, Listener
from truenorth.live.sources import open_bytes

Array = NDArray[np.float64]

SAME = "same"  # the source of the IMU's rows
FAR = 10.0  # s: clocks that differ by so much are two


class AidSource(Protocol):
    """What brings rows to a feed."""

    def advance(self, newest: float) -> None:
        """The IMU's newest row is of this time (s)."""

    @property
    def note(self) -> str:
        """What is to be said; empty where nothing is."""


class Replayed:
    """Rows of a log, in step with those of the IMU.

    Parameters
    ----------
    rows : (N, 1 + columns) array
        Of a feed.
    add : callable
        Takes them.
    """

    note = ""

    def __init__(self, rows: Array, add: Callable[[Array], None]) -> None:
        self._rows, self._add, self._at = rows, add, 0

    def advance(self, newest: float) -> None:
        """See :class:`AidSource`."""
        last = int(np.searchsorted(self._rows[:, 0], newest, side="right"))
        if last > self._at:
            self._add(self._rows[self._at : last])
            self._at = last


class Streamed:
    """A stream, read in a thread of its own.

    Parameters
    ----------
    listener : Listener
    read : callable or None
        Gives bytes, see :func:`open_bytes`; None: another source hands them to the listener.
    """

    def __init__(self, listener: Listener, read: Callable[[], bytes | None] | None) -> None:
        self._listener, self._newest = listener, -np.inf
        self._failure = ""
        if read is not None:
            threading.Thread(target=self._run, args=(read,), daemon=True).start()

    def _run(self, read: Callable[[], bytes | None]) -> None:
        try:
            while (data := read()) != b"":
                if data:
                    self._listener.hear(data)
        except (TruenorthError, OSError) as error:
            self._failure = str(error)

    def advance(self, newest: float) -> None:
        """See :class:`AidSource`."""
        self._newest = newest

    @property
    def note(self) -> str:
        """See :class:`AidSource`."""
        key, rows = self._listener.feed.key, self._listener.feed.rows
        found = [self._failure]
        if self._listener.broken:
            found.append(f"{key}: {self._listener.broken} lines or messages could not be read")
        if len(rows) and np.isfinite(self._newest) and abs(rows[-1, 0] - self._newest) > FAR:
            found.append(
                f"{key}: its clock is {rows[-1, 0] - self._newest:+.0f} s off that of the IMU; expected one clock: take the "
                "time of arrival for both"
            )
        return "; ".join(text for text in found if text)


def open_aid(
    text: str, feed: Feed, kept: AidJournal | None = None, *, by_arrival: bool = False, **options: Any
) -> tuple[AidSource, Listener | None]:
    """The source that a text names, as :func:`truenorth.live.sources.open_source`; ``same``: that of the IMU's rows.

    Parameters
    ----------
    feed : Feed
    kept : AidJournal, optional
        Where the rows are kept; a log is passed over up to the last row there.
    by_arrival : bool
        Time is that of arrival, whatever the rows say.
    **options
        Of the reader.

    Returns
    -------
    source : AidSource
    listener : Listener or None
        What is to be given the bytes of the IMU's source.

    Raises
    ------
    UsageError
        A text that names none, a file or port that cannot be opened.
    DataError
        A log that cannot be read.
    """
    add = feed.add if kept is None else kept.add
    if text.startswith("replay:"):
        path = Path(text.removeprefix("replay:"))
        if not (is_file(path) or is_folder(path)):
            raise UsageError(f"source {text}: there is no file {path}")
        rows = feed.rows_of(READERS[feed.key](path, **feed.reading, **options))
        after = -np.inf if kept is None else kept.earlier[:, 0].max(initial=-np.inf)
        return Replayed(rows[rows[:, 0] > after], add), None
    listener = Listener(feed, text, shared=text == SAME, by_arrival=by_arrival, add=add, **options)
    return Streamed(listener, None if text == SAME else open_bytes(text)), listener if text == SAME else None
