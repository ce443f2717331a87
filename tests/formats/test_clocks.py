"""Columns that count and are no clocks, clocks of two kinds in one log, lost rows that are no bunches."""

import re

import numpy as np
import pytest

from tests.formats.corpus.truth import truth
from tests.formats.test_field_logs import is_read, rows
from truenorth.core.errors import DataError, UsageError
from truenorth.formats import UnsureError, read_gnss, read_imu

MOVED = truth("swaying", "tactical")
XYZ = "gx (rad/s),gy (rad/s),gz (rad/s),ax (m/s^2),ay (m/s^2),az (m/s^2)"


def skipping(seed=1):
    """Counts of packets of two kinds: 2, 1, 2, 1 and now and then more."""
    rng = np.random.default_rng(seed)
    return 17 + np.cumsum(rng.choice([1, 2, 3], len(MOVED.time), p=[0.5, 0.45, 0.05])).astype(float)


def write(path, header, *parts):
    path.write_text(header + "\n" + rows(*parts, form="%.15g"))
    return path


# -------------------------------------------------------------------------------------------------------- counters


@pytest.mark.parametrize("name", ["Packet number", "PacketCounter", "index", "seq", "Sample", "frame_id", "No."])
def test_a_name_of_a_counter_is_no_clock_whatever_it_leaves_out(tmp_path, name):
    """An x-IMU counts packets of all kinds: read as ms, a log of 256 Hz was one of 500 Hz."""
    path = write(tmp_path / "log.csv", f"{name},{XYZ}", skipping(), MOVED.gyro, MOVED.accel)
    with pytest.raises(UsageError, match=rf"no time in the log: column '{re.escape(name)}' counts .*or give the rate"):
        read_imu(path)
    is_read(path, rate=100.0)


def test_an_index_that_is_a_date_is_a_clock(tmp_path):
    stamps = np.round((1.7e9 + MOVED.time) * 1e3)
    is_read(write(tmp_path / "log.csv", f"index,{XYZ}", stamps, MOVED.gyro, MOVED.accel))


def test_a_counter_without_a_name_is_asked_about(tmp_path):
    counts = np.cumsum(np.resize([2.0, 2.0, 1.0], len(MOVED.time)))
    (path := tmp_path / "log.csv").write_text(rows(counts, MOVED.gyro, MOVED.accel))
    with pytest.raises(UnsureError, match=r"goes up by 1 to 2 from row to row: it may be in ms .* or count") as caught:
        read_imu(path)
    assert [set(option) for option in caught.value.options] == [{"columns", "units"}, {"rate"}]
    is_read(path, rate=100.0)


# ------------------------------------------------------------------------------------------- times of a clock's face


