"""PSINS and KF-GINS: values by hand, headers, and files of the one under the name of the other."""

import numpy as np
import pytest

from tests.helpers import raises_naming
from truenorth.core.errors import DataError
from truenorth.formats import read_imu

DEG = np.pi / 180
COMPACT = """% PSINS-format SIMU log file. (DO NOT MODIFY!)
% 2014-03-12 10:00:00  by somebody
%   [latitude0(deg), longitude0(deg), height0(m), t0(s), sampling-interval(ms), g(m/s^2)].

0.900000 0.167000 -90.592000 0.000000 0.000000 0.000000
34.24604800 108.90966400 380.000 5.00000000 10.00000000 9.780327
0.100000 0.100000 0.200000 125.000 125.000 250.000

1 2 -3 10 20 800
0 1 -2 11 19 801
2 0 -1 12 18 802
"""


def test_psins_compact(tmp_path):
    path = tmp_path / "log.imu"
    path.write_text(COMPACT)
    record = read_imu(path)
    assert record.kind == "increments"
    np.testing.assert_allclose(record.time, [5.01, 5.02, 5.03], rtol=1e-15)
    arcsec = DEG / 3600
    np.testing.assert_allclose(record.gyro[0], np.array([0.1, 0.2, -0.6]) * arcsec, rtol=1e-14)
    ugs = 1e-6 * 9.780327
    np.testing.assert_allclose(record.accel[2], np.array([12 * 125, 18 * 125, 802 * 250]) * ugs, rtol=1e-14)


def test_psins_compact_with_dither_of_the_sampling_time(tmp_path):
    lines = COMPACT.splitlines()
    lines[4:7] = [f"{line} 0" for line in lines[4:7]]
    lines[8:] = [f"{line} {dither}" for line, dither in zip(lines[8:], [0, 300, -100])]
    path = tmp_path / "log.imu"
    path.write_text("\n".join(lines))
    np.testing.assert_allclose(read_imu(path).time, [5.01, 5.0203, 5.0302], rtol=1e-14)


@pytest.mark.parametrize(
    ("line", "text", "words"),
    [
        (5, "34.2 108.9 380 5 0 9.78", ["line 6", "sampling interval 0 ms"]),
        (5, "34.2 108.9 380 5 10 978", ["line 6", "gravity 978"]),
        (9, "0 1 x 11 19 801", ["line 10", "gz", "'x'"]),
        (9, "0 1 nan 11 19 801", ["line 10", "gz", "nan"]),
        (9, "0 1 2 11", ["line 10", "4 columns"]),
    ],
)
def test_psins_compact_with_faults(line, text, words, tmp_path):
    lines = COMPACT.splitlines()
    lines[line] = text
    path = tmp_path / "log.imu"
    path.write_text("\n".join(lines))
    with raises_naming(DataError, *words):
        read_imu(path)


def test_psins_compact_cut_short(tmp_path):
    path = tmp_path / "log.imu"
    path.write_text("\n".join(COMPACT.splitlines()[:6]))
    with pytest.raises(DataError, match="cut short"):
        read_imu(path)


TIME = np.arange(1, 6) / 100
INCREMENTS = np.arange(30.0).reshape(5, 6) / 7


@pytest.mark.parametrize("above", ["", "% a remark\n", "gx gy gz ax ay az t\n", "log of a laboratory\n\n"])
@pytest.mark.parametrize("delimiter", [" ", ","])
def test_psins_plain(above, delimiter, tmp_path):
    path = tmp_path / "log.imu"
    with path.open("w") as file:
        file.write(above)
        np.savetxt(file, np.column_stack([INCREMENTS, TIME]), fmt="%.17g", delimiter=delimiter)
    record = read_imu(path)
    np.testing.assert_array_equal(record.time, TIME)
    np.testing.assert_array_equal(np.hstack([record.gyro, record.accel]), INCREMENTS)


def test_kf_gins_reads_frd_and_leaves_an_odometer_alone(tmp_path):
    path = tmp_path / "log.txt"
    np.savetxt(path, np.column_stack([TIME, INCREMENTS, TIME]), fmt="%.17g", header="t dtheta dvel odo")
    record = read_imu(path, format="kf-gins")
    np.testing.assert_array_equal(record.gyro, INCREMENTS[:, [1, 0, 2]] * [1, 1, -1])
    np.testing.assert_array_equal(record.accel, INCREMENTS[:, [4, 3, 5]] * [1, 1, -1])
    asked = read_imu(path, format="kf-gins", axes="RFU")  # said in so many words: not the format's default
    np.testing.assert_array_equal(asked.gyro, INCREMENTS[:, :3])


@pytest.mark.parametrize(
    ("name", "table", "header", "words"),
    [
        ("log.imu", np.column_stack([TIME, INCREMENTS / 1e9 - TIME[:, None]]), "", ["first column", "kf-gins"]),
        ("log.txt", np.column_stack([INCREMENTS[::-1], TIME]), "", ["seventh column", "psins"]),
        ("log.txt", np.column_stack([TIME, INCREMENTS]), "t,wx,wy,wz,ax,ay,az", ["header of names", "csv"]),
        ("log.imu", np.column_stack([TIME, INCREMENTS]), "t,wx,wy,wz,ax,ay,az", ["'t,wx", "csv"]),
        ("log.txt", INCREMENTS, "", ["6 columns", "expected 7"]),
        ("log.imu", INCREMENTS[:, :5], "", ["5 columns", "expected 6 or 7"]),
    ],
)
def test_one_under_the_name_of_the_other(name, table, header, words, tmp_path):
    path = tmp_path / name
    np.savetxt(path, table, fmt="%.17g", header=header, comments="", delimiter=",")
    with raises_naming(DataError, name, *words):
        read_imu(path, format="psins" if name == "log.imu" else "kf-gins")


@pytest.mark.parametrize("name", ["log.txt", "log.imu"])
def test_text_faults_are_named_by_line(name, tmp_path):
    path = tmp_path / name
    rows = [[*[str(v) for v in values], str(t)] if name == "log.imu" else [str(t), *[str(v) for v in values]]
            for t, values in zip(TIME, INCREMENTS)]  # fmt: skip
    rows[3][2] = "oops"
    path.write_text("% remark\n" + "\n".join(" ".join(row) for row in rows))
    format = "psins" if name == "log.imu" else "kf-gins"
    with pytest.raises(DataError, match=r"line 5, column .*'oops'"):
        read_imu(path, format=format)
    path.write_text("no numbers here\n" * 3)
    with pytest.raises(DataError, match="3 columns"):
        read_imu(path, format=format)


def test_binary_with_a_bad_number_and_time_going_back(tmp_path):
    path = tmp_path / "log.bin"
    table = np.column_stack([np.arange(1, 101) / 100, np.ones((100, 6))])
    bad = table.copy()
    bad[41, 5] = np.nan
    bad.tofile(path)
    with pytest.raises(DataError, match=r"row 42, column dvel_y: nan"):
        read_imu(path)
    bad = table.copy()
    bad[41, 0] = 0.3
    bad.tofile(path)
    with pytest.raises(DataError, match=r"row 42, column t: time goes back"):
        read_imu(path)
