"""Logs of the field that were read wrong, lost rows in silence or were refused though sound: line ends in cells, clocks, dates."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pytest

from tests.formats.corpus.truth import DEG
from tests.formats.test_field_logs import MOVED, G, is_read, rows
from tests.runs import some
from truenorth.core.errors import DataError
from truenorth.formats import read_gnss, read_imu
from truenorth.formats.wraps import unwrapped

HEADER = "time,gx,gy,gz,ax,ay,az"
LINES = rows(MOVED.time, MOVED.gyro, MOVED.accel).splitlines()


def write(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def notes(record):
    return "; ".join(f"{guess.what}: {guess.value}" for guess in record.taken_for)


# ---------------------------------------------------------------------------------------------- line ends in quoted cells


@pytest.mark.parametrize("cell", ["a\nb", "a, b\r\n\r\nc", 'he said ""go""\nthen left', "$GPGGA,1,2\r\n"])
@pytest.mark.parametrize("place", some(["second"], ["first", "last"]))
def test_a_line_end_in_a_quoted_cell(tmp_path, cell, place):
    """It is one row by the rules of CSV, wherever the cell stands."""
    path, where = tmp_path / "log.csv", {"first": 0, "second": 1, "last": 7}[place]
    lines = [line.split(",") for line in [HEADER, *LINES]]
    for k, line in enumerate(lines):
        line.insert(where, "note" if k == 0 else f'"{cell}"' if k in (20, 21, 900) else "ok")
    write(path, [",".join(line) for line in lines])
    record = is_read(path)
    assert "rows with line ends in quoted cells: 3" in notes(record)
    lines[1000][3 + (where < 3)] = "x"
    write(path, [",".join(line) for line in lines])
    number = path.read_text().replace("\r\n", "\n").splitlines().index(",".join(lines[1000])) + 1
    with pytest.raises(DataError, match=rf"line {number}, column gz: 'x'"):
        read_imu(path)


def test_a_line_end_in_a_quoted_cell_of_each_row_and_of_the_header(tmp_path):
    lines = [f'{line},"at {k}\nso it was"' for k, line in enumerate(LINES)]
    is_read(write(tmp_path / "log.csv", [f'{HEADER},"what\nhappened"', *lines]))


def test_a_number_that_a_line_end_cuts_is_named(tmp_path):
    lines = [HEADER, *LINES]
    cells = lines[20].split(",")
    lines[20] = ",".join([*cells[:3], '"0.\n1"', *cells[4:]])
    with pytest.raises(DataError, match=r"line 21, column gz: '0\. 1'; expected a number"):
        read_imu(write(tmp_path / "log.csv", lines))


# ------------------------------------------------------------------------------------------- rows above the table


@pytest.mark.parametrize("header", [True, False])
def test_rows_of_another_table_above_the_table_are_not_lost_in_silence(tmp_path, header):
    short = [",".join(line.split(",")[:4]) for line in LINES[:30]]
    lines = [*([HEADER] if header else []), *short, *LINES[30:]]
    with pytest.raises(
        DataError, match=rf"line {1 + header}: 4 columns, as in 30 lines.* 7 columns; expected one table"
    ):
        read_imu(write(tmp_path / "log.csv", lines))
    with pytest.raises(DataError, match=r"line 1: 4 columns, as in 30 lines"):
        read_imu(write(tmp_path / "log.csv", [*short, HEADER, *LINES[30:]]))


def test_one_row_that_lacks_its_beginning_and_a_matrix_above_the_header_are_noted(tmp_path):
    record = read_imu(write(tmp_path / "log.csv", [HEADER, LINES[0][20:], *LINES[1:]]))
    assert len(record) == len(LINES) - 1
    assert "lines of numbers that are no whole row left out: 1, the first is line 2" in notes(record)
    record = is_read(write(tmp_path / "log.csv", ["turn", "1,0,0", "0,1,0", "0,0,1", HEADER, *LINES]))
    assert "lines of numbers above the header left out: 3, the first is line 2" in notes(record)


# --------------------------------------------------------------------------------------------------- clocks that start anew


@pytest.mark.parametrize(
    ("name", "ticks", "period"),
    [
        ("time_us", 1e6, 2**32), ("micros", 1e6, 2**32), ("time", 1e6, 2**32), ("SampleTimeFine", 1e6, 2**32),
        ("time_ms", 1e3, 2**16), ("time_us", 1e6, 2**24), ("time_ns", 1e9, 2**32), ("time_ms", 1e3, 2**32),
        ("tow [s]", 1.0, 604800), ("itow", 1e3, 604800000),
    ],
)  # fmt: skip
def test_a_counter_that_starts_anew_goes_on(tmp_path, name, ticks, period):
    counts = (np.round(ticks * MOVED.time, 6) - np.round(ticks * MOVED.time[1000], 6) + period) % period
    path = tmp_path / "log.csv"
    stamps = [f"{count:.15g}" for count in counts]
    path.write_text(f"{name},gx,gy,gz,ax,ay,az\n" + rows(stamps, MOVED.gyro, MOVED.accel))
    assert "starts anew" in notes(is_read(path))


def test_seconds_that_were_made_of_a_counter_go_on(tmp_path):
    """``micros() / 1e6`` starts anew at 4294.967296 s."""
    path = tmp_path / "log.csv"
    stamps = [f"{(t + 4294.967296 - 20.0) % 4294.967296:.6f}" for t in MOVED.time]
    path.write_text(f"{HEADER}\n" + rows(stamps, MOVED.gyro, MOVED.accel))
    assert "a counter of 32 bits, which starts anew once" in notes(is_read(path))


@pytest.mark.parametrize("back", [1000.0, 2.0**32 * 1e-6 - 1.0, 2.0**16, 86400.0])
def test_a_clock_that_goes_back_elsewhere_is_refused(tmp_path, back):
    path = tmp_path / "log.csv"
    stamps = [f"{5000.0 + t + 2e5 - back * (k > 999):.6f}" for k, t in enumerate(MOVED.time)]
    path.write_text(f"{HEADER}\n" + rows(stamps, MOVED.gyro, MOVED.accel))
    with pytest.raises(DataError, match=r"line 1002, column time: time goes back"):
        read_imu(path)


def test_a_period_of_few_steps_and_a_gap_at_the_turn_are_not_sure():
    step = np.arange(100.0) * 6000.0
    assert unwrapped(step % 2**16)[1] is None
    gap = np.concatenate([2**32 - 1e4 * np.arange(50.0, 0.0, -1.0), 1e6 + 1e4 * np.arange(50.0)])
    assert unwrapped(gap)[1] is None


def test_a_receiver_s_week_that_ends_goes_on(tmp_path):
    path = tmp_path / "gnss.csv"
    lines = [f"{(604795 + k) % 604800},31.0,121.0,10.0" for k in range(20)]
    fixes = read_gnss(write(path, ["tow,lat,lon,alt", *lines]))
    np.testing.assert_allclose(np.diff(fixes.time), 1.0)


# ----------------------------------------------------------------------------------------------------------------- dates


@pytest.mark.parametrize(
    ("form", "start", "said"),
    [
        ("%d/%m/%Y %H:%M:%S.%f", datetime(2021, 3, 11, 23, 59, 40), "the day first: it changes at midnight"),
        ("%m/%d/%Y %H:%M:%S.%f", datetime(2021, 3, 11, 23, 59, 40), "the month first: it changes at midnight"),
        ("%d-%m-%Y %H:%M:%S.%f", datetime(2021, 3, 25, 10, 0, 0), "the day first"),
        ("%m/%d/%Y %H:%M:%S.%f", datetime(2021, 3, 25, 10, 0, 0), "the month first"),
        ("%d/%m/%Y %H:%M:%S.%f", datetime(2021, 1, 31, 23, 59, 40), "the day first"),
        ("%m/%d/%Y %I:%M:%S.%f %p", datetime(2021, 3, 11, 11, 59, 40), "the month first: no number of theirs shows"),
        ("%d.%m.%Y %H:%M:%S.%f", datetime(2021, 3, 11, 10, 0, 0), "the day first"),
        ("%d/%m/%y %H:%M:%S.%f", datetime(2021, 3, 12, 23, 59, 40), "the day first"),
    ],
)
def test_dates_whose_order_the_log_shows(tmp_path, form, start, said):
    path = tmp_path / "log.csv"
    stamps = [(start + timedelta(seconds=float(t))).strftime(form) for t in MOVED.time]
    path.write_text(f"{HEADER}\n" + rows(stamps, MOVED.gyro, MOVED.accel))
    record = is_read(path)
    assert said in notes(record)
    assert abs(record.time[0] - MOVED.time[0] - (start - datetime(1970, 1, 1)).total_seconds()) < 1e-5


def test_dates_of_two_orders_are_refused(tmp_path):
    stamps = [f"{25 if k < 50 else 3}/{3 if k < 50 else 25}/2021 10:00:{t:09.6f}" for k, t in enumerate(MOVED.time)]
    (tmp_path / "log.csv").write_text(f"{HEADER}\n" + rows(stamps, MOVED.gyro, MOVED.accel))
    with pytest.raises(DataError, match=r"column time: not dates or times of one form .*both numbers"):
        read_imu(tmp_path / "log.csv")


# ------------------------------------------------------------------------------------------------------- labelled lines

NAMES = ("ax", "ay", "az", "gx", "gy", "gz")


def labelled(mark, between, clock="t"):
    values = np.column_stack([MOVED.accel, MOVED.gyro])
    lines = []
    for time, row in zip(MOVED.time, values):
        cells = [f"{name}{mark}{value:.9g}" for name, value in zip(NAMES, row)]
        lines.append(between.join([*([f"{clock}{mark}{time:.3f}"] if clock else []), *cells]))
    return lines


@pytest.mark.parametrize("mark", some([" = "], [":", "=", ": "]))
@pytest.mark.parametrize("between", some([" ", ", "], [",", "\t", " | "]))
def test_labelled_values(tmp_path, mark, between):
    """As the plotter of the Arduino IDE wants them, behind what the device says when it starts."""
    boot = ["ets Jun  8 2016 00:22:57", "rst:0x1 (POWERON_RESET),boot:0x13", "MPU6050 found!", ""]
    record = is_read(write(tmp_path / "log.txt", boot + labelled(mark, between)))
    assert "labelled values; lines above the first sample left out: 3" in notes(record)
    is_read(write(tmp_path / "log.txt", labelled(mark, between, clock="")), rate=100.0)


def test_labelled_values_with_stamps_and_units(tmp_path):
    path = tmp_path / "log.txt"
    write(path, [f"10:11:{t:09.6f} -> {line}" for t, line in zip(MOVED.time, labelled(":", " ", clock=""))])
    is_read(path)
    write(
        path, [f"\x1b[0;32mI ({1e3 * t:.0f}) IMU: {line}" for t, line in zip(MOVED.time, labelled("=", " ", clock=""))]
    )
    is_read(path)
    values = np.column_stack([MOVED.accel / G, MOVED.gyro / DEG])
    said = [" ".join(f"{n}: {v:.9g} {u}" for n, v, u in zip(NAMES, row, 3 * ["g"] + 3 * ["deg/s"])) for row in values]
    write(path, [f"t: {t:.3f} s, {line}" for t, line in zip(MOVED.time, said)])
    assert "unit of the gyros: deg/s" in notes(is_read(path))


def test_a_sample_of_several_lines(tmp_path):
    """As the examples of Adafruit's libraries print it."""
    lines = ["Adafruit MPU6050 test!", "MPU6050 Found!", ""]
    for f, w in zip(MOVED.accel, MOVED.gyro):
        lines.append("Acceleration X: {:.7f}, Y: {:.7f}, Z: {:.7f} m/s^2".format(*f))
        lines.append("Rotation X: {:.8f}, Y: {:.8f}, Z: {:.8f} rad/s".format(*w))
        lines += ["Temperature: 25.10 degC", ""]
    path = write(tmp_path / "log.txt", lines)
    record = is_read(path, rate=100.0)
    assert "unit of the gyros: rad/s" in notes(record)
    path.write_text("\n".join(lines[:-3]) + "\n")
    assert len(read_imu(path, rate=100.0)) == len(MOVED.time) - 1
    begun = read_imu(
        write(path, lines[4:]), rate=100.0
    )  # inside a sample, whose forces are not paired with the next one's rates
    np.testing.assert_allclose(begun.accel, MOVED.accel[1:], atol=1e-6)
    np.testing.assert_allclose(begun.gyro, MOVED.gyro[1:], atol=1e-7)
    lines[101] = "reset"
    with pytest.raises(DataError, match=r"line 102: 'reset'; expected values of "):
        read_imu(write(path, lines), rate=100.0)


