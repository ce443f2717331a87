"""Logs of devices, written by the decoders' own encoders where they have one, read back as the truth they hold."""

import struct
import zlib
from types import SimpleNamespace

import numpy as np
import pytest

from tests.formats.corpus.truth import truth
from truenorth.core.errors import DataError, TruenorthError
from truenorth.formats import read_gnss, read_imu, read_trajectory, write_layout
from truenorth.formats.magnetometer import read_magnetometer

SWAY = truth("swaying", "tactical", 100.0, 10.0)
TIME = SWAY.time
TOW = 208800.0
LAT, LON, ALT = 48.1, 11.5, 500.0
# T by m/s^2: a field of the earth's size that turns as gravity does, which is enough to see axes
FIELD_OF_FORCE = 4.8e-6
FIELD = SWAY.accel * FIELD_OF_FORCE
SBF_HOME = {"Latitude": np.radians(LAT), "Longitude": np.radians(LON), "Height": ALT, "Vn": 1.0, "Ve": 2.0, "Vu": -0.5}
FRD = lambda v: v[:, [1, 0, 2]] * [1.0, 1.0, -1.0]  # noqa: E731


def assert_is_sway(record, atol_gyro, atol_accel, start):
    assert len(record) == len(TIME)
    np.testing.assert_allclose(record.time - start, TIME, atol=1e-4)
    np.testing.assert_allclose(record.gyro, SWAY.gyro, atol=atol_gyro)
    np.testing.assert_allclose(record.accel, SWAY.accel, atol=atol_accel)


def assert_is_field(record, every=10):
    np.testing.assert_allclose(record.time, TIME[::every], atol=1e-4)
    np.testing.assert_allclose(record.field, FIELD[::every], atol=1e-7)


def assert_is_at_home(record, count, velocity=(2.0, 1.0, -0.5)):
    assert len(record) == count
    np.testing.assert_allclose(np.degrees(record.lat), LAT, atol=1e-6)
    np.testing.assert_allclose(np.degrees(record.lon), LON, atol=1e-6)
    np.testing.assert_allclose(record.alt, ALT, atol=1e-3)
    np.testing.assert_allclose(record.v_n[:, : len(velocity)], np.tile(velocity, (count, 1)), atol=2e-2)


def ubx_bytes(pyubx2, log=SWAY):
    parts = []
    for k, t in enumerate(log.time):
        if k % 20 == 0:
            fix = pyubx2.UBXMessage(
                "NAV", "NAV-PVT", pyubx2.GET, iTOW=round((TOW + t) * 1e3), lat=LAT, lon=LON, height=500000, velE=2000,
                velN=1000, velD=500, hAcc=1000, vAcc=2000, sAcc=100, fixType=3,
            )  # fmt: skip
            parts.append(fix.serialize())
        counts = [*np.degrees(log.gyro[k]) * 2**12, *log.accel[k] * 2**10]
        words = [kind << 24 | round(value) % (1 << 24) for kind, value in zip((14, 13, 5, 16, 17, 18), counts)]
        payload = bytes(4) + b"".join(struct.pack("<II", word, k * 256) for word in words)
        parts.append(pyubx2.UBXMessage("ESF", "ESF-RAW", pyubx2.GET, payload=payload).serialize())
    return parts


def test_ublox(tmp_path):
    path = tmp_path / "log.ubx"
    path.write_bytes(b"".join(ubx_bytes(pytest.importorskip("pyubx2"))))
    record = read_imu(path)
    assert_is_sway(record, 1e-5, 1e-3, record.time[0] - TIME[0])
    assert abs(record.time[0] - TOW - TIME[0]) < 0.11  # the clock is known to the spacing of the fixes
    fixes = read_gnss(path)
    assert_is_at_home(fixes, 50)
    np.testing.assert_allclose(fixes.position_sigma[0], [0.7071, 0.7071, 2.0], atol=1e-3)


