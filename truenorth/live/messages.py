"""Whole messages of a device's stream, handed to the reader of its logs: what a file of them holds, a stream holds as well.

u-blox UBX, Septentrio SBF, NovAtel OEM, Xsens Xbus, MAVLink, and ROS 2 in frames of ours: each message begins with bytes that tell
the protocol, and says its length in its first bytes. What does not begin so is passed over.
"""

from __future__ import annotations

import struct
import tempfile
import time as clock
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.formats.devices import module_of, xsens

Array = NDArray[np.float64]
Tables = dict[str, dict[str, Array]]


LONGEST_LINE = 4096  # bytes; what is longer without an end is not text


def _novatel(head: bytes) -> int:
    if head[:1] in (b"#", b"%"):  # a line of text
        return head.find(b"\n") + 1 or LONGEST_LINE
    if head[2] == 0x13:  # short header
        return 12 + head[3] + 4
    return head[3] + int.from_bytes(head[8:10], "little") + 4


def _mavlink(head: bytes) -> int:
    return 8 + head[1] if head[0] == 0xFE else 12 + head[1] + 13 * (head[2] & 1)


# How messages begin, bytes that tell the length, and the length of the whole.
PROTOCOLS: dict[str, tuple[tuple[bytes, ...], int, Callable[[bytes], int]]] = {
    "ubx": ((b"\xb5\x62",), 6, lambda head: 8 + int.from_bytes(head[4:6], "little")),
    "sbf": ((b"$@",), 8, lambda head: int.from_bytes(head[6:8], "little")),
    "novatel": ((b"\xaa\x44\x12", b"\xaa\x44\x13", b"#BEST", b"#INS", b"#RAWIMU", b"%INS", b"%RAWIMU"), 10, _novatel),
    "xsens": ((b"\xfa\xff\x36",), 6, xsens.length),
    "ros": ((b"TNRM",), 8, lambda head: int.from_bytes(head[4:8], "little")),
    "mavlink": ((b"\xfe", b"\xfd"), 3, _mavlink),
}


def protocol_of(data: bytes) -> str | None:
    """The protocol of the first message in some bytes; MAVLink, which begins with one byte, only where the bytes begin so."""
    found = [(data.find(sync), name) for name, (syncs, _, _) in PROTOCOLS.items() for sync in syncs]
    there = [(at, name) for at, name in found if at == 0 or (at > 0 and name != "mavlink")]
    return min(there)[1] if there else None


class Messages:
    """Bytes of one protocol, in chunks of any size, to tables of the messages that are whole now.

    Parameters
    ----------
    protocol : str
        One of `PROTOCOLS`.
    source : str
        Messages to the user begin with it.

    Attributes
    ----------
    broken : int
        Stretches of bytes that were passed over.
    """

    def __init__(self, protocol: str, source: str) -> None:
        self.module = module_of(protocol)
        self.broken = 0
        self._protocol, self._source = protocol, source
        self._half = b""
        memory = getattr(self.module, "Memory", None)
        self._options = {} if memory is None else {"memory": memory()}

    def feed(self, data: bytes, part: str) -> Tables:
        """Tables by what they hold, as :mod:`truenorth.formats.devices` gives them.

        Raises
        ------
        UsageError, DataError
            The decoder is not installed; messages that lack what is needed.
        """
        whole = self._whole(data)
        if not whole:
            return {}
        if self._protocol == "mavlink":  # a log has a stamp before each message
            stamp = struct.pack(">Q", int(clock.time() * 1e6))
            whole = [stamp + message for message in whole]
        suffix = ".tlog" if self._protocol == "mavlink" else f".{self._protocol}"
        with tempfile.NamedTemporaryFile(suffix=suffix) as file:
            file.write(b"".join(whole))
            file.flush()
            try:
                found: Tables = self.module.tables(Path(file.name), part, **self._options)
            except ImportError:
                raise UsageError(
                    f"{self._source}: {self._protocol} needs a decoder: pip install 'truenorth[{self.module.EXTRA}]'"
                ) from None
            except (UsageError, DataError):
                raise
            except Exception:  # decoders let whatever a damaged message provokes through
                self.broken += 1
                return {}
        return found

    def _whole(self, data: bytes) -> list[bytes]:
        """Cut messages off the front; the rest waits."""
        self._half += data
        syncs, need, length = PROTOCOLS[self._protocol]
        found = []
        while True:
            starts = [at for at in (self._half.find(sync) for sync in syncs) if at >= 0]
            if not starts:
                self._half = self._half[-2:]
                break
            start = min(starts)
            self.broken += start > 0
            self._half = self._half[start:]
            if len(self._half) < need or len(self._half) < (size := length(self._half)):
                break
            found.append(self._half[:size])
            self._half = self._half[size:]
        return found
