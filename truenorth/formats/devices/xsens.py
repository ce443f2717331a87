"""Xsens MTi (Xbus messages, MTData2): DeltaQ and DeltaV, or RateOfTurn and Acceleration, with SampleTimeFine.

An Xbus message is a preamble FA, a bus identifier, a kind, a length (FF: two bytes of it follow), its data and a byte that makes
the sum of all but the preamble zero. MTData2 (kind 36) holds packets: identifier (2 bytes), length, values, big-endian; the last
bits of an identifier say how its numbers are written. SampleTimeFine counts 1e-4 s. There is no library for them in the package
index that is kept, and the packets that are needed are few: they are read here.

Source: Xsens, "MT Low Level Communication Protocol Documentation", MT0101P.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError

Array = NDArray[np.float64]

EXTRA = ""  # no decoder is needed
AXES = "FLU"
PREAMBLE, LONG, DATA = 0xFA, 0xFF, 0x36
TIME, VELOCITY_STEP, FORCE, TURN, RATE = 0x1060, 0x4010, 0x4020, 0x8030, 0x8020
TICK, TICKS = 1e-4, 1 << 32  # s; the counter begins anew after 119 h
KIND = 0xFFF0  # of an identifier; below it: how numbers are written
WIDTH = {0: 4, 1: 4, 2: 6, 3: 8}


class Memory:
    """What a stream goes on from: how often the counter began anew, and what its rows are."""

    def __init__(self) -> None:
        self.last, self.turns = 0, 0
        self.increments: bool | None = None

    def time(self, count: int) -> float:
        """Of a count, s."""
        self.turns += self.last - count > TICKS // 2
        self.last = count
        return TICK * (count + TICKS * self.turns)


def tables(
    path: Path, part: str, topic: str | None = None, memory: Memory | None = None
) -> dict[str, dict[str, Array]]:
    """Increments where the device gives them, else rates and specific forces.

    Raises
    ------
    DataError
        Messages without a time.
    """
    clock, untimed = memory or Memory(), 0
    steps: list[list[float]] = []
    rates: list[list[float]] = []
    for data in messages(path.read_bytes()):
        found = dict(packets(data))
        if TIME not in found:
            untimed += bool(found)
            continue
        time = clock.time(int(found[TIME][0]))
        if TURN in found and VELOCITY_STEP in found:
            steps.append([time, *_rotation(found[TURN]), *found[VELOCITY_STEP]])
        if RATE in found and FORCE in found:
            rates.append([time, *found[RATE], *found[FORCE]])
    if untimed and not (steps or rates):
        raise DataError(
            f"{path.name}: messages of an Xsens without SampleTimeFine; expected it among the outputs of the device"
        )
    if clock.increments is None and (steps or rates):
        clock.increments = bool(steps)
    rows, names = rates, ("gyro", "rad/s", "accel", "m/s^2")
    if clock.increments:
        rows, names = steps, ("dtheta", "rad", "dvel", "m/s")
    headings = [f"{names[i]}_{x} [{names[i + 1]}]" for i in (0, 2) for x in "xyz"]
    return {"imu": dict(zip(["time [s]", *headings], np.array(rows).T)) if rows else {}}


def messages(data: bytes) -> Iterator[bytes]:
    """The contents of the MTData2 messages whose sums fit."""
    at = 0
    while (at := data.find(PREAMBLE, at)) >= 0 and len(data) - at >= 5:
        size = length(data[at:])
        whole = data[at : at + size]
        if len(whole) < size or sum(whole[1:]) & 0xFF:
            at += 1
            continue
        if whole[2] == DATA:
            yield whole[6 if whole[3] == LONG else 4 : -1]
        at += size


def length(head: bytes) -> int:
    """Of a whole message, by its first six bytes."""
    return 7 + int.from_bytes(head[4:6], "big") if head[3] == LONG else 5 + head[3]


def packets(data: bytes) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Kind and numbers of each packet that is read."""
    at = 0
    while at + 3 <= len(data):
        identifier, size = int.from_bytes(data[at : at + 2], "big"), data[at + 2]
        value, at = data[at + 3 : at + 3 + size], at + 3 + size
        kind = identifier & KIND
        if kind == TIME and len(value) == 4:
            yield kind, struct.unpack(">I", value)
        elif kind in (VELOCITY_STEP, FORCE, TURN, RATE):
            numbers = _numbers(value, identifier & 3)
            if len(numbers) == (4 if kind == TURN else 3):
                yield kind, numbers


def _numbers(value: bytes, form: int) -> tuple[float, ...]:
    """Numbers of a packet: float32, fixed point 12.20 or 16.32 (the fraction first), float64."""
    count = len(value) // WIDTH[form]
    if form in (0, 3):
        return struct.unpack(f">{count}{'f' if form == 0 else 'd'}", value[: count * WIDTH[form]])
    if form == 1:
        return tuple(x / 2**20 for x in struct.unpack(f">{count}i", value[: 4 * count]))
    parts = struct.iter_unpack(">Ih", value[: 6 * count])
    return tuple(whole + fraction / 2**32 for fraction, whole in parts)


def _rotation(q: tuple[float, ...]) -> Array:
    """Rotation vector of a quaternion, scalar first, rad."""
    w, v = (q[0], np.array(q[1:])) if q[0] >= 0.0 else (-q[0], -np.array(q[1:]))
    half = float(np.linalg.norm(v))
    return np.asarray(v * (2.0 if half < 1e-12 else 2.0 * np.arctan2(half, w) / half))
