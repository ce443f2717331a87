"""Logs of aiding sensors: what was written comes back; names, units and signs as logs have them; every fault is named."""

import numpy as np
import pytest
from scipy.io import savemat

import truenorth
from truenorth.core.attitude import dcm_from_euler, quaternion_from_dcm
from truenorth.core.errors import DataError, UsageError
from truenorth.core.position import Position
from truenorth.formats import UnsureError, read_gnss, read_master, read_odometer, read_velocity, write_record
from truenorth.records import GnssRecord, HeightRecord, MasterRecord, OdometerRecord, Trajectory, VelocityRecord

RNG = np.random.default_rng(3)
N = 40
T = 100.0 + np.arange(N) / 3
THREE = RNG.normal(size=(N, 3))
C = dcm_from_euler(RNG.uniform(0, 6.28, N), RNG.uniform(-1.5, 1.5, N), RNG.uniform(-3, 3, N))
LAT, LON, ALT = RNG.uniform(-1.5, 1.5, N), RNG.uniform(-3, 3, N), RNG.normal(size=N) * 100


def holes(values):
    return np.where(RNG.random(values.shape) < 0.2, np.nan, values)


RECORDS = {
    "odometer": [
        OdometerRecord(T, THREE[:, 0]),
        OdometerRecord(T, np.abs(THREE[:, 0]), "speed", signed=False),
        OdometerRecord(T, np.round(30 * THREE[:, 0]), "pulses", 0.0213),
        OdometerRecord(T, np.round(30 * np.abs(THREE[:, 0])), "pulses", 0.0213, signed=False),
    ],
    "velocity": [
        VelocityRecord(T, THREE),
        VelocityRecord(T, holes(THREE), "navigation", holes(np.abs(THREE))),
        VelocityRecord(T, np.where([False, True, False], THREE, np.nan)),
    ],
    "gnss": [
        GnssRecord(T, LAT, LON, ALT),
        GnssRecord(
            T, holes(LAT), LON, holes(ALT), holes(THREE), np.abs(THREE), np.abs(THREE), np.abs(THREE[:, :2]), 4 + 0 * T
        ),
        GnssRecord(T, np.full(N, np.nan), np.full(N, np.nan), np.full(N, np.nan), THREE),
    ],
    "height": [HeightRecord(T, ALT), HeightRecord(T, ALT, holes(np.abs(ALT)))],
    "master": [
        MasterRecord(T, C, THREE, LAT, LON, ALT, THREE, THREE),
        MasterRecord(T, C),
        MasterRecord(T, None, THREE, w_ib_b=THREE),
    ],
    "trajectory": [Trajectory(T, C, THREE, LAT, LON, ALT)],
}
CASES = [(kind, i) for kind, records in RECORDS.items() for i in range(len(records))]


@pytest.mark.parametrize("suffix", ["csv", "parquet", "npz"])
@pytest.mark.parametrize(("kind", "number"), CASES)
def test_what_was_written_comes_back(kind, number, suffix, tmp_path):
    record = RECORDS[kind][number]
    path = tmp_path / f"log.{suffix}"
    write_record(record, path)
    again = getattr(truenorth, f"read_{kind}")(path)
    assert type(again) is type(record)
    for name in ("kind", "pulse_size", "signed", "frame"):
        assert getattr(again, name, None) == getattr(record, name, None)
    for name in ("time", *record.groups()):
        ours, theirs = getattr(record, name), getattr(again, name)
        if ours is None:
            assert theirs is None
        elif name in ("lat", "lon", "C_nb"):  # through degrees
            np.testing.assert_allclose(theirs, ours, rtol=4e-16, atol=4e-15 if name == "C_nb" else 0)
        else:
            np.testing.assert_array_equal(theirs, ours)


