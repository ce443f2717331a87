"""An antenna that shakes more quickly than its delay is known: which of several periods its receiver shows."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment.in_motion import align_in_motion
from truenorth.estimate.moment import as_unsure, likeliest_moment, quickness
from truenorth.navigation import Mounting
from truenorth.quality.swing import shake
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import Layout
from truenorth.state.track import Residuals, Track

ARM = np.array([-0.5, -2.0, 2.0])
PERIOD = 0.19  # s
COURSE = [
    {"kind": "accelerate", "to": "25 m/s", "acceleration": "0.6 m/s^2"},
    {"kind": "turn", "angle": "25 deg", "rate": "1 deg/s"},
    {"kind": "accelerate", "to": "15 m/s", "acceleration": "0.5 m/s^2"},
    {"kind": "turn", "angle": "-30 deg", "rate": "1.2 deg/s"},
    {"kind": "accelerate", "to": "25 m/s", "acceleration": "0.5 m/s^2"},
    {"kind": "straight", "duration": "60 s"},
]


def recorded(seed, late, amplitude=0.06, rate=5.0):
    """A drive whose body rolls by so many degrees, and shakes the IMU; a receiver that is so late, s."""
    mapping = {
        "name": "train",
        "duration": "160 s",
        "rate": "100 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": "industrial",
        "motion": {"kind": "legs", "heading": f"{70 * seed} deg", "legs": COURSE},
        "disturbances": [
            {"kind": "sway", "tones": {"roll": [{"amplitude": f"{amplitude} deg", "period": f"{PERIOD} s"}]}},
            {
                "kind": "vibration",
                "sines": [{"frequency": f"{1 / PERIOD} Hz", "acceleration": ["200 mg", "0 mg", "0 mg"]}],
            },
        ],
        "gnss": {
            "rate": f"{rate} Hz",
            "position_noise": "1 m",
            "velocity_noise": "0.1 m/s",
            "latency": f"{late} s",
            "lever_arm": [f"{x} m" for x in ARM],
        },
    }
    scenario = read_scenario(mapping)
    return scenario.simulate(seed=seed), scenario.simulate_aiding(seed=seed)["gnss"].record


def off_by(seed, late, **of):
    """Errors of delay, attitude, velocity and place over their sigmas."""
    log, gnss = recorded(seed, late, **of)
    answer = align_in_motion(log.record, "industrial", gnss=gnss, antenna=Mounting(lever_arm=ARM, latency_sigma=0.15))
    assert answer.status == "aligned", answer.reasons
    state, at = answer.moving, log.motion.states(np.array([answer.time]))
    delay = state.delays.get("GNSS")  # a receiver of one row a second may show several as well
    track = state.track[-1:]
    true = Track.of_motion(np.array([answer.time]), at.C_nb, at.v_n, np.stack([at.lat, at.lon, at.alt], axis=1))
    errors = track.errors_against(true, np.zeros(1, dtype=int))[0, :9] / np.sqrt(np.diag(state.P)[:9])
    return errors if delay is None else np.append(errors, (delay[0] - late) / delay[1])


@pytest.mark.parametrize(("seed", "late"), some([(0, 0.1)], [(1, -0.12)]))
def test_the_period_that_is_shown_is_found(seed, late):
    """Of these two the first was refused for its specification, and the delay of the second 36 of its sigmas off."""
    found = off_by(seed, late)
    assert len(found) == 10  # the delay is one of them
    assert np.abs(found).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize(("amplitude", "rate"), [(0.08, 1.0), (0.03, 5.0), (0.08, 5.0), (0.03, 10.0), (0.08, 10.0)])
def test_periods_at_all_rates(amplitude, rate):
    for seed, late in enumerate((0.13, -0.1, 0.05, 0.2)):
        assert np.abs(off_by(seed, late, amplitude=amplitude, rate=rate)).max() < 4.0


def tone(amplitude, hertz, seed=0):
    """A log at rest but for a roll, rad, with the noise of an industrial IMU."""
    time, rng = 0.01 * np.arange(1, 20001), np.random.default_rng(seed)
    rate = np.zeros((len(time), 3))
    rate[:, 1] = amplitude * 2.0 * np.pi * hertz * np.cos(2.0 * np.pi * hertz * (time - 0.005))
    gyro = 0.01 * rate + 1e-5 * rng.standard_normal(rate.shape)
    return ImuRecord(time, gyro, [0.0, 0.0, 0.0981] + 1e-4 * rng.standard_normal(rate.shape), "increments", "tone")


def test_a_shake_is_that_of_the_antenna_and_no_noise():
    """``A w |l|`` across the axis, RMS; of rows' noise alone nothing is left, and a slow roll is no shake."""
    at_rest = SimpleNamespace(gyro_bias=np.zeros((1, 3)))
    size, rate = shake(at_rest, tone(1e-3, 5.0), ARM)
    assert size == pytest.approx(1e-3 * 2.0 * np.pi * 5.0 * np.hypot(ARM[0], ARM[2]) / np.sqrt(2.0), rel=0.15)
    assert rate == pytest.approx(2.0 * np.pi * 5.0, rel=0.1)
    assert shake(at_rest, tone(0.0, 5.0), ARM)[0] < 1e-3
    assert shake(at_rest, tone(1e-2, 0.2), ARM)[0] < 0.1 * 1e-2 * 2.0 * np.pi * 0.2 * 2.06


