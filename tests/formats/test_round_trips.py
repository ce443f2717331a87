"""What is written is read back bit for bit, in every format; and written whole or not at all."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from truenorth.core.errors import UsageError
from truenorth.formats import read_imu, write_imu
from truenorth.records import ImuRecord

SUFFIXES = [".csv", ".parquet", ".pq", ".npz"]


def record_of(values, kind="rates"):
    time = 1e5 + 0.01 * np.arange(1, len(values) + 1)
    return ImuRecord(time, values[:, :3], values[:, 3:], kind)


def assert_same_bits(a: ImuRecord, b: ImuRecord):
    assert a.kind == b.kind
    for name in ("time", "gyro", "accel"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("kind", ["rates", "increments"])
@settings(max_examples=10, deadline=None)
@given(values=arrays(float, (5, 6), elements=st.floats(-1e4, 1e4)))
def test_any_number_comes_back(suffix, kind, values, tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / f"log{suffix}"
    record = record_of(values, kind)
    write_imu(record, path)
    assert_same_bits(read_imu(path), record)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_many_rows_come_back_in_order(suffix, tmp_path):
    record = record_of(np.arange(6 * 70_000, dtype=float).reshape(-1, 6) / 7)
    write_imu(record, tmp_path / f"log{suffix}")
    assert_same_bits(read_imu(tmp_path / f"log{suffix}"), record)


def test_the_csv_is_the_documented_one(tmp_path):
    write_imu(record_of(np.ones((2, 6))), tmp_path / "log.csv")
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert lines[0] == "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    assert len(lines) == 3


def test_pandas_reads_and_writes_the_same_parquet(tmp_path):
    pd = pytest.importorskip("pandas")
    record = record_of(np.arange(12.0).reshape(2, 6))
    record.to_frame().to_parquet(tmp_path / "theirs.parquet")
    assert_same_bits(read_imu(tmp_path / "theirs.parquet"), record)
    write_imu(record, tmp_path / "ours.parquet")
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "ours.parquet").set_index("time"), record.to_frame())


def test_a_suffix_that_cannot_be_written(tmp_path):
    for name in ("log.mat", "log"):
        with pytest.raises(UsageError, match=r"\.csv, \.parquet"):
            write_imu(record_of(np.ones((2, 6))), tmp_path / name)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("before", [None, b"what stood here"])
def test_a_failure_while_writing_leaves_no_half_file(suffix, before, tmp_path, monkeypatch):
    path = tmp_path / f"log{suffix}"
    if before is not None:
        path.write_bytes(before)

    def half(record, file):
        file.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(f"truenorth.formats.{ {'.csv': 'csv_out', '.npz': 'npz'}.get(suffix, 'parquet') }.write", half)
    with pytest.raises(KeyboardInterrupt):
        write_imu(record_of(np.ones((2, 6))), path)
    assert [file.name for file in tmp_path.iterdir()] == ([] if before is None else [path.name])
    if before is not None:
        assert path.read_bytes() == before


def test_a_killed_writer_leaves_what_stood_there(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"what stood here")
    program = (
        "import sys, time, numpy as np\n"
        "import truenorth.formats.csv_out as csv\n"
        "from truenorth import ImuRecord, write_imu\n"
        "def half(record, file):\n"
        "    file.write_bytes(b'half')\n"
        "    print('half', flush=True)\n"
        "    time.sleep(60)\n"
        "csv.write = half\n"
        "write_imu(ImuRecord(np.arange(2.0), np.ones((2, 3)), np.ones((2, 3))), sys.argv[1])\n"
    )
    with subprocess.Popen([sys.executable, "-c", program, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"half\n"
        os.kill(process.pid, signal.SIGKILL)
    assert path.read_bytes() == b"what stood here"


def test_reading_a_csv_imports_nothing_heavy(tmp_path):
    """What it costs is in the benchmarks; what would make it slow is seen here."""
    write_imu(record_of(np.random.default_rng(0).normal(size=(900, 6))), tmp_path / "log.csv")
    program = (
        "import sys, numpy\n"
        "from truenorth import read_imu\n"
        "record = read_imu(sys.argv[1])\n"
        "heavy = {'pandas', 'numba', 'scipy', 'pydantic', 'matplotlib', 'yaml'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", program, str(tmp_path / "log.csv")], check=True)
