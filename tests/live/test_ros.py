"""ROS 2 live: bags that a recorder goes on writing, and messages on a zenoh key, are the rows of the finished bag."""

import shutil
import socket
import sqlite3
import threading
import time

import numpy as np
import pytest

pytest.importorskip("rosbags")
pytest.importorskip("mcap")

from rosbags.typesys import Stores, get_typestore

from tests.formats.test_ros import FLU, STAMPS, N, write_bag
from tests.runs import some
from truenorth.core.errors import UsageError
from truenorth.formats import read_imu
from truenorth.formats.layout import Layout
from truenorth.live.binary_rows import binary_row
from truenorth.live.sources import open_source

IMU = "sensor_msgs/msg/Imu"


def rows_of(record):
    return np.column_stack([record.time, record.gyro, record.accel])


def taken(source, enough, seconds=20.0):
    """Rows until there are so many, or the source ends."""
    found, until = [np.empty((0, 7))], time.monotonic() + seconds
    for rows in source:
        found.append(rows)
        if sum(map(len, found)) >= enough or time.monotonic() > until:
            break
    return np.vstack(found)


@pytest.mark.parametrize("step", some([10**6], [1, 100]))
def test_an_mcap_file_that_grows(step, tmp_path):
    whole = next(write_bag(tmp_path, "mcap").glob("*.mcap"))
    data, growing = whole.read_bytes(), tmp_path / "growing.mcap"
    growing.write_bytes(b"")
    source = iter(open_source(f"bag:{growing}", Layout()))
    found = [np.empty((0, 7))]
    with growing.open("ab") as file:
        for at in range(0, len(data), max(step, len(data) // 40 if step == 1 else 1)):
            file.write(data[at : at + max(step, len(data) // 40 if step == 1 else 1)])
            file.flush()
            found.append(next(source, np.empty((0, 7))))
    found += list(source)  # its footer has come: it ends
    assert np.array_equal(np.vstack(found), rows_of(read_imu(whole)))


@pytest.mark.parametrize("compression", ["none", "zstd", "lz4"])
def test_chunks_of_an_mcap_writer_as_they_come(compression, tmp_path):
    from mcap.writer import CompressionType, Writer

    path = tmp_path / "log.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=2000, compression=CompressionType[compression.upper()])
        writer.start()
        schema = writer.register_schema(IMU, "ros2msg", b"")
        channel = writer.register_channel("/imu", "cdr", schema)
        other = writer.register_channel("/text", "json", schema)
        source = iter(open_source(f"bag:{path}", Layout()))
        messages = serialised()
        for stamp, message in zip(STAMPS.tolist()[:20], messages):
            writer.add_message(channel, stamp, message, stamp)
            writer.add_message(other, stamp, b"{}", stamp)
        file.flush()
        early = next(source)
        assert 0 < len(early) < 20
        for stamp, message in zip(STAMPS.tolist()[20:], messages[20:]):
            writer.add_message(channel, stamp, message, stamp)
        writer.finish()
    found = np.vstack([early, *source])
    np.testing.assert_array_equal(found[:, 1:4], np.column_stack([-FLU[0][:, 1], FLU[0][:, 0], FLU[0][:, 2]]))


def test_an_sqlite_bag_that_grows_and_the_next_file_of_the_folder(tmp_path):
    folder = write_bag(tmp_path, "sqlite3")
    database = next(folder.glob("*.db3"))
    (folder / "metadata.yaml").unlink()
    complete = rows_of(read_imu(database))
    growing = tmp_path / "bag"
    growing.mkdir()
    first = growing / "bag_0.db3"
    shutil.copy(database, first)
    with sqlite3.connect(first) as base:
        late = base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id").fetchall()[10:]
        base.execute("DELETE FROM messages WHERE id > 10")
    source = iter(open_source(f"bag:{growing}?topic=/imu", Layout()))
    found = [next(source)]
    with sqlite3.connect(first) as base:
        base.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", late[:8])
    found.append(next(source))
    second = growing / "bag_1.db3"
    shutil.copy(database, second)
    with sqlite3.connect(second) as base:
        base.execute("DELETE FROM messages")
        base.executemany("INSERT INTO messages (topic_id, timestamp, data) VALUES (?, ?, ?)", late[8:])
    (growing / "metadata.yaml").write_text("")
    assert np.array_equal(np.vstack([*found, *source]), complete)


def test_a_topic_must_be_chosen_where_there_are_two(tmp_path):
    path = write_bag(tmp_path, "mcap", topics=("/front", "/rear"))
    with pytest.raises(UsageError, match="several topics hold imu: /front, /rear"):
        list(open_source(f"bag:{path}", Layout()))
    rows = np.vstack(list(open_source(f"bag:{path}?topic=/rear", Layout())))
    assert len(rows) == N


@pytest.mark.parametrize("text", ["bag:missing", "bag:{folder}", "zenoh:rt/imu?listen=nonsense"])
def test_what_cannot_be_opened(text, tmp_path):
    if text.startswith("zenoh"):
        pytest.importorskip("zenoh")
    with pytest.raises(UsageError, match=r"bag:|zenoh:"):
        open_source(text.format(folder=tmp_path), Layout())


def serialised():
    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    Vector, Quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    Time, Header, Imu = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"], types[IMU]
    nine, found = np.zeros(9), []
    for stamp, gyro, accel in zip(STAMPS.tolist(), *FLU):
        header = Header(Time(stamp // 10**9, stamp % 10**9), "imu")
        message = Imu(header, Quaternion(0, 0, 0, 1), nine, Vector(*gyro), nine, Vector(*accel), nine)
        found.append(bytes(store.serialize_cdr(message, IMU)))
    return found


@pytest.mark.parametrize("how", ["rmw", "bridge", "bytes"])
def test_samples_of_a_zenoh_key(how):
    """Peer to peer on this machine: a publisher of ROS 2 messages, and one of binary rows."""
    zenoh = pytest.importorskip("zenoh")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        place = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    key = {"rmw": "0/imu/sensor_msgs::msg::dds_::Imu_/RIHS01_1", "bridge": "imu", "bytes": "rows"}[how]
    listened = {"rmw": "0/imu/**", "bridge": "imu", "bytes": "rows"}[how]
    more = "&type=sensor_msgs/msg/Imu" if how == "bridge" else ""
    source = open_source(f"zenoh:{listened}?listen={place}{more}", Layout())
    gyro, accel = FLU
    data = serialised()
    if how == "bytes":
        data = [binary_row(t, w, f) for t, w, f in zip(STAMPS * 1e-9, gyro, accel)]
    settings = zenoh.Config()
    settings.insert_json5("connect/endpoints", f'["{place}"]')
    with zenoh.open(settings) as session:
        publisher = session.declare_publisher(key)

        def publish():
            for _ in range(100):
                if publisher.matching_status.matching:
                    break
                time.sleep(0.05)
            for message in data:
                publisher.put(message)

        thread = threading.Thread(target=publish)
        thread.start()
        found = taken(source, N)
        thread.join()
    assert len(found) == N
    if how != "bytes":
        gyro = np.column_stack([-gyro[:, 1], gyro[:, 0], gyro[:, 2]])
    np.testing.assert_array_equal(found[:, 1:4], gyro)
    np.testing.assert_allclose(found[:, 0], STAMPS * 1e-9, rtol=0, atol=3e-7)
