"""Samples of a zenoh key, ROS 2 topics among them: rmw_zenoh and the bridge of ROS 2 put each message there, serialised.

``zenoh:KEY?connect=tcp/192.0.2.7:7447&type=sensor_msgs/msg/Imu``. What is no ROS message is taken for bytes of a stream: CSV lines,
binary rows, a device's messages.
"""

from __future__ import annotations

import json
import queue
import re
from collections.abc import Callable, Mapping
from typing import Any

from truenorth.core.errors import UsageError
from truenorth.formats.devices.ros import frame

WAIT = 0.5  # s
MOST = 10_000  # samples that wait; when it is full, the oldest go
NAMED = re.compile(r"([\w]+)::(msg)::dds_::(\w+)_(?:/|$)")  # a type in a key of rmw_zenoh


def open_zenoh(key: str, options: Mapping[str, list[str]]) -> Callable[[], bytes | None]:
    """What reads the samples of a key; see :func:`truenorth.live.sources.open_bytes`.

    Parameters
    ----------
    key : str
        An expression; ``*`` and ``**`` stand for parts of it.
    options : mapping
        ``connect``, ``listen``: endpoints; ``mode``: peer or client; ``type``: of ROS 2 messages, where the key does not say it.

    Raises
    ------
    UsageError
        zenoh is not installed, or cannot be opened so.
    """
    try:
        import zenoh
    except ImportError:
        raise UsageError("zenoh needs its library: pip install 'truenorth[zenoh]'") from None
    kind = options.get("type", [""])[0]
    waiting: queue.Queue[bytes] = queue.Queue()

    def heard(sample: Any) -> None:
        data = sample.payload.to_bytes()
        topic = str(sample.key_expr)
        named = NAMED.search(topic)
        ros = kind or ("" if named is None else "/".join(named.groups()))
        waiting.put(frame(topic, ros, data) if ros else data)
        if waiting.qsize() > MOST:
            waiting.get_nowait()

    settings = zenoh.Config()
    try:
        for name in ("connect", "listen"):
            if name in options:
                settings.insert_json5(f"{name}/endpoints", json.dumps(options[name]))
        if "mode" in options:
            settings.insert_json5("mode", json.dumps(options["mode"][0]))
        session = zenoh.open(settings)
        subscriber = session.declare_subscriber(key, heard)
    except zenoh.ZError as error:
        raise UsageError(f"zenoh:{key}: cannot be opened ({error})") from None

    def read() -> bytes | None:
        _ = session, subscriber  # they end when nobody holds them
        try:
            found = [waiting.get(timeout=WAIT)]
        except queue.Empty:
            return None
        while not waiting.empty():
            found.append(waiting.get_nowait())
        return b"".join(found)

    return read