def log(tmp_path, text, name="log.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "options", "factor"),
    [
        ("time,speed", {}, 1.0),
        ("t,Speed [km/h]", {}, 1 / 3.6),
        ("Time (s),wheel speed (kn)", {}, 1852 / 3600),
        ("time_s,speed_kmh", {}, 1 / 3.6),
        ("time,speed_m_s", {}, 1.0),
        ("time,speed_mps,distance_total", {}, None),
        ("time,v", {"units": "speed=km/h"}, 1 / 3.6),
        ("time,speed_kmh", {"units": {"speed": "m/s"}}, 1.0),
        ("stamp,x", {"columns": "time=stamp,speed=x", "units": "speed=0.1 m/s"}, 0.1),
        ("stamp,x", {"columns": {"time": "stamp", "speed": "-x"}}, -1.0),
    ],
)
def test_names_and_units_of_columns(header, options, factor, tmp_path):
    rows = ["1,10,0", "2,20,5", "3,-5,9"]
    width = header.count(",") + 1
    path = log(tmp_path, "\n".join([header, *(",".join(row.split(",")[:width]) for row in rows)]) + "\n")
    record = truenorth.read_odometer(path, **options)
    if factor is None:  # a counter wins over a speed, and its first row is where it stood
        assert (record.kind, record.time.tolist(), record.values.tolist()) == ("distance", [2.0, 3.0], [5.0, 4.0])
        assert truenorth.read_odometer(path, columns="speed=speed_mps").values.tolist() == [10.0, 20.0, -5.0]
        return
    assert record.time.tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(record.values, factor * np.array([10.0, 20.0, -5.0]), rtol=1e-15)


def test_a_file_next_to_the_log(tmp_path):
    path = log(tmp_path, "ms;n\n1000;7\n2000;8\n")
    log(tmp_path, "columns: {time: ms, pulses: n}\nunits: {time: ms}\npulse_size: 3 cm\nsigned: false\n", "log.yaml")
    record = truenorth.read_odometer(path)
    assert (record.time.tolist(), record.pulse_size, record.signed) == ([1.0, 2.0], 0.03, False)
    assert truenorth.read_odometer(path, pulse_size=0.5, signed=True).distance.tolist() == [3.5, 4.0]
    log(tmp_path, "colums: {time: ms}\n", "log.yaml")
    with pytest.raises(DataError, match=r"log\.yaml .*colums.*columns"):
        truenorth.read_odometer(path)


def test_velocity_in_other_axes_and_the_other_way(tmp_path):
    path = log(tmp_path, "time,v_x,v_y,v_z\n1,5,2,\n2,6,3,\n")
    record = truenorth.read_velocity(path, axes="FRD")
    np.testing.assert_array_equal(record.velocity, [[2, 5, np.nan], [3, 6, np.nan]])
    path = log(tmp_path, "time,VN,VE,VD\n1,1,2,3\n2,1,2,3\n")
    record = truenorth.read_velocity(path)
    assert record.frame == "navigation"
    assert record.velocity.tolist() == [[2, 1, -3]] * 2
    path = log(tmp_path, "time,VN,VE,v_forward\n1,1,2,3\n2,1,2,3\n")
    with pytest.raises(UsageError, match="body and navigation"):
        truenorth.read_velocity(path)
    assert truenorth.read_velocity(path, frame="body").measured.tolist() == [False, True, False]


