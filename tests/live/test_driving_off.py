"""A van that waits and drives off: its heading is carried on by the gyros, or goes on in motion, within its sigma all along."""

import math

import numpy as np
import pytest

import truenorth as tn
from truenorth.live import Aligner
from truenorth.simulation.scenario import read_scenario

WAIT, DURATION = 120.0, 240.0


@pytest.fixture(scope="module")
def van():
    content = read_scenario("van").to_mapping() | {"duration": f"{DURATION:g} s", "imu": "navigation", "rate": "50 Hz"}
    content["motion"]["wait"] = f"{WAIT:g} s"
    scenario = read_scenario(content)
    return scenario.simulate(seed=5), scenario.simulate_aiding(seed=5)["gnss"].record


def watched(aligner, sim, gnss=None):
    """The run's answers every five seconds, with the heading's error in sigmas."""
    record, fix, found = sim.record, 0, []
    for first in range(0, len(record), 25):
        part = slice(first, first + 25)
        aligner.push(record.time[part], record.gyro[part], record.accel[part])
        while gnss is not None and fix < len(gnss) and gnss.time[fix] + 0.3 <= record.time[part][-1]:
            one = slice(fix, fix + 1)
            aligner.push_gnss(gnss.time[one], gnss.lat[one], gnss.lon[one], gnss.alt[one], v_n=gnss.v_n[one])
            fix += 1
        answer = aligner.answer if first % 250 == 0 else None
        if answer is not None and answer.heading_known:
            C = sim.motion.states(np.array([answer.time])).C_nb[0]
            off = (answer.euler[0] - math.atan2(C[0, 1], C[1, 1]) + math.pi) % (2.0 * math.pi) - math.pi
            found.append((answer, abs(off) / answer.sigma[0]))
    return found


@pytest.mark.slow
def test_without_another_sensor_the_gyros_carry_the_heading_on(van):
    sim, _ = van
    place = tn.Position(float(sim.truth.lat[0]), float(sim.truth.lon[0]), float(sim.truth.alt[0]))
    with Aligner(place, "navigation", kind=sim.record.kind, background=False) as aligner:
        answers = watched(aligner, sim)
        final = aligner.finish()
    assert WAIT - 5.0 < aligner.left <= WAIT + 1.0
    assert final.status == "aligned"
    assert final.time <= aligner.left
    assert len(answers) > 30
    assert max(ratio for _, ratio in answers) < 4.0
    last, _ = answers[-1]
    assert last.time > DURATION - 6.0
    assert any("the gyros carry it on" in reason for reason in last.reasons)
    assert last.sigma[0] > final.euler_sigma[0]


@pytest.mark.slow
def test_with_fixes_alignment_goes_on_in_motion(van):
    sim, gnss = van
    with Aligner(None, "navigation", kind=sim.record.kind, background=False) as aligner:
        answers = watched(aligner, sim, gnss)
        final = aligner.finish()
    assert max(ratio for _, ratio in answers) < 4.0
    assert final.moving is not None
    assert final.status == "aligned"
    assert WAIT - 5.0 < aligner.left < WAIT + 6.0
    last, _ = answers[-1]
    assert any("goes on in motion" in reason for reason in last.reasons)
    before = [answer for answer, _ in answers if answer.time < WAIT]
    after = [answer for answer, _ in answers if answer.time > WAIT]
    assert before
    assert after
    gap = max(np.diff([answer.time for answer, _ in answers]))
    assert gap < 10.1  # no stretch without an answer
