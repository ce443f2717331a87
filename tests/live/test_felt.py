"""Rows that come one by one lose the known errors of their sensors, as a whole log does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from truenorth.live.felt import Felt, without_known
from truenorth.records import ImuRecord
from truenorth.records.specified import corrected, lag
from truenorth.records.specs import imu_spec

RATE = 100.0
TURNING = 2.0 * np.pi / 6.0


def motion(kind):
    time = np.arange(1, 1500) / RATE
    gyro = np.stack([0.2 * np.sin(TURNING * time + k) for k in range(3)], axis=1)
    accel = np.stack([9.0 + np.cos(TURNING * time + k) for k in range(3)], axis=1)
    return ImuRecord(time, gyro, accel) if kind == "rates" else ImuRecord(time, gyro / RATE, accel / RATE, kind=kind)


def pushed(felt, record, chunk):
    rows = np.column_stack([record.time, record.gyro, record.accel])
    return np.vstack([felt.corrected(rows[i : i + chunk]) for i in range(0, len(rows), chunk)])


SPEC = replace(
    imu_spec("tactical"),
    gyro_latency=0.012,
    accel_bandwidth=80.0,
    accel_positions=((0.0, 0.03, 0.0), (0.0, 0.0, 0.04), (0.05, 0.0, 0.0)),
)


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("spec", [SPEC, replace(SPEC, gyro_latency=0.0)], ids=["gyros later", "accelerometers later"])
def test_they_are_the_rows_of_the_whole_log(kind, spec):
    record = motion(kind)
    rows, whole = pushed(Felt(spec, kind), record, 7), corrected(record, spec)
    assert np.allclose(rows[:, 0], whole.time, rtol=0.0, atol=1e-12)
    assert np.allclose(rows[:, 1:4], whole.gyro, rtol=0.0, atol=1e-12)
    # The slope to the row before is that of half an interval earlier: r w'' / (2 rate) at the most.
    late = 0.05 * 0.2 * TURNING**2 / (2.0 * RATE)
    scale = 1.0 if kind == "rates" else 1.0 / RATE
    off = np.abs(rows[3:-3, 4:] - whole.accel[3:-3]).max() / scale
    assert 0.0 < off < late * 1.1


def test_the_same_whatever_the_chunks_and_out_of_order():
    record = motion("rates")
    one, many = pushed(Felt(SPEC), record, 1), pushed(Felt(SPEC), record, 100)
    assert np.array_equal(one, many)
    rows = np.column_stack([record.time, record.gyro, record.accel])
    felt = Felt(SPEC)
    felt.corrected(rows[:50])
    felt.corrected(rows[51:60])
    assert np.allclose(felt.corrected(rows[50:51]), many[50:51], rtol=0.0, atol=1e-12)


def test_what_is_known_is_in_no_specification_any_more():
    plain = without_known(SPEC)
    assert lag(plain, "gyro") == lag(plain, "accel") == 0.0
    assert plain.accel_positions is None
    assert not Felt(plain).known
