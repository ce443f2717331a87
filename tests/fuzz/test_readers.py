"""Damaged logs of every format: a record, or one error of ours; no traceback, no crash, no NaN.

`make test` tries eight of each; `make fuzz` 6,500 of each, 100,000 in all (about .015 s of one core each).
"""

import os
import signal
import struct
from contextlib import contextmanager

import numpy as np
import pandas as pd  # noqa: F401  # not within an input's time
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from tests.forked import Reader
from tests.formats.corpus.dialects import DEG, SI, G, table
from tests.formats.corpus.truth import truth
from tests.formats.test_devices import dataflash_bytes, ulog_bytes
from tests.formats.test_text_devices import numbers, phone_log, vn
from truenorth.core.errors import TruenorthError
from truenorth.core.yaml_file import read_mapping
from truenorth.formats import mat, read_gnss, read_imu, read_odometer, write_imu
from truenorth.records import ImuRecord

LONGEST = 10.0  # s of one input
PHASES = (Phase.explicit, Phase.generate, Phase.shrink)  # to explain a failure traces every line
EXAMPLES = int(os.environ.get("FUZZ", "8"))
SETTLED = settings(
    max_examples=EXAMPLES,
    derandomize="FUZZ" not in os.environ,
    phases=PHASES,
    deadline=None,
    suppress_health_check=list(HealthCheck),
    database=None,
)
SPICE = [
    b"\n", b",", b"-", b"e9", b"1e200", b"nan", b"\0", b'"', b";", b"$", b"\xff", "١".encode(), "٫".encode(), b"9" * 400,
    b"\r", b"#", b"[", b"{{", b"*", b":", b"&a", b"inf", b"  ", b"\t", b"T", b"Z", struct.pack("<d", 1e200),
]  # fmt: skip


@contextmanager
def in_time():
    """An input that takes longer than ten seconds of the processor, or a minute of the clock, is a failure."""

    def late(number, frame):
        raise AssertionError(f"longer than {LONGEST:g} s")

    timers = {signal.SIGPROF: (signal.ITIMER_PROF, LONGEST), signal.SIGALRM: (signal.ITIMER_REAL, 6.0 * LONGEST)}
    before = {number: signal.signal(number, late) for number in timers}
    for timer, seconds in timers.values():
        signal.setitimer(timer, seconds)
    try:
        yield
    finally:
        for timer, _ in timers.values():
            signal.setitimer(timer, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


def logs(folder) -> dict[str, bytes]:
    short = truth("swaying", "tactical", 50.0, 4.0)
    record = ImuRecord(short.time, short.gyro, short.accel)
    for suffix in ("npz", "parquet"):
        write_imu(record, folder / f"whole.{suffix}")
    savemat(folder / "whole.mat", {"time": short.time, "gyro": short.gyro, "accel": short.accel})
    rows = [f"$GPGGA,{100000 + k:06d}.00,4806.0,N,01130.0,E,1,08,1.0,500.0,M,45.0,M,," for k in range(20)]
    steps = list(zip(short.increments.gyro, short.increments.accel))
    values = np.column_stack([short.time, short.gyro, short.accel])
    labels = [" ".join(f"{name}:{value:.6g}" for name, value in zip(SI.split(","), row)) for row in values]
    noted = [f'{line},"at {k}\nso"' for k, line in enumerate(table(short, SI).splitlines())]
    fixes = [f"009 1000{k:02d}.00 +03119.09973 +00058.49277 036.00 090.00 +152.5 +0.3" for k in range(20)]
    dated = [
        f"11/03/2021 23:59:{k // 10:02d}.{k % 10}," + ",".join(f"{v:.6g}" for v in row[1:])
        for k, row in enumerate(values)
    ]
    return {
        "labels.txt": ("boot\n" + "\n".join(labels) + "\n").encode(),
        "noted.csv": ("\n".join(noted) + "\n").encode(),
        "drive.vbo": (VBO + "\n".join(fixes) + "\n").encode(),
        "dated.csv": (f"{SI}\n" + "\n".join(dated) + "\n").encode(),
        "log.csv": table(short, SI).encode(),
        "odd.csv": table(short, "t;wx;wy;wz;ax;ay;az", sep=";", decimal=",", gyro=DEG, accel=G).encode(),
        "bare.txt": table(short, "", sep=" ").encode(),
        "log.imu": table(short.increments, "", sep=" ", order="gat").encode(),
        "log.bin": np.column_stack([short.time, short.increments.gyro, short.increments.accel]).tobytes(),
        "log.npz": (folder / "whole.npz").read_bytes(),
        "log.parquet": (folder / "whole.parquet").read_bytes(),
        "log.mat": (folder / "whole.mat").read_bytes(),
        "log.ulg": ulog_bytes()[:20_000],
        "dataflash.bin": dataflash_bytes()[:20_000],
        "phone.txt": phone_log()[:20_000].encode(),
        "fixes.txt": phone_log()[:20_000].encode(),
        "vn.txt": "".join(vn(f"VNDTV,+0.01,{numbers(*a)},{numbers(*v)}") for a, v in steps).encode(),
        "log.nmea": ("\r\n".join(rows) + "\r\n").encode(),
        "odo.csv": b"time,speed [km/h]\n" + b"".join(b"%d,%d\n" % (k, 30 + k) for k in range(30)),
        "spec.yaml": b"gyro: {bias: 1 deg/h, random_walk: 0.1 deg/sqrt(h)}\naccel: &a {bias: 1 mg}\n",
    }


VBO = "File created\n\n[header]\nvelocity kmh\n\n[column names]\nsats time lat long velocity heading height vertvel\n\n[data]\n"
READ = {
    "log.nmea": read_gnss,
    "drive.vbo": read_gnss,
    "fixes.txt": read_gnss,
    "odo.csv": read_odometer,
    "spec.yaml": read_mapping,
}
NAMES = ["log.csv", "odd.csv", "bare.txt", "log.imu", "log.bin", "log.npz", "log.parquet", "log.mat", "log.ulg",
         "dataflash.bin", "phone.txt", "fixes.txt", "vn.txt", "log.nmea", "odo.csv", "spec.yaml",
         "labels.txt", "noted.csv", "drive.vbo", "dated.csv"]  # fmt: skip


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, bytes]:
    return logs(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("name", NAMES)
def test_what_is_damaged_is_a_record_or_an_error_of_ours(name, whole, tmp_path_factory, monkeypatch, request):
    folder = tmp_path_factory.mktemp("fuzz")
    if name == "log.mat":
        reader = Reader()
        request.addfinalizer(reader.close)
        monkeypatch.setattr(mat, "subprocess", reader)

    @SETTLED
    @given(data=st.data())
    def attempt(data):
        content = bytearray(whole[name])
        for _ in range(data.draw(st.integers(1, 4))):
            place, gone = data.draw(st.integers(0, len(content))), data.draw(st.integers(0, 40))
            content[place : place + gone] = data.draw(st.binary(max_size=12) | st.sampled_from(SPICE))
        if data.draw(st.integers(0, 9)) == 0:
            content = content[: data.draw(st.integers(0, len(content)))]
        path = folder / name
        path.write_bytes(content)
        with in_time():
            try:
                record = READ.get(name, read_imu)(path)
            except TruenorthError:
                return
        if isinstance(record, ImuRecord):
            assert np.isfinite(record.gyro).all()
            assert np.isfinite(record.accel).all()
            assert np.all(np.diff(record.time) > 0.0)

    attempt()