def face(time, parts):
    """Seconds of a day as HHMMSS and parts of a second."""
    whole = np.floor(time * parts + 0.5)
    seconds = whole // parts
    return (seconds // 3600 * 10000 + seconds // 60 % 60 * 100 + seconds % 60) * parts + whole % parts


@pytest.mark.parametrize("parts", [1e2, 1e3, 1e6])
@pytest.mark.parametrize("name", ["time", "clock"])
def test_hours_minutes_and_seconds_in_whole_numbers(tmp_path, name, parts):
    """``74859980`` is 7:48:59.980: as ms it jumped by 40 s at the minute."""
    stamps = face(7 * 3600 + 48 * 60 + 45.0 + MOVED.time, parts)
    record = is_read(write(tmp_path / "log.csv", f"{name},{XYZ}", stamps, MOVED.gyro, MOVED.accel))
    assert record.time[0] == pytest.approx(7 * 3600 + 48 * 60 + 45.01)
    assert any("HHMMSS" in guess.why for guess in record.taken_for)


def test_a_receivers_time_of_the_clocks_face(tmp_path):
    time = 36555.0 + np.arange(120.0)
    lat = 48.0 + 1e-5 * np.arange(120.0)
    path = write(tmp_path / "gnss.csv", "time,lat,lon,alt", face(time, 1.0), lat, 0 * lat + 11.0, 0 * lat)
    np.testing.assert_allclose(read_gnss(path).time, time)


# ---------------------------------------------------------------------------------------------- two clocks, and jumps


def test_a_time_that_repeats_gives_way_to_a_clock_that_does_not(tmp_path):
    coarse, fine = np.floor(MOVED.time * 10.0) / 10.0, np.round((1.7e9 + MOVED.time) * 1e3)
    record = is_read(write(tmp_path / "log.csv", f"time,millis,{XYZ}", coarse, fine, MOVED.gyro, MOVED.accel))
    assert record.time[0] == pytest.approx(1.7e9, abs=0.02)
    with pytest.raises(UnsureError, match="repeat"):  # the caller's column is the caller's
        read_imu(tmp_path / "log.csv", columns={"time": "time"})


@pytest.mark.parametrize("rate", [None, 44.5])
def test_no_rate_is_offered_or_taken_across_a_jump(tmp_path, rate):
    """Rows over the span with a jump of 50 s are no rate: it was offered, and the log was read with it."""
    coarse = np.floor(MOVED.time * 10.0) / 10.0 + 50.0 * (MOVED.time > 10.0)
    path = write(tmp_path / "log.csv", f"time,{XYZ}", coarse, MOVED.gyro, MOVED.accel)
    with pytest.raises(DataError, match=r"line 10\d\d: the stamps jump by 50.*keep the rows before or behind"):
        read_imu(path, rate=rate)


# -------------------------------------------------------------------------------------------------------- lost rows


@pytest.mark.parametrize("jitter", [0.0, 2e-4])
@pytest.mark.parametrize("share", [0.1, 0.33])
def test_lost_rows_are_no_bunches(tmp_path, jitter, share):
    """PX4 lost a third of the rows of 250 Hz: a rate of 188 Hz was offered for all of them."""
    rng = np.random.default_rng(2)
    keep = rng.random(len(MOVED.time)) > share
    stamps = np.round((MOVED.time + jitter * rng.standard_normal(len(keep))) * 1e6) * 1e-6
    path = write(tmp_path / "log.csv", f"time,{XYZ}", stamps[keep], MOVED.gyro[keep], MOVED.accel[keep])
    np.testing.assert_allclose(read_imu(path).time, stamps[keep], atol=2e-6)


@pytest.mark.parametrize("kind", ["bunches", "coarse"])
def test_bunches_of_whole_steps_are_still_asked_about(tmp_path, kind):
    """Three rows 1 ms apart and then a wait; and a computer's clock of 15.6 ms under rows of 48 Hz."""
    count = np.arange(len(MOVED.time))
    if kind == "bunches":
        stamps = count // 4 * 40.0 + count % 4
    else:
        stamps = np.round(np.floor(count * (1e3 / 48.0) / 15.625) * 15.625, 3)
    path = write(tmp_path / "log.csv", f"time (ms),{XYZ}", stamps, MOVED.gyro, MOVED.accel)
    with pytest.raises(UnsureError, match="bunches"):
        read_imu(path)


@pytest.mark.parametrize("times", [2, 24])
def test_rows_that_are_all_written_many_times_are_taken_once(tmp_path, times):
    """A node wrote each message 24 times: a rate was offered for copies of rows."""
    every = np.repeat(np.arange(len(MOVED.time)), times)
    path = write(tmp_path / "log.csv", f"time,{XYZ}", MOVED.time[every], MOVED.gyro[every], MOVED.accel[every])
    record = is_read(path)
    assert any("rows that repeat" in guess.value for guess in record.taken_for)


def test_rows_of_one_coarse_stamp_that_differ_are_no_copies(tmp_path):
    coarse = np.floor(MOVED.time * 10.0) / 10.0
    held = np.arange(len(MOVED.time)) // 2 * 2
    path = write(tmp_path / "log.csv", f"time,{XYZ}", coarse, MOVED.gyro[held], MOVED.accel[held])
    with pytest.raises(UnsureError, match="repeat"):
        read_imu(path)


def test_the_sensors_own_stamp_where_that_of_the_arrival_repeats(tmp_path):
    arrival = np.maximum.accumulate(MOVED.time + 0.004 * (np.arange(len(MOVED.time)) % 97 > 94))
    arrival[1000::500] = arrival[999::500][: len(arrival[1000::500])]
    path = write(tmp_path / "log.csv", f"%time,field.header.stamp,{XYZ}", arrival, MOVED.time, MOVED.gyro, MOVED.accel)
    np.testing.assert_array_equal(is_read(path).time, MOVED.time)
