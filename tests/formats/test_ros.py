"""ROS bags that the rosbags library itself writes: ROS 1, ROS 2 in SQLite and in MCAP."""

import sys

import numpy as np
import pytest

pytest.importorskip("rosbags")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_gnss, read_imu, read_velocity
from truenorth.formats.magnetometer import read_magnetometer

KINDS = ["ros1", "sqlite3", "mcap"]
N = 30
STAMPS = 1_700_000_000_123_456_789 + np.arange(N) * 5_000_000  # whole nanoseconds that no double of seconds holds
SENSORS = np.random.default_rng(4).standard_normal((N, 6))
FLU = SENSORS[:, [0, 1, 2]], SENSORS[:, [3, 4, 5]]


def write_bag(folder, kind, topics=("/imu",), stamps=STAMPS, sensors=SENSORS):
    first = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    types = store.types
    Vector, Quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    Time, Header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    Imu, String = types["sensor_msgs/msg/Imu"], types["std_msgs/msg/String"]
    serialize = store.serialize_ros1 if first else store.serialize_cdr
    path = folder / ("log.bag" if first else "log")
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    nine = np.zeros(9)
    with Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugin) as writer:
        talk = writer.add_connection("/talk", String.__msgtype__, typestore=store)
        writer.write(talk, int(STAMPS[0]), serialize(String("hello"), String.__msgtype__))
        for topic in topics:
            connection = writer.add_connection(topic, Imu.__msgtype__, typestore=store)
            for stamp, row in zip(stamps.tolist(), sensors):
                header = Header(*((0,) if first else ()), Time(stamp // 10**9, stamp % 10**9), "imu")
                message = Imu(header, Quaternion(0, 0, 0, 1), nine, Vector(*row[:3]), nine, Vector(*row[3:]), nine)
                writer.write(connection, stamp, serialize(message, Imu.__msgtype__))
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_values_come_back_to_the_bit_in_our_axes(kind, tmp_path):
    record = read_imu(write_bag(tmp_path, kind))
    assert record.kind == "rates"
    np.testing.assert_allclose(record.time, STAMPS * 1e-9, rtol=0, atol=3e-7)
    for ours, given in ((record.gyro, FLU[0]), (record.accel, FLU[1])):
        np.testing.assert_array_equal(ours, np.column_stack([-given[:, 1], given[:, 0], given[:, 2]]))


@pytest.mark.parametrize("kind", KINDS)
def test_axes_of_the_call_win(kind, tmp_path):
    np.testing.assert_array_equal(read_imu(write_bag(tmp_path, kind), axes="RFU").gyro, FLU[0])


@pytest.mark.parametrize(("kind", "suffix"), [("sqlite3", "db3"), ("mcap", "mcap")])
@pytest.mark.parametrize("alone", [False, True])
def test_the_file_in_a_bag(kind, suffix, alone, tmp_path):
    path = write_bag(tmp_path, kind) / f"log.{suffix}"
    if alone:
        path = path.rename(tmp_path / f"other.{suffix}")
    assert len(read_imu(path)) == N


@pytest.mark.parametrize("kind", KINDS)
def test_magnetic_field(kind, tmp_path):
    first = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    T = store.types
    Field, Vector, Header = T["sensor_msgs/msg/MagneticField"], T["geometry_msgs/msg/Vector3"], T["std_msgs/msg/Header"]
    path = tmp_path / ("log.bag" if first else "log")
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    with Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/mag", Field.__msgtype__, typestore=store)
        for stamp in STAMPS.tolist():
            stamped = Header(
                *((0,) if first else ()), T["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9), ""
            )
            message = Field(stamped, Vector(20e-6, 3e-6, -40e-6), np.zeros(9))  # forward, left, up
            serialize = store.serialize_ros1 if first else store.serialize_cdr
            writer.write(connection, stamp, serialize(message, Field.__msgtype__))
    record = read_magnetometer(path)
    np.testing.assert_allclose(record.field, np.tile([-3e-6, 20e-6, -40e-6], (N, 1)))
    np.testing.assert_allclose(record.time, STAMPS * 1e-9, rtol=0, atol=3e-7)
    with pytest.raises(DataError, match=r"no topic with sensor_msgs/msg/Imu messages; found /mag"):
        read_imu(path)


@pytest.mark.parametrize("kind", KINDS)
def test_topics(kind, tmp_path):
    path = write_bag(tmp_path, kind, ("/left/imu", "/right/imu"))
    with pytest.raises(UsageError, match=r"several topics: /left/imu, /right/imu; choose one: topic"):
        read_imu(path)
    assert len(read_imu(path, topic="/left/imu")) == N
    path.with_suffix(".yaml").write_text("topic: /right/imu\n")
    assert len(read_imu(path)) == N
    with pytest.raises(UsageError, match=r"no such topic '/imu'; found /left/imu"):
        read_imu(path, topic="/imu")


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_without_an_imu(kind, tmp_path):
    with pytest.raises(DataError, match=r"no topic with sensor_msgs/msg/Imu messages; found /talk"):
        read_imu(write_bag(tmp_path, kind, topics=()))


@pytest.mark.parametrize("kind", KINDS)
def test_bad_messages_are_named(kind, tmp_path):
    sensors = SENSORS.copy()
    sensors[16, 4] = np.nan
    with pytest.raises(DataError, match=r"log.*: row 17, column accel_y \[m/s\^2\]: nan"):
        read_imu(write_bag(tmp_path, kind, sensors=sensors))


@pytest.mark.parametrize("kind", KINDS)
def test_stamps_that_repeat(kind, tmp_path):
    stamps = STAMPS.copy()
    stamps[8] = stamps[7]
    with pytest.raises(DataError, match=r"row 9, column time \[s\]: time repeats"):
        read_imu(write_bag(tmp_path, kind, stamps=stamps))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("part", [0.2, 0.6, 0.95])
def test_a_bag_that_is_cut_short(kind, part, tmp_path):
    path = write_bag(tmp_path, kind)
    file = path if path.is_file() else next(f for f in path.iterdir() if f.suffix in (".db3", ".mcap"))
    file.write_bytes(file.read_bytes()[: int(part * file.stat().st_size)])
    with pytest.raises(DataError) as error:
        read_imu(path)
    assert path.name in str(error.value)
    assert "\n" not in str(error.value)


def test_without_the_library(tmp_path, monkeypatch):
    path = write_bag(tmp_path, "mcap")
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(UsageError, match=r"pip install 'truenorth\[ros\]'"):
        read_imu(path)


@pytest.mark.parametrize("kind", KINDS)
def test_positions_and_velocities(kind, tmp_path):
    first = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    T = store.types
    serialize = store.serialize_ros1 if first else store.serialize_cdr
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    path = tmp_path / ("log.bag" if first else "log")
    vector, many = T["geometry_msgs/msg/Vector3"], np.zeros(36)
    with Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugin) as writer:
        fixes = writer.add_connection("/fix", "sensor_msgs/msg/NavSatFix", typestore=store)
        wheels = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=store)
        for stamp in STAMPS.tolist():
            time = T["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
            header = T["std_msgs/msg/Header"](*((0,) if first else ()), time, "base")
            status = T["sensor_msgs/msg/NavSatStatus"](0, 1)
            sigma2 = np.diag([1.0, 4.0, 9.0]).ravel()
            fix = T["sensor_msgs/msg/NavSatFix"](header, status, 48.1, 11.5, 500.0, sigma2, 2)
            writer.write(fixes, stamp, serialize(fix, "sensor_msgs/msg/NavSatFix"))
            place = T["geometry_msgs/msg/Pose"](
                T["geometry_msgs/msg/Point"](0, 0, 0), T["geometry_msgs/msg/Quaternion"](0, 0, 0, 1)
            )
            twist = T["geometry_msgs/msg/Twist"](vector(5.0, 0.5, 0.1), vector(0, 0, 0))
            pose = T["geometry_msgs/msg/PoseWithCovariance"](place, many)
            odometry = T["nav_msgs/msg/Odometry"](
                header, "base", pose, T["geometry_msgs/msg/TwistWithCovariance"](twist, many)
            )
            writer.write(wheels, stamp, serialize(odometry, "nav_msgs/msg/Odometry"))
    gnss = read_gnss(path)
    np.testing.assert_allclose(np.degrees(gnss.lat), 48.1)
    np.testing.assert_allclose(gnss.position_sigma, np.tile([1.0, 2.0, 3.0], (N, 1)))
    velocity = read_velocity(path)
    np.testing.assert_allclose(velocity.velocity, np.tile([-0.5, 5.0, 0.1], (N, 1)))
    with pytest.raises(DataError, match="no topic with sensor_msgs/msg/Imu"):
        read_imu(path)
