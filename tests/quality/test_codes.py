"""Codes that a converter misses and dead bands: found where they are, with what they take, and not in sound sensors."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.quality.codes import _most_alike, codes_evidence, piled_up
from truenorth.records import ImuRecord

ROWS = 6000


def swung(rng):
    """A sensor that swings and has noise."""
    return np.sin(0.01 * np.arange(ROWS)) + 0.05 * rng.standard_normal(ROWS)


@pytest.mark.parametrize("step", [0.0, 1e-3])
def test_a_missing_code_is_found_where_it_is(step):
    """Of values with many digits, and of counts."""
    values = swung(np.random.default_rng(1))
    values = step * np.round(values / step) if step else values
    low, width = 0.3, 0.06
    spoilt = np.where((values > low) & (values < low + width), low, values)
    pile = piled_up(spoilt)
    assert pile is not None
    assert pile.value == pytest.approx(low, abs=1e-12)
    assert pile.above == pytest.approx(width, abs=0.005)
    assert pile.below < 0.01
    assert pile.rows >= np.count_nonzero((values > low) & (values < low + width))


def test_of_a_dead_band_the_turn_that_is_lost_is_within_what_is_said():
    """Rates that pass slowly through a band that reads zero, on one side of it only."""
    rng = np.random.default_rng(2)
    rate = 0.03 + 0.3 * np.sin(0.01 * np.arange(ROWS)) + 0.002 * rng.standard_normal(ROWS)
    dead = np.where(np.abs(rate) < 0.02, 0.0, rate)
    time, other = 0.01 * np.arange(1.0, ROWS + 1.0), 0.01 * rng.standard_normal((ROWS, 3))
    record = ImuRecord(time, np.column_stack([dead, other[:, :2]]), other + np.array([0.0, 0.0, 9.8]), "rates")
    (found,) = codes_evidence(record)
    assert found.figures["name"] == "gyro_x"
    assert abs(np.sum(dead - rate)) * 0.01 < found.effect.level
    at_rest = codes_evidence(record, 0.6)[0].effect
    assert at_rest.level == 0.0 < at_rest.heading
    assert codes_evidence(replace(record, gyro=other)) == []


def test_sound_sensors_have_none():
    """Noise, counts finer and coarser than it, counts rescaled so that every third is left out, a rate that is held and let go."""
    rng = np.random.default_rng(3)
    noise = swung(rng)
    ramp = np.clip(np.abs(np.arange(ROWS) % 2000 - 1000) - 300.0, 0.0, 400.0) / 400.0
    for values in (
        rng.standard_normal(ROWS),
        noise,
        np.round(noise / 0.02) * 0.02,
        np.round(noise / 0.2) * 0.2,
        np.round(1.5 * np.round(noise / 0.002)) * 0.002,
        ramp,
        ramp + 1e-3 * rng.standard_normal(ROWS),
    ):
        assert piled_up(values) is None


@pytest.mark.parametrize("seed", range(6))
def test_counts_that_were_added_up_and_taken_apart_miss_none(seed):
    """Increments of an angle in counts: zero has one value, each other count many, which differ in their last digits."""
    rng = np.random.default_rng(seed)
    rate = 30.0 * np.sin(0.02 * np.arange(ROWS)) + 2.0 * rng.standard_normal(ROWS)
    count = 4.848136811095e-7
    angle = count * np.round(np.cumsum(rate))
    dtheta = np.diff(angle, prepend=0.0)
    assert piled_up(dtheta) is None


def test_a_short_channel_has_no_pile():
    """Of 10 to 13 rows two slices of another length were compared."""
    for rows in range(1, 20):
        assert piled_up(np.arange(rows) % 3.0) is None


@pytest.mark.parametrize("zero", [0.0, -0.0])
def test_rows_of_one_value_are_never_missed(zero):
    """The quick count is no less than the rows of the most frequent value, be it a zero of either sign."""
    rng = np.random.default_rng(4)
    values = rng.standard_normal(200_000)
    assert _most_alike(values) < 15
    for value in (0.3, zero):
        values[rng.choice(len(values), 40, replace=False)] = np.where(np.arange(40) % 2, value, abs(value))
        assert _most_alike(values) >= 40
    assert _most_alike(np.round(values)) >= np.unique(np.round(values), return_counts=True)[1].max()
