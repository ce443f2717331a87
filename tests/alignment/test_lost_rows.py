"""Rows that are lost on a base that shakes: what a bridge misses is noise of the filter, and the answer stays within its sigma."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth as tn
from benchmarks.honesty import transfer
from tests.recordings import rlg_vehicle_xian
from truenorth.alignment.task import lost_walk, noise_in
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_a_bridge_misses_what_it_would_miss_of_rows_that_are_there(kind):
    """White noise of sigma s: of a row s^2 (1 + 1/2), of two s^2 (2 + 2) are missed."""
    rng, interval, s = np.random.default_rng(1), 0.01, 0.3
    time = interval * np.arange(1, 40_001)
    x = s * rng.standard_normal((len(time), 3)) * (interval if kind == "increments" else 1.0)
    keep = np.ones(len(time), dtype=bool)
    keep[1000:39_000:200] = False  # 190 rows
    keep[1100:39_000:400] = keep[1101:39_000:400] = False  # 95 pairs
    record = ImuRecord(
        time[keep], x[keep], x[keep] + [0.0, 0.0, 9.8 * (interval if kind == "increments" else 1.0)], kind
    )
    expected = s * interval * np.sqrt((190 * 1.5 + 95 * 4.0) / record.duration)
    assert lost_walk(record, record.gyro) == pytest.approx(expected, rel=0.03)
    whole = ImuRecord(time, x, x, kind)
    assert lost_walk(whole, whole.gyro) == 0.0
    spec = imu_spec("navigation")
    assert noise_in(record, spec).accel_random_walk == pytest.approx(
        np.hypot(spec.accel_random_walk, expected), rel=0.05
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_hundredth_of_the_rows_lost_leaves_a_heading(seed):
    """People get in and out, the engine shakes the car: with the specification alone heading was refused, its sigma a fifth."""
    whole = rlg_vehicle_xian()[0][:30_000]
    place = tn.Position.from_degrees(34.246, 108.91, 380.0)
    keep = np.random.default_rng(seed).random(len(whole)) > 0.01
    record = ImuRecord(whole.time[keep], whole.gyro[keep], whole.accel[keep], whole.kind)
    best, found = (tn.align(log, place, imu="navigation") for log in (whole, record))
    assert found.status == "aligned"
    assert abs(found.heading - best.heading) < 3.0 * found.euler_sigma[0]


def shaken_and_lost(record):
    """An engine shakes the slave, by 1 m/s^2 and .02 deg/s to and fro from row to row, and a twentieth of its rows are lost."""
    rng = np.random.default_rng(8)
    shake = np.diff(rng.standard_normal((len(record) + 1, 6)), axis=0) * [*[np.radians(0.02)] * 3, *[1.0] * 3]
    shake *= record.interval if record.kind == "increments" else 1.0
    keep = rng.random(len(record)) > 0.05
    keep[:3] = True
    gyro, accel = record.gyro + shake[:, :3], record.accel + shake[:, 3:]
    return replace(record, time=record.time[keep], gyro=gyro[keep], accel=accel[keep])


@pytest.mark.slow
def test_a_slave_whose_rows_are_lost_is_no_poorer_one(monkeypatch):
    """What bridges miss is noise of the filter: it was taken for a bending body, and all such logs were refused."""
    whole = transfer.align_transfer
    monkeypatch.setattr(transfer, "align_transfer", lambda slave, *a, **k: whole(shaken_and_lost(slave), *a, **k))
    found = transfer.transferred(transfer.ship, transfer.ERRORS)(5, 0)
    assert not found.refused
    assert max(np.nanmax(np.abs(ratio)) for ratio in found.ratios.values()) < 4.0
