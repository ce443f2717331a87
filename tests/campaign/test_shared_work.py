"""What the runs of a campaign and the steps of an alignment share is worked out once, and workers keep their memory."""

import os

import numpy as np

from truenorth.campaign.aligning import _truth_of
from truenorth.campaign.execution import one_thread_each
from truenorth.core.position import Position
from truenorth.errors.staying import StaticModel
from truenorth.estimate.staying import core_system
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.strapdown.inertial import integrate

PLACE = Position.from_degrees(45.0, 0.0)


def test_states_of_a_shared_motion_are_worked_out_once():
    motion = rest(PLACE)
    first = _truth_of(motion)(3.0)
    assert _truth_of(motion)(3.0) is first
    assert np.array_equal(first.C_nb, motion.states(np.array(3.0)).C_nb)
    assert _truth_of(rest(PLACE))(3.0) is not first


def test_check_and_alignment_share_one_linearisation_and_no_other():
    log = simulate(rest(PLACE), duration=60.0, imu="navigation", seed=1).record
    noise, P0 = StaticModel.of(imu_spec("navigation")), np.eye(12)

    def system(integrals, C, prior):
        return core_system(noise, integrals, integrals, C, PLACE, prior, "velocity")

    integrals, C = integrate(log), np.eye(3)
    one, other = system(integrals, C, P0), system(integrals, C, 4.0 * P0)
    assert other.Phi is one.Phi
    assert np.array_equal(other.P0, 4.0 * P0)
    assert np.array_equal(one.P0, P0)
    turned = system(integrals, C[[1, 0, 2]], P0)
    assert not np.array_equal(turned.Phi, one.Phi)
    biased = system(integrate(log, gyro_bias=np.array([1e-3, 0.0, 0.0])), C, P0)
    assert not np.array_equal(biased.Phi, one.Phi)


def test_workers_keep_memory_unless_the_user_says_otherwise(monkeypatch):
    monkeypatch.delenv("MALLOC_TRIM_THRESHOLD_", raising=False)
    monkeypatch.setenv("MALLOC_MMAP_THRESHOLD_", "7")
    with one_thread_each():
        assert int(os.environ["MALLOC_TRIM_THRESHOLD_"]) >= 2**25
        assert os.environ["MALLOC_MMAP_THRESHOLD_"] == "7"
    assert "MALLOC_TRIM_THRESHOLD_" not in os.environ
    assert os.environ["MALLOC_MMAP_THRESHOLD_"] == "7"
