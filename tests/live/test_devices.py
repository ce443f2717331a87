"""Streams of devices and sensors: the bytes of their logs in pieces, noise in between, are the rows of those logs."""

import socket
import struct
import time
from types import SimpleNamespace

import numpy as np
import pytest

from tests.formats.test_devices import ALT, FRD, LAT, LON, SBF_HOME, SWAY, TIME, TOW, novatel_line, ubx_bytes
from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_gnss, read_imu
from truenorth.formats.layout import Layout
from truenorth.live import GnssFeed, IndexerFeed, MagnetometerFeed, OdometerFeed, VelocityFeed
from truenorth.live.aid_sources import open_aid
from truenorth.live.decode import Decoder
from truenorth.live.listening import Listener


def in_pieces(data, hear, seed=0, longest=700):
    random, at = np.random.default_rng(seed), 0
    found = []
    while at < len(data):
        step = int(random.integers(1, longest))
        found.append(hear(data[at : at + step]))
        at += step
    return found


@pytest.mark.slow
def test_ublox_in_pieces_is_the_log(tmp_path):
    pyubx2 = pytest.importorskip("pyubx2")
    parts = ubx_bytes(pyubx2)
    path = tmp_path / "log.ubx"
    path.write_bytes(b"".join(parts))
    noisy = b"".join(part if k % 97 else part + b"\x00noise\xb5" for k, part in enumerate(parts))
    feed = GnssFeed()
    decoder = Decoder(Layout(), "test")
    decoder.others.append(Listener(feed, "test", shared=True).hear)
    found = np.vstack(in_pieces(noisy, decoder.feed))
    record = read_imu(path)
    np.testing.assert_allclose(found[:, 1:4], record.gyro, atol=1e-12)
    np.testing.assert_allclose(found[:, 4:], record.accel, atol=1e-12)
    np.testing.assert_allclose(np.diff(found[:, 0]), np.diff(record.time), atol=1e-9)
    assert abs(found[0, 0] - record.time[0]) < 0.11
    fixes = read_gnss(path)
    np.testing.assert_allclose(feed.rows[:, 0], fixes.time)
    np.testing.assert_allclose(feed.rows[:, 1], fixes.lat)
    np.testing.assert_allclose(feed.rows[:, 4:7], fixes.v_n)
    np.testing.assert_allclose(feed.rows[:, 7:10], fixes.position_sigma)
    assert decoder.others


def test_a_message_that_is_damaged_is_lost_alone():
    pyubx2 = pytest.importorskip("pyubx2")
    fixes = [part for part in ubx_bytes(pyubx2) if part[2:4] == b"\x01\x07"]
    damaged = bytearray(fixes[7])
    damaged[30] ^= 0xFF
    feed = GnssFeed()
    in_pieces(b"".join([*fixes[:7], bytes(damaged), *fixes[8:]]), Listener(feed, "test").hear, longest=90)
    assert len(feed.rows) == len(fixes) - 1


def test_septentrio_and_novatel_in_pieces():
    pysbf2, _ = pytest.importorskip("pysbf2"), pytest.importorskip("novatel_edie")
    blocks, lines = [], []
    for k in range(10):
        of_week = {"TOW": round(TOW * 1e3) + 1000 * k, "WNc": 2300}
        blocks.append(pysbf2.SBFMessage("PVTGeodetic", Error=0, **of_week, **SBF_HOME).serialize())
        fix = f'SOL_COMPUTED,SINGLE,{LAT},{LON},455.0,45.0,WGS84,2.0,1.0,3.0,"",0.0,0.0,12,12,12,0,00,06,00,33'
        lines.append(novatel_line("BESTPOSA", fix, TOW + k).encode())
    for data in (b"".join(blocks), b"".join(lines)):
        feed = GnssFeed()
        listener = Listener(feed, "test")
        in_pieces(b"\x00\x01" + data, listener.hear, longest=120)
        np.testing.assert_allclose(feed.rows[:, 0], TOW + np.arange(10))
        np.testing.assert_allclose(np.degrees(feed.rows[:, 1]), LAT)
        np.testing.assert_allclose(feed.rows[:, 3], ALT)


def test_mavlink_in_pieces():
    mavutil = pytest.importorskip("pymavlink.mavutil")
    link = mavutil.mavlink.MAVLink(SimpleNamespace(write=lambda _: None), srcSystem=1, srcComponent=1)
    gyro, accel, data = FRD(SWAY.gyro), FRD(SWAY.accel), b""
    for k, t in enumerate(TIME):
        data += link.highres_imu_encode(round(t * 1e6), *accel[k], *gyro[k], 0, 0, 0, 0, 0, 0, 0, 63).pack(link)
    found = np.vstack(in_pieces(data, Decoder(Layout(), "test").feed))
    np.testing.assert_allclose(found[:, 0], TIME, atol=1e-6)
    np.testing.assert_allclose(found[:, 1:4], SWAY.gyro, atol=1e-6)
    np.testing.assert_allclose(found[:, 4:], SWAY.accel, atol=1e-5)


