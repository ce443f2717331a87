"""Records of aiding sensors: what is wrong is named when they are made; between samples they follow the truth."""

import numpy as np
import pandas as pd
import pytest

from truenorth.core.attitude import dcm_from_euler, quaternion_from_dcm, rotation_vector_from_dcm
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.records import (
    GnssRecord,
    HeightRecord,
    ImuRecord,
    MasterRecord,
    OdometerRecord,
    Trajectory,
    VelocityRecord,
)
from truenorth.simulation import Sway, Tone

T = np.arange(1.0, 6.0)
THREE = np.arange(15.0).reshape(5, 3)
NOWHERE = np.full(5, np.nan)
LEVEL = np.broadcast_to(np.eye(3), (5, 3, 3))


def gnss(**changes):
    values = {"time": T, "lat": 0.6 + 0 * T, "lon": 1.9 + 0 * T, "alt": 400.0 + T}
    return GnssRecord(**values | changes)


def trajectory(**changes):
    values = {"C_nb": LEVEL, "v_n": THREE, "lat": 0.6 + 0 * T, "lon": 1.9 + 0 * T, "alt": 400.0 + T}
    return Trajectory(T, **values | changes)


def put(array, index, value):
    changed = np.array(array, dtype=float)
    changed[index] = value
    return changed


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: OdometerRecord(T, put(T, 2, np.nan), source="odo.csv"), ["odo.csv: row 3, column distance: nan"]),
        (lambda: OdometerRecord(T[::-1], T), ["row 2, column time", "goes back"]),
        (lambda: OdometerRecord(T, T[:4]), ["time and values", "(5,) and (4,)", "(N,) and (N,)"]),
        (lambda: OdometerRecord(T, T, "miles"), ["kind 'miles'", "'pulses'"]),
        (lambda: OdometerRecord(T, T, "pulses"), ["pulse size of None", "give pulse_size"]),
        (lambda: OdometerRecord(T, T, "pulses", -0.1), ["pulse size of -0.1"]),
        (lambda: OdometerRecord(T, T, "speed", 0.1), ["a pulse size", "speed"]),
        (lambda: OdometerRecord(T, put(T, 1, -2), "speed", signed=False), ["row 2, column speed_unsigned: -2"]),
        (lambda: VelocityRecord(T, THREE, "sea"), ["frame 'sea'", "'body' or 'navigation'"]),
        (lambda: VelocityRecord(T, put(THREE, (1, 1), np.inf)), ["row 2, column v_forward: inf"]),
        (lambda: VelocityRecord(T, NOWHERE[:, None] + THREE), ["not one velocity"]),
        (lambda: VelocityRecord(T, THREE, "navigation", 0 * THREE), ["row 1, column sigma_VE: 0", "above zero"]),
        (lambda: gnss(lat=put(T * 0, 3, 39.9)), ["row 4, column lat: 39.9", "radians", "degrees"]),
        (lambda: gnss(lon=T * 20), ["row 1, column lon: 20", "radians"]),
        (lambda: gnss(alt=put(T, 0, -1e6)), ["row 1, column alt", "metres"]),
        (lambda: gnss(v_n=T), ["time, lat, lon, alt and v_n", "(5,) and (5,)", "(N,) and (N, 3)"]),
        (lambda: gnss(position_sigma=put(THREE + 1, (2, 1), -1)), ["row 3, column sigma_N: -1"]),
        (lambda: gnss(lat=NOWHERE), ["neither a position nor a velocity"]),
        (lambda: HeightRecord(T, put(T, 4, np.nan)), ["row 5, column alt: nan"]),
        (lambda: HeightRecord(T[:1], T[:1]), ["1 sample(s)"]),
        (lambda: trajectory(C_nb=1.001 * LEVEL), ["row 1: C_nb is no rotation", "0.002"]),
        (lambda: trajectory(C_nb=-LEVEL), ["determinant is -1"]),
        (lambda: trajectory(v_n=put(THREE, (0, 2), np.nan)), ["row 1, column VU: nan"]),
        (lambda: MasterRecord(T), ["neither attitude nor velocity"]),
        (lambda: MasterRecord(T, v_n=THREE, lat=T * 0), ["lat without lon, alt"]),
        (lambda: MasterRecord.from_quaternions(T, np.ones((5, 4))), ["row 1: a quaternion of norm 2"]),
        (lambda: MasterRecord.from_quaternions(T, np.ones((5, 3))), ["(5, 3)", "scalar first"]),
    ],
)
def test_what_is_wrong_is_named(make, words):
    with pytest.raises(DataError) as caught:
        make()
    for word in words:
        assert word in str(caught.value), caught.value


