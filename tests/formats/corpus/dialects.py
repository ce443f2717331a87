"""The logs of the corpus: a writer for each dialect, the option that answers its question, the word of its refusal."""

from __future__ import annotations

import bz2
import gzip
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.formats.corpus.truth import Truth, truth

DEG, G = np.pi / 180.0, 9.80665
FRD = ([1, 0, 2], [1, 1, -1])  # what x, y, z of these axes are of right, forward, up
FLU = ([1, 0, 2], [1, -1, 1])
SI = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
EPOCH = 1_700_000_000.0


@dataclass(frozen=True)
class Log:
    """A log of the corpus."""

    name: str  # of the file; unique
    write: Callable[[Path], None]  # makes the file
    truth: Truth  # what is to be read
    # options that answer the reader's question; empty where it needs none
    answer: dict[str, Any] = field(default_factory=dict)
    refused: str = ""  # what the reader has to say instead; empty where it reads
    shift: float = 0.0  # s; of the log's clock against the truth's


def table(
    t: Truth, header: str, *, gyro: float = 1.0, accel: float = 1.0, time: float = 1.0, start: float = 0.0, sep: str = ",",
    order: str = "tga", axes: Any = None, above: str = "", below: str = "", decimal: str = ".", extra: Any = None,
    fmt: str = "%.9g", end: str = "\n",
) -> str:  # fmt: skip
    """A text of rows: `order` of time (t), gyros (g), accelerometers (a), extra columns (e), a counter (n); units by divisors."""
    pick, sign = axes or ([0, 1, 2], [1, 1, 1])
    parts = {
        "t": [f"{value:.10g}" if start == 0.0 else f"{value:.6f}" for value in (t.time + start) / time],
        "g": t.gyro[:, pick] * sign / gyro,
        "a": t.accel[:, pick] * sign / accel,
        "n": [str(k) for k in range(len(t.time))],
        "e": extra,
    }
    parts = {
        key: part.reshape(len(part), -1).tolist() if isinstance(part, np.ndarray) and part.dtype.kind in "fiu" else part
        for key, part in parts.items()
    }
    rows = []
    for k in range(len(t.time)):
        cells: list[str] = []
        for key in order:
            part = parts[key][k]
            cells += [part] if isinstance(part, str) else [fmt % value for value in part]
        rows.append(sep.join(cells).replace(".", decimal) if decimal != "." else sep.join(cells))
    head = [above.rstrip("\n")] if above else []
    return end.join([*head, *([header] if header else []), *([below] if below else []), *rows]) + end


def text(t: Truth, header: str, encoding: str = "utf-8", pack: Callable[[bytes], bytes] | None = None, **how: Any):
    """A writer of a text."""

    def write(path: Path) -> None:
        content = table(t, header, **how).encode(encoding)
        path.write_bytes(content if pack is None else pack(content))

    return write


def zstd(content: bytes) -> bytes:
    import pyarrow as pa

    sink = pa.BufferOutputStream()
    with pa.CompressedOutputStream(sink, "zstd") as file:
        file.write(content)
    return sink.getvalue().to_pybytes()


def frame(t: Truth, kind: str, names: list[str], **how: Any) -> Callable[[Path], None]:
    """A writer of Parquet or Feather."""

    def write(path: Path) -> None:
        import pyarrow as pa
        import pyarrow.feather as pf
        import pyarrow.parquet as pq

        time = t.time
        columns = [how.get("stamps", time), *(t.gyro / how.get("gyro", 1.0)).T, *(t.accel / how.get("accel", 1.0)).T]
        content = pa.table([pa.array(column) for column in columns], names=names)
        (pq.write_table if kind == "parquet" else pf.write_feather)(content, path)

    return write


def iso(t: Truth, zone: str = "", sep: str = "T") -> list[str]:
    stamps = np.datetime64("2024-03-05T10:00:00") + np.round(t.time * 1e6).astype("timedelta64[us]")
    return [str(stamp).replace("T", sep) + zone for stamp in stamps]


def with_stamps(t: Truth, stamps: list[str], header: str, order: str = "ega", **how: Any) -> Callable[[Path], None]:
    return text(t, header, extra=stamps, order=order, **how)


