"""Transfer alignment: what is said of sigma is what the result holds, and what was said of the master is used."""

import math

import numpy as np
import pytest

from truenorth.alignment import transfer
from truenorth.alignment.transfer import align_transfer
from truenorth.core.position import Position
from truenorth.errors.master import MASTERS
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight
from truenorth.state.evidence import Effect, Evidence

ARCMIN = math.radians(1.0 / 60.0)


@pytest.fixture(scope="module")
def flight():
    """A slave and its master, 30 s with an S-turn."""
    way = course(
        Position.from_degrees(34.0, 109.0, 1000.0), [*straight(5.0), *s_turn(0.3, 0.05), *straight(60.0)], speed=60.0
    )
    slave = simulate(way, rate=100.0, duration=30.0, imu=imu_spec("tactical"), seed=1).record
    return slave, simulate_sensor(way, MasterSpec(velocity_noise=0.05), duration=30.0, seed=1).record


def _against(answer):
    return next(item for item in answer.evidence if item.key in ("transfer.absolute", "transfer.relative"))


def test_the_sentence_has_the_sigma_of_the_summary_where_a_rival_widens_it(flight, monkeypatch):
    """Of a hint of 5 arcmin both say so; the sentence said 1.7 arcmin, the summary 3.9."""
    widens = Evidence("rival.master_heading", {"size": 5.0 * ARCMIN}, "hint", Effect(heading=5.0 * ARCMIN))
    monkeypatch.setattr(transfer, "_rivals", lambda *_: [widens])
    answer = align_transfer(*flight, "tactical", matching="velocity", master_errors="navigation")
    said = _against(answer).figures
    assert said["heading"] > 5.0 * ARCMIN
    heading, pitch, roll = answer.transfer.relative_sigma
    assert (said["heading"], said["level"]) == (heading, max(pitch, roll))


def test_positions_alone_count_what_of_the_masters_errors_acts_on_them(flight, monkeypatch):
    """A drift of its velocity is in level, its velocity in the slave's; attitude against it has both errors. It said: not given."""
    monkeypatch.setattr(transfer, "_rivals", lambda *_: [])
    given, errors = {"matching": "position", "mounting_sigma": 0.0}, MASTERS["navigation"]
    stated, truth = (align_transfer(*flight, "tactical", master_errors=e, **given) for e in ("navigation", "none"))
    assert stated.transfer.considered
    assert _against(stated).key == "transfer.absolute"
    assert not truth.transfer.considered
    assert stated.euler_sigma[1] > truth.euler_sigma[1]
    assert np.all(np.diag(stated.transfer.P)[3:6] > 2.0 * errors.velocity**2)
    # The start is the master's attitude, through a seat that is known; what positions find of it is the slave's own.
    assert np.all(stated.transfer.relative_sigma >= errors.attitude[[2, 0, 1]])
    np.testing.assert_allclose(stated.transfer.relative_sigma[0], math.hypot(stated.euler_sigma[0], errors.attitude[2]))