RECORDS = [
    ImuRecord(T, THREE, THREE),
    OdometerRecord(T, T, "pulses", 0.02, False),
    VelocityRecord(T, put(THREE, (slice(None), 0), np.nan), "body", THREE + 1),
    gnss(v_n=THREE, quality=T),
    HeightRecord(T, T),
    trajectory(),
    MasterRecord(T, LEVEL, w_ib_b=THREE),
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_windows_shifts_and_tables(record):
    window = record.between(2.0, 4.0)
    assert type(window) is type(record)
    assert window.time.tolist() == [2.0, 3.0, 4.0]
    pd.testing.assert_frame_equal(window.to_frame(), record.to_frame().loc[2.0:4.0])
    assert record.between(None, record.time[-1]) is record
    assert record[::1] is record
    late = record.shifted(0.25)
    assert late.time.tolist() == (T + 0.25).tolist()
    pd.testing.assert_frame_equal(late.to_frame().reset_index(drop=True), record.to_frame().reset_index(drop=True))
    with pytest.raises(DataError, match=r"fewer than two samples from 7 s to .*; the record runs from"):
        record.between(7.0)
    with pytest.raises(ValueError, match="read-only"):
        record.time[0] = 3.0


def test_the_columns_of_tables():
    names = [list(record.to_frame().columns) for record in RECORDS]
    assert names[1] == ["pulses_unsigned", "pulse_size"]
    assert names[2] == ["v_forward", "v_up", "sigma_v_forward", "sigma_v_up"]
    assert names[3] == ["lat", "lon", "alt", "VE", "VN", "VU", "quality"]
    assert names[5] == ["lat", "lon", "alt", "VE", "VN", "VU", "roll", "pitch", "heading"]
    assert names[6] == ["gyro_x", "gyro_y", "gyro_z", "roll", "pitch", "heading"]
    table = trajectory(C_nb=dcm_from_euler(T, 0.1 + 0 * T, -0.2 + 0 * T)).to_frame()
    np.testing.assert_allclose(table["heading"], np.degrees(T), rtol=1e-14)
    np.testing.assert_allclose(table["lat"], np.degrees(0.6), rtol=1e-15)


def test_distance_and_speed_of_an_odometer():
    time = np.array([1.0, 2.0, 4.0])
    pulses = OdometerRecord(time, [5, 10, -20], "pulses", 0.1)
    np.testing.assert_allclose(pulses.distance, [0.5, 1.0, -2.0])
    np.testing.assert_allclose(pulses.speed, [0.5 / 1.5, 1.0, -1.0])
    speeds = OdometerRecord(time, [2.0, 4.0, 6.0], "speed")
    np.testing.assert_allclose(speeds.distance, [3.0, 3.0, 10.0])  # of the nominal interval of 1.5 s, then trapezia


@pytest.mark.parametrize(("kind", "size"), [("distance", None), ("pulses", 0.05)])
def test_counts_from_the_start_are_no_counts_of_each_interval(kind, size):
    """A car that stands, drives and backs up; of a log of its way the speeds were thousands of m/s, and the solution ran away."""
    time = 0.1 * np.arange(2000)
    way = np.where(time > 60.0, 12.0 * np.sin(0.02 * (time - 60.0)), 0.0) * 0.1 / (size or 1.0)
    way[[500, 700]] = 1e4  # two rows that a fault of the counter has spoilt
    assert len(OdometerRecord(time, way, kind, size)) == len(time)
    way[[500, 700]] = 0.0
    for start in (0.0, 1e6):
        total = start + np.cumsum(way)
        row = 1 + np.argmax(np.abs(total * (size or 1.0)) > 40.0)
        with pytest.raises(
            DataError, match=rf"row {row}, column {kind}: .* counted from the start: call the column {kind}_total"
        ):
            OdometerRecord(time, total, kind, size)


MOTION = Sway(
    Position.from_degrees(60.0, 179.9999, 50.0),
    heading_tones=(Tone(0.3, 20.0, 0.4),),
    pitch_tones=(Tone(0.1, 15.0, 0.0),),
    roll_tones=(Tone(0.1, 12.0, 1.0),),
    east_tones=(Tone(20.0, 30.0, 0.0),),
    up_tones=(Tone(1.0, 25.0, 2.0),),
)


def pose(time, kind=Trajectory, **kept):
    at = MOTION.states(time)
    values = {"C_nb": at.C_nb, "v_n": at.v_n, "lat": at.lat, "lon": at.lon, "alt": at.alt}
    return kind(time, **(kept or values))


def test_between_samples_the_truth_is_followed():
    """The errors of interpolation are those of its order: halving the step divides them by 4, and 16 for position."""
    times = np.linspace(3.0, 37.0, 1001)
    true = MOTION.states(times)
    errors = []
    for step in (0.5, 0.25):
        at = pose(np.arange(0.0, 40.0 + step, step)).at(times)
        attitude = rotation_vector_from_dcm(at.C_nb @ np.swapaxes(true.C_nb, 1, 2))
        errors.append([np.abs(e).max() for e in (attitude, at.v_n - true.v_n, at.lon - true.lon, at.alt - true.alt)])
    ratios = np.divide(*errors)
    np.testing.assert_allclose(ratios, [4, 4, 16, 16], rtol=0.1)
    assert errors[1][0] < 0.3 * (2 * np.pi / 20) ** 2 * 0.25**2 / 8 * 2
    assert errors[1][3] < 1e-5


def test_at_its_samples_a_trajectory_keeps_its_bits():
    at = pose(np.arange(10.0))
    again = at.at(at.time)
    for name in ("v_n", "lat", "lon", "alt"):
        np.testing.assert_array_equal(getattr(again, name), getattr(at, name))
    np.testing.assert_allclose(again.C_nb, at.C_nb, atol=1e-15)


def test_longitude_goes_on_across_the_date_line():
    west = Trajectory(T, LEVEL, [30.0, 0, 0] + 0 * THREE, 0 * T, np.array([-2, -1, 0, 1, 2]) * 1e-6 + np.pi, 0 * T)
    wrapped = Trajectory(T, LEVEL, west.v_n, west.lat, np.mod(west.lon + np.pi, 2 * np.pi) - np.pi, west.alt)
    times = [1.5, 3.5, 4.5]
    difference = np.exp(1j * west.at(times).lon) - np.exp(1j * wrapped.at(times).lon)
    assert np.abs(difference).max() < 1e-15
    np.testing.assert_array_equal(wrapped.at(T).lon[:4], wrapped.lon[:4])


def test_outside_there_is_nothing():
    with pytest.raises(DataError, match=r"nothing at 5\.5.* runs from 1\.0+ s to 5\.0+ s.* clock"):
        trajectory().at([2.0, 5.5])
    with pytest.raises(DataError, match="nothing at nan"):
        trajectory().at([2.0, np.nan])


def test_a_master_with_attitude_alone_and_quaternions():
    time = np.arange(0.0, 10.0)
    C = MOTION.states(time).C_nb
    master = MasterRecord.from_quaternions(time, quaternion_from_dcm(C), source="master.csv")
    np.testing.assert_allclose(master.C_nb, C, atol=1e-14)
    at = master.at([0.5, 8.25])
    assert at.v_n is None
    assert at.lat is None
    assert at.source == "master.csv"


def test_what_a_record_with_a_gap_covers():
    time = np.array([0.0, 1.0, 2.0, 5.0, 6.0])
    master = MasterRecord(time, v_n=THREE)
    times = np.array([-0.1, 0.0, 1.5, 2.0, 3.0, 5.0, 5.5, 6.0, 6.1])
    assert master.covers(times).tolist() == [False, True, True, True, False, True, True, True, False]
    assert master.covers(times, 3.0).tolist() == [False, *[True] * 7, False]


def _three(rows=5):
    return np.arange(1.0, rows + 1), np.ones((rows, 3)), np.ones((rows, 3))


def test_what_the_caller_writes_later_is_not_the_records():
    time, gyro, accel = _three()
    record = ImuRecord(time, gyro, accel)
    gyro[:] = 7.0
    time[0] = -5.0
    assert np.all(record.gyro == 1.0)
    assert record.time[0] == 1.0


def test_a_masked_value_is_absent():
    time, gyro, accel = _three()
    masked = np.ma.masked_array(gyro, mask=np.zeros(gyro.shape, bool))
    masked[3, 1] = np.ma.masked
    with pytest.raises(DataError, match="row 4, column gyro_y: nan"):
        ImuRecord(time, masked, accel)


def test_dates_are_seconds_since_1970():
    _, gyro, accel = _three()
    time = np.datetime64("2024-03-05T10:00:00", "ns") + np.arange(5) * np.timedelta64(10, "ms")
    record = ImuRecord(time, gyro, accel)
    assert record.interval == pytest.approx(0.01, abs=1e-6)
    assert record.time[0] == 1709632800.0


@pytest.mark.parametrize(
    "wrong", [None, "text", [["a"] * 3] * 5, {"a": 1}, np.ones((5, 3), complex), object(), [[1, 2], [3]]]
)
def test_what_is_no_array_of_numbers_is_named(wrong):
    time, _, accel = _three()
    with pytest.raises(DataError, match="gyro"):
        ImuRecord(time, wrong, accel)


@pytest.mark.parametrize(("kind", "value"), [("rates", 1e200), ("rates", -2e6), ("increments", 2e6)])
def test_what_no_sensor_measures_is_refused(kind, value):
    time, gyro, accel = _three()
    gyro[2, 0] = value
    with pytest.raises(DataError, match=r"row 3, column .*_x.*check the units"):
        ImuRecord(time, gyro, accel, kind)


def test_a_record_is_shown_in_a_line():
    record = GnssRecord(
        np.array([1.0, 2.0]), *np.radians([[48.0, 48.0], [11.0, 11.0]]), np.array([5.0, 5.0]), source="g.csv"
    )
    assert repr(record) == "GnssRecord(g.csv: 2 rows, 1 to 2 s, 1 Hz; lat, lon, alt)"


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("scale", [1e300, 1e-300])
def test_times_of_no_clock_are_refused(scale, kind):
    """Squares of such intervals overflow."""
    time = np.arange(1, 11) * 0.01
    with pytest.raises(DataError, match=r"row 10, column time|row every 1e-302 s|row 1, column d"):
        ImuRecord(time * scale, np.full((10, 3), 1e-3), np.full((10, 3), 0.1), kind)