def bunched(t: Truth, size: int) -> Truth:
    """Stamps of a computer that reads `size` rows at once, a fifth of a millisecond after each other."""
    k = np.arange(len(t.time))
    last = t.time[np.minimum((k // size + 1) * size - 1, len(k) - 1)]
    return Truth(last + 2e-4 * (k % size), t.gyro, t.accel)


def xyz(time: str, *patterns: str) -> str:
    """A header: the clock, and each pattern for x, y and z."""
    return ",".join([time, *(pattern.format(axis) for pattern in patterns for axis in "xyz")])


def logs() -> list[Log]:
    """The corpus."""
    nav, still, cheap = truth(grade="navigation", seconds=60.0), truth(), truth(grade="consumer")
    sway, drive, cheap_sway = truth("swaying"), truth("driven"), truth("swaying", "consumer")
    fast = truth("swaying", "tactical", 200.0, 25.0)
    mag = 1.0 / np.sqrt(3.0) + 0.01 * np.random.default_rng(1).normal(size=(len(sway.time), 3))
    found: list[Log] = []

    def add(name: str, write: Callable[[Path], None], t: Truth, **more: Any) -> None:
        found.append(Log(name, write, t, **more))

    dps, both = {"gyro": DEG, "accel": G}, {"gyro": "deg/s", "accel": "g"}
    # --- separators, decimals, encodings, packing
    for key, sep in (
        ("comma", ","),
        ("semicolon", ";"),
        ("tab", "\t"),
        ("blank", " "),
        ("blanks", "   "),
        ("bar", "|"),
        ("padded", " , "),
    ):
        add(f"si_{key}.csv", text(still, SI.replace(",", sep), sep=sep), still)
    for key, sep in (("semicolon", ";"), ("tab", "\t"), ("blank", " ")):
        add(f"decimal_comma_{key}.csv", text(still, SI.replace(",", sep), sep=sep, decimal=","), still)
    add(
        "decimal_comma_comma.csv", text(still, SI, decimal=","), still, refused="a header of 7 columns above rows of 14"
    )
    add("crlf.csv", text(still, SI, end="\r\n"), still)
    add("mac.csv", text(still, SI, end="\r"), still)
    add("bom.csv", text(still, SI, encoding="utf-8-sig"), still)
    add("utf16.csv", text(still, SI, encoding="utf-16"), still)
    add(
        "latin1.csv",
        text(
            still,
            "température,time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z",
            encoding="latin-1",
            order="etga",
            extra=np.full(len(still.time), 21.5),
        ),
        still,
    )
    add("packed.csv.gz", text(still, SI, pack=gzip.compress), still)
    add("packed.csv.zst", text(still, SI, pack=zstd), still)
    add("packed.csv.bz2", text(still, SI, pack=bz2.compress), still)
    add("trailing_comma.csv", text(still, SI + ",", order="tgae", extra=[""] * len(still.time)), still)
    add("no_suffix_known.dat", text(still, SI), still)
    # --- preambles, headers, remarks
    xsens = (
        "// General information:\n//  MT Manager version: 2021.2\n//  Update Rate: 100.0Hz\n//  Filter Profile: general"
    )
    add("xsens.txt", text(sway, "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tMag_X\tMag_Y\tMag_Z",
        sep="\t", order="ntage", above=xsens, time=1e-4, extra=mag), sway)  # fmt: skip
    add(
        "xsens_no_time.txt",
        text(sway, "PacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z", sep="\t", order="nag", above=xsens),
        sway,
    )
    add(
        "units_row.csv",
        text(cheap, "Time,GyroX,GyroY,GyroZ,AccX,AccY,AccZ", below="s,deg/s,deg/s,deg/s,g,g,g", **dps),
        cheap,
    )
    add("remarks.csv", text(still, SI, above="# made by hand\n% and remarked"), still)
    add("header_is_a_remark.csv", text(still, "# " + SI), still)
    add("lab_notes.csv", text(still, SI, above="Experiment 7, second floor\nOperator: N. N.\n"), still)
    # --- names and units in headings
    euroc = xyz("#timestamp [ns]", "w_RS_S_{} [rad s^-1]", "a_RS_S_{} [m s^-2]")
    add("euroc.csv", text(cheap, euroc, time=1e-9, start=EPOCH), cheap, shift=EPOCH)
    add(
        "phone.csv",
        text(
            cheap,
            xyz('"Time (s)"', '"Gyroscope {} (rad/s)"', '"Acceleration {} (m/s^2)"'),
        ),
        cheap,
    )
    add(
        "suffixes.csv",
        text(cheap, "time_us,gyro_x_dps,gyro_y_dps,gyro_z_dps,accel_x_g,accel_y_g,accel_z_g", time=1e-6, **dps),
        cheap,
    )
    add("degree_sign.csv", text(cheap, "t [s];wx [°/s];wy [°/s];wz [°/s];ax [g];ay [g];az [g]", sep=";", **dps), cheap)
    add(
        "milli.csv",
        text(
            cheap,
            "t [ms],gyro_x [mdps],gyro_y [mdps],gyro_z [mdps],acc_x [mg],acc_y [mg],acc_z [mg]",
            time=1e-3,
            gyro=1e-3 * DEG,
            accel=1e-3 * G,
        ),
        cheap,
    )
    add(
        "px4.csv",
        text(
            cheap,
            "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2]",
            time=1e-6,
            axes=FRD,
        ),
        cheap,
        answer={"units": "rad/s,m/s^2", "axes": "FRD"},
    )
    add(
        "ros_echo.csv",
        text(
            sway,
            "%time,field.header.seq,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
            time=1e-9,
            start=EPOCH,
            order="tnga",
        ),
        sway,
        shift=EPOCH,
    )
    add("ardupilot.csv", text(cheap_sway, "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", time=1e-6), cheap_sway)
    add("accel_first.csv", text(sway, "t,ax,ay,az,wx,wy,wz", order="tag"), sway)
    add("gx_ax.csv", text(sway, "t gx gy gz ax ay az", sep=" "), sway)
    add("fx_wx.csv", text(nav, "t,wx,wy,wz,fx,fy,fz"), nav)
    add("omega.csv", text(nav, "time,omega_x,omega_y,omega_z,f_x,f_y,f_z", **dps), nav)
    add("pqr.csv", text(sway, "t,p,q,r,ax,ay,az", **dps), sway)
    add(
        "camel.csv",
        text(
            sway,
            "Timestamp,AngularVelocityX,AngularVelocityY,AngularVelocityZ,LinearAccelerationX,LinearAccelerationY,LinearAccelerationZ",
        ),
        sway,
    )
    add("reversed_names.csv", text(sway, "time,x_gyro,y_gyro,z_gyro,x_accel,y_accel,z_accel", **dps), sway)
    add(
        "with_gravity_free.csv",
        text(
            sway,
            "t,acc_x,acc_y,acc_z,userAcc_x,userAcc_y,userAcc_z,gyro_x,gyro_y,gyro_z",
            order="taeg",
            extra=0.1 * mag,
        ),
        sway,
    )
    add(
        "two_accelerations.csv",
        text(
            sway,
            "t,accel_x,accel_y,accel_z,linear_acceleration_x,linear_acceleration_y,linear_acceleration_z,gyro_x,gyro_y,gyro_z",
            order="taeg",
            extra=0.1 * mag,
        ),
        sway,
    )
    add("two_imus.csv", text(sway, xyz("t", "imu0_gyro_{}", "imu0_acc_{}", "imu1_acc_{}"),
        order="tgae", extra=sway.accel + 0.02), sway,
        answer={"columns": {"accel_x": "imu0_acc_x", "accel_y": "imu0_acc_y", "accel_z": "imu0_acc_z"}})  # fmt: skip
    # --- units by behaviour
    add("g_dps_moving.csv", text(cheap_sway, "t,wx,wy,wz,ax,ay,az", **dps), cheap_sway)
    add("si_moving.csv", text(cheap_sway, "t,wx,wy,wz,ax,ay,az"), cheap_sway)
    add("si_driven.csv", text(drive, "t,wx,wy,wz,ax,ay,az"), drive, answer={"units": {"gyro": "rad/s"}})
    add("dps_driven.csv", text(drive, "t,wx,wy,wz,ax,ay,az", gyro=DEG), drive, answer={"units": {"gyro": "deg/s"}})
    add("degh_moving.csv", text(sway, "t,wx,wy,wz,ax,ay,az", gyro=DEG / 3600), sway)
    add(
        "mg_moving.csv",
        text(truth("swaying", "navigation"), "t,wx,wy,wz,ax,ay,az", gyro=DEG, accel=1e-3 * G),
        truth("swaying", "navigation"),
        answer={"units": {"accel": "mg"}},
    )
    add(
        "gal.csv",
        text(truth("swaying", "navigation"), "t,wx,wy,wz,ax,ay,az", accel=0.0099),
        truth("swaying", "navigation"),
        answer={"units": {"accel": "0.0099 m/s^2"}},
    )
    add("still_cheap_si.csv", text(cheap, "t,wx,wy,wz,ax,ay,az"), cheap, answer={"units": {"gyro": "rad/s"}})
    add("still_cheap_dps.csv", text(cheap, "t,wx,wy,wz,ax,ay,az", gyro=DEG), cheap, answer={"units": {"gyro": "deg/s"}})
    add("still_cheap_documented_dps.csv", text(cheap, SI, gyro=DEG), cheap, answer={"units": both | {"accel": "m/s^2"}})
    add(
        "documented_dps_moving.csv",
        text(cheap_sway, SI, gyro=DEG),
        cheap_sway,
        answer={"units": both | {"accel": "m/s^2"}},
    )
    add(
        "counts.csv",
        text(cheap_sway, "t,wx,wy,wz,ax,ay,az", gyro=DEG / 131, accel=G / 16384),
        cheap_sway,
        answer={"units": {"gyro": "0.00763358779 deg/s", "accel": "6.103515625e-05 g"}},
    )
    add(
        "gravity_taken_out.csv",
        text(Truth(sway.time, sway.gyro, 0.02 * mag - 0.0115), "t,wx,wy,wz,ax,ay,az"),
        sway,
        refused="gravity",
    )
    # --- rates or increments
    for key, t in (("still", nav), ("moving", sway)):
        add(
            f"increments_{key}.csv",
            text(t.increments, "t,dtheta_x,dtheta_y,dtheta_z,dvel_x,dvel_y,dvel_z"),
            t.increments,
        )
        add(f"increments_unsaid_{key}.csv", text(t.increments, "t,gx,gy,gz,ax,ay,az"), t.increments)
    add("increments_degrees.csv", text(sway.increments, "t,gx,gy,gz,ax,ay,az", gyro=DEG), sway.increments)
    add(
        "increments_arcsec.csv",
        text(
            nav.increments, "t,delta_theta_x,delta_theta_y,delta_theta_z,delta_v_x,delta_v_y,delta_v_z", gyro=DEG / 3600
        ),
        nav.increments,
    )
    slow = truth("swaying", "navigation", 10.0, 60.0)
    add(
        "ten_hertz_g.csv",
        text(slow, "t,wx,wy,wz,ax,ay,az", accel=G),
        slow,
        answer={"kind": "rates", "units": {"accel": "g"}},
    )
    # --- no header
    add("bare.csv", text(sway, ""), sway)
    add("bare_accel_first.csv", text(sway, "", order="tag", sep=" "), sway)
    add("bare_time_last.txt", text(sway, "", order="gat", sep="  "), sway)
    add("bare_counter.csv", text(sway, "", order="ntag"), sway)
    add("bare_no_time.csv", text(sway, "", order="ga"), sway, answer={"rate": 100.0})
    add(
        "bare_with_magnetometer.csv",
        text(sway, "", order="tage", extra=mag),
        sway,
        answer={
            "columns": {
                f"{s}_{x}": str(i) for i, (s, x) in enumerate(((s, x) for s in ("accel", "gyro") for x in "xyz"), 2)
            }
        },
    )
    add("kf_gins.txt", text(sway.increments, "", sep=" ", axes=FRD), sway.increments)
    add("psins.imu", text(nav.increments, "", sep=" ", order="gat"), nav.increments)
    # --- clocks
    for key, unit in (("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        add(f"clock_{key}.csv", text(sway, SI, time=unit), sway)
        add(f"epoch_{key}.csv", text(sway, SI, time=unit, start=EPOCH), sway, shift=EPOCH)
    add("epoch_s.csv", text(fast, SI, start=EPOCH), fast, shift=EPOCH)
    add("iso.csv", with_stamps(sway, iso(sway), SI), sway, shift=1709632800.0)
    add("iso_zulu.csv", with_stamps(sway, iso(sway, "Z"), SI), sway, shift=1709632800.0)
    add("iso_blank.csv", with_stamps(sway, iso(sway, sep=" "), SI.replace(",", ";"), sep=";"), sway, shift=1709632800.0)
    add("time_of_day.csv", with_stamps(sway, [s[11:] for s in iso(sway)], SI), sway, shift=36000.0)
    add("secs_nsecs.csv", text(sway, "secs,nsecs,wx,wy,wz,ax,ay,az", order="ega", fmt="%.12g",
        extra=np.stack([EPOCH + np.floor(sway.time), np.round((sway.time % 1.0) * 1e9)], axis=1)), sway, shift=EPOCH)  # fmt: skip
    thousand = truth("swaying", "tactical", 1000.0, 8.0)
    add(
        "millisecond_counter.csv",
        text(thousand, "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z", time=1e-3),
        thousand,
        answer={"units": {"time": "ms"}},
    )
    add(
        "bunches.csv",
        text(bunched(truth("swaying", "tactical", 125.0, 30.0), 5), SI),
        truth("swaying", "tactical", 125.0, 30.0),
        answer={"rate": 125.0},
        shift=8e-4,
    )
    add(
        "time_goes_back.csv",
        text(Truth(np.where(sway.time > 10.0, sway.time - 3.0, sway.time), sway.gyro, sway.accel), SI),
        sway,
        refused="time goes back",
    )
    # --- cuts and holes
    add(
        "cut.csv",
        lambda path: path.write_text(table(sway, SI)[:-31]),
        Truth(sway.time[:-1], sway.gyro[:-1], sway.accel[:-1]),
    )
    add(
        "hole.csv",
        lambda path: path.write_text(table(sway, SI).replace(table(sway, SI).split("\n")[700].split(",")[3], "", 1)),
        sway,
        refused="line 701",
    )
    add(
        "text_in_a_cell.csv",
        lambda path: path.write_text(table(sway, SI).replace("\n2,", "\n2,oops", 1)),
        sway,
        refused="oops",
    )
    add("zeros_at_the_end.csv", lambda path: path.write_bytes(table(sway, SI).encode() + bytes(4096)), sway)
    # --- axes
    add("frd_still.csv", text(nav, SI, axes=FRD), nav, answer={"axes": "FRD"})
    add("fld.csv", text(sway, SI, axes=([1, 0, 2], [1, -1, -1])), sway, answer={"axes": "FLD"})
    add("wrong_sign.csv", _turned_gyro(sway), sway, answer={"columns": {"gyro_y": "-gyro_y"}})
    # --- tables of other kinds
    names = SI.split(",")
    stamps = np.datetime64("2024-03-05T10:00:00", "ns") + np.round(sway.time * 1e9).astype("timedelta64[ns]")
    add("table.parquet", frame(still, "parquet", names), still)
    add("table.feather", frame(still, "feather", names), still)
    add(
        "other_names.parquet",
        frame(sway, "parquet", ["Time", "gyroX", "gyroY", "gyroZ", "accX", "accY", "accZ"], **dps),
        sway,
    )
    add("stamps.feather", frame(sway, "feather", names, stamps=stamps), sway, shift=1709632800.0)
    add("arrays.npz", lambda path: np.savez(path, time=still.time, gyro=still.gyro, accel=still.accel), still)
    add("usual_arrays.npz", lambda path: np.savez(path, t=sway.time, gyr=sway.gyro / DEG, acc=sway.accel / G), sway)
    add(
        "increments.npz",
        lambda path: np.savez(path, dtheta=nav.increments.gyro, dvel=nav.increments.accel, ts=nav.interval),
        nav.increments,
    )
    # --- what is no IMU's log
    add(
        "gnss.csv",
        lambda path: path.write_text(
            "time,lat,lon,alt\n" + "\n".join(f"{k},48.1,11.5,{500 + k}" for k in range(100)) + "\n"
        ),
        still,
        refused="no columns of an IMU",
    )
    add(
        "letter.csv",
        lambda path: path.write_text("Dear colleague,\nplease find attached.\n"),
        still,
        refused="letter.csv",
    )
    return found


def _turned_gyro(t: Truth) -> Callable[[Path], None]:
    return text(Truth(t.time, t.gyro * [1, -1, 1], t.accel), SI)
