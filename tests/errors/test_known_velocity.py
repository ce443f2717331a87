"""Velocities of a log at rest are worked out once about an attitude, and anew about another."""

import numpy as np
import pytest

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import Position
from truenorth.errors import staying
from truenorth.simulation import rest, simulate
from truenorth.strapdown.inertial import integrate

PLACE = Position.from_degrees(40.0, 118.0)


@pytest.fixture(scope="module")
def integrals():
    record = simulate(rest(PLACE), rate=20.0, duration=30.0, imu="tactical", seed=1).record
    return integrate(record), integrate(record.between(None, 20.0))


@pytest.mark.parametrize("velocity", [staying.mean_velocity, staying.gained_velocity])
def test_it_is_known_about_one_attitude_and_place_of_one_log(integrals, velocity):
    first, second = integrals
    C, other = np.eye(3), dcm_from_rotation_vector([0.0, 0.0, 0.1])
    found = velocity(first, C, PLACE.lat, 0.0)
    assert velocity(first, C.copy(), PLACE.lat, 0.0) is found
    assert not found.flags.writeable
    for log, about, lat in ((first, other, PLACE.lat), (first, C, 0.1), (second, C, PLACE.lat)):
        np.testing.assert_array_equal(velocity(log, about, lat, 0.0), velocity.__wrapped__(log, about, lat, 0.0))
