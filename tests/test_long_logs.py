"""Logs of days: what is read, aligned and navigated holds a part of them in memory at a time."""

from __future__ import annotations

import resource
import subprocess
import sys
from zipfile import ZipFile

import numpy as np
import pytest

from benchmarks.bench_days import RATE, at_rest
from truenorth import Position, align, imu_spec, navigate, read_imu, write_imu
from truenorth.core import blocks, mapped
from truenorth.core.mapped import read_mapped, write_mappable
from truenorth.quality import sampling
from truenorth.quality.alternation import alternation
from truenorth.simulation import Sway, Tone, simulate
from truenorth.strapdown.increments import in_blocks, increments
from truenorth.strapdown.inertial import integrate

PLACE = Position.from_degrees(45.0)
HOURS = 8.0


@pytest.fixture(scope="module")
def record():
    ship = Sway(PLACE, pitch_tones=(Tone(0.05, 7.0),), roll_tones=(Tone(0.1, 9.0),), lever_arm=(1.0, 2.0, 1.0))
    return simulate(ship, rate=20.0, duration=120.0, imu=imu_spec("navigation"), seed=1, kind="rates").record


@pytest.fixture
def short_blocks(monkeypatch):
    """Blocks of few rows, so that a short log has many."""
    for module in list(sys.modules.values()):
        if getattr(module, "__name__", "").startswith("truenorth") and getattr(module, "BLOCK", None) == blocks.BLOCK:
            monkeypatch.setattr(module, "BLOCK", 192)  # whole groups of 64, as the integration takes them


def test_a_large_array_stays_on_the_disk_and_nothing_copies_it(tmp_path, record, monkeypatch):
    monkeypatch.setattr(mapped.read_mapped, "__defaults__", (1000,))
    write_imu(record, tmp_path / "log.npz")
    found = read_imu(tmp_path / "log.npz")
    for name in ("time", "gyro", "accel"):
        array = getattr(found, name)
        np.testing.assert_array_equal(array, getattr(record, name))
        while isinstance(array.base, np.ndarray):
            array = array.base
        assert type(array) is np.memmap
        assert array.ctypes.data % 64 == 0


def test_a_mappable_file_is_one_of_numpy(tmp_path):
    arrays = {"a": np.arange(7.0), "longer name": np.arange(12).reshape(3, 4), "none": np.zeros((0, 3))}
    write_mappable(tmp_path / "x.npz", arrays)
    assert ZipFile(tmp_path / "x.npz").testzip() is None
    with np.load(tmp_path / "x.npz") as archive:
        for name, values in arrays.items():
            np.testing.assert_array_equal(archive[name], values)
    np.savez_compressed(tmp_path / "packed.npz", **arrays)
    np.savez(tmp_path / "plain.npz", **arrays)
    for file in ("x", "packed", "plain"):
        found = read_mapped(tmp_path / f"{file}.npz", smallest=1)
        assert list(found) == list(arrays)
        for name, values in arrays.items():
            np.testing.assert_array_equal(found[name], values)
    assert type(read_mapped(tmp_path / "x.npz", smallest=1)["a"]) is np.memmap


def test_blocks_have_the_bits_of_the_whole(record, short_blocks):
    whole = increments(record)
    parts = list(in_blocks(record))
    assert len(parts) > 8
    for i in range(2):
        np.testing.assert_array_equal(np.concatenate([part[1 + i] for part in parts]), whole[i])


def figures(record):
    found = integrate(record, 1.0, np.full(3, 1e-6), np.full(3, 1e-4), rows_at=[3, 700, len(record) - 1])
    return [*(getattr(found, name) for name in ("time", "C_ib", "velocity", "position", "C_mean", "C_ib_at"))]


def test_the_inertial_frame_goes_on_from_block_to_block(record, request):
    whole = figures(record)
    request.getfixturevalue("short_blocks")
    for part, one in zip(figures(record), whole, strict=True):
        np.testing.assert_array_equal(part, one)


def test_faults_of_a_log_are_the_same_in_blocks(record, request):
    accel = np.array(record.accel)
    accel[1000:1100, 2] = accel[1000, 2]
    accel[:, 0] = np.clip(accel[:, 0], None, np.quantile(accel[:, 0], 0.9))
    stuck = type(record)(record.time, record.gyro, accel, record.kind)
    whole = sampling.check_sampling(stuck)
    assert whole[0].longest_runs[5] == 100
    assert whole[0].longest_at[5] == 1000
    assert "saturated" in [finding.code for finding in whole[1]]
    request.getfixturevalue("short_blocks")
    again = sampling.check_sampling(type(record)(record.time, record.gyro, accel, record.kind))
    assert again[1] == whole[1]


@pytest.mark.parametrize("period", [2, 3, 5])
def test_what_sensors_in_turn_do_is_the_same_in_blocks(record, period, request):
    accel = np.array(record.accel)
    accel[::period] += (0.01, 0.02, 0.0)
    found = alternation(type(record)(record.time, record.gyro, accel, record.kind), period)
    assert found.any()
    request.getfixturevalue("short_blocks")
    again = alternation(type(record)(record.time, record.gyro, accel.copy(), record.kind), period)
    np.testing.assert_allclose(again, found, rtol=1e-12)


def test_answers_are_the_same_in_blocks(record, request):
    record = record.between(None, 60.0)
    found = align(record, PLACE, "navigation", method="kalman", at=30.0)
    track = navigate(record, found, check_clocks=False).track
    request.getfixturevalue("short_blocks")
    again = align(copy_of(record), PLACE, "navigation", method="kalman", at=30.0)
    np.testing.assert_allclose(again.C_nb, found.C_nb, rtol=0.0, atol=1e-11)
    in_blocks_ = navigate(record, found, check_clocks=False).track
    for name in ("time", "C_nb", "v_n", "position", "P"):
        np.testing.assert_array_equal(getattr(in_blocks_, name), getattr(track, name))


def copy_of(record):
    """The same log; nothing that was remembered of the other."""
    return type(record)(record.time, record.gyro, record.accel, record.kind)


# Bytes that a command may ask the system for, the log on the disk not among them; held whole it took 2.2 GB.
LIMIT = 3 << 29


@pytest.mark.slow
@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the limit counts memory that is mapped on Linux alone"
)
@pytest.mark.parametrize("counted", [False, True])
def test_a_log_of_a_night_takes_less_memory_than_its_rows(tmp_path, counted):
    rows = round(HOURS * 3600.0 * RATE)
    log = tmp_path / "log.npz"
    at_rest(log, rows, counted=counted)
    assert log.stat().st_size > 300 << 20
    start = ["align", str(log), "--lat", "45", "--imu", "navigation", "--to", "900", "-o", str(tmp_path / "start")]
    for command in (start, start[:-4], ["navigate", str(log), "--start", str(tmp_path / "start")]):
        done = subprocess.run(
            [sys.executable, "-m", "truenorth", *command],
            capture_output=True,
            text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (LIMIT, LIMIT)),
        )
        assert done.returncode == 0, done.stderr[-2000:]
