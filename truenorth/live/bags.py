"""A ROS 2 bag while it is being written: MCAP or sqlite3, one file or the folder of a recorder.

Messages go on as frames (:func:`truenorth.formats.devices.ros.frame`), so that a bag is read like the stream of any other device.
What a recorder has not written yet is not there: MCAP chunks come whole, some seconds of messages at once.
"""

from __future__ import annotations

import io
import re
import sqlite3
import time as clock
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol

from truenorth.core.errors import DataError, UsageError
from truenorth.core.paths import is_file, is_folder
from truenorth.formats.devices.ros import EXTRA, KNOWN, frame

POLL = 0.05  # s, between two looks at a file that grows
BYTES = 1 << 20
MAGIC = 8  # bytes with which an MCAP file begins
HEADER = 9  # bytes of a record: its kind and its length
FOOTER = 2
MOST = 5000  # messages at a time
SUFFIXES = (".mcap", ".db3")


class _File(Protocol):
    """One file of a bag."""

    closed: bool  # its writer has ended it

    def messages(self) -> Iterator[tuple[str, str, bytes]]:
        """Topic, type and serialised message of those that are new."""


class _Mcap:
    """Whole records at the end of an MCAP file."""

    def __init__(self, path: Path) -> None:
        try:
            from mcap import exceptions, stream_reader
        except ImportError:
            raise UsageError(f"{path}: MCAP needs a decoder: pip install 'truenorth[{EXTRA}]'") from None
        self._reader, self._end, self._error = stream_reader.StreamReader, exceptions.EndOfFile, exceptions.McapError
        self._path, self._file = path, path.open("rb")
        self._rest, self._skipped = b"", False
        self._types: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        self.closed = False

    def messages(self) -> Iterator[tuple[str, str, bytes]]:
        """See :class:`_File`."""
        self._rest += self._file.read(BYTES)
        at = 0 if self._skipped else MAGIC
        if len(self._rest) < at:
            return
        self._skipped, end = True, at
        while not self.closed and len(self._rest) >= end + HEADER:
            length = HEADER + int.from_bytes(self._rest[end + 1 : end + HEADER], "little")
            if len(self._rest) < end + length:
                break
            self.closed = self._rest[end] == FOOTER
            end += length
        whole, self._rest = self._rest[at:end], self._rest[end:]
        try:
            yield from self._of(self._reader(io.BytesIO(whole), skip_magic=True, emit_chunks=False).records)
        except self._end:
            return
        except self._error as error:
            raise DataError(f"bag:{self._path}: a damaged record ({error})") from None

    def _of(self, records: Iterator[Any]) -> Iterator[tuple[str, str, bytes]]:
        for record in records:
            kind = type(record).__name__
            if kind == "Schema":
                self._types[record.id] = record.name
            elif kind == "Channel" and record.message_encoding == "cdr":
                self._channels[record.id] = record.topic, self._types[record.schema_id]
            elif kind == "Message" and record.channel_id in self._channels:
                yield *self._channels[record.channel_id], record.data


class _Sqlite:
    """New rows of an sqlite3 bag."""

    closed = False

    def __init__(self, path: Path) -> None:
        self._base = sqlite3.connect(f"file:{path}?mode=ro", uri=True, check_same_thread=False)
        self._last = -1

    def messages(self) -> Iterator[tuple[str, str, bytes]]:
        """See :class:`_File`."""
        query = (
            "SELECT messages.id, name, type, data FROM messages JOIN topics ON topic_id = topics.id "
            "WHERE messages.id > ? ORDER BY messages.id LIMIT ?"
        )
        try:
            rows = self._base.execute(query, (self._last, MOST)).fetchall()
        except sqlite3.OperationalError:  # locked, or its tables are not there yet
            return
        for self._last, topic, kind, data in rows:
            yield topic, kind, data


def open_bag(path: Path, topics: Sequence[str]) -> Callable[[], bytes | None]:
    """What reads the messages of a bag as frames; see :func:`truenorth.live.sources.open_bytes`.

    Parameters
    ----------
    path : Path
        ``.mcap``, ``.db3``, or the folder of a recorder, whose files follow each other.
    topics : sequence of str
        That are read; all when there is none.

    Raises
    ------
    UsageError
        No such file, a folder without a bag, or no decoder.
    """
    if not (is_file(path) or is_folder(path)):
        raise UsageError(f"bag:{path}: there is no such file or folder")
    files = _files(path)
    if not files:
        raise UsageError(f"bag:{path}: no {' or '.join(SUFFIXES)} file in it")
    done = [files[0]]
    file: _File = _opened(files[0])

    def read() -> bytes | None:
        nonlocal file
        found = b"".join(
            frame(topic, kind, data)
            for topic, kind, data in file.messages()
            if kind in KNOWN and (not topics or topic in topics)
        )
        if found:
            return found
        later = [name for name in _files(path) if name not in done]
        if later:
            done.append(later[0])
            file = _opened(later[0])
        elif file.closed if path.is_file() else (path / "metadata.yaml").exists():
            return b""
        else:
            clock.sleep(POLL)
        return None

    return read


def _opened(path: Path) -> _File:
    return _Mcap(path) if path.suffix == ".mcap" else _Sqlite(path)


def _files(path: Path) -> list[Path]:
    """In the order in which a recorder writes them: by the number at the end of the name."""
    if path.is_file():
        return [path]

    def number(name: Path) -> int:
        found = re.search(r"(\d+)$", name.stem)
        return int(found[1]) if found else -1

    return sorted((p for p in path.iterdir() if p.suffix in SUFFIXES), key=number)