@pytest.mark.parametrize("moving", [1, 0])
def test_ublox_with_two_antennas(tmp_path, moving):
    """A moving base's heading; that of a base which stays is where the vehicle is from there, and no heading."""
    pyubx2 = pytest.importorskip("pyubx2")
    parts = []
    for k in range(10):
        tow = round((TOW + k) * 1e3)
        fix = {"lat": LAT, "lon": LON, "height": 500000, "velE": 2000, "velN": 1000, "velD": 500, "fixType": 3}
        pair = {"relPosHeading": 123.4, "accHeading": 0.2, "gnssFixOK": 1, "relPosHeadingValid": int(k != 4)}
        parts.append(pyubx2.UBXMessage("NAV", "NAV-PVT", pyubx2.GET, iTOW=tow, **fix, hAcc=1000, vAcc=2000, sAcc=100))
        parts.append(
            pyubx2.UBXMessage("NAV", "NAV-RELPOSNED", pyubx2.GET, version=1, iTOW=tow, isMoving=moving, **pair)
        )
    (path := tmp_path / "log.ubx").write_bytes(b"".join(message.serialize() for message in parts))
    record = read_gnss(path)
    assert_is_at_home(record, 10)
    if not moving:
        assert record.heading is None
        return
    assert np.flatnonzero(np.isnan(record.heading)).tolist() == [4]
    np.testing.assert_allclose(np.degrees(np.delete(record.heading, 4)), 123.4)
    np.testing.assert_allclose(np.degrees(np.delete(record.heading_sigma, 4)), 0.2)
    path.write_bytes(b"".join(message.serialize() for message in parts[1::2]))
    alone = read_gnss(path)
    assert len(alone) == 9
    assert not alone.has_position.any()


def test_septentrio(tmp_path):
    pysbf2 = pytest.importorskip("pysbf2")
    path = tmp_path / "log.sbf"
    with path.open("wb") as file:
        for k in range(10):
            fix = {"TOW": round(TOW * 1e3) + 1000 * k, "WNc": 2300}
            file.write(pysbf2.SBFMessage("PVTGeodetic", Error=0, **fix, **SBF_HOME).serialize())
            file.write(
                pysbf2.SBFMessage("PosCovGeodetic", **fix, Cov_latlat=4.0, Cov_lonlon=1.0, Cov_hgthgt=9.0).serialize()
            )
    record = read_gnss(path)
    assert_is_at_home(record, 10)
    np.testing.assert_allclose(record.position_sigma, np.tile([1.0, 2.0, 3.0], (10, 1)))
    assert record.time[0] == TOW
    with pytest.raises(DataError, match="no rates and specific forces in this sbf log; found positions"):
        read_imu(path)


def test_septentrio_earth_fixed_with_two_antennas(tmp_path):
    """As receivers write that are set to PVTCartesian; sigmas are turned into east, north, up."""
    pysbf2 = pytest.importorskip("pysbf2")
    from truenorth.core.earth import ecef_axes, ecef_from_geodetic

    home, C = ecef_from_geodetic(np.radians(LAT), np.radians(LON), ALT), ecef_axes(np.radians(LAT), np.radians(LON))
    velocity = C @ [2.0, 1.0, -0.5]
    with (path := tmp_path / "log.sbf").open("wb") as file:
        for k in range(10):
            fix = {"TOW": round(TOW * 1e3) + 1000 * k, "WNc": 2300}
            place = {**dict(zip("XYZ", map(float, home))), **dict(zip(("Vx", "Vy", "Vz"), map(float, velocity)))}
            file.write(pysbf2.SBFMessage("PVTCartesian", Error=0, **fix, **place).serialize())
            file.write(pysbf2.SBFMessage("PosCovCartesian", **fix, Cov_xx=4.0, Cov_yy=4.0, Cov_zz=4.0).serialize())
            file.write(pysbf2.SBFMessage("AttEuler", Error=0, **fix, Heading=123.0, Pitch=0.0, Roll=0.0).serialize())
            file.write(pysbf2.SBFMessage("AttCovEuler", **fix, Cov_HeadHead=0.04).serialize())
    record = read_gnss(path)
    assert_is_at_home(record, 10)
    np.testing.assert_allclose(record.position_sigma, 2.0, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(record.heading), 123.0, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(record.heading_sigma), 0.2, rtol=1e-5)


