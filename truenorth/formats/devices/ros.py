"""ROS 1 and ROS 2 bags (sqlite3, MCAP) by rosbags: sensors' messages as tables.

Imu, MagneticField (axes FLU, REP 103), NavSatFix, TwistStamped, Odometry.
Time is that of the headers' stamps, in seconds since 1970: a double holds it to a quarter of a microsecond.
"""

from __future__ import annotations

from collections.abc import Callable
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


def tables(path: Path, part: str, topic: str | None = None) -> dict[str, dict[str, Array]]:
    """The messages of one topic: that of the name, or the only one that holds this part.

    Raises
    ------
    UsageError
        Several topics hold it.
    DataError
        None does; the message lists those there are.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    kinds = MESSAGES.get(part, {})
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        chosen = _topic(reader, topic, part, path.name)
        connections = [c for c in reader.connections if c.topic == chosen and c.msgtype in kinds]
        stamps, rows = [], []
        for connection, _, raw in reader.messages(connections=connections):
            message: Any = reader.deserialize(raw, connection.msgtype)
            stamps.append(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec)
            rows.append(kinds[connection.msgtype][0](message))
    if not rows:
        raise DataError(f"{path.name}: topic {chosen} holds no messages")
    names = kinds[connections[0].msgtype][1]
    return {part: {"time [s]": np.array(stamps, dtype=np.int64) * 1e-9, **dict(zip(names, np.array(rows).T))}}


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
