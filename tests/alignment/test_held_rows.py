"""A slower sensor written at a faster clock: rows that repeat the one before hold a sample, which is taken once."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth as tn
from truenorth.core.attitude import euler_from_dcm
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario

HELD = {
    "every third": lambda k: np.where(k % 3 == 2, k - 1, k),
    "every second": lambda k: k // 2 * 2,
    "110 Hz at 166 Hz": lambda k: np.ceil(np.floor(k * 110 / 166) * 166 / 110 - 1e-9).astype(int),
}


@pytest.fixture(scope="module")
def van():
    """A van with GNSS for three minutes, as rates: record, receiver, true attitude at a time."""
    built = read_scenario({**read_scenario("van").to_mapping(), "duration": "240 s"})
    drive, gnss = built.simulate(run=1), built.simulate_aiding(run=1)["gnss"].record
    record, truth = drive.record, drive.truth.trajectory()
    unit = record.interval if record.kind == "increments" else 1.0
    record = ImuRecord(record.time, record.gyro / unit, record.accel / unit).between(None, 180.0)
    return record, gnss, lambda t: euler_from_dcm(truth.C_nb[np.argmin(np.abs(truth.time - t))])


def written(record, rows):
    """The record with other rows' values."""
    return replace(record, gyro=record.gyro[rows], accel=record.accel[rows])


def off(found, true):
    """Attitude errors over their sigmas."""
    e = found.euler - np.array(true(found.time))
    return np.abs((e + np.pi) % (2.0 * np.pi) - np.pi) / found.euler_sigma


@pytest.fixture(scope="module")
def whole(van):
    record, gnss, _ = van
    return tn.align(record, aid=tn.Gnss(gnss), imu="industrial")


@pytest.mark.slow
@pytest.mark.parametrize("how", ["every second", "every third", "110 Hz at 166 Hz"])
def test_a_van_whose_sensor_is_slower_than_its_log(van, whole, how):
    """`inconsistent` before, though within 2.3 sigma."""
    record, gnss, true = van
    held = written(record, HELD[how](np.arange(len(record))))
    found = tn.align(held, aid=tn.Gnss(gnss), imu="industrial")
    assert found.status == whole.status == "aligned", found.reasons
    assert np.all(off(found, true) < 4.0)
    assert np.all(found.euler_sigma < 1.3 * whole.euler_sigma)
    assert [item.key for item in found.evidence].count("record.repeated_rows") == 1


@pytest.mark.slow
def test_samples_that_are_held_for_ten_rows_are_said(van):
    record, gnss, _ = van
    held = written(record, np.arange(len(record)) // 10 * 10)
    assert tn.align(held, aid=tn.Gnss(gnss), imu="industrial").status == "inconsistent"


@pytest.mark.slow
def test_rows_that_are_doubled_by_chance_are_said(van):
    """Each with a time of its own: the log's clock is wrong, and no row is left out."""
    record, gnss, _ = van
    again = np.flatnonzero(np.random.default_rng(3).random(len(record)) < 0.1)
    rows = np.sort(np.concatenate([np.arange(len(record)), again]))[: len(record)]
    assert tn.align(written(record, rows), aid=tn.Gnss(gnss), imu="industrial").status == "inconsistent"


@pytest.mark.slow
@pytest.mark.parametrize("how", HELD)
def test_it_is_navigated(van, how):
    record, gnss, true = van
    held = written(record, HELD[how](np.arange(len(record))))
    aid = tn.Gnss(gnss)
    start = tn.align(held.between(None, 110.0), aid=aid, imu="industrial")
    best, found = (tn.navigate(log, start, aid=aid, imu="industrial") for log in (record, held))
    assert found.status == best.status == "navigated", found.reasons
    assert "record.repeated_rows" in [item.key for item in found.evidence]
    e = found.euler[-1] - np.array(true(found.time[-1]))
    assert np.all(np.abs((e + np.pi) % (2.0 * np.pi) - np.pi) < 4.0 * found.euler_sigma[-1])
    assert np.all(found.track.sigma[-1, :3] < 1.3 * best.track.sigma[-1, :3])


def test_at_rest_nothing_changes_but_by_the_samples_that_are_there():
    built = read_scenario({**read_scenario("van").to_mapping(), "duration": "120 s"})
    still = built.simulate(run=0).record.between(None, 30.0)
    unit = still.interval if still.kind == "increments" else 1.0
    record = ImuRecord(still.time, still.gyro / unit, still.accel / unit)
    held = written(record, np.arange(len(record)) // 2 * 2)
    place = (40.0, 116.0)
    best, found = (tn.align(log, place, imu="industrial", at=float(record.time[-1])) for log in (record, held))
    assert found.status == best.status
    assert np.all(np.abs(found.euler[1:] - best.euler[1:]) < best.euler_sigma[1:])
    assert found.euler_sigma == pytest.approx(best.euler_sigma, rel=0.3)
