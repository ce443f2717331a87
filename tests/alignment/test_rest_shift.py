"""Stops at which gyros show another rate than at the others: biases that change on the way."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.alignment.rest_shift import shift_evidence
from truenorth.navigation.stops import turned_in_stops
from truenorth.records.specs import imu_spec
from truenorth.simulation.scenario import read_scenario
from truenorth.state.state import Start

SHIFT = np.radians([0.0, 0.1, 0.5])  # rad/s, of a UAV whose engine starts, or of rates that a filter has corrected
WHEN = 80.0  # s: the van drives


def van(seed):
    """A van with a consumer IMU that stands for 30 s, drives, and stops for 20 s; its log and its receiver's."""
    scenario = read_scenario({**read_scenario("van").to_mapping(), "duration": "200 s", "imu": "consumer"})
    return scenario.simulate(run=seed), scenario.simulate_aiding(run=seed)["gnss"].record


def shifted(record):
    """The log whose gyros have another bias from `WHEN` on."""
    off = np.where(record.time[:, None] > WHEN, SHIFT, 0.0)
    return replace(record, gyro=record.gyro + (off * record.steps[:, None] if record.kind == "increments" else off))


@pytest.mark.parametrize("seed", some([0], [1]))
def test_seconds_of_another_rate_are_those_after_the_change(seed):
    log, gnss = van(seed)
    assert turned_in_stops(log.record, None, gnss)[0].size == 0
    at, off = turned_in_stops(shifted(log.record), None, gnss)
    assert at.size >= 5
    late = at > WHEN  # rest is what most seconds are
    assert late.all() or not late.any()
    np.testing.assert_allclose(np.median(off, axis=0), SHIFT if late.all() else -SHIFT, atol=np.radians(0.05))


@pytest.mark.slow
def test_a_heading_that_such_a_change_turns_is_not_said_to_be_known():
    """Said, and no error above four sigmas under a good status; the sound log says nothing of it."""
    log, gnss = van(0)
    sound = tn.align(log.record, None, "consumer", aid=tn.Gnss(gnss))
    assert sound.status == "aligned"
    assert "rest.shifts" not in {item.key for item in sound.evidence}
    answer = tn.align(shifted(log.record), None, "consumer", aid=tn.Gnss(gnss))
    assert "rest.shifts" in {item.key for item in answer.evidence}
    C = log.motion.states(np.array([answer.time])).C_nb[0]
    off = (answer.euler[0] - np.arctan2(C[0, 1], C[1, 1]) + np.pi) % (2.0 * np.pi) - np.pi
    assert answer.status == "inconsistent" or abs(off) < 4.0 * answer.euler_sigma[0]


@pytest.mark.slow
def test_a_turn_on_the_spot_between_stops_is_no_change():
    """By 10 deg within 10 s while the van stands: its heading was called 79 deg uncertain, and the log was refused."""
    log, gnss = van(0)
    record = log.record
    turning = ((record.time > 10.0) & (record.time < 20.0))[:, None] * np.radians([0.0, 0.0, -1.0])
    turned = replace(
        record, gyro=record.gyro + (turning * record.steps[:, None] if record.kind == "increments" else turning)
    )
    assert turned_in_stops(turned, None, gnss)[0].size >= 5
    track = SimpleNamespace(time=record.time[[-1]], C_nb=np.eye(3)[None])
    assert shift_evidence(turned, imu_spec("consumer"), track, None, gnss) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_navigation_says_so_too(seed):
    """It took such a change for the bias it had begun with, and did not look."""
    log, gnss = van(seed)
    spec, at = imu_spec("consumer"), log.motion.states(np.array([0.0]))
    sigma = np.repeat([np.radians(1.0), 0.05, 3.0, spec.gyro_bias, spec.accel_bias], 3)
    zero = np.zeros(3)
    place = float(at.lat[0]), float(at.lon[0]), float(at.alt[0])
    start = Start(0.0, at.C_nb[0], at.v_n[0], *place, zero, zero, np.diag(sigma**2))
    for record, is_said in ((log.record, False), (shifted(log.record), True)):
        result = tn.navigate(record, start, aid=tn.Gnss(gnss), imu=spec, check_clocks=False)
        assert ("rest.shifts" in {item.key for item in result.evidence}) == is_said
