"""Where rows come from: a log replayed or still being written, standard input, UDP, TCP, a serial line, ROS 2.

``replay:log.csv@10x``, ``follow:log.csv`` (a file that another program goes on writing), ``-``, ``udp://:9000``,
``tcp://host:port``, ``serial:/dev/ttyUSB0?baud=921600``, ``bag:folder?topic=/imu`` (a ROS 2 bag that is being written),
``zenoh:key``.
"""

from __future__ import annotations

import os
import re
import socket
import sys
import time as clock
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import parse_qs, urlsplit

import numpy as np
from numpy.typing import NDArray

from truenorth.core.atomic import noted
from truenorth.core.errors import UsageError
from truenorth.core.paths import is_file, is_folder
from truenorth.formats.layout import Layout
from truenorth.live.bags import open_bag
from truenorth.live.decode import Decoder
from truenorth.live.log import Kind
from truenorth.live.zenoh_source import open_zenoh
from truenorth.records import ImuRecord

Array = NDArray[np.float64]

CHUNK = 0.02  # s of a replayed log in a chunk
FASTEST = 500.0  # times: a faster replay has chunks of ten seconds all the same
BYTES = 65536
QUEUE = 4 * 2**20  # bytes of datagrams that wait while other programs have the cores; what does not fit is lost
WAIT = 0.5  # s: a silent line is asked again after it, so that an interrupt is noticed
POLL = 0.05  # s, between two looks at a file that grows
EXAMPLES = (
    "replay:log.csv@10x, follow:log.csv, -, udp://:9000, tcp://host:port, serial:/dev/ttyUSB0?baud=921600, bag:folder?topic=/imu "
    "or zenoh:key"
)


class Source(Protocol):
    """Chunks of rows ``time, gyro (3), accel (3)``, SI units, RFU; empty where nothing came for a while."""

    @property
    def kind(self) -> Kind:
        """What a row is; known from the first rows on."""

    @property
    def broken(self) -> int:
        """Lines or messages that could not be read."""

    @property
    def note(self) -> str:
        """What is to be said of the source's clock; empty where it has one."""

    def __iter__(self) -> Iterator[Array]: ...


class Replay:
    """A log, row by row.

    Parameters
    ----------
    record : ImuRecord
    speed : float
        Times as fast as it was recorded; infinite: as fast as rows are taken.
    after : float, s
        Rows up to this time are passed over.
    """

    broken, note = 0, ""

    def __init__(self, record: ImuRecord, speed: float = 1.0, after: float = -np.inf) -> None:
        self.kind: Kind = record.kind
        self._speed = speed
        first = int(np.searchsorted(record.time, after, side="right"))
        self._rows = np.column_stack([record.time, record.gyro, record.accel])[first:]
        self._length = max(1, round(CHUNK / record.interval * max(1.0, min(speed, FASTEST))))

    def __iter__(self) -> Iterator[Array]:
        begun = clock.monotonic()
        for at in range(0, len(self._rows), self._length):
            chunk = self._rows[at : at + self._length]
            if np.isfinite(self._speed):
                due = begun + (chunk[-1, 0] - self._rows[0, 0]) / self._speed
                clock.sleep(max(0.0, due - clock.monotonic()))
            yield chunk


class Stream:
    """Bytes of a pipe, a socket or a serial line, decoded.

    Parameters
    ----------
    read : callable
        Gives bytes; none at all (b"") at the end; None where nothing came for a while.
    decoder : Decoder
    """

    def __init__(self, read: Callable[[], bytes | None], decoder: Decoder) -> None:
        self._read, self._decoder = read, decoder

    def share(self, hear: Callable[[bytes], None]) -> None:
        """Hand the bytes to another sensor's listener as well."""
        self._decoder.others.append(hear)

    @property
    def kind(self) -> Kind:
        """See :class:`Source`."""
        return self._decoder.kind

    @property
    def broken(self) -> int:
        """See :class:`Source`."""
        return self._decoder.broken

    @property
    def note(self) -> str:
        """See :class:`Source`."""
        if not self._decoder.arrival_time:
            return ""
        return "rows carry no time: that of their arrival is taken, and its jitter with it"

    def __iter__(self) -> Iterator[Array]:
        while (data := self._read()) != b"":
            yield np.empty((0, 7)) if data is None else self._decoder.feed(data)


