"""A slave that is poorer than its specification: in sigma or named; and sound ones, which are neither."""

import math

import numpy as np
import pytest

from truenorth import Position
from truenorth.alignment.transfer import align_transfer
from truenorth.campaign.faults import run_faults
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight

FAULT = "specification ten times too good"


@pytest.mark.slow
def test_gyros_that_see_no_turn_have_no_scale_factor():
    """The rate of a slave that goes straight on is its noise, and a scale factor of -1 took that out: 45 where chance gives 10."""
    way = course(Position.from_degrees(20.0, 115.0), straight(400.0), heading=0.6, speed=6.0)
    spec = imu_spec("industrial")
    master = MasterSpec(
        clock_offset=0.03,
        lever_arm=(0.5, -0.3, 1.0),
        mounting=(0.05, -0.03, 0.04),
        velocity_noise=0.05,
        attitude_noise=math.radians(1.0 / 60.0),
        correlation_time=200.0,
    )
    slave = simulate(way, rate=100.0, duration=120.0, imu=spec, seed=2, run=8).record
    rows = simulate_sensor(way, master, duration=120.0, seed=2, run=8).record
    answer = align_transfer(slave, rows, spec, matching="both", lever_arm_sigma=1.0)
    assert answer.status == "aligned"
    assert not [item for item in answer.evidence if item.key.startswith("rival.")]


@pytest.mark.slow
def test_a_slave_ten_times_poorer_than_specified_is_not_wrong_in_silence():
    """The first log was 8.3 sigmas of heading off, `aligned`."""
    trials = run_faults(["transfer"], [FAULT, "none"], runs=6, seed=20611)
    assert not [trial for trial in trials if trial.outcome == "silent"]
    assert np.all([trial.outcome == "harmless" for trial in trials if trial.fault == "none"])