def seen(innovation, late=0.0, prior=0.02):
    """A track whose receiver's velocities have these innovations."""
    time = np.arange(0.0, 240.0, 0.2)
    z = np.tile(np.reshape(innovation, (-1, 1)), (1, 3)) * np.ones((len(time), 3))
    ones = np.ones(len(time), dtype=bool)
    r = Residuals("GNSS velocity", time, z, np.ones_like(z), (z**2).sum(axis=1), ones, 0, time + late, ~ones)
    layout = Layout(("GNSS lag",), ((prior,),))
    P = np.broadcast_to(np.diag([1e-6] * 15 + [0.002**2]), (len(time), 16, 16))
    level = np.broadcast_to(np.eye(3), (len(time), 3, 3))
    v_n = np.tile([0.0, 10.0, 0.0], (len(time), 1))
    return Track(time, level, v_n, np.tile([0.8, 0.2, 0.0], (len(time), 1)), np.zeros((len(time), 16)), P, layout, (r,))


def tried(fits, worse):
    """The moment that is found where delays within .01 s of those in `fits` leave noise, and others that much more."""

    def run(antenna):
        noise = np.random.default_rng(0).standard_normal(1200)
        near = any(abs(antenna.latency - late) < 0.01 for late in fits)
        return seen(noise * (1.0 if near else worse), -antenna.latency)

    return likeliest_moment(run, lambda antenna, _: run(antenna), Mounting(latency_sigma=0.15), 2.0 * np.pi / PERIOD)


def test_one_moment_that_fits_is_taken_and_two_that_do_are_in_sigma():
    one = tried([0.1209], 1.3)
    assert one.shown
    assert one.antenna.latency == pytest.approx(0.1209, abs=0.02)
    assert one.spread == pytest.approx(0.1 * PERIOD / (2.0 * np.pi))  # a tenth of a radian of the shake
    assert one.evidence == ()
    two = tried([0.1209, -0.0605], 1.3)
    assert two.spread > 0.05
    assert [item.key for item in two.evidence] == ["delay.one_of_several"]
    track = as_unsure(seen(0.0), two.spread)
    assert track.sigma[-1, 15] == pytest.approx(np.hypot(0.002, two.spread))


def on_the_arm(sigma):
    return Mounting(lever_arm=ARM, latency_sigma=sigma)


def test_delays_that_are_known_and_antennas_that_do_not_shake_are_left_alone():
    known = Mounting(lever_arm=ARM, latency_sigma=0.01)
    assert likeliest_moment(None, None, known, 2.0 * np.pi / PERIOD).antenna is known
    assert quickness(on_the_arm(0.0), tone(1e-2, 5.0), seen(0.0)) == 0.0
    assert quickness(on_the_arm(0.15), tone(1e-2, 0.5), seen(0.0)) == 0.0
    assert quickness(on_the_arm(0.15), tone(2e-3, 5.0), seen(0.0)) == 0.0
    assert quickness(on_the_arm(0.15), tone(1e-2, 5.0), seen(0.0)) == pytest.approx(2.0 * np.pi * 5.0, rel=0.1)


def test_a_shake_that_no_row_shows_leaves_the_delay_open():
    """As of a receiver whose velocities are means: each moment leaves as much."""
    assert not tried([0.1209], 1.0).shown