def test_flat_json_lines(tmp_path):
    values = zip(MOVED.time, np.column_stack([MOVED.accel, MOVED.gyro]))
    lines = ["{" + ", ".join(f'"{n}": {v:.9g}' for n, v in zip(("t", *NAMES), (t, *row))) + "}" for t, row in values]
    is_read(write(tmp_path / "log.jsonl", lines))


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (
            "Brownout detector was triggered",
            r"line 101: 'Brownout.*expected values of t, ax, ay, az, gx, gy, gz, as in the other",
        ),
        ("t:1.01 ax:0.1 ay:ovf az:9.8 gx:0 gy:0 gz:0", r"line 101, column ay: 'ovf'; expected a number"),
        ("t:1.01 ax:0.1 ay:0.2", r"line 101: 't:1.01 ax:0.1 ay:0.2'; expected values of"),
    ],
)
def test_a_damaged_line_of_labelled_values_is_named(tmp_path, wrong, says):
    lines = labelled(":", " ")
    lines[100] = wrong
    with pytest.raises(DataError, match=says):
        read_imu(write(tmp_path / "log.txt", lines))


def test_labelled_lines_that_are_cut_at_the_ends(tmp_path):
    lines = labelled(":", " ")
    (tmp_path / "log.txt").write_text("\n".join([lines[0][15:], *lines[1:-1], lines[-1][:-8]]))
    record = read_imu(tmp_path / "log.txt")
    assert len(record) == len(lines) - 2
    assert "the last line is cut: left out" in notes(record)


