"""ROS 1 and ROS 2 bags (sqlite3, MCAP) by rosbags: sensors' messages as tables.

Imu, MagneticField (axes FLU, REP 103), NavSatFix, TwistStamped, Odometry.
Time is that of the headers' stamps, in seconds since 1970: a double holds it to a quarter of a microsecond.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

Array = NDArray[np.float64]

EXTRA = "ros"
AXES = "FLU"


def _imu(m: Any) -> list[float]:
    w, f = m.angular_velocity, m.linear_acceleration
    return [w.x, w.y, w.z, f.x, f.y, f.z]


def _fix(m: Any) -> list[float]:
    known = m.position_covariance_type > 0
    sigma = np.sqrt(np.asarray(m.position_covariance).reshape(3, 3).diagonal()) if known else np.full(3, np.nan)
    return [m.latitude, m.longitude, m.altitude, *sigma, float(m.status.status + 1)]


def _twist(m: Any) -> list[float]:
    v = m.twist.linear
    return [v.x, v.y, v.z]


def _field(m: Any) -> list[float]:
    b = m.magnetic_field
    return [b.x, b.y, b.z]


def _odometry(m: Any) -> list[float]:
    v = m.twist.twist.linear
    return [v.y * -1.0, v.x, v.z]  # REP 103: x forward, y left, of the child frame


# What is read for each part: message, its values, their headings.
MESSAGES: dict[str, dict[str, tuple[Callable[[Any], list[float]], tuple[str, ...]]]] = {
    "imu": {
        "sensor_msgs/msg/Imu": (
            _imu, (*(f"gyro_{x} [rad/s]" for x in "xyz"), *(f"accel_{x} [m/s^2]" for x in "xyz")),
        ),
    },
    "gnss": {
        "sensor_msgs/msg/NavSatFix": (
            _fix,
            ("lat [deg]", "lon [deg]", "alt [m]", "sigma_E [m]", "sigma_N [m]", "sigma_U [m]", "quality"),
        ),
    },
    "mag": {"sensor_msgs/msg/MagneticField": (_field, tuple(f"mag_{x} [T]" for x in "xyz"))},
    "velocity": {
        "nav_msgs/msg/Odometry": (_odometry, ("v_right [m/s]", "v_forward [m/s]", "v_up [m/s]")),
        "geometry_msgs/msg/TwistStamped": (_twist, ("VE [m/s]", "VN [m/s]", "VU [m/s]")),
    },
}  # fmt: skip


KNOWN = frozenset(kind for kinds in MESSAGES.values() for kind in kinds)  # types that are read
SYNC, LENGTHS = b"TNRM", struct.Struct("<IHH")  # of a frame: its length, and those of topic and type


@dataclass
class Memory:
    """Of a stream: the topic that each part is taken from."""

    topics: dict[str, str] = field(default_factory=dict)


def frame(topic: str, kind: str, data: bytes) -> bytes:
    """A message of a stream, serialised (CDR), with its topic and its type, such as ``sensor_msgs/msg/Imu``."""
    names = topic.encode(), kind.encode()
    size = len(SYNC) + LENGTHS.size + sum(map(len, names)) + len(data)
    return SYNC + LENGTHS.pack(size, *map(len, names)) + b"".join(names) + data


def tables(
    path: Path, part: str, topic: str | None = None, memory: Memory | None = None
) -> dict[str, dict[str, Array]]:
    """The messages of one topic: that of the name, or the only one that holds this part; with a memory, of frames.

    Raises
    ------
    UsageError
        Several topics hold it.
    DataError
        None does; the message lists those there are.
    """
    from rosbags.highlevel import AnyReader

    kinds = MESSAGES.get(part, {})
    if memory is not None:
        return _of_frames(path, part, memory)
    with AnyReader([path], default_typestore=_types()) as reader:
        chosen = _topic(reader, topic, part, path.name)
        connections = [c for c in reader.connections if c.topic == chosen and c.msgtype in kinds]
        messages = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(connections=connections)]
    if not messages:
        raise DataError(f"{path.name}: topic {chosen} holds no messages")
    return {part: _table(messages, *kinds[connections[0].msgtype])}


def _table(messages: list[Any], values: Callable[[Any], list[float]], names: tuple[str, ...]) -> dict[str, Array]:
    stamps = [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages]
    rows = np.array([values(m) for m in messages])
    return {"time [s]": np.array(stamps, dtype=np.int64) * 1e-9, **dict(zip(names, rows.T))}


def _of_frames(path: Path, part: str, memory: Memory) -> dict[str, dict[str, Array]]:
    """Whole frames, of which those of one topic count.

    Raises
    ------
    UsageError
        A second topic holds this part.
    """
    kinds, messages = MESSAGES.get(part, {}), []
    for topic, kind, data in _frames(path.read_bytes()):
        if kind not in kinds:
            continue
        chosen = memory.topics.setdefault(part, topic)
        if topic != chosen:
            raise UsageError(f"several topics hold {part}: {chosen}, {topic}; choose them: ?topic=NAME in the source")
        messages.append((kind, _types().deserialize_cdr(data, kind)))
    if not messages:
        return {}
    return {part: _table([message for _, message in messages], *kinds[messages[0][0]])}


def _frames(data: bytes) -> Iterator[tuple[str, str, bytes]]:
    at = 0
    while at < len(data):
        size, topic, kind = LENGTHS.unpack_from(data, at + len(SYNC))
        first = at + len(SYNC) + LENGTHS.size
        ends = first + topic, first + topic + kind
        yield data[first : ends[0]].decode(), data[ends[0] : ends[1]].decode(), data[ends[1] : at + size]
        at += size


@cache
def _types() -> Any:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_HUMBLE)


def _topic(reader: AnyReader, wanted: str | None, part: str, source: str) -> str:
    kinds = MESSAGES.get(part, {})
    topics = sorted({c.topic for c in reader.connections if c.msgtype in kinds})
    found = ", ".join(topics)
    if not topics:
        others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})) or "none"
        raise DataError(f"{source}: no topic with {' or '.join(kinds) or part} messages; found {others}")
    if wanted is None and len(topics) > 1:
        raise UsageError(
            f"{source}: several topics: {found}; choose one: topic, in the call or in a YAML file next to it"
        )
    if wanted is not None and wanted not in topics:
        raise UsageError(f"{source}: no such topic {wanted!r}; found {found}")
    return wanted or topics[0]