def test_gnss_in_earth_fixed_and_local_coordinates(tmp_path):
    from truenorth.core.earth import ecef_axes, ecef_from_geodetic

    lat, lon, alt = np.radians([48.0, 48.001]), np.radians([11.0, 11.002]), np.array([500.0, 520.0])
    v_n = np.array([[3.0, -4.0, 1.0], [1.0, 2.0, -0.5]])
    axes = ecef_axes(lat, lon)
    place, speed = ecef_from_geodetic(lat, lon, alt), np.einsum("kij,kj->ki", axes, v_n)
    names = [f"{kind}{axis}" for kind in ("ecef_", "ecef_v", "sigma_ecef_", "sigma_ecef_v") for axis in "xyz"]
    table = np.column_stack([[1.0, 2.0], place, speed, np.tile([2.0, 2, 2, 0, 0.1, 0.1], (2, 1))])
    np.savetxt(tmp_path / "e.csv", table, "%.17g", ",", header=",".join(["time", *names]), comments="")
    record = truenorth.read_gnss(tmp_path / "e.csv")
    np.testing.assert_allclose(record.lat, lat, rtol=1e-15)
    np.testing.assert_allclose(record.lon, lon, rtol=1e-15)
    np.testing.assert_allclose(record.alt, alt, atol=2e-9)
    np.testing.assert_allclose(record.v_n, v_n, atol=1e-14)
    np.testing.assert_allclose(record.position_sigma, 2.0, rtol=1e-14)
    assert np.isnan(record.velocity_sigma).all(axis=1).all()  # one unknown axis leaves all three of n unknown

    origin = Position.from_degrees(48.0, 11.0, 500.0)
    away = (place - place[0]) @ axes[0]
    np.savetxt(
        tmp_path / "l.csv", np.column_stack([[1, 2], away * [1, 1, -1]]), "%.17g", ",", header="t,pos_e,pos_n,down"
    )
    with pytest.raises(UsageError, match="without an origin"):
        truenorth.read_gnss(tmp_path / "l.csv")
    local = truenorth.read_gnss(tmp_path / "l.csv", origin=origin)
    np.testing.assert_allclose(local.lat, lat, atol=1e-15)
    np.testing.assert_allclose(local.lon, lon, atol=1e-15)
    np.testing.assert_allclose(local.alt, alt, atol=5e-9)


def test_gnss_with_speed_and_course_gaps_and_no_fix(tmp_path):
    text = "time,lat,lon,alt,speed_kmh,course,fix,hdop\n1,48,11,,36,90,1,1.2\n2,48,11,400,0,,1,\n3,0,0,0,9,9,0,\n4,,,,,,1,0\n"
    record = truenorth.read_gnss(log(tmp_path, text))
    assert record.has_position.tolist() == [True, True, False, False]
    assert record.has_velocity.tolist() == [True, True, False, False]
    np.testing.assert_allclose(record.v_n[:2, :2], [[10, 0], [0, 0]], atol=1e-14)
    assert np.isnan(record.dop[1:]).all()


def test_a_master_with_yaw_the_other_way_and_quaternions(tmp_path):
    heading, pitch, roll = np.radians([350.0, 10.0]), np.radians([3.0, -4.0]), np.radians([1.0, 170.0])
    C_nb = dcm_from_euler(heading, pitch, roll)
    table = np.column_stack([[1, 2], -np.degrees(heading), np.degrees(pitch), np.degrees(roll)])
    np.savetxt(tmp_path / "y.csv", table, "%.17g", ",", header="time,yaw_ccw,pitch,roll")
    np.testing.assert_allclose(truenorth.read_master(tmp_path / "y.csv").C_nb, C_nb, atol=1e-15)
    table = np.column_stack([[1, 2], quaternion_from_dcm(C_nb), [[1, 2, 3], [4, 5, 6]]])
    np.savetxt(tmp_path / "q.csv", table, "%.17g", ",", header="time,q_w,q_x,q_y,q_z,gyro_x,gyro_y,gyro_z")
    record = truenorth.read_master(tmp_path / "q.csv", axes="FRD")
    np.testing.assert_allclose(record.C_nb, C_nb, atol=1e-15)
    assert record.w_ib_b.tolist() == [[2, 1, -3], [5, 4, -6]]


def test_arrays_by_name(tmp_path):
    gnss = np.column_stack([T, LAT, LON, ALT, THREE])
    columns = {"time": "gps[0]", "lat": "gps[1]", "lon": "gps[2]", "alt": "gps[3]"}
    columns |= {"VN": "gps[4]", "VE": "gps[5]", "VU": "-gps[6]"}
    np.savez(tmp_path / "a.npz", gps=gnss, imu=np.ones((5, 3)), words=np.array("text"))
    savemat(tmp_path / "a.mat", {"gps": gnss, "imu": np.ones((5, 3))})
    for name in ("a.npz", "a.mat"):
        record = truenorth.read_gnss(tmp_path / name, columns=columns, units="position=rad")
        np.testing.assert_array_equal(record.lat, LAT)
        np.testing.assert_array_equal(record.v_n, THREE[:, [1, 0, 2]] * [1, 1, -1])
        with pytest.raises(DataError, match=r"different length \(time 40, imu\[1\] 5"):
            truenorth.read_gnss(tmp_path / name, columns={"time": "gps[0]", "lat": "imu[1]", "lon": "imu[2]"})


