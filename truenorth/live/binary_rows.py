"""Rows of an IMU in a fixed binary form, also in a stream that holds sentences and messages of other sensors.

A row: ``TNR1``, seven little-endian float64 (time s, gyro x y z rad/s, specific force x y z m/s^2) and the CRC-32 of those 56
bytes as little-endian uint32: 64 bytes. Any byte may stand in a row by chance, the end of a line and the beginning of any message
too: so rows are cut out of a stream before anything else is looked for in it.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAGIC = b"TNR1"
PAYLOAD = struct.Struct("<7d")
LENGTH = len(MAGIC) + PAYLOAD.size + 4


def binary_row(time: float, gyro: Array, accel: Array) -> bytes:
    """One row in the binary form."""
    payload = PAYLOAD.pack(time, *gyro, *accel)
    return MAGIC + payload + struct.pack("<I", zlib.crc32(payload))


class BinaryRows:
    """Bytes of a stream, in chunks of any size, to its binary rows and what stands between them.

    Attributes
    ----------
    seen : bool
        A whole row has come.
    damaged, stretches : int
        Rows whose check does not fit, and stretches of other bytes, those among them, before a row.
    """

    def __init__(self) -> None:
        self.seen = False
        self.damaged = self.stretches = 0
        self._between = False  # other bytes have come since the last row
        self._half = b""

    def feed(self, data: bytes) -> tuple[list[tuple[float, ...]], bytes]:
        """The rows that are whole now, and the bytes before, between and behind them; half a row waits."""
        data, self._half = self._half + data, b""
        rows, rest, at = [], [], 0
        while (start := data.find(MAGIC, at)) >= 0:
            row = data[start : start + LENGTH]
            if len(row) < LENGTH:
                break
            payload, check = row[len(MAGIC) : -4], row[-4:]
            sound = zlib.crc32(payload) == int.from_bytes(check, "little")
            end = start if sound else start + 1  # of a damaged one, rows may begin within it
            rest.append(data[at:end])
            self._between |= end > at
            at = end
            self.damaged += not sound
            if sound:
                self.seen = True
                self.stretches += self._between
                self._between = False
                rows.append(PAYLOAD.unpack(payload))
                at = start + LENGTH
        if start < 0:  # the end may be the beginning of the next one
            start = next((len(data) - n for n in range(len(MAGIC) - 1, 0, -1) if data.endswith(MAGIC[:n])), len(data))
        start = max(start, at)
        rest.append(data[at:start])
        self._between |= start > at
        self._half = data[start:]
        return rows, b"".join(rest)

    def given_back(self) -> bytes:
        """What waits, in a stream that turns out to hold no rows of this form."""
        half, self._half = self._half, b""
        return half
