"""Single rows that stand out: taken off where they are errors, left where the measurements show them."""

from dataclasses import replace

import numpy as np
import pytest

from tests.alignment.test_suspect import track
from truenorth.campaign.faults import run_faults
from truenorth.estimate.spiked import spike_evidence, without_spikes
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import across_gaps

ROWS = 4000
TIME = 0.02 * np.arange(1.0, ROWS + 1.0)


def shaken(rng):
    """A vehicle that vibrates at 12 Hz, gathers way in a row and has noise."""
    accel = 0.01 * rng.standard_normal((ROWS, 3)) + [0.0, 0.0, 9.8]
    accel += 0.05 * np.sin(2.0 * np.pi * 12.0 * TIME)[:, None]
    accel[2000:] += [0.0, 1.5, 0.0]
    return ImuRecord(TIME, 0.001 * rng.standard_normal((ROWS, 3)), accel, "rates")


def test_spikes_are_taken_off_and_nothing_else_is():
    record = shaken(np.random.default_rng(1))
    assert without_spikes(record) == (record, 0)
    at = np.arange(100, ROWS - 100, 97)
    accel, gyro = record.accel.copy(), record.gyro.copy()
    accel[at, 0] += 0.6
    gyro[at[:5] + 7, 2] -= 0.05
    mended, count = without_spikes(replace(record, accel=accel, gyro=gyro))
    assert count == len(at) + 5
    assert np.abs(mended.accel - record.accel)[at, 0].max() < 0.1
    rest = np.delete(mended.accel, at, axis=0)
    np.testing.assert_array_equal(rest, np.delete(record.accel, at, axis=0))


def test_a_row_that_holds_a_gap_is_as_long_as_that_and_no_spike():
    """A car with four gaps had 22 spikes, and heading's sigma grew from 12 arcmin to 2.5 deg."""
    rates = shaken(np.random.default_rng(4))
    keep = np.ones(ROWS, dtype=bool)
    for row in (500, 1500, 3000):
        keep[row : row + 20] = False
    gaps = ImuRecord(TIME[keep], rates.gyro[keep] * 0.02 + 0.001, rates.accel[keep] * 0.02, "increments")
    record = across_gaps(gaps)
    assert without_spikes(record) == (record, 0)
    accel = record.accel.copy()
    at = np.arange(100, len(record) - 100, 97)
    accel[at, 0] += 0.012
    mended, count = without_spikes(replace(record, accel=accel))
    assert count == len(at)
    assert np.abs(mended.accel - record.accel)[at, 0].max() < 0.002


def test_a_spike_in_the_row_before_a_gap_is_one():
    """The bridge holds a half of it for each row that is lost: two rows in a row stood out, which are no single ones."""
    rates = shaken(np.random.default_rng(5))
    keep = np.ones(ROWS, dtype=bool)
    for row in (500, 1500, 3000):
        keep[row : row + 3] = False
    sound = ImuRecord(TIME[keep], rates.gyro[keep] * 0.02, rates.accel[keep] * 0.02, "increments")
    accel = sound.accel.copy()
    accel[sound.gaps - 1, 0] += 0.012
    mended, count = without_spikes(across_gaps(replace(sound, accel=accel)))
    assert count == 3
    assert np.abs(mended.accel - across_gaps(sound).accel).max() < 0.004


@pytest.mark.parametrize("true", [False, True])
def test_knocks_that_the_measurements_show_are_left(true):
    """Velocities follow the sum of the rows: with those that are true, or without."""
    sound = shaken(np.random.default_rng(2))
    accel = sound.accel.copy()
    accel[np.arange(50, ROWS, 101), 0] += 1.0
    log = replace(sound, accel=accel)
    moved = log if true else sound
    first = track(1.0, level=0.0)
    noise = np.random.default_rng(3).standard_normal(first.residuals[0].innovation.shape)
    edges = np.linspace(0, ROWS, len(noise) + 1).astype(int)[1:] - 1

    def run(record):
        off = np.cumsum(record.accel[:, 0] - moved.accel[:, 0])[edges] * 0.02 / 0.05
        z = noise + np.column_stack([off, np.zeros((len(off), noise.shape[1] - 1))])
        source = replace(first.residuals[0], innovation=z, nis=np.sum(z**2, axis=1))
        C_nb = first.C_nb.copy()
        C_nb[:, 0, 1] = 0.1 * off[-1]
        return replace(first, residuals=(source,), C_nb=C_nb)

    found = spike_evidence(run, run(log), log)
    assert bool(found) != true
    if found:
        assert found[0].figures["count"] == 40


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["odometer", "gnss", "transfer", "navigate"])
def test_none_passes_in_silence(procedure):
    assert [t for t in run_faults([procedure], ["spikes"], runs=3, seed=7119) if t.outcome == "silent"] == []