ODO = "time,speed\n1,2\n2,3\n"


@pytest.mark.parametrize(
    ("reader", "text", "options", "words"),
    [
        ("odometer", "time,speed\n1,2\n2,x\n", {}, ["line 3, column speed: 'x'", "expected a number"]),
        ("odometer", "time,speed\n1,2\n2,\n", {}, ["line 3, column speed: nan", "finite"]),
        ("odometer", "time,speed\n1,2\n\n1,3\n", {}, ["line 4, column time", "repeats"]),
        ("odometer", "time,speed\n1,2\n2\n3,4\n5,6\n", {}, ["line 3: 1 columns", "expected 2"]),
        ("odometer", "speed,x\n1,2\n2,3\n", {}, ["no column of time among speed, x", "name it, in the call"]),
        ("odometer", "time,x\n1,2\n2,3\n", {}, ["expected time and one of pulses", "understood only time"]),
        (
            "odometer",
            "time,speed,v\n1,2,3\n2,3,4\n",
            {},
            ["'speed' and 'v' are both speed", "say which, columns: {speed: ...}"],
        ),
        ("odometer", "time,pulses\n1,2\n2,3\n", {}, ["pulses without their size", "'2 cm'"]),
        ("odometer", "time,pulses,pulse_size\n1,2,1\n2,3,2\n", {}, ["pulse_size", "one size"]),
        ("odometer", ODO, {"units": "speed=deg"}, ["column speed", "cannot be in 'deg'", "speed"]),
        ("odometer", "time,speed [furlong]\n1,2\n2,3\n", {}, ["speed [furlong]", "'furlong'", "not known"]),
        ("odometer", ODO, {"units": "sped=km/h"}, ["units", "'sped'", "'speed'"]),
        ("odometer", ODO, {"units": "km/h"}, ["units are", "pairs such as"]),
        ("odometer", ODO, {"columns": {"speed": "Sped"}}, ["column 'Sped' is missing", "is it 'speed'?"]),
        ("odometer", ODO, {"columns": {"velo": "speed"}}, ["columns: key 'velo' is not known"]),
        ("odometer", "1,2\n2,3\n", {}, ["numbers, and no header of names", "time,pulses"]),
        ("odometer", "", {}, ["empty", "log of named columns"]),
        ("odometer", ODO, {"format": "psins"}, ["format 'psins'", "choose one of csv, parquet, feather, npz, mat"]),
        ("odometer", ODO, {"format": "npz"}, ["read as npz"]),
        ("velocity", ODO.replace("speed", "x"), {}, ["v_forward", "VE, VN, VU"]),
        ("velocity", "time,v_forward\n1,\n2,\n", {}, ["not one velocity"]),
        ("velocity", ODO.replace("speed", "v_x"), {"axes": "FFD"}, ["two letters lie along one axis"]),
        ("gnss", ODO, {}, ["expected time and lat, lon, alt"]),
        (
            "gnss",
            "time,lat,lon\n1,48,11\n2,-95,110\n",
            {},
            ["line 3, column lat: -95 deg; expected -90 to 90 deg", "latitude"],
        ),
        (
            "gnss",
            "time,lat,lon\n1,48,11\n2,48,511\n",
            {},
            ["line 3, column lon: 511 deg; expected -360 to 360", "longitude"],
        ),
        (
            "gnss",
            "t;B;L\n1;116.3;39.9\n2;116.3;39.9\n",
            {"columns": "lat=B,lon=L"},
            [
                "line 2, column B: 116.3 deg",
                "column L stays within 39.9 deg",
                "exchanged",
                "columns: {lat: 'L', lon: 'B'}",
                "log.yaml",
            ],
        ),
        (
            "gnss",
            "time,lat,lon\n1,48,11\n2,48,11\n",
            {"units": "position=rad"},
            [
                "line 2, column lat: 48 rad; expected -1.5708 to 1.5708 rad",
                "look like degrees",
                "units: {position: deg}",
            ],
        ),
        ("gnss", "time,lat [rad],lon [rad]\n1,4.8e8,11\n2,48,11\n", {}, ["480000000 rad", "check the unit"]),
        (
            "gnss",
            "time,lat,lon\n1,481234567,112345678\n2,481234568,112345679\n",
            {},
            ["whole numbers", "position: 1e-07 deg"],
        ),
        ("gnss", "time,lat,lon\n1,4807.038,1131.2\n2,4807.039,1131.2\n", {}, ["degrees and minutes (ddmm.mmmm)"]),
        (
            "master",
            "time,VE,VN,VU,lat,lon,alt\n1,2,3,4,95,11,0\n2,2,3,4,5,6,7\n",
            {},
            ["line 2, column lat: 95 deg", "seem exchanged"],
        ),
        ("height", ODO, {}, ["expected time and alt"]),
        ("height", "time,alt\n1,2\n2,\n", {}, ["line 3, column alt: nan"]),
        ("master", "time,heading,roll\n1,2,3\n2,3,4\n", {}, ["heading, pitch, roll without pitch"]),
        ("master", "time,lat,lon,alt\n1,2,3,4\n2,3,4,5\n", {}, ["attitude (heading, pitch, roll) or velocity"]),
        ("master", "time,VE,VN,VU\n1,2,,4\n2,3,4,5\n", {}, ["line 2, column VN: nan"]),
        ("master", "time,qw,qx,qy,qz\n1,1,0,0,0\n2,1,1,0,0\n", {}, ["line 3: a quaternion of norm 1.41421"]),
        ("trajectory", "time,VE,VN,VU,roll,pitch,heading\n1,2,3,4,5,6,7\n2,2,3,4,5,6,7\n", {}, ["lat, lon, alt"]),
    ],
)
def test_every_fault_is_named(reader, text, options, words, tmp_path):
    path = log(tmp_path, text)
    with pytest.raises((DataError, UsageError)) as caught:
        getattr(truenorth, f"read_{reader}")(path, **options)
    for word in words:
        assert word in str(caught.value), caught.value
    assert "\n" not in str(caught.value)


