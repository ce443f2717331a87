"""Logs of phones' apps: fixes that stand on each row of the IMU, what a phone says of them, decimals with either mark."""

import numpy as np
import pytest

from truenorth.core.errors import DataError, UsageError
from truenorth.formats import read_imu
from truenorth.formats.gnss import read_gnss

G = 9.80665
TIME = 0.01 * np.arange(1000)
FIXES = np.floor(TIME + 0.305)  # a new one each second, the first at .695 s after the start
LAT, LON = 55.85 + 1e-5 * FIXES, 37.48 + 2e-5 * FIXES
ANDROSENSOR = (
    "ACCELEROMETER X (m/s²)", "ACCELEROMETER Y (m/s²)", "ACCELEROMETER Z (m/s²)", "GRAVITY X (m/s²)", "GRAVITY Y (m/s²)",
    "GRAVITY Z (m/s²)", "LINEAR ACCELERATION X (m/s²)", "LINEAR ACCELERATION Y (m/s²)", "LINEAR ACCELERATION Z (m/s²)",
    "GYROSCOPE X (rad/s)", "GYROSCOPE Y (rad/s)", "GYROSCOPE Z (rad/s)", "MAGNETIC FIELD X (μT)", "MAGNETIC FIELD Y (μT)",
    "MAGNETIC FIELD Z (μT)", "ORIENTATION Z (azimuth °)", "ORIENTATION X (pitch °)", "ORIENTATION Y (roll °)",
    "ATMOSPHERIC PRESSURE (hPa)", "LOCATION Latitude : ", "LOCATION Longitude : ", "LOCATION Altitude ( m)",
    "LOCATION Altitude-google ( m)", "LOCATION Speed ( Kmh)", "LOCATION Accuracy ( m)", "LOCATION ORIENTATION (°)",
    "Satellites in range", "Time since start in ms ", "YYYY-MO-DD HH-MI-SS_SSS",
)  # fmt: skip


def tilted():
    """Rates and specific forces of a phone that rolls slowly about y."""
    roll = 0.5 * np.sin(0.4 * TIME)
    gyro = np.column_stack([0.0 * TIME, 0.2 * np.cos(0.4 * TIME), 0.0 * TIME])
    return gyro, G * np.column_stack([-np.sin(roll), 0.0 * TIME, np.cos(roll)])


def cells(values, decimal="."):
    return [f"{value:.9f}".replace(".", decimal) for value in values]


def write(path, names, columns, separator=","):
    path.write_text(
        "\n".join([separator.join(names), *(separator.join(row) for row in zip(*columns, strict=True))]) + "\n"
    )
    return path


@pytest.fixture
def androsensor(tmp_path):
    gyro, accel = tilted()
    numbers = [*accel.T, *accel.T, *(0.01 * accel).T, *gyro.T, *np.ones((7, len(TIME))), LAT, LON, 174.0 + 0.0 * TIME]
    more = [np.full(len(TIME), np.nan), 3.6 + 0.0 * TIME, 3.03 + 0.0 * TIME, 90.0 + 0.0 * TIME]
    stamps = [[str(round(1000 * t)) for t in TIME], [f"2021-05-20 22:06:41:{round(1000 * t) % 1000:03d}" for t in TIME]]
    columns = [*map(cells, numbers), *map(cells, more), ["28 / 30"] * len(TIME), *stamps]
    return write(tmp_path / "Sensor_record.csv", ANDROSENSOR, columns, ";")


def test_a_fix_that_stands_on_each_row_is_one(androsensor):
    """Rows where it changes; the first one, of which nobody knows when it came, is left out."""
    gyro, accel = tilted()
    imu, fixes = read_imu(androsensor), read_gnss(androsensor)
    np.testing.assert_allclose(imu.accel, accel, atol=1e-8)
    np.testing.assert_allclose(imu.gyro, gyro, atol=1e-8)
    assert ("unit of time", "ms", "the heading") in [guess[:3] for guess in imu.taken_for]
    np.testing.assert_allclose(fixes.time, np.arange(0.7, 10.0, 1.0), atol=1e-9)
    np.testing.assert_allclose(np.degrees(fixes.lat), 55.85 + 1e-5 * np.arange(1, 11), atol=1e-9)
    np.testing.assert_allclose(fixes.alt, 174.0)
    np.testing.assert_allclose(fixes.v_n[:, :2], np.tile([1.0, 0.0], (10, 1)), atol=1e-9)
    np.testing.assert_allclose(fixes.position_sigma[:, :2], 2.0)  # the circle of 3.03 m holds 68 %


def test_a_fix_that_never_changes_is_refused(androsensor):
    stale = androsensor.read_text().splitlines()
    androsensor.write_text("\n".join([stale[0], *([stale[1]] * 50)]) + "\n")
    lines = androsensor.read_text().splitlines()
    rows = [line.replace(";0;2021", f";{10 * k};2021") for k, line in enumerate(lines[1:])]
    androsensor.write_text("\n".join([lines[0], *rows]) + "\n")
    with pytest.raises(
        DataError, match=r"the fix changes 0 times in 50 rows, columns LOCATION Latitude.*expected new fixes"
    ):
        read_gnss(androsensor)