def ulog_bytes(log=SWAY):
    """A ULog as PX4 writes it: header, flags, formats, subscriptions, data."""

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    parts.append(message("F", b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;"))
    parts.append(message("F", b"vehicle_magnetometer:uint64_t timestamp;float[3] magnetometer_ga;"))
    parts.append(message("F", b"sensor_gps:uint64_t timestamp;double latitude_deg;double longitude_deg;double altitude_ellipsoid_m;"
                         b"float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;float eph;float epv;uint8_t fix_type;"))  # fmt: skip
    parts += [
        message("A", struct.pack("<BH", 0, 0) + b"sensor_combined"),
        message("A", struct.pack("<BH", 0, 1) + b"sensor_gps"),
    ]
    parts.append(message("A", struct.pack("<BH", 0, 2) + b"vehicle_magnetometer"))
    gyro, accel, gauss = FRD(log.gyro), FRD(log.accel), FRD(log.accel) * FIELD_OF_FORCE * 1e4
    for k, t in enumerate(log.time):
        if k % 10 == 0:
            parts.append(message("D", struct.pack("<HQ3f", 2, round(t * 1e6), *gauss[k])))
        parts.append(message("D", struct.pack("<HQ6f", 0, round(t * 1e6), *gyro[k], *accel[k])))
        if k % 100 == 0:
            values = (LAT, LON, ALT, 1.0, 2.0, 0.5, 1.0, 2.0, 3)
            parts.append(message("D", struct.pack("<HQ3d5fB", 1, round(t * 1e6), *values)))
    return b"".join(parts)


def dataflash_bytes(log=SWAY):
    """A DataFlash log as ArduPilot writes it: formats, then messages."""

    def form(kind, length, name, types, names):
        return struct.pack("<BBBBB4s16s64s", 0xA3, 0x95, 0x80, kind, length, name, types, names)

    parts = [form(0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    parts.append(form(0x81, 3 + 8 + 1 + 24, b"IMU", b"QBffffff", b"TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"))
    parts.append(form(0x82, 3 + 8 + 2 + 8 + 4 + 12, b"GPS", b"QBBLLefff", b"TimeUS,I,Status,Lat,Lng,Alt,Spd,GCrs,VZ"))
    parts.append(form(0x83, 3 + 8 + 1 + 12 + 1, b"MAG", b"QBfffB", b"TimeUS,I,MagX,MagY,MagZ,Health"))
    gyro, accel, mgauss = FRD(log.gyro), FRD(log.accel), FRD(log.accel) * FIELD_OF_FORCE * 1e7
    for k, t in enumerate(log.time):
        if k % 10 == 0:
            for i in (0, 1):  # a second compass, which is not read
                parts.append(struct.pack("<BBBQB3fB", 0xA3, 0x95, 0x83, round(t * 1e6), i, *mgauss[k] * (1 - 2 * i), 1))
        parts.append(struct.pack("<BBBQB6f", 0xA3, 0x95, 0x81, round(t * 1e6), 0, *gyro[k], *accel[k]))
        if k % 100 == 0:
            course = np.degrees(np.arctan2(2.0, 1.0))
            values = (0, 3, round(LAT * 1e7), round(LON * 1e7), round(ALT * 100), np.hypot(1, 2), course, 0.5)
            parts.append(struct.pack("<BBBQBBiiifff", 0xA3, 0x95, 0x82, round(t * 1e6), *values))
    return b"".join(parts)


def old_dataflash_bytes(log=SWAY):
    """As ArduPilot wrote before version 3.3: ms, and of GPS the time of week first and the board's last."""

    def form(kind, length, name, types, names):
        return struct.pack("<BBBBB4s16s64s", 0xA3, 0x95, 0x80, kind, length, name, types, names)

    parts = [form(0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")]
    parts.append(form(0x81, 3 + 4 + 24, b"IMU", b"Iffffff", b"TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"))
    parts.append(form(0x82, 3 + 5 + 8 + 4 + 12 + 4, b"GPS", b"BILLefffI", b"Status,TimeMS,Lat,Lng,Alt,Spd,GCrs,VZ,T"))
    parts.append(form(0x83, 3 + 4 + 12 + 1, b"MAG", b"IfffB", b"TimeMS,MagX,MagY,MagZ,Health"))
    gyro, accel, mgauss = FRD(log.gyro), FRD(log.accel), FRD(log.accel) * FIELD_OF_FORCE * 1e7
    for k, t in enumerate(log.time):
        at = round(t * 1e3)
        if k % 10 == 0:
            parts.append(struct.pack("<BBBI3fB", 0xA3, 0x95, 0x83, at, *mgauss[k], 1))
        parts.append(struct.pack("<BBBI6f", 0xA3, 0x95, 0x81, at, *gyro[k], *accel[k]))
        if k % 100 == 0:
            course = np.degrees(np.arctan2(2.0, 1.0))
            values = (round(LAT * 1e7), round(LON * 1e7), round(ALT * 100), np.hypot(1, 2), course, 0.5)
            parts.append(struct.pack("<BBBBIiiifffI", 0xA3, 0x95, 0x82, 3, 345600000 + at, *values, at))
    return b"".join(parts)


def test_messages_of_a_flight_controller_without_a_time_are_named(tmp_path):
    pytest.importorskip("pymavlink")
    (path := tmp_path / "old.bin").write_bytes(old_dataflash_bytes().replace(b"GCrs,VZ,T", b"GCrs,VZ,X"))
    with pytest.raises(DataError, match=r"messages GPS have no time of the board among .*TimeMS.*expected TimeUS"):
        read_gnss(path)


@pytest.mark.parametrize(
    ("module", "name", "content"),
    [
        ("pyulog", "log.ulg", ulog_bytes),
        ("pymavlink", "00000001.bin", dataflash_bytes),
        ("pymavlink", "old.bin", old_dataflash_bytes),
    ],
    ids=["px4", "ardupilot", "ardupilot before 3.3"],
)
def test_flight_controllers(tmp_path, module, name, content):
    pytest.importorskip(module)
    path = tmp_path / name
    path.write_bytes(content())
    assert_is_sway(read_imu(path), 1e-6, 1e-5, 0.0)
    assert_is_at_home(read_gnss(path), 10)
    assert_is_field(read_magnetometer(path))
    write_layout(read_imu(path), path)  # which all its readers then obey, or pass over where it is the IMU's
    assert_is_sway(read_imu(path), 1e-6, 1e-5, 0.0)
    assert_is_at_home(read_gnss(path), 10)
    assert_is_field(read_magnetometer(path))
    layout = path.with_suffix(".yaml")
    layout.write_text(layout.read_text() + "wrong: 1\n")
    with pytest.raises(DataError, match="'wrong' is not known"):
        read_gnss(path)


def write_tlog(path, mavutil, log=SWAY):
    """HIGHRES_IMU and GPS_RAW_INT, each with its stamp, as ground stations write them."""
    link = mavutil.mavlink.MAVLink(SimpleNamespace(write=lambda _: None), srcSystem=1, srcComponent=1)
    gyro, accel, gauss = FRD(log.gyro), FRD(log.accel), FRD(log.accel) * FIELD_OF_FORCE * 1e4
    with path.open("wb") as file:

        def write(message, t):
            file.write(struct.pack(">Q", 1_700_000_000_000_000 + round(t * 1e6)) + message.pack(link))

        for k, t in enumerate(log.time):
            held = gauss[k // 10 * 10]  # the board sends its last reading again
            write(link.highres_imu_encode(round(t * 1e6), *accel[k], *gyro[k], *held, 0, 0, 0, 0, 511), t)
            if k % 100 == 0:
                course = round(np.degrees(np.arctan2(2.0, 1.0)) * 100)
                place = (round(LAT * 1e7), round(LON * 1e7), round(ALT * 1e3))
                write(
                    link.gps_raw_int_encode(
                        round(t * 1e6), 3, *place, 100, 100, round(np.hypot(1, 2) * 100), course, 9
                    ),
                    t,
                )


def test_mavlink(tmp_path):
    mavutil = pytest.importorskip("pymavlink.mavutil")
    path = tmp_path / "log.tlog"
    write_tlog(path, mavutil)
    assert_is_sway(read_imu(path), 1e-6, 1e-5, 0.0)
    assert_is_at_home(read_gnss(path), 10, (2.0, 1.0))
    assert_is_field(read_magnetometer(path))


def novatel_line(name, body, tow, form="cdba"):
    """An ASCII log with its checksum, as an OEM7 receiver writes it; RAWIMUS has a short header."""
    short = name.startswith("RAWIMUS")
    head = (
        f"{name},2300,{tow:.3f};" if short else f"{name},COM1,0,55.0,FINESTEERING,2300,{tow:.3f},02000020,{form},16809;"
    )
    text = head + body
    return f"{'%' if short else '#'}{text}*{novatel_crc(text.encode()):08x}\r\n"


def novatel_crc(content):
    """CRC-32 that begins with zero and ends without a complement."""
    return zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF


@pytest.mark.parametrize("forms", [("cdba",) * 3, ("b1f6", "0141", "471d")], ids=["since 2020", "before"])
def test_novatel(tmp_path, forms):
    """Older firmware calls the height above mean sea level ``height``: its messages have other sums of their definitions."""
    pytest.importorskip("novatel_edie")
    path = tmp_path / "log.gps"
    place, errors = f"{LAT},{LON},{ALT - 45.0},45.0", ",".join(["0.1"] * 9)
    course = f"{np.hypot(1, 2)},{np.degrees(np.arctan2(2, 1))}"
    lines = []
    for k in range(10):
        fix = f'SOL_COMPUTED,SINGLE,{place},WGS84,2.0,1.0,3.0,"",0.0,0.0,12,12,12,0,00,06,00,33'
        lines.append(novatel_line("BESTPOSA", fix, TOW + k, forms[0]))
        lines.append(
            novatel_line("BESTVELA", f"SOL_COMPUTED,DOPPLER_VELOCITY,0.15,0.0,{course},-0.5,0.0", TOW + k, forms[1])
        )
        ins = f"INS_SOLUTION_GOOD,INS_RTKFIXED,{place},1.0,2.0,-0.5,1.5,-0.7,123.0,{errors},0,0"
        lines.append(novatel_line("INSPVAXA", ins, TOW + k, forms[2]))
    path.write_text("".join(lines))
    record = read_gnss(path)
    assert_is_at_home(record, 10)
    np.testing.assert_allclose(record.position_sigma, np.tile([1.0, 2.0, 3.0], (10, 1)))
    assert record.time[0] == TOW
    solution = read_trajectory(path)
    assert_is_at_home(solution, 10)


@pytest.mark.parametrize("of_place", ["7145", "b1f6", "cdba"])
@pytest.mark.parametrize("of_velocity", ["0141", "8c02", "10a2"])
def test_novatel_of_older_firmware(tmp_path, of_place, of_velocity):
    """Fields have other names there: logs were refused as damaged, or had no velocity."""
    pytest.importorskip("novatel_edie")
    place, course = f"{LAT},{LON},{ALT - 45.0},45.0", f"{np.hypot(1, 2)},{np.degrees(np.arctan2(2, 1))}"
    fix = f'SOL_COMPUTED,SINGLE,{place},WGS84,2.0,1.0,3.0,"",0.0,0.0,12,12,12,0,00,06,00,33'
    lines = []
    for k in range(5):
        lines.append(novatel_line("BESTPOSA", fix, TOW + k, of_place))
        moved = f"{'SOL_COMPUTED' if k else 'INSUFFICIENT_OBS'},DOPPLER_VELOCITY,0.15,0.0,{course},-0.5,0.0"
        lines.append(novatel_line("BESTVELA", moved, TOW + k, of_velocity))
    path = tmp_path / "log.gps"
    path.write_text("".join(lines))
    record = read_gnss(path)
    np.testing.assert_allclose(record.alt, ALT)
    np.testing.assert_allclose(record.v_n[1:], np.tile([2.0, 1.0, -0.5], (4, 1)), atol=1e-6)
    assert np.isnan(record.v_n[0]).all()


@pytest.mark.parametrize("definition", ["46eb", "471d", "4e14"])
def test_heights_of_novatels_solutions_are_above_the_ellipsoid(tmp_path, definition):
    """INSPVAX counts from mean sea level and brings the undulation, INSPVA from the ellipsoid. Those of other kinds are no rows."""
    pytest.importorskip("novatel_edie")
    sea, errors = f"{LAT},{LON},{ALT - 45.0},45.0", ",".join(["0.1"] * 9)
    motion = "1.0,2.0,-0.5,1.5,-0.7,123.0"
    lines = {"INSPVAX": [], "INSPVA": []}
    for k in range(5):
        ins = f"INS_SOLUTION_GOOD,INS_RTKFIXED,{sea},{motion},{errors},0,0"
        lines["INSPVAX"].append(novatel_line("INSPVAXA", ins, TOW + k, definition))
        lines["INSPVAX"].append(novatel_line("INSPVASDCMPA", f"2300,0,{errors},0,56,00000000,0,0", TOW + k, "c454"))
        ins = f"2300,{TOW + k:.3f},{LAT},{LON},{ALT},{motion},INS_SOLUTION_GOOD"
        lines["INSPVA"].append(novatel_line("INSPVAA", ins, TOW + k, "54e2"))
    for name, of in lines.items():
        (tmp_path / f"{name}.gps").write_text("".join(of))
        assert_is_at_home(read_trajectory(tmp_path / f"{name}.gps"), 5)


def test_novatel_text_without_carriage_returns(tmp_path):
    """An editor or a version control ends lines by a line feed alone: none of them was decoded."""
    pytest.importorskip("novatel_edie")
    lines = [novatel_line("RAWIMUSA", f"2300,{TOW + 0.01 * k:.6f},00000077,641{k % 9},-3,{k},20{k % 7},-28,9", TOW + 0.01 * k)
             for k in range(200)]  # fmt: skip
    (tmp_path / "as_sent.ASC").write_bytes("".join(lines).encode())
    (tmp_path / "edited.ASC").write_bytes("".join(lines).replace("\r\n", "\n").encode())
    units = {"gyro": "1e-7 deg", "accel": "1.5e-5 m/s"}
    sent, edited = (read_imu(tmp_path / name, units=units, kind="increments") for name in ("as_sent.ASC", "edited.ASC"))
    assert len(edited.gyro) == 200
    np.testing.assert_array_equal(edited.gyro, sent.gyro)
    np.testing.assert_array_equal(edited.accel, sent.accel)


def test_rtklib(tmp_path):
    path = tmp_path / "rover.pos"
    head = ("% program   : RTKPOST ver.2.4.2\n% ( lat/lon/height=WGS84/ellipsoidal,Q=1:fix )\n"
            "%  GPST                  latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)\n")  # fmt: skip
    days = [f"2024/03/05 10:00:{k:02d}.000 {LAT:14.9f} {LON:14.9f} {ALT:10.4f} 1 9 2.0 1.0 3.0" for k in range(10)]
    weeks = [f"2304 {TOW + k:.3f} {LAT:14.9f} {LON:14.9f} {ALT:10.4f} 1 9 2.0 1.0 3.0" for k in range(10)]
    for rows, start in ((days, 1709632800.0), (weeks, TOW)):
        path.write_text(head + "\n".join(rows) + "\n")
        record = read_gnss(path)
        np.testing.assert_allclose(np.degrees(record.lat), LAT)
        np.testing.assert_allclose(record.alt, ALT)
        np.testing.assert_allclose(record.position_sigma, np.tile([1.0, 2.0, 3.0], (10, 1)))
        np.testing.assert_allclose(record.time, start + np.arange(10.0), atol=1e-6)


@pytest.mark.parametrize("mark", [",", ";"])
def test_rtklib_with_marks_between_the_columns(tmp_path, mark):
    """Its option out-fieldsep; week and seconds are two columns then, and a date with its time of day is one."""
    path = tmp_path / "rover.pos"
    names = [
        "%  GPST        ",
        " latitude(deg)",
        "longitude(deg)",
        " height(m)",
        "  Q",
        " ns",
        "  sdn(m)",
        "  sde(m)",
        "  sdu(m)",
    ]
    rest = ["", f"{LAT:14.9f}", f"{LON:14.9f}", f"{ALT:10.4f}", " 1", " 9", " 2.0", " 1.0", " 3.0"]
    times = [f"2304{mark}{TOW:.0f}.000", f"2304{mark}{TOW + 1:.0f}.000", f"2304{mark}{TOW + 2:.0f}.000"]
    dates = [f"2024/03/05 10:00:0{k}.000" for k in range(3)]
    for stamps, start in ((times, TOW), (dates, 1709632800.0)):
        rows = [stamp + mark.join(rest) for stamp in stamps]
        path.write_text("% program   : RTKPOST ver.2.4.2\n" + "\n".join([mark.join(names), *rows]) + "\n")
        record = read_gnss(path)
        np.testing.assert_allclose(record.time, start + np.arange(3.0), atol=1e-6)
        np.testing.assert_allclose(np.degrees([record.lat, record.lon]).T, np.tile([LAT, LON], (3, 1)))
        np.testing.assert_allclose(record.position_sigma, np.tile([1.0, 2.0, 3.0], (3, 1)))
    path.write_text(path.read_text().replace(mark + "  sdu(m)", "").replace(mark + "  sde(m)", ""))
    with pytest.raises(DataError, match=r"a header of 7 (?:names|columns) above rows of 9"):
        read_gnss(path)


def test_the_gnss_text_of_kf_gins(tmp_path):
    path = tmp_path / "gnss.txt"
    path.write_text("\n".join(f"{TOW + k:.3f} {LAT:.9f} {LON:.9f} {ALT:.4f} 0.02 0.01 0.03" for k in range(10)) + "\n")
    record = read_gnss(path)
    np.testing.assert_allclose(np.degrees(record.lat), LAT)
    np.testing.assert_allclose(record.position_sigma, np.tile([0.01, 0.02, 0.03], (10, 1)))


NOISE = [
    b"",
    bytes(200),
    b"\xb5\x62\x10\x03",
    b"\xa3\x95\x80" + bytes(range(256)),
    np.random.default_rng(3).bytes(4000),
]


@pytest.mark.parametrize(
    "name", ["log.ubx", "log.sbf", "log.ulg", "log.tlog", "log.gps", "log.bag", "log.mcap", "a.bin"]
)
@pytest.mark.parametrize("content", NOISE, ids=range(len(NOISE)))
def test_damage_is_one_message(name, content, tmp_path):
    path = tmp_path / name
    path.write_bytes(content)
    for read in (read_imu, read_gnss):
        with pytest.raises(TruenorthError) as error:
            read(path)
        assert name in str(error.value)