def test_paths(tmp_path):
    with pytest.raises(UsageError, match="No such file"):
        truenorth.read_gnss(tmp_path / "none.csv")
    with pytest.raises(UsageError, match="a folder"):
        truenorth.read_height(tmp_path)
    with pytest.raises(DataError, match="expected time and alt"):
        truenorth.read_height(log(tmp_path, "time,word\n1,2\n2,3\n", "log.dat"))
    path = tmp_path / "log.csv"
    write_record(RECORDS["height"][0], tmp_path / "a.parquet")
    (tmp_path / "a.parquet").rename(path)
    with pytest.raises(DataError, match="holds parquet data"):
        truenorth.read_height(path)


T60 = np.arange(60.0)


def rows_of(tmp_path, header, *columns, name="log.csv"):
    path = tmp_path / name
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.12g")
    return path


@pytest.mark.parametrize(("apart", "unit"), [(1e3, "ms"), (1e6, "us"), (200.0, "ms")])
def test_a_clock_without_a_unit_is_asked_for(apart, unit, tmp_path):
    """Rows a thousand seconds apart, or milliseconds: of fixes the way between them may tell, of a speed nothing does."""
    path = rows_of(tmp_path, "timestamp,speed", apart * T60, 5.0 + 0 * T60)
    with pytest.raises(UnsureError, match=rf"seconds, or {unit}\? .*units: {{time: {unit}}} or units: {{time: s}}"):
        read_odometer(path)
    assert read_odometer(path, units=f"time={unit}").duration == pytest.approx(
        60 * apart * {"ms": 1e-3, "us": 1e-6}[unit]
    )
    assert len(read_odometer(path, units="time=s")) == 60
    assert len(read_odometer(rows_of(tmp_path, "time_ms,speed", apart * T60, 5.0 + 0 * T60))) == 60
    ship = rows_of(tmp_path, "time,lat,lon,alt", 600.0 * T60, 20.0 + 0.02 * T60, 115 + 0.01 * T60, 0 * T60)
    assert read_gnss(ship).interval == 600.0  # 4 m/s, and not 4 km/s