def test_what_repeats_in_a_log_of_a_receiver_alone_stays(tmp_path):
    """A parked receiver that holds its place still measures it."""
    time, zero = np.arange(50.0), np.zeros(50)
    path = write(tmp_path / "gnss.csv", ("time", "lat", "lon", "alt"), [cells(time), *map(cells, (zero, zero, zero))])
    assert len(read_gnss(path)) == 50


@pytest.mark.parametrize("known", [True, False])
def test_what_a_phone_says_of_a_fix(tmp_path, known):
    """Sensor Logger: a number below zero says that the phone does not know."""
    names = ("time", "seconds_elapsed", "bearingAccuracy", "speedAccuracy", "verticalAccuracy", "horizontalAccuracy", "speed",
             "bearing", "altitude", "longitude", "latitude")  # fmt: skip
    stamps = [str(1_700_000_000_000_000_000 + k * 10**9) for k in range(10)]
    said = [30.0, 0.4, 4.0, 3.03, 2.0, 90.0] if known else [-1.0, -1.0, -1.0, 3.03, -1.0, -1.0]
    columns = [stamps, cells(range(10)), *(cells([value] * 10) for value in (*said, 100.0, 37.48, 55.85))]
    fixes = read_gnss(write(tmp_path / "Location.csv", names, columns))
    assert fixes.time[0] == pytest.approx(1.7e9)
    np.testing.assert_allclose(fixes.position_sigma[0], [2.0, 2.0, 4.0 if known else np.nan])
    if known:
        np.testing.assert_allclose(fixes.v_n[0, :2], [2.0, 0.0], atol=1e-9)
        across = np.hypot(0.4, 2.0 * np.radians(30.0))  # along the course .4 m/s; the larger one on each axis
        np.testing.assert_allclose(fixes.velocity_sigma[0], across)
    else:
        assert not np.isfinite(fixes.v_n).any()
        assert fixes.velocity_sigma is None


@pytest.mark.parametrize("unit", ["m", "°"])
def test_phyphox(tmp_path, unit):
    """It writes degrees over a height's accuracy, which is in metres."""
    names = ("Time (s)", "Latitude (°)", "Longitude (°)", "Height (m)", "Velocity (m/s)", "Direction (°)",
             "Horizontal Accuracy (m)", f"Vertical Accuracy ({unit})")  # fmt: skip
    values = (range(10), [55.85] * 10, [37.48] * 10, [100.0] * 10, [2.0] * 10, [90.0] * 10, [3.03] * 10, [4.0] * 10)
    quoted = [f'"{name}"' for name in names]
    fixes = read_gnss(write(tmp_path / "Location.csv", quoted, [cells(v, ",") for v in values], ";"))
    np.testing.assert_allclose(fixes.v_n[0, :2], [2.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(fixes.position_sigma[0], [2.0, 2.0, 4.0])
    assert ("Vertical Accuracy (°) in m" in fixes.source) == (unit == "°")
    with pytest.raises(UsageError, match="vertical_accuracy cannot be in 'deg'"):
        read_gnss(tmp_path / "Location.csv", units={"vertical_accuracy": "deg"})


TOOLBOX = ("time", "gFx", "gFy", "gFz", "wx", "wy", "wz")


def toolbox(path, marks, first=TIME):
    gyro, accel = tilted()
    return write(
        path, TOOLBOX, [cells(v, m) for v, m in zip((first, *(accel / G).T, *gyro.T), marks, strict=True)], ";"
    )


@pytest.mark.parametrize(
    "marks", [",,,,,,,", ".......", ".,,,,,,", ".,,,..."], ids=["commas", "points", "clock", "mixed"]
)
def test_a_column_with_decimal_points_among_columns_with_commas(tmp_path, marks):
    gyro, accel = tilted()
    record = read_imu(toolbox(tmp_path / "log.csv", marks[:7]))
    np.testing.assert_allclose(record.time, TIME, atol=1e-9)
    np.testing.assert_allclose(record.gyro, gyro, atol=1e-8)
    np.testing.assert_allclose(record.accel, accel, atol=1e-7)


@pytest.mark.parametrize(
    ("marks", "changed", "words"),
    [
        (".,,,,,,", 3, r"log.csv: line 501, column gFx: .*in line 2; expected one decimal mark in a column: write"),
        (",,,,,,,", 2, r"line 501, column gFx: .*a decimal comma, as in most rows: write all with one mark"),
    ],
    ids=["in a table of both marks", "in a table of commas"],
)
def test_another_decimal_mark_in_one_row_is_refused_by_line_and_column(tmp_path, marks, changed, words):
    path = toolbox(tmp_path / "log.csv", marks)
    lines = path.read_text().splitlines()
    lines[500] = lines[500].replace(",", ".", changed)
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(DataError, match=words):
        read_imu(path)


def test_points_that_may_stand_between_thousands_are_refused(tmp_path):
    path = toolbox(tmp_path / "log.csv", ".,,,,,,", 5.0 + TIME)
    path.write_text(
        "\n".join(line[:5] + line[11:] if k else line for k, line in enumerate(path.read_text().splitlines())) + "\n"
    )
    with pytest.raises(DataError, match=r"line 2, column time: '5.000' may be a decimal number or one of thousands"):
        read_imu(path)