def open_source(text: str, layout: Layout, after: float = -np.inf, *, by_arrival: bool = False) -> Source:
    """The source that a text names.

    Parameters
    ----------
    layout : Layout
        Columns, units and axes of its rows.
    after : float, s
        A replayed log is passed over up to this time.
    by_arrival : bool
        Time is that of arrival, whatever the rows say.

    Raises
    ------
    UsageError
        A text that names none, a file or port that cannot be opened.
    """
    if text.startswith("replay:"):
        return _replay(text.removeprefix("replay:"), layout, after)
    return Stream(open_bytes(text), Decoder(layout, text, by_arrival=by_arrival))


def open_bytes(text: str) -> Callable[[], bytes | None]:
    """What reads the bytes of a source: some of them, none at all (b"") at the end, None where nothing came for a while.

    Raises
    ------
    UsageError
        As :func:`open_source`.
    """
    if text == "-":
        return lambda: os.read(sys.stdin.fileno(), BYTES)
    try:
        address = urlsplit(text)
        if address.scheme == "udp" and address.port:
            return _udp(address.hostname or "127.0.0.1", address.port)
        if address.scheme == "tcp" and address.port:
            return _tcp(address.hostname or "127.0.0.1", address.port)
        if address.scheme == "serial" and address.path:
            return _serial(address.path, parse_qs(address.query))
        if address.scheme == "bag" and address.path:
            return open_bag(Path(address.path), parse_qs(address.query).get("topic", []))
        if address.scheme == "zenoh" and address.path:
            return open_zenoh(address.path, parse_qs(address.query))
        if address.scheme == "follow" and address.path:
            return _follow(Path(address.path))
    except OSError as error:
        raise UsageError(f"source {text}: cannot be opened ({error.strerror or error})") from None
    except ValueError as error:
        raise UsageError(f"source {text}: {error}; expected {EXAMPLES}") from None
    raise UsageError(f"source {text!r} is not known; expected {EXAMPLES}")


def _replay(text: str, layout: Layout, after: float) -> Replay:
    from truenorth.formats import read_imu

    found = re.fullmatch(r"(.*?)(?:@(?:(\d+(?:\.\d*)?)x|(max)))?", text, re.DOTALL)
    assert found is not None
    path, speed, fastest = found.groups()
    if not path or not (is_file(Path(path)) or is_folder(Path(path))):
        raise UsageError(f"source replay:{text}: there is no file {path}")
    options: dict[str, Any] = {"units": layout.units or None, "columns": layout.columns or None}
    record = read_imu(path, axes=layout.axes, rate=layout.rate, kind=layout.kind, **options)
    factor = np.inf if fastest else 1.0 if speed is None else float(speed)
    if factor <= 0.0:
        raise UsageError(f"source replay:{text}: expected a speed above zero, such as @10x or @max")
    return Replay(record, factor, after)


def _follow(path: Path) -> Callable[[], bytes | None]:
    """A file that another program goes on writing."""
    noted(path)
    file = path.open("rb")

    def read() -> bytes | None:
        data = file.read(BYTES)
        if not data:
            clock.sleep(POLL)
        return data or None

    return read


def _udp(host: str, port: int) -> Callable[[], bytes | None]:
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, QUEUE)  # the system takes as much of it as it allows
    line.bind((host, port))
    line.settimeout(WAIT)

    def read() -> bytes | None:
        try:
            return line.recv(BYTES) or None
        except TimeoutError:
            return None

    return read


def _tcp(host: str, port: int) -> Callable[[], bytes | None]:
    line = socket.create_connection((host, port), timeout=10.0)
    line.settimeout(WAIT)

    def read() -> bytes | None:
        try:
            return line.recv(BYTES)
        except TimeoutError:
            return None

    return read


def _serial(path: str, options: dict[str, list[str]]) -> Callable[[], bytes | None]:
    try:
        import serial
    except ImportError:
        raise UsageError("a serial line needs pyserial: pip install 'truenorth[live]'") from None
    line = serial.Serial(path, int(options.get("baud", ["115200"])[0]), timeout=WAIT)

    def read() -> bytes | None:
        return line.read(max(1, line.in_waiting)) or None

    return read