def test_places_near_zero_may_be_radians(tmp_path):
    car = 48.1 + 1e-5 * T60, 11.5 + 2e-5 * T60, 500.0 + 0 * T60
    path = rows_of(tmp_path, "time,lat,lon,alt", T60, *np.radians(car[:2]), car[2])
    with pytest.raises(
        UnsureError, match=r"degrees south of Ghana, or radians of lat 48\.100, lon 11\.500 deg.*position: rad"
    ):
        read_gnss(path)
    assert np.degrees(read_gnss(path, units="position=rad").lat[0]) == pytest.approx(48.1)
    assert np.degrees(read_gnss(path, units="position=deg").lat[0]) == pytest.approx(np.radians(48.1))
    ship = rows_of(tmp_path, "time,lat,lon,alt", 60.0 * T60, 1.0 + 0.01 * T60, 2.0 + 0.01 * T60, 0 * T60)
    assert np.degrees(read_gnss(ship).lat[0]) == pytest.approx(1.0)  # 26 m/s, and not 1.5 km/s
    moored = rows_of(tmp_path, "time,lat,lon,alt", T60, 1.23456 + 0 * T60, 2.0 + 0 * T60, 0 * T60)
    assert np.degrees(read_gnss(moored).lat[0]) == pytest.approx(1.23456)  # as radians in steps of 64 m


def test_a_vehicle_that_goes_along_x_is_asked_for_its_axes(tmp_path):
    path = rows_of(tmp_path, "time,vx,vy,vz", T60, 5.0 + 0 * T60, 0.1 + 0 * T60, 0 * T60)
    with pytest.raises(UnsureError, match=r"along x .*axes: FRD or axes: FLU or axes: RFU"):
        read_velocity(path)
    np.testing.assert_allclose(read_velocity(path, axes="FLU").velocity, np.tile([-0.1, 5.0, 0.0], (60, 1)))
    np.testing.assert_allclose(read_velocity(path, axes="RFU").velocity[:, 0], 5.0)
    forward = rows_of(tmp_path, "time,vx,vy,vz", T60, 0.1 + 0 * T60, 5.0 + 0 * T60, 0 * T60)
    np.testing.assert_allclose(read_velocity(forward).velocity[:, 1], 5.0)


def test_a_yaw_is_asked_which_way_it_counts(tmp_path):
    path = rows_of(tmp_path, "time,yaw,pitch,roll", T60, 30.0 + 0 * T60, 2.0 + 0 * T60, 3.0 + 0 * T60)
    with pytest.raises(UnsureError, match=r"columns: \{heading: yaw\} or columns: \{heading: -yaw\}"):
        read_master(path)
    for name, heading in (("yaw", 30.0), ("-yaw", -30.0)):
        C = read_master(path, columns=f"heading={name}").C_nb[0]
        assert np.degrees(np.arctan2(C[0, 1], C[1, 1])) == pytest.approx(heading)


def test_a_course_beyond_all_numbers_is_named(tmp_path):
    """1e490 is infinite: its sine warned, and the row passed for one without a velocity."""
    path = tmp_path / "gnss.csv"
    rows = [f"{k},48.0,11.0,500.0,1.0,{'1e490' if k == 2 else '10'}" for k in range(5)]
    path.write_text("\n".join(["time,lat,lon,alt,speed,course", *rows]))
    with pytest.raises(DataError, match=r"row 3, column VE: inf"):
        read_gnss(path)


@pytest.mark.parametrize(
    "names",
    ["sd_e,sd_n,sd_u", "SDE,SDN,SDU", "std_east,std_north,std_up", "sigma E,sigma N,sigma D", "e-std,n-std,u-std"],
)
def test_standard_deviations_by_their_usual_names(tmp_path, names):
    """They were passed over without a word: of a receiver that said how good its fixes are nobody listened."""
    path = tmp_path / "gps.csv"
    path.write_text(f"time,lat,lon,alt,{names}\n" + "".join(f"{k},48,11,500,1.5,2.5,3.5\n" for k in range(5)))
    np.testing.assert_array_equal(read_gnss(path).position_sigma, np.tile([1.5, 2.5, 3.5], (5, 1)))
