"""Places that are late by a motion known from both sides: their column, and when it is asked for."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.aiding.position import POSITION, POSITION_OF_KNOWN_MOTION
from truenorth.aiding.source import Aiding, state
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, normal_gravity, radii
from truenorth.errors.model import InsModel
from truenorth.estimate.events import Setting, lag_of_fixes, late_fixes
from truenorth.estimate.known_motion import is_led_by_errors, of_known_motion
from truenorth.estimate.run import navigate_track, with_states
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.state.state import Start, State

TIME = np.arange(1.0, 60.0)
LAT, SPEED = np.radians(45.0), 1.0
R_M, R_N = radii(LAT)
SEED, LOGS = 2203, 12  # any
SWAY = 0.05  # rad, of a body in step: as gyros of a consumer IMU may be askew, velocity is known to some decimetres a second


def fixes(late=0.2, sigma=0.2):
    """Of a vehicle that goes east at a metre a second, shown .3 s late."""
    lon = SPEED * (TIME - 0.3) / (R_N * np.cos(LAT))
    places = np.stack([np.full(len(TIME), LAT), lon, np.zeros(len(TIME))], axis=1)
    return Aiding(
        "GNSS position", "position", TIME, places, np.full((len(TIME), 3), sigma), states=state("GNSS", "lag", late)
    )


def stops():
    return Aiding("zero velocity", "velocity", TIME[:2], np.zeros((2, 3)), np.full((2, 3), 0.1))


def velocities():
    return replace(stops(), name="GNSS velocity")


@pytest.fixture(scope="module")
def track():
    time = np.arange(1, 3001) / 50.0
    log = ImuRecord(time, np.zeros((3000, 3)), np.tile([0.0, 0.0, 9.806], (3000, 1)))
    model = InsModel.from_spec(imu_spec("consumer"))
    sigma = np.repeat([0.05, 0.1, 1.0, 0.01, 0.3], 3)
    start = Start.of(State.at(np.eye(3), LAT, v_n=[SPEED, 0.0, 0.0]), np.diag(sigma**2))
    return navigate_track(log, start, with_states(model, [fixes()]), [fixes()], interval=0.2, every=5)


def test_a_sensor_of_velocity_knows_the_column_itself():
    late = fixes()
    assert late_fixes([stops(), late]) is late
    assert late_fixes([late, velocities()]) is None
    assert late_fixes([replace(late, states={})]) is None


def test_errors_of_a_slow_vehicle_s_velocity_matter(track):
    assert is_led_by_errors(track, [fixes()], 0.2)
    assert not is_led_by_errors(replace(track, v_n=100.0 * track.v_n), [fixes()], 0.2)
    assert not is_led_by_errors(track, [fixes(), velocities()], 0.2)
    assert not is_led_by_errors(track, [fixes()], 0.005)  # 12,000 rows: more than a smoother holds


def test_the_column_is_of_the_velocities_that_were_shown(track):
    """At the time of the stamp less the delay that the smoothed track has found; and no correction moves it."""
    other, (known,) = stops(), of_known_motion([fixes()], track)
    assert of_known_motion([other], track) == [other]
    assert of_known_motion([other], None) == [other]
    assert known.row is POSITION_OF_KNOWN_MOTION
    late = track.sensors[-1, track.layout.slice_of("GNSS lag")][0]
    for axis in range(3):
        seen = np.interp(TIME - late, track.time, track.v_n[:, axis])
        np.testing.assert_allclose(known.measured[:, 3 + axis], seen, rtol=1e-12, atol=1e-12)
    model = with_states(InsModel.from_spec(imu_spec("consumer")), [known])
    assert lag_of_fixes(Setting(model, (known,))) == -1
    assert lag_of_fixes(Setting(model, (replace(known, kind=POSITION, measured=known.measured[:, :3]),))) > 0


def walked(seed):
    """Errors of the delay over their sigma, by a pass's own velocities and by smoothed ones, of a body that sways in step."""
    rng = np.random.default_rng([SEED, seed])
    step, late, w = 0.02, 0.2 * rng.standard_normal(), 2.0 * np.pi / np.array([17.0, 23.0])
    phase, ends = rng.uniform(0.0, 2.0 * np.pi, 2), step * np.arange(10_001)

    def velocity(t):
        return SPEED * np.cos(phase + w * np.atleast_1d(t)[:, None])

    def place(t):
        return SPEED / w * (np.sin(phase + w * t[:, None]) - np.sin(phase))

    def attitude(t):
        return dcm_from_euler(*(SWAY * np.sin(np.multiply.outer(2.0 * np.pi * np.array([0.9, 1.8, 0.9]), t) + starts)))

    starts = rng.uniform(0.0, 2.0 * np.pi, (3, 1))
    log, C = ends[1:], attitude(ends - ends[0])
    middle = attitude(ends[1:] - 0.5 * step)
    pushed = np.hstack(
        [np.diff(velocity(ends), axis=0), np.full((len(log), 1), step * float(normal_gravity(LAT, 0.0)))]
    )
    dvel = np.einsum("kji,kj->ki", middle, pushed)
    dtheta = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:])
    dtheta += step * np.einsum("kji,j->ki", middle, earth_rate_n(LAT))
    at = np.arange(1.0, 199.0)
    shown = place(at - late) + rng.standard_normal((len(at), 2))
    places = np.stack([LAT + shown[:, 1] / R_M, shown[:, 0] / (R_N * np.cos(LAT)), np.zeros(len(at))], axis=1)
    source = Aiding("GNSS position", "position", at, places, np.ones((len(at), 3)), states=state("GNSS", "lag", 0.2))
    model = with_states(InsModel.from_spec(imu_spec("consumer"), unsteady=True), [source])
    sigma = np.repeat([0.05, 0.5, 1.0, 1e-4, 0.3], 3)
    start = Start.of(State.at(C[0], LAT, v_n=[*velocity(0.0)[0], 0.0]), np.diag(sigma**2))

    def off(aiding, **options):
        track = navigate_track(
            ImuRecord(log, dtheta, dvel, "increments"), start, model, [aiding], interval=0.2, **options
        )
        lag = model.layout.slice_of("GNSS lag").start
        return (track.sensors[-1, lag] - late) / track.sigma[-1, lag], track

    own, _ = off(source)
    _, smoothed = off(source, smooth=True, every=1)
    known, _ = off(of_known_motion([source], smoothed)[0])
    return own, known


@pytest.mark.slow
def test_errors_of_a_velocity_are_no_delay():
    """What runs ahead by an error of its velocity is ahead of the next fix, as if that was late."""
    own, known = np.array([walked(seed) for seed in range(LOGS)]).T
    assert own.mean() > 1.0
    assert abs(known.mean()) < 4.0 / np.sqrt(LOGS)  # false alarms: one in 16,000
    assert np.sqrt(np.mean(known**2)) < 1.0 + 4.0 / np.sqrt(2.0 * LOGS)
