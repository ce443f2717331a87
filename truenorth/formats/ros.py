"""ROS 1 and ROS 2 bags with `sensor_msgs/Imu`: rates at the headers' stamps, body axes FLU by convention (REP 103).

Time starts at zero with the first message: a double cannot hold both the date and the nanoseconds.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from truenorth.core.errors import DataError, UsageError
from truenorth.formats.layout import Layout
from truenorth.formats.table import finish
from truenorth.records import ImuRecord

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

IMU = "sensor_msgs/msg/Imu"
LABELS = (
    "header.stamp",
    *(f"{group}.{axis}" for group in ("angular_velocity", "linear_acceleration") for axis in "xyz"),
)


def read(path: Path, layout: Layout) -> ImuRecord:
    """Read a bag: a ROS 1 ``.bag`` file, the folder of a ROS 2 bag or one of the files in it (sqlite3, MCAP).

    Raises
    ------
    UsageError
        The rosbags library is not installed, or the topic must be named.
    DataError
        A damaged bag, no IMU messages, NaN, or stamps that go back.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise UsageError("reading ROS bags needs the rosbags library: pip install 'truenorth[ros]'") from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            topic = _topic(reader, layout.topic, path.name)
            chosen = [c for c in reader.connections if c.topic == topic and c.msgtype == IMU]
            rows = [_row(reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(connections=chosen)]
    except (DataError, UsageError):
        raise
    except Exception as error:  # the library lets whatever a damaged file provokes through: struct, sqlite, lz4, ...
        raise DataError(f"{path.name}: the bag is damaged, not complete or not of a known kind ({error})") from error
    if not rows:
        raise DataError(f"{path.name}: topic {topic} holds no messages")
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    values = np.array([row[1:] for row in rows])
    time = (stamps - stamps[0]) * 1e-9
    return finish(
        time, values[:, :3], values[:, 3:], layout.kind or "rates", layout, path.name,
        axes="FLU", labels=LABELS, place=lambda row: f"message {row + 1} of {topic}",
    )  # fmt: skip


def _topic(reader: AnyReader, wanted: str | None, source: str) -> str:
    topics = sorted({c.topic for c in reader.connections if c.msgtype == IMU})
    found = ", ".join(topics)
    if not topics:
        others = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})) or "none"
        raise DataError(f"{source}: no topic with {IMU} messages; found {others}")
    if wanted is None and len(topics) > 1:
        raise UsageError(
            f"{source}: several IMU topics: {found}; choose one with --topic, or topic: in a YAML file beside it"
        )
    if wanted is not None and wanted not in topics:
        raise UsageError(f"{source}: no IMU topic {wanted!r}; found {found}")
    return wanted or topics[0]


def _row(message: Any) -> tuple[int, float, float, float, float, float, float]:
    stamp, w, f = message.header.stamp, message.angular_velocity, message.linear_acceleration
    return stamp.sec * 1_000_000_000 + stamp.nanosec, w.x, w.y, w.z, f.x, f.y, f.z
