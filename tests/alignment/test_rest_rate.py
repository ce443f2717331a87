"""A vehicle that rests with aids: its gyros see the earth's rate, and noisy aids do not hide that they know no heading."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.aiding.aids import Gnss
from truenorth.alignment import align
from truenorth.alignment.in_motion_task import moving_task
from truenorth.alignment.rest_rate import heading_by_biases
from truenorth.campaign.fault_benches import RECEIVER
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.simulation.scenario import read_scenario

WAITING = {
    "name": "waiting",
    "duration": "90 s",
    "rate": "50 Hz",
    "position": {"lat": "34 deg", "lon": "109 deg", "alt": "400 m"},
    "imu": "navigation",
    "motion": {
        "kind": "sway",
        "heading": "92 deg",
        "tones": {"roll": [{"amplitude": "0.02 deg", "period": "1.7 s", "phase": "30 deg"}]},
    },
    "gnss": RECEIVER,
}
VAN = {  # it stands for 30 s, and goes through town
    **read_scenario("van").to_mapping(),
    "duration": "100 s",
    "imu": "tactical",
    "odometer": None,
    "gnss": {"rate": "5 Hz", "position_noise": "0.5 m", "velocity_noise": "0.05 m/s"},
}


@pytest.fixture(scope="module")
def waiting():
    built = read_scenario(WAITING)
    return built.simulate(seed=3).record, built.simulate_aiding(seed=3)["gnss"].record, built.imu_spec


def _off(answer) -> float:
    return float(abs((np.degrees(answer.heading) - 92.0 + 180.0) % 360.0 - 180.0))


def _biased(record, bias):
    """A log of increments with a bias of its gyros, rad/s."""
    return replace(record, gyro=record.gyro + bias * record.interval)


def test_a_sound_log_passes(waiting) -> None:
    record, gnss, spec = waiting
    answer = align(record, imu=spec, aid=Gnss(gnss))
    assert not any(item.key.startswith("rate.") for item in answer.evidence)
    assert _off(answer) < 3.0 * np.degrees(answer.euler_sigma[0])


@pytest.mark.slow
def test_gyros_whose_axes_are_exchanged_miss_the_earths_rate(waiting) -> None:
    record, gnss, spec = waiting
    short = record.between(None, 60.0)  # behind each rival stands a navigation, and a longer log has more of them
    answer = align(replace(short, gyro=short.gyro[:, [0, 2, 1]]), imu=spec, aid=Gnss(gnss))
    assert answer.status == "inconsistent"
    assert any(item.key == "rate.misses" for item in answer.evidence)


@pytest.mark.slow
def test_velocities_a_hundred_times_as_noisy_give_no_heading_that_is_not_there(waiting) -> None:
    """In cm/s by mistake: of the vehicle at rest only the noise grows; a real one was 65 deg off, 22 of its sigmas."""
    record, gnss, spec = waiting
    short = record.between(None, 68.0)
    answer = align(short, imu=spec, aid=Gnss(replace(gnss, v_n=100.0 * gnss.v_n)))
    sigma = np.degrees(answer.euler_sigma[0])
    assert answer.status not in ("aligned",) or _off(answer) < 3.0 * sigma


@pytest.fixture(scope="module")
def driving():
    built = read_scenario(VAN)
    return built.simulate(seed=3), built.simulate_aiding(seed=3)["gnss"].record, built.imu_spec


def test_what_biases_make_of_heading_is_what_a_filter_answers_to_them(driving) -> None:
    """Differences of the whole filter, a bias added to each gyro in turn: at rest a sigma of it turns heading by 6 deg."""
    sim, gnss, spec = driving
    task = moving_task(sim.record, spec, None, gnss, None, None, None, (), True, None, 0.0).with_spec(spec)
    guess = replace(task.by_the_earth(), C_nb=sim.motion.states(sim.record.time[:1]).C_nb[0])
    track = task.run(guess, gated=False)
    sigma, turned = np.sqrt(spec.bias_variance[0]), []
    for axis in np.eye(3):
        other = replace(task, record=_biased(sim.record, sigma * axis))
        turned.append(rotation_vector_from_dcm(track.C_nb[-1] @ other.run(guess, gated=False).C_nb[-1].T)[2])
    assert heading_by_biases(task, track) == pytest.approx(np.linalg.norm(turned), rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_heading_that_gnss_has_seen_turn_bears_a_bias_of_three_sigmas(driving, axis) -> None:
    """At rest one sound log in forty shows 2.5 sigmas along north or up: no reason to refuse what motion has shown."""
    sim, gnss, spec = driving
    bias = 3.0 * np.sqrt(spec.bias_variance[0]) * np.eye(3)[axis] - sim.errors.gyro_bias
    answer = align(_biased(sim.record, bias), imu=spec, aid=Gnss(gnss))
    assert answer.status == "aligned"
    C = sim.motion.states(np.array([answer.time])).C_nb[0]
    off = rotation_vector_from_dcm(C @ answer.C_nb.T)[2]
    assert abs(off) < 4.0 * np.sqrt(answer.phi_covariance[2, 2]) < np.radians(0.5)
