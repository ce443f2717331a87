"""From each device's own file to a heading: an IMU of navigation grade at rest, in the resolution that the device writes."""

import struct
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from tests.formats.corpus.truth import LAT, truth
from tests.formats.test_devices import FRD, TOW, dataflash_bytes, novatel_line, ubx_bytes, ulog_bytes, write_tlog
from truenorth.alignment import align
from truenorth.core.errors import AlignmentError
from truenorth.core.position import Position
from truenorth.formats import read_imu

STILL = truth("still", "navigation", 50.0, 100.0)  # its heading is 30 deg
PLACE = Position(LAT, 0.0, 0.0)
RAWIMU = {"gyro": 2.0**-33, "accel": 0.3048 * 2.0**-27}  # rad and m/s of a count of a HG1900 and its like


def ubx(folder):
    pyubx2 = pytest.importorskip("pyubx2")
    (path := folder / "log.ubx").write_bytes(b"".join(ubx_bytes(pyubx2, STILL)))
    return path, {}


def px4(folder):
    pytest.importorskip("pyulog")
    (path := folder / "log.ulg").write_bytes(ulog_bytes(STILL))
    return path, {}


def ardupilot(folder):
    pytest.importorskip("pymavlink")
    (path := folder / "00000001.bin").write_bytes(dataflash_bytes(STILL))
    return path, {}


def mavlink(folder):
    write_tlog(path := folder / "log.tlog", pytest.importorskip("pymavlink.mavutil"), STILL)
    return path, {}


def novatel(folder):
    """RAWIMUSX: counts of increments, z first and y with the other sign."""
    pytest.importorskip("novatel_edie")
    lines = []
    counts = {sensor: np.round(getattr(STILL.increments, sensor) / size) for sensor, size in RAWIMU.items()}
    for k, t in enumerate(STILL.time):
        tow = TOW + t
        words = [
            f"{sign * row[axis]:.0f}"
            for row in (counts["accel"][k], counts["gyro"][k])
            for axis, sign in ((2, 1), (1, -1), (0, 1))
        ]
        lines.append(novatel_line("RAWIMUSXA", f"00,5,2300,{tow:.6f},00000000,{','.join(words)}", tow))
    (path := folder / "log.gps").write_text("".join(lines))
    return path, {
        "units": {"gyro": f"{RAWIMU['gyro']!r} rad", "accel": f"{RAWIMU['accel']!r} m/s"},
        "kind": "increments",
    }


def ros(kind):
    def written(folder):
        pytest.importorskip("rosbags")
        from tests.formats.test_ros import write_bag

        flu = np.hstack([v[:, [1, 0, 2]] * [1.0, -1.0, 1.0] for v in (STILL.gyro, STILL.accel)])
        return write_bag(folder, kind, stamps=np.round(STILL.time * 1e9).astype(np.int64), sensors=flu), {}

    return written


DEVICES = {
    "u-blox": ubx, "PX4": px4, "ArduPilot": ardupilot, "MAVLink": mavlink, "NovAtel": novatel, "ROS 1": ros("ros1"),
    "ROS 2": ros("sqlite3"), "MCAP": ros("mcap"),
}  # fmt: skip


SLOW = ("u-blox",)  # its decoder takes 3 ms a message


@pytest.mark.slow
@pytest.mark.parametrize(
    "device", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in DEVICES]
)
def test_a_file_leads_to_a_heading(device, tmp_path):
    path, options = DEVICES[device](tmp_path)
    answer = align(read_imu(path, **options), PLACE, "navigation")
    assert answer.status == "aligned", answer.reasons
    heading, sigma = np.degrees([answer.heading, answer.euler_sigma[0]])
    assert sigma < 0.3
    assert abs(heading - 30.0) < 4.0 * sigma
    np.testing.assert_allclose(np.degrees(answer.euler[1:]), [0.4, -0.3], atol=4.0 * np.degrees(answer.euler_sigma[1]))


def test_a_resolution_too_coarse_for_north_is_named(tmp_path):
    """SCALED_IMU counts in mrad/s, 14 times the earth's rate: level, and no heading."""
    mavutil = pytest.importorskip("pymavlink.mavutil")
    link = mavutil.mavlink.MAVLink(SimpleNamespace(write=lambda _: None), srcSystem=1, srcComponent=1)
    with (path := tmp_path / "log.tlog").open("wb") as file:
        for t, gyro, accel in zip(STILL.time, FRD(STILL.gyro), FRD(STILL.accel)):
            words = [*np.round(accel / 9.80665e-3).astype(int), *np.round(gyro * 1e3).astype(int), 0, 0, 0]
            message = link.scaled_imu_encode(round(t * 1e3), *map(int, words))
            file.write(struct.pack(">Q", round(t * 1e6)) + message.pack(link))
    with pytest.raises(AlignmentError, match="all gyros read zero in every row"):
        align(read_imu(path), PLACE, "consumer")


@pytest.mark.slow
def test_a_command_that_read_novatel_ends_without_a_word(tmp_path):
    """The decoder counts what Python leaves at its end, and called it leaked."""
    log, _ = novatel(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "truenorth", "inspect", log], capture_output=True, text=True, check=False
    )
    assert "leaked" not in done.stderr
    assert done.stderr.startswith("truenorth: log.gps: the accelerometers show")
