"""A simulated structure that bends: the slave's end moves with what it turns, and its sensors show that."""

import math

import numpy as np

from truenorth.core.position import Position
from truenorth.records.flexure import FlexureSpec
from truenorth.simulation.course import course
from truenorth.simulation.flexure import Flexed
from truenorth.simulation.manoeuvres import straight, turn

ARM, K = (6.0, -1.0, 0.5), (0.5, 0.7, 0.9)


def _way():
    legs = [*straight(3.0), *turn(np.radians(60.0), np.radians(3.0), "coordinated"), *straight(40.0)]
    return course(Position(np.radians(34.0), 0.3, 5000.0), legs, heading=np.radians(30.0), speed=200.0)


def _bent(arm=ARM):
    spec = FlexureSpec(sigma=(1e-3, 2e-3, 4e-3), correlation_time=0.5, coupling=K, arm=arm)
    return Flexed(_way(), spec, duration=12.0, seed=3)


def test_the_end_moves_by_the_coupling_times_what_it_turns():
    """About each axis of the body by its own coupling, in place; without an arm it turns in its place."""
    t = np.linspace(1.0, 11.0, 41)
    bent, rigid = _bent(), _way().states(t)
    heading, pitch, roll = bent.angles(t).T
    moved = np.cross(np.array(K) * np.stack([pitch, roll, -heading], axis=1), ARM)
    at = bent.states(t)
    np.testing.assert_allclose(at.alt - rigid.alt, np.einsum("ki,ki->k", rigid.C_nb[:, 2], moved), atol=1e-6)
    alone = _bent((0.0, 0.0, 0.0)).states(t)
    np.testing.assert_array_equal(alone.v_n, rigid.v_n)


def test_velocity_and_force_are_the_derivatives_of_the_place():
    """By central differences: 2e-4 m/s of 0.2 m/s that it moves, 2e-3 m/s^2 of 2."""
    t, h = np.linspace(1.03, 11.03, 41), 1e-4
    late, early, at = (_bent().states(t + s) for s in (h, -h, 0.0))
    rigid_late, rigid_early, rigid = (_way().states(t + s) for s in (h, -h, 0.0))
    up = ((late.alt - rigid_late.alt) - (early.alt - rigid_early.alt)) / (2 * h)
    np.testing.assert_allclose(at.v_n[:, 2] - rigid.v_n[:, 2], up, atol=2e-4)
    assert np.ptp(up) > 0.1
    force = np.einsum("kij,kj->ki", at.C_nb, at.f_b) - np.einsum("kij,kj->ki", rigid.C_nb, rigid.f_b)
    pushed = ((late.v_n - rigid_late.v_n) - (early.v_n - rigid_early.v_n)) / (2 * h)
    np.testing.assert_allclose(force, pushed, atol=5e-3)
    assert math.sqrt(np.mean(force**2)) > 0.2
