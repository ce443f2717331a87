"""Live against a master INS: the answer of the whole log, and navigation goes on between two solutions."""

import math

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.live import Aligner
from truenorth.records import MasterRecord
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
