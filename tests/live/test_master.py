"""Live against a master INS: the answer of the whole log, and navigation goes on between two solutions."""

import math

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.live import Aligner
from truenorth.records import MasterRecord
from truenorth.simulation import Sway, Tone, simulate
from truenorth.simulation.scenario import read_scenario

DURATION, LATE = 60.0, 0.3


@pytest.fixture(scope="module")
def flight():
    """An aircraft that turns after 30 s; the master is 30 ms late, which nobody says."""
    content = read_scenario("transfer_flat_turn").to_mapping() | {
        "duration": f"{DURATION:g} s",
        "rate": "50 Hz",
        "imu": "tactical",
    }
    content["motion"]["legs"][0]["duration"] = "30 s"
    content["motion"]["legs"] = content["motion"]["legs"][:2]
    scenario = read_scenario(content)
    sim = scenario.simulate(seed=1)
    return sim, scenario.simulate_aiding(seed=1)["master"].record


def place_of(sim):
    return tn.Position(float(sim.truth.lat[0]), float(sim.truth.lon[0]), float(sim.truth.alt[0]))


def fed(aligner, record, master, chunk):
    """Rows as they come; those of the master some tenths of a second late."""
    at = 0
    for first in range(0, len(record), chunk):
        part = slice(first, first + chunk)
        while at < len(master) and master.time[at] + LATE <= record.time[part][-1]:
            aligner.push_master(master.time[at], master.C_nb[at : at + 1], master.v_n[at : at + 1])
            at += 1
        aligner.push(record.time[part], record.gyro[part], record.accel[part])


@pytest.mark.slow
@pytest.mark.parametrize("chunk", some([13], [1, 1000]))
def test_the_last_answer_is_that_of_the_whole_log_to_the_bit(flight, chunk):
    sim, master = flight
    record, place = sim.record, place_of(sim)
    with Aligner(place, "tactical", kind=record.kind, background=False) as aligner:
        fed(aligner, record, master, chunk)
        found, answer = aligner.finish(), aligner.answer
    kept = int(np.searchsorted(master.time, record.time[-1] - LATE, side="right"))
    seen = MasterRecord(master.time[:kept], master.C_nb[:kept], master.v_n[:kept])
    whole = tn.align(record, place, "tactical", aid=[tn.Master(seen)])
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert np.array_equal(found.phi_covariance, whole.phi_covariance)
    assert found.status == whole.status
    assert found.transfer is not None
    assert answer.time == record.time[-1]


@pytest.mark.slow
def test_between_two_solutions_navigation_goes_on(flight):
    sim, master = flight
    record = sim.record
    stop = int(np.searchsorted(record.time, 57.0))
    with Aligner(place_of(sim), "tactical", kind=record.kind, background=False) as aligner:
        fed(aligner, record[:stop], master, 25)
        answer = aligner.answer
    assert answer.solution.time < answer.time
    truth = sim.motion.states(np.array([answer.time]))
    off = answer.euler[0] - math.atan2(truth.C_nb[0, 0, 1], truth.C_nb[0, 1, 1])
    assert abs((off + math.pi) % (2.0 * math.pi) - math.pi) < 4.0 * answer.sigma[0]
    assert np.all(np.abs(answer.motion.v_n - truth.v_n[0]) < 4.0 * answer.motion.v_sigma + 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_between_solutions_a_ship_heaves_and_rolls_as_surely_as_is_said(kind):
    """Her height is not held, and her motion goes on from where the master's last row falls within a row of the IMU."""
    place = tn.Position.from_degrees(45.0, 10.0)
    motion = Sway(
        place,
        heading=0.7,
        heading_tones=(Tone(0.02, 11.0),),
        pitch_tones=(Tone(0.02, 6.0),),
        roll_tones=(Tone(0.1, 9.0),),
        up_tones=(Tone(0.8, 8.0),),
        lever_arm=(1.0, 5.0, 2.0),
    )
    record = simulate(motion, rate=25.0, duration=100.0, imu="tactical", seed=5, kind=kind).record
    rng, time = np.random.default_rng(5), np.arange(0.331, 100.0, 0.2)
    true = motion.states(time)
    seen = true.v_n + 0.03 * rng.normal(size=(len(time), 3))
    answers, at = [], 0
    with Aligner(place, "tactical", kind=kind, background=False) as aligner:
        for first in range(0, len(record), 25):
            part = slice(first, first + 25)
            while at < len(time) and time[at] + LATE <= record.time[part][-1]:
                aligner.push_master(time[at], true.C_nb[at : at + 1], seen[at : at + 1])
                at += 1
            aligner.push(record.time[part], record.gyro[part], record.accel[part])
            answers += [] if aligner.answer is None else [aligner.answer]
    v_n = motion.states(np.array([a.time for a in answers])).v_n
    assert np.ptp(v_n[:, 2]) > 1.0
    sigma = np.stack([a.motion.v_sigma for a in answers])
    assert sigma.min() > 1e-4
    ratio = (np.stack([a.motion.v_n for a in answers]) - v_n) / sigma
    assert np.abs(ratio).max() < 4.0
    assert np.sqrt(np.mean(ratio**2)) < 1.5
