"""A vehicle whose body leans from its wheels' path by the force on it: tyres run askew in bends, springs let it dip."""

import numpy as np
import pytest
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from truenorth.aiding.aids import WHEEL
from truenorth.aiding.wheel import COMPLIANCE
from truenorth.alignment.in_motion import align_in_motion
from truenorth.core.attitude import misalignment
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario

TYRES, SPRINGS = 0.005, 0.006  # rad s^2/m: 2.8 and 3.4 deg/g


def leaning(record, tyres, springs):
    """What the same IMU shows on a body that leans, and the body's last attitude seen from the path."""
    force = uniform_filter1d(record.accel / record.interval, 51, axis=0)
    force = np.concatenate([force[:1], force])
    lean = Rotation.from_rotvec(np.stack([springs * force[:, 1], 0.0 * force[:, 0], -tyres * force[:, 0]], axis=1))
    turned = lean[:-1].inv() * Rotation.from_rotvec(record.gyro.copy()) * lean[1:]
    halfway = Rotation.from_rotvec(0.5 * (lean[:-1].as_rotvec() + lean[1:].as_rotvec()))
    return ImuRecord(record.time, turned.as_rotvec(), halfway.inv().apply(record.accel.copy()), "increments"), lean[
        -1
    ].as_matrix()


@pytest.fixture(scope="module")
def drive():
    mapping = read_scenario("van").to_mapping()
    mapping = {key: value for key, value in mapping.items() if key not in ("gnss", "disturbances", "lever_arm")}
    wheel = {"output": "distance", "rate": "10 Hz", "scale": "1 %", "noise": "0.02 m/s"}
    van = read_scenario({**mapping, "imu": "navigation", "duration": "240 s", "odometer": wheel})
    sim = van.simulate(seed=12)
    return sim, van.simulate_aiding(seed=12)["odometer"].record


@pytest.mark.slow
def test_what_tyres_and_springs_give_is_found(drive):
    """The two angles to three sigmas, attitude to four."""
    sim, odometer = drive
    record, lean = leaning(sim.record, TYRES, SPRINGS)
    place = sim.motion.position
    answer = align_in_motion(record, "navigation", position=place, odometer=odometer)
    error = misalignment(answer.C_nb, sim.motion.states(record.time[-1:]).C_nb[0] @ lean)
    assert answer.status == "aligned", answer.reasons
    assert np.all(np.abs(error) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))
    track = answer.moving.track
    own = track.layout.slice_of(COMPLIANCE)
    found, sigma = track.sensors[-1][own], track.sigma[-1][own]
    np.testing.assert_array_less(np.abs(found - [TYRES, SPRINGS]), 3.0 * sigma)
    assert sigma[1] < 0.2 * WHEEL.compliance  # the springs' shows within minutes of a town, with its stops


@pytest.mark.slow
def test_a_rigid_body_is_found_rigid(drive):
    sim, odometer = drive
    answer = align_in_motion(sim.record, "navigation", position=sim.motion.position, odometer=odometer)
    track = answer.moving.track
    own = track.layout.slice_of(COMPLIANCE)
    assert answer.status == "aligned", answer.reasons
    np.testing.assert_array_less(np.abs(track.sensors[-1][own]), 3.0 * track.sigma[-1][own])
