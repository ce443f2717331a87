"""u-blox UBX by pyubx2: NAV-PVT (position, velocity), ESF-RAW and ESF-MEAS (gyros and accelerometers of M8, F9 and M9 modules).

Time is the GPS time of week, s. The inertial messages carry counts of the sensor's own clock, which are carried over to it by
the NAV-PVT around them: no message comes before its data, so the clock is the one that lies below all arrivals. Scales: u-blox
F9 interface description, ESF-MEAS data types (2^-12 deg/s, 2^-10 m/s^2, 24 bits).

Heading of two antennas is that of NAV-RELPOSNED of a moving base; that of a base which stays says where the vehicle is, not how it
points, and is passed over. It belongs to the NAV-PVT of its epoch; a log without them holds headings alone.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Tables = dict[str, dict[str, Array]]

EXTRA = "ublox"
AXES = "RFU"
GYROS, ACCELS = {14: 0, 13: 1, 5: 2}, {16: 0, 17: 1, 18: 2}
FIXES = 10  # of a stream, that tell its clock
TICKS = (1e-3, 39.0625e-6, 1e-6)  # s, of the sensor clocks of the modules


@dataclass
class Memory:
    """What a stream's next messages need of those before: the sensor's clock, and samples that are not whole yet."""

    time: float | None = None  # of the last fix, s
    samples: dict[int, dict[tuple[str, int], float]] = field(default_factory=dict)
    arrivals: list[tuple[int, float]] = field(default_factory=list)
    clock: tuple[float, float] | None = None  # size of a tick, and time of tick zero, s


def tables(path: Path, part: str, topic: str | None = None, memory: Memory | None = None) -> Tables:
    """Position and velocity; rates and specific forces, where the module writes them; from a stream once its clock is known."""
    from pyubx2 import ERR_IGNORE, UBX_PROTOCOL, UBXReader

    m = memory or Memory()
    fixes: list[tuple[float, ...]] = []
    headings: dict[float, tuple[float, float]] = {}
    with path.open("rb") as stream:
        for _, message in UBXReader(stream, protfilter=UBX_PROTOCOL, quitonerror=ERR_IGNORE):
            kind = getattr(message, "identity", "")
            if kind == "NAV-PVT" and message.fixType >= 2:
                fixes.append(_fix(message))
                m.time = fixes[-1][0]
            elif kind == "NAV-RELPOSNED" and _points(message):
                headings[_tow(message, 4)] = message.relPosHeading, message.accHeading
            elif kind in ("ESF-RAW", "ESF-MEAS"):
                for tag, key, value in _values(message):
                    m.samples.setdefault(tag, {})[key] = value
                    if m.time is not None and m.clock is None:
                        m.arrivals.append((tag, m.time))
    if m.clock is None and (memory is None or len({when for _, when in m.arrivals}) >= FIXES):
        m.clock, m.arrivals = _clock(m.arrivals), []
    if memory is not None and m.clock is None:
        return {"gnss": _gnss(fixes, headings), "imu": {}}
    return {"gnss": _gnss(fixes, headings), "imu": _imu(m)}


def _tow(message: Any, first: int) -> float:
    """Time of week, s: the library makes a time of day of it."""
    return int.from_bytes(message.payload[first : first + 4], "little") * 1e-3


def _points(m: Any) -> bool:
    """Whether a relative position is that of a second antenna on the vehicle, and its heading is said to be valid."""
    return bool(m.version >= 1 and m.gnssFixOK and m.isMoving and m.relPosHeadingValid)


def _fix(m: Any) -> tuple[float, ...]:
    return (
        _tow(m, 0), m.lat, m.lon, m.height * 1e-3, m.velE * 1e-3, m.velN * 1e-3, -m.velD * 1e-3,
        m.hAcc * 1e-3, m.vAcc * 1e-3, m.sAcc * 1e-3, float(m.fixType),
    )  # fmt: skip


def _values(message: Any) -> list[tuple[int, tuple[str, int], float]]:
    payload: bytes = message.payload
    if message.identity == "ESF-RAW":  # blocks of a datum and its tag
        words = struct.iter_unpack("<II", payload[4 : len(payload) - (len(payload) - 4) % 8])
    else:
        tag, flags = struct.unpack_from("<IH", payload)
        words = ((word, tag) for (word,) in struct.iter_unpack("<I", payload[8 : 8 + 4 * (flags >> 11)]))
    found = []
    for word, tag in words:
        raw, kind = word & 0xFFFFFF, word >> 24 & 0x3F
        value = raw - (1 << 24) if raw >= 1 << 23 else raw
        if kind in GYROS:
            found.append((tag, ("gyro", GYROS[kind]), value * 2.0**-12))
        elif kind in ACCELS:
            found.append((tag, ("accel", ACCELS[kind]), value * 2.0**-10))
    return found


def _gnss(fixes: list[tuple[float, ...]], headings: dict[float, tuple[float, float]]) -> dict[str, Array]:
    if not fixes:
        t, (heading, sigma) = np.array(list(headings)), np.array(list(headings.values())).reshape(-1, 2).T
        return {"time [s]": t, "heading [deg]": heading, "sigma_heading [deg]": sigma} if headings else {}
    t, lat, lon, alt, ve, vn, vu, h, v, s, quality = np.array(fixes).T
    heading, heading_sigma = np.array([headings.get(tow, (np.nan, np.nan)) for tow in t]).T
    return {
        "time [s]": t, "lat [deg]": lat, "lon [deg]": lon, "alt [m]": alt, "VE [m/s]": ve, "VN [m/s]": vn, "VU [m/s]": vu,
        "sigma_E [m]": h / np.sqrt(2.0), "sigma_N [m]": h / np.sqrt(2.0), "sigma_U [m]": v,
        "sigma_VE [m/s]": s / np.sqrt(3.0), "sigma_VN [m/s]": s / np.sqrt(3.0), "sigma_VU [m/s]": s / np.sqrt(3.0),
        "quality": quality, "heading [deg]": heading, "sigma_heading [deg]": heading_sigma,
    }  # fmt: skip


def _clock(arrivals: list[tuple[int, float]]) -> tuple[float, float] | None:
    """Size of a tick and time of tick zero; None where too few fixes are there to tell."""
    if len({when for _, when in arrivals}) < 3:
        return None
    tag, when = np.array(arrivals, dtype=np.float64).T
    slope = float(np.polyfit(tag - tag[0], when - when[0], 1)[0])
    tick = min(TICKS, key=lambda size: abs(np.log(max(slope, 1e-12) / size)))
    return tick, float(np.median(when - tag * tick))


def _imu(m: Memory) -> dict[str, Array]:
    """The samples that are whole, which are then forgotten."""
    keys = [(sensor, axis) for sensor in ("gyro", "accel") for axis in range(3)]
    tags = [tag for tag, row in m.samples.items() if len(row) == len(keys)]
    if not tags:
        return {}
    values = np.array([[row[key] for key in keys] for row in map(m.samples.pop, tags)])
    names = [f"gyro_{axis} [deg/s]" for axis in "xyz"] + [f"accel_{axis} [m/s^2]" for axis in "xyz"]
    table = dict(zip(names, values.T))
    clock = np.array(tags, dtype=np.float64)
    if m.clock is None:
        return {"time": clock, **table}
    tick, zero = m.clock
    return {"time [s]": clock * tick + zero, **table}