def sentence(body):
    total = 0
    for letter in body:
        total ^= ord(letter)
    return f"${body}*{total:02X}\r\n".encode()


def epoch(k, seconds):
    clock = f"{int(seconds // 3600) % 24:02d}{int(seconds // 60) % 60:02d}{seconds % 60:05.2f}"
    place = f"{48 + k * 1e-6 * 0:02.0f}06.{60000 + 5 * k:05d},N,01130.{k:05d},E"
    return sentence(f"GPGGA,{clock},{place},1,08,0.9,500.0,M,45.0,M,,"), sentence(
        f"GPRMC,{clock},A,{place},1.94,090.0,221126,,"
    )


def test_nmea_in_pieces_over_midnight():
    """A broken sentence is counted; the clock goes on from one day to the next; no epoch waits for the one after it."""
    feed = GnssFeed()
    listener = Listener(feed, "test")
    start = 86390.0
    for k in range(20):
        gga, rmc = epoch(k, (start + k) % 86400.0)
        in_pieces(gga + (b"$GPGGA,broken*00\r\n" if k == 7 else b"") + rmc, listener.hear, seed=k, longest=30)
        if k:
            assert feed.rows[-1, 0] == start + k
    assert listener.broken == 1
    np.testing.assert_allclose(feed.rows[:, 0], start + np.arange(20))
    np.testing.assert_allclose(feed.rows[:, 3], 545.0)
    np.testing.assert_allclose(feed.rows[:, 4], 1.94 * 1852 / 3600, atol=1e-9)


def test_text_of_other_sensors_with_units_and_totals():
    odometer, velocity = OdometerFeed(), VelocityFeed()
    counts = "time,distance_total [m]\n" + "".join(f"{k * 0.1:.1f},{k * 0.5:.2f}\n" for k in range(100))
    speeds = "time,v_right [km/h],v_forward [km/h],v_up [km/h]\n" + "".join(
        f"{k * 0.1:.1f},0,36,0\n" for k in range(50)
    )
    in_pieces(counts.encode(), Listener(odometer, "test").hear, longest=25)
    in_pieces(speeds.encode(), Listener(velocity, "test").hear, longest=25)
    assert odometer.kind == "distance"
    np.testing.assert_allclose(odometer.rows[:, 0], 0.1 * np.arange(1, 100))
    np.testing.assert_allclose(odometer.rows[:, 1], 0.5)
    np.testing.assert_allclose(velocity.rows[:, 2], 10.0)
    assert odometer.moves_from() == pytest.approx(0.1)


