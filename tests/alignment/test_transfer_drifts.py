"""A master whose heading drifts, and one whose stamps are later than said: named by likelihood, and sound ones not refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.verdict import grown
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.evidence import Effect
from truenorth.state.layout import DV, PHI

ARCMIN = math.radians(1.0 / 60.0)
DEG = math.radians(1.0)


def _logs(run, seconds, grade, rate=2.0, late=0.0):
    legs = [*straight(15.0), *s_turn(20 * DEG, 3 * DEG), *straight(30.0), *s_turn(20 * DEG, 3 * DEG), *straight(300.0)]
    way = course(Position.from_degrees(50.0, 20.0, 3000.0), legs, heading=0.6, speed=100.0)
    slave = simulate(way, rate=50.0, duration=seconds, imu=imu_spec(grade), seed=6120, run=run).record
    of_master = MasterSpec(rate=rate, clock_offset=late, velocity_noise=0.05, attitude_noise=ARCMIN)
    return slave, simulate_sensor(way, of_master, duration=seconds, seed=6120, run=run).record


def _keys(answer):
    return {item.key for item in answer.evidence}


@pytest.mark.slow
@pytest.mark.parametrize("run", range(3))
def test_a_heading_that_drifts_is_named(run):
    """1.4 arcmin a minute, of a master taken for the truth: a navigation slave shows it, and a sound master is not refused."""
    slave, master = _logs(run, 200.0, "navigation")
    turned = np.zeros((len(master), 3))
    turned[:, 2] = 1.4 * ARCMIN / 60.0 * (master.time - master.time[0])
    drifting = replace(master, C_nb=dcm_from_rotation_vector(turned) @ master.C_nb)
    known = {"lever_arm_sigma": 0.3, "matching": "both"}
    sound = align_transfer(slave, master, "navigation", **known)
    assert sound.status == "aligned"
    assert "rival.master_heading" not in _keys(sound)
    found = align_transfer(slave, drifting, "navigation", **known)
    assert "rival.master_heading" in _keys(found)
    off = rotation_vector_from_dcm(found.C_nb @ sound.C_nb.T)[2]
    assert found.status == "inconsistent" or abs(off) < 4.0 * found.euler_sigma[0]  # named, or in sigma
    said = align_transfer(slave, drifting, "navigation", **known, master_errors="heading=2 arcmin,level=0.3 arcmin")
    assert said.status == "aligned"


@pytest.mark.slow
@pytest.mark.parametrize("run", range(3))
def test_a_delay_that_a_short_log_holds_where_it_was_said(run):
    """Known to 5 ms, and .3 s wrong, by velocity of a row a second: it came out where it was said, and nothing spoke against it."""
    known = {"lever_arm_sigma": 0.3, "matching": "velocity", "delay_sigma": 0.005}
    wrong = align_transfer(*_logs(run, 60.0, "tactical", rate=1.0, late=0.3), "tactical", **known)
    assert wrong.status == "inconsistent"
    named = [item for item in wrong.evidence if item.key == "transfer.delay"]
    assert len(named) == 1
    assert named[0].figures["miss"] == pytest.approx(0.3, abs=0.05)
    assert align_transfer(*_logs(run, 60.0, "tactical", rate=1.0), "tactical", **known).status == "aligned"


@pytest.mark.slow
@pytest.mark.parametrize(("seconds", "rate", "grade"), [(60.0, 2.0, "tactical"), (120.0, 1.0, "navigation")])
@pytest.mark.parametrize("late", [0.3, -0.3])
def test_a_delay_by_attitude_alone_is_named(seconds, rate, grade, late):
    """Known to 5 ms, and .3 s wrong: the noise that was fitted held it, and the delay was 56 of its sigmas off, aligned."""
    known = {"lever_arm_sigma": 0.3, "matching": "attitude", "delay_sigma": 0.005}
    wrong = align_transfer(*_logs(0, seconds, grade, rate=rate, late=late), grade, **known)
    assert wrong.status == "inconsistent"
    (named,) = [item for item in wrong.evidence if item.key == "transfer.delay"]
    assert named.figures["miss"] == pytest.approx(0.3, abs=0.05)
    assert "rival.master_heading" not in _keys(wrong)
    sound = align_transfer(*_logs(0, seconds, grade, rate=rate), grade, **known)
    assert sound.status == "aligned"
    assert abs(sound.transfer.delay) < 4.0 * sound.transfer.delay_sigma


@pytest.mark.slow
def test_a_heading_that_drifts_is_no_delay_by_attitude_alone():
    """3 arcmin a minute are no delay."""
    slave, master = _logs(0, 200.0, "navigation")
    turned = np.zeros((len(master), 3))
    turned[:, 2] = 3.0 * ARCMIN / 60.0 * (master.time - master.time[0])
    drifting = replace(master, C_nb=dcm_from_rotation_vector(turned) @ master.C_nb)
    found = align_transfer(slave, drifting, "navigation", matching="attitude", delay_sigma=0.005)
    assert "transfer.delay" not in _keys(found)


@pytest.mark.slow
def test_what_is_added_is_in_what_navigation_begins_with():
    """Attitude and velocity of the covariance that goes on are as unsure as the answer."""
    answer = align_transfer(*_logs(0, 60.0, "tactical"), "tactical", lever_arm_sigma=0.3)
    added = Effect(heading=2e-3, level=1e-3, velocity=0.2)
    before, after = answer.transfer.P, grown(answer, added).transfer.P
    np.testing.assert_allclose(np.diag(after - before)[PHI], np.square([1e-3, 1e-3, 2e-3]))
    assert np.sqrt(np.diag(after)[DV].max()) == pytest.approx(math.hypot(np.sqrt(np.diag(before)[DV].max()), 0.2))


@pytest.mark.parametrize("matching", some(["position"], ["position+attitude"]))
def test_places_of_a_master_whose_velocity_errs_name_no_heading(matching):
    """A drift of heading acts on no place, and as a rival has the master's other errors too: without one of them it broke down."""
    known = {"lever_arm_sigma": 0.3, "matching": matching, "master_errors": "navigation"}
    answer = align_transfer(*_logs(0, 200.0, "navigation"), "navigation", **known)
    assert answer.status == "aligned"
    assert "rival.master_heading" not in _keys(answer)
