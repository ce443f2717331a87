"""Gyros whose biases alone are larger than specified, where the earth's rate tells heading: sound drives have no such rival."""

import pytest

from truenorth.campaign.faults import run_faults
from truenorth.estimate.poorer import BIASES, poorer
from truenorth.records.specs import imu_spec


def test_biases_of_the_gyros_grow_and_nothing_else_does():
    spec = imu_spec("navigation")
    other = poorer(spec, 10.0, BIASES["rival.gyro_biases"])
    assert other.gyro_bias == 10.0 * spec.gyro_bias
    assert (other.accel_bias, other.gyro_random_walk) == (spec.accel_bias, spec.gyro_random_walk)


@pytest.mark.slow
def test_gyros_that_feel_force_do_not_turn_a_heading_in_silence():
    """Seed 302, by odometer: three of six were 3.4 to 5.1 sigmas off, two of which measurements tell from a sound log."""
    trials = run_faults(["odometer"], ["gyros feel force", "none"], runs=6, seed=302)
    assert [t for t in trials if t.outcome in ("silent", "crash")] == []
    assert not any(t.outcome == "flagged" for t in trials if t.fault == "none")