def test_a_sensor_of_its_own_source_and_a_clock_that_is_another(tmp_path):
    """Fixes over UDP with the time of day, an IMU that counts from zero: named, and what to do."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    feed = GnssFeed()
    source, listener = open_aid(f"udp://:{port}", feed)
    assert listener is None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k in range(6):
            sender.sendto(b"".join(epoch(k, 43200.0 + k)), ("127.0.0.1", port))
    for _ in range(100):
        if len(feed.rows) == 6:
            break
        time.sleep(0.05)
    source.advance(5.0)
    assert "its clock is +43200 s off that of the IMU" in source.note
    with pytest.raises(UsageError, match="no file"):
        open_aid("replay:missing.csv", feed)


def test_angles_of_an_encoder_that_wraps_are_counted_on():
    """A stream is read some lines at a time: whole turns are those of the lines before."""
    feed = IndexerFeed(("z",))
    angles = np.arange(400) * 7.0
    text = "time,angle_1\n" + "".join(f"{k * 0.1:.1f},{a % 360.0:.1f}\n" for k, a in enumerate(angles))
    in_pieces(text.encode(), Listener(feed, "test").hear, longest=40)
    assert feed.rows[-1, 0] == pytest.approx(39.9)
    np.testing.assert_allclose(
        np.degrees(feed.rows[:, 1] - feed.rows[0, 1]), angles[-len(feed.rows) :] - angles[0], atol=1e-9
    )


def test_a_magnetometer_in_a_stream_of_mavlink():
    """In the axes of the device (FRD) and milligauss; turned to ours and tesla."""
    mavutil = pytest.importorskip("pymavlink.mavutil")
    link = mavutil.mavlink.MAVLink(SimpleNamespace(write=lambda _: None), srcSystem=1, srcComponent=1)
    data = b"".join(
        link.scaled_imu_encode(20 * k, 0, 0, -1000, 0, 0, 0, 200 + k, 10, 450).pack(link) for k in range(50)
    )
    feed = MagnetometerFeed(np.array([1.0, 20.0, -45.0]) * 1e-6)
    in_pieces(data, Listener(feed, "test").hear, longest=200)
    field = np.column_stack([np.full(50, 10.0), 200.0 + np.arange(50), np.full(50, -450.0)]) * 1e-7
    np.testing.assert_allclose(feed.rows[:, 1:], field, atol=1e-12)


def xbus(*packets):
    """An MTData2 message of an Xsens."""
    data = b"".join(kind.to_bytes(2, "big") + bytes([len(value)]) + value for kind, value in packets)
    size = bytes([len(data)]) if len(data) < 255 else b"\xff" + len(data).to_bytes(2, "big")
    message = b"\xff\x36" + size + data
    return b"\xfa" + message + bytes([-sum(message) & 0xFF])


def fixed(values):
    """Fixed point 16.32: the fraction first."""
    whole = np.floor(values).astype(int)
    return b"".join(struct.pack(">Ih", round((x - w) * 2**32), w) for x, w in zip(values, whole, strict=True))


FORMS = {
    "float32": (0, lambda values: np.asarray(values, ">f4").tobytes(), 1e-6),
    "12.20": (1, lambda values: np.round(np.asarray(values) * 2**20).astype(">i4").tobytes(), 1e-6),
    "16.32": (2, fixed, 1e-9),
    "float64": (3, lambda values: np.asarray(values, ">f8").tobytes(), 1e-15),
}


@pytest.mark.parametrize("form", FORMS)
def test_xsens_in_pieces_is_the_log(form, tmp_path):
    """Rates and specific forces in every form of number; the device's axes are forward, left, up."""
    bits, write, off = FORMS[form]
    gyro, accel = (np.stack([v[:, 1], -v[:, 0], v[:, 2]], axis=1) for v in (SWAY.gyro, SWAY.accel))
    messages = [
        xbus(
            (0x1020, b"\x00\x07"),
            (0x1060, round(t * 1e4).to_bytes(4, "big")),
            (0x4020 + bits, write(a)),
            (0x8020 + bits, write(g)),
        )
        for t, g, a in zip(TIME, gyro, accel, strict=True)
    ]
    path = tmp_path / "log.xbus"
    path.write_bytes(b"".join(messages))
    record = read_imu(path)
    damaged = bytearray(messages[7])
    damaged[-3] ^= 0x10
    noisy = b"\xfa\xff" + b"".join([*messages[:7], bytes(damaged), *messages[8:]])
    found = np.vstack(in_pieces(noisy, Decoder(Layout(), "test").feed))
    assert record.kind == "rates"
    np.testing.assert_allclose(record.gyro, SWAY.gyro, atol=off)
    np.testing.assert_allclose(record.accel, SWAY.accel, atol=20 * off)
    kept = np.delete(np.column_stack([record.time, record.gyro, record.accel]), 7, axis=0)
    np.testing.assert_allclose(found, kept, atol=1e-12)


def test_increments_of_an_xsens_go_before_its_rates_and_its_counter_may_begin_anew():
    """Rotation over the interval as a quaternion, whatever its sign; a message with rates alone is no row then."""
    dtheta, dvel = np.array([1e-3, -2e-3, 3e-3]), np.array([0.01, 0.02, 0.0981])
    half = np.linalg.norm(dtheta) / 2.0
    q = np.concatenate([[np.cos(half)], np.sin(half) * dtheta / (2.0 * half)])
    write, data = FORMS["float64"][1], []
    for k in range(40):
        ticks = ((1 << 32) - 2000 + 100 * k) % (1 << 32)
        rates = [(0x4023, write(dvel * 100.0)), (0x8023, write(dtheta * 100.0))]
        steps = [(0x4013, write(dvel)), (0x8033, write(q if k % 2 else -q))] if k % 4 == 0 else []
        data.append(xbus((0x1060, ticks.to_bytes(4, "big")), *rates, *steps))
    decoder = Decoder(Layout(), "test")
    found = np.vstack(in_pieces(b"".join(data), decoder.feed, longest=90))
    assert decoder.kind == "increments"
    np.testing.assert_allclose(np.diff(found[:, 0]), 0.04, atol=1e-6)
    assert len(found) == 10
    np.testing.assert_allclose(found[:, 1:4], np.tile([2e-3, 1e-3, 3e-3], (10, 1)), atol=1e-12)
    np.testing.assert_allclose(found[:, 4:], np.tile([-0.02, 0.01, 0.0981], (10, 1)), atol=1e-12)


def test_an_xsens_without_a_time_is_asked_for_it():
    write = FORMS["float32"][1]
    message = xbus((0x4020, write([0.0, 0.0, 9.8])), (0x8020, write([0.0, 0.0, 0.0])))
    with pytest.raises(DataError, match="SampleTimeFine"):
        Decoder(Layout(), "test").feed(message)