# ------------------------------------------------------------------------------------------- more of the same logs' sort


def test_a_row_with_text_that_lacks_its_beginning_is_noted(tmp_path):
    lines = [f"{line},ok" for line in LINES]
    record = read_imu(write(tmp_path / "log.csv", [f"{HEADER},note", lines[0][24:], *lines[1:]]))
    assert "lines of numbers that are no whole row left out: 1, the first is line 2" in notes(record)


def test_sentences_of_a_receiver_above_a_table_are_no_header(tmp_path):
    """As the multi-sensor logger of a university writes them: the date, then the rows."""
    lines = ["logger.ino", "GPZDA,130427.00,15,08,2023,00,00*6A", *LINES]
    is_read(write(tmp_path / "log.txt", lines))


def test_a_clock_that_an_export_lists_and_the_device_does_not_send(tmp_path):
    """As Xsens's program writes it: the rate stands above, the column of the fine time is empty."""
    above = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Firmware Version: 4.0.2\n"
    names = ["PacketCounter", "SampleTimeFine", "UTC_Nano", *(f"Acc_{x}" for x in "XYZ"), *(f"Gyr_{x}" for x in "XYZ")]
    count = [f"{k:05d}" for k in range(len(LINES))]
    table = rows(count, [""] * len(count), [""] * len(count), MOVED.accel, MOVED.gyro, sep="\t")
    (tmp_path / "log.txt").write_text(above + "\t".join(names) + "\n" + table)
    assert "rate: 100 Hz" in notes(is_read(tmp_path / "log.txt"))


def test_whole_seconds_and_the_milliseconds_that_elapsed(tmp_path):
    """As scripts for a microcontroller write them."""
    seconds = [f"{700000000 + int(t + 1e-6)}" for t in MOVED.time]
    parts = [f"{round(1e3 * t) % 1000}" for t in MOVED.time]
    header = "Epoch_time_s,milliseconds_elapsed,Ax,Ay,Az,Gx,Gy,Gz\n"
    (tmp_path / "log.csv").write_text(header + rows(seconds, parts, MOVED.accel / G, MOVED.gyro / DEG))
    is_read(tmp_path / "log.csv")
