"""Bytes of an aiding sensor's source to the rows of its feed: NMEA, a device's messages, or text with named columns.

Text goes through the reader of such logs, a few lines at a time: what a file may look like, a stream may look like as well. The
lines before the new ones stand with them, since a count may be a difference.
"""

from __future__ import annotations

import re
import tempfile
import time as clock
from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import body_axes
from truenorth.core.errors import DataError
from truenorth.core.units import parse_unit
from truenorth.formats import read_encoder, read_gnss, read_height, read_master, read_odometer, read_velocity
from truenorth.formats.magnetometer import read_magnetometer
from truenorth.live.binary_rows import BinaryRows
from truenorth.live.feed import Feed
from truenorth.live.messages import LONGEST_LINE, Messages, protocol_of

Array = NDArray[np.float64]

READERS: dict[str, Any] = {
    "gnss": read_gnss,
    "odometer": read_odometer,
    "velocity": read_velocity,
    "baro": read_height,
    "master": read_master,
    "indexer": read_encoder,
    "magnetometer": read_magnetometer,
    "attitude": read_master,
}
PARTS = {"magnetometer": "mag"}  # what a device's tables are named, where it is not the feed's key
DAY = 86400.0
BEFORE = 2  # lines: a total of counts needs one before, a record two rows
PLACE, MOTION = ("GGA",), ("RMC", "VTG")
HEADING = re.compile(r"(\w+) ?(?:\[(.+)\])?")


class Listener:
    """One source of one feed.

    Parameters
    ----------
    feed : Feed
    source : str
        Messages begin with it.
    shared : bool
        The stream is the IMU's as well: lines of text and binary rows are not ours.
    by_arrival : bool
        Time is that of arrival, whatever the rows say.
    add : callable, optional
        Takes the rows in the place of the feed.
    options : mapping
        Of the reader, such as columns and units.

    Attributes
    ----------
    broken : int
        Lines or messages that could not be read.
    """

    def __init__(
        self,
        feed: Feed,
        source: str,
        *,
        shared: bool = False,
        by_arrival: bool = False,
        add: Callable[[Array], None] | None = None,
        **options: Any,
    ) -> None:
        self.feed, self._source, self._options, self._add = feed, source, options, add or feed.add
        self._shared, self._by_arrival = shared, by_arrival
        self._binary = BinaryRows()
        self._half = b""
        self._messages: Messages | None = None
        self._header = b""
        self._lines: list[bytes] = []  # text: the lines before the new ones; NMEA: sentences since the epoch before
        self._last = -np.inf
        self._days = 0.0
        self._broken = 0

    @property
    def broken(self) -> int:
        """Lines or messages that could not be read."""
        return self._broken + (0 if self._messages is None else self._messages.broken)

    def hear(self, data: bytes) -> None:
        """Take bytes in; what they hold goes to the feed.

        Raises
        ------
        DataError
            Text that is none of these.
        """
        if self._shared:
            _, data = self._binary.feed(data)
        if self._messages is None and not self._header and not self._lines:
            protocol = protocol_of(self._half + data)
            if protocol is not None:
                data = self._half + data + self._binary.given_back()
                self._messages = Messages(protocol, self._source)
        if self._messages is not None:
            part = PARTS.get(self.feed.key, self.feed.key)
            self._take(self._messages.feed(data, part).get(part, {}))
            return
        *lines, self._half = (self._half + data).split(b"\n")
        if len(self._half) > LONGEST_LINE:
            raise DataError(f"{self._source}: {len(self._half)} bytes without the end of a line; expected text or NMEA")
        lines = [line.strip() for line in lines if line.strip()]
        sentences = [line[line.find(b"$") :] for line in lines if b"$" in line]
        if sentences and self.feed.key == "gnss":
            self._nmea(sentences)
        elif lines and not self._shared:
            self._text(lines)

    def _take(self, table: dict[str, Array]) -> None:
        """A device's table: headings with their units."""
        rows: dict[str, Array] = {}
        for heading, values in table.items():
            found = HEADING.fullmatch(heading)
            if found is not None:
                rows[found[1]] = values * (1.0 if found[2] is None else parse_unit(found[2])[0])
        if "time" not in rows:
            return
        count = len(rows["time"])
        values = np.column_stack([rows.get(name, np.full(count, np.nan)) for name in ("time", *self.feed.columns)])
        if self.feed.key == "magnetometer" and self._messages is not None:
            axes = self.feed.reading.get("axes") or self._messages.module.AXES
            values[:, 1:] = values[:, 1:] @ body_axes(axes).T
        self._give(values)

    def _text(self, lines: list[bytes]) -> None:
        """Lines with named columns, the names first."""
        lines = [line for line in lines if line[:1] not in b"#$/"]
        if not self._header and lines:
            self._header, *lines = lines
        if not lines:
            return
        window = [*self._lines, *lines]
        self._lines = window[-BEFORE:]
        if len(window) > BEFORE:
            self._read(b"\n".join([self._header, *window]), ".csv")

    def _nmea(self, lines: list[bytes]) -> None:
        """Sentences; the newest epoch waits until its place and its velocity are there, or another one begins."""
        sound = [line for line in lines if _sound(line)]
        self._broken += len(lines) - len(sound)
        self._lines += [line for line in sound if line[3:6].decode() in (*PLACE, *MOTION)]
        stamps = [line.split(b",")[1] if line[3:6] != b"VTG" else b"" for line in self._lines]
        epochs = [i for i, stamp in enumerate(stamps) if stamp and stamp not in stamps[:i]]
        if len(epochs) < 2:
            return
        kinds = {line[3:6].decode() for line in self._lines[epochs[-1] :]}
        end = len(self._lines) if kinds & set(PLACE) and kinds & set(MOTION) else epochs[-1]
        if end > epochs[1]:
            self._read(b"\n".join(self._lines[:end]), ".nmea")
            self._lines = self._lines[epochs[-2 if end == epochs[-1] else -1] :]

    def _read(self, text: bytes, suffix: str) -> None:
        """Read some lines as a file of them; rows that are not new are passed over."""
        with tempfile.NamedTemporaryFile(suffix=suffix) as file:
            file.write(text + b"\n")
            file.flush()
            try:
                record = READERS[self.feed.key](Path(file.name), **self.feed.reading, **self._options)
            except DataError as error:
                self._broken += 1
                self.feed.failure = str(error).replace(Path(file.name).name, self._source)
                return
        if suffix == ".nmea":
            # An IMU next to a receiver seldom knows the date, and no epoch is to wait for one: the time of day, as it goes on.
            record = record.shifted(-DAY * (record.time[0] // DAY))
            if record.time[-1] + self._days < self._last - DAY / 2:
                self._days += DAY
            record = record.shifted(self._days)
        rows = self.feed.continued(self.feed.rows_of(record))
        self._give(rows[rows[:, 0] > self._last])
        self._last = float(rows[-1, 0])

    def _give(self, rows: Array) -> None:
        if self._by_arrival and len(rows):
            rows[:, 0] += clock.monotonic() - rows[-1, 0]
        self._add(rows)


def _sound(sentence: bytes) -> bool:
    """Whether a sentence's checksum fits."""
    body, star, check = sentence[1:].partition(b"*")
    return bool(star) and check[:2].upper() == b"%02X" % reduce(lambda a, b: a ^ b, body, 0)
