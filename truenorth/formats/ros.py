"""ROS 1 and ROS 2 bags with `sensor_msgs/Imu`: rates at the header's stamps, body axes FLU by convention (REP 103)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from truenorth.errors import DataError, UsageError
from truenorth.formats.table import Layout, finish, with_defaults
from truenorth.records import ImuRecord

IMU = "sensor_msgs/msg/Imu"


def read(path: Path, layout: Layout, topic: str | None = None) -> ImuRecord:
    """Read a bag: a ``.bag`` file, a folder with metadata, or an ``.mcap`` file.

    Raises
    ------
    UsageError
        The rosbags library is not installed, or the topic must be named.
    DataError
        No IMU messages.
    """
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise UsageError("reading ROS bags needs the rosbags library: pip install 'truenorth[ros]'") from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            connections = [c for c in reader.connections if c.msgtype == IMU]
            topics = sorted({c.topic for c in connections})
            if topic is None and len(topics) != 1:
                found = ", ".join(topics) or "none"
                if not topics:
                    raise DataError(f"{path.name}: no topic with {IMU} messages")
                raise UsageError(f"{path.name}: several IMU topics: {found}; choose one with --topic")
            wanted = topic or topics[0]
            if wanted not in topics:
                raise UsageError(f"{path.name}: no IMU topic {wanted!r}; found {', '.join(topics) or 'none'}")
            chosen = [c for c in connections if c.topic == wanted]
            rows = [_row(reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages(connections=chosen)]
    except AnyReaderError as error:
        raise DataError(f"{path.name}: not a bag that can be read ({error})") from None
    if not rows:
        raise DataError(f"{path.name}: topic {wanted} holds no messages")
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    values = np.array([row[1] for row in rows])
    time = (stamps - stamps[0]) * 1e-9  # differences in whole nanoseconds first: a double cannot hold both
    return finish(time, values[:, :3], values[:, 3:], "rates", with_defaults(layout, axes="FLU"), path.name)


def _row(message: Any) -> tuple[int, tuple[float, ...]]:
    stamp, w, f = message.header.stamp, message.angular_velocity, message.linear_acceleration
    return stamp.sec * 1_000_000_000 + stamp.nanosec, (w.x, w.y, w.z, f.x, f.y, f.z)
