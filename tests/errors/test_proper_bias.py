"""The bias of an accelerometer that is stated is the sensor's own, without what gravity makes of its scale factor."""

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.alignment.result import Alignment
from truenorth.errors.axes import proper_bias
from truenorth.simulation.runs import Simulation
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import ACCEL_AXES, BA, SLOW_ACCEL, Layout
from truenorth.state.track import Track

MICRO_G = 9.80665e-6
WORST = 4.0  # sigmas


def test_what_gravity_makes_of_the_axes_is_taken_off_by_hand() -> None:
    layout = Layout((SLOW_ACCEL, ACCEL_AXES), ((1.0,) * 3, (1.0,) * 9))
    slow, axes = layout.groups[SLOW_ACCEL], layout.groups[ACCEL_AXES]
    sensors = np.zeros((1, layout.states))
    sensors[0, BA], sensors[0, slow] = [1.0, 2.0, 3.0], [0.1, 0.2, 0.3]
    sensors[0, axes] = np.arange(9.0)
    A = np.random.default_rng(3).normal(size=(layout.states, layout.states))
    P = A @ A.T
    nothing = np.zeros((1, 3))
    track = Track(np.zeros(1), np.eye(3)[None], nothing, nothing, sensors, P[None], layout, ())
    force = np.array([0.5, -1.0, 2.0])
    bias, sigma = proper_bias(track, force, np.full(3, 1e9))  # states say what acts: the specification is not asked
    own = sensors[0, BA] + sensors[0, slow] - sensors[0, axes].reshape(3, 3) @ force
    np.testing.assert_allclose(bias[0], own)
    J = np.zeros(layout.states)
    J[BA.stop - 1], J[slow.stop - 1], J[axes.stop - 3 : axes.stop] = 1.0, 1.0, -force
    assert sigma[0, 2] == pytest.approx(np.sqrt(J @ P @ J))


def test_without_states_of_the_axes_they_are_in_sigma() -> None:
    nothing, P = np.zeros((1, 3)), np.eye(15)[None]
    track = Track.of_motion(np.zeros(1), np.eye(3)[None], nothing, nothing, np.arange(6.0))
    bias, sigma = proper_bias(Track(**{**vars(track), "P": P}), np.array([0.0, 0.0, 9.8]), np.full(3, 8.0))
    np.testing.assert_allclose(bias[0], [3.0, 4.0, 5.0])
    np.testing.assert_allclose(sigma[0], 3.0)


@pytest.fixture(scope="module", params=some([0], [1]))
def drive(request: pytest.FixtureRequest) -> tuple[Simulation, tn.Gnss, Alignment]:
    scenario = read_scenario({**read_scenario("van").to_mapping(), "duration": "150 s"})
    driven, logs = scenario.simulate(run=request.param), scenario.simulate_aiding(run=request.param)
    gnss = tn.Gnss(logs["gnss"].record)
    return driven, gnss, tn.align(driven.record.between(None, 100.0), imu="industrial", aid=gnss)


@pytest.mark.slow
def test_a_drive_states_the_bias_of_the_upward_accelerometer(drive: tuple[Simulation, tn.Gnss, Alignment]) -> None:
    driven, gnss, start = drive
    assert start.status == "aligned"
    drawn = driven.errors.accel_bias
    scale = 9.8 * tn.imu_spec("industrial").accel_scale_factor
    assert start.accel_bias_sigma[2] > 0.5 * scale, "gravity does not tell a scale factor from a bias"
    assert (np.abs(start.accel_bias - drawn) < WORST * start.accel_bias_sigma).all()
    frame = tn.navigate(driven.record, start, aid=gnss).to_frame()
    for i, axis in enumerate("xyz"):
        own, sigma = frame[f"accel_bias_{axis}_ug"] * MICRO_G, frame[f"accel_bias_{axis}_sigma_ug"] * MICRO_G
        assert (np.abs(own - drawn[i]) < WORST * sigma).all(), axis


def test_navigation_goes_on_with_what_acts(drive: tuple[Simulation, tn.Gnss, Alignment]) -> None:
    _, _, start = drive
    moving = start.moving
    assert moving is not None
    assert moving.acting_bias is not None
    np.testing.assert_array_equal(moving.acting_bias, moving.track.accel_bias[-1])
    own = moving.acting_bias - moving.known[ACCEL_AXES].reshape(3, 3) @ moving.force
    np.testing.assert_allclose(start.accel_bias, own)
