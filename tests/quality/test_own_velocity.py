"""How fast a base goes to and fro, by its forces alone: of gyros that do not see the earth turn."""

import numpy as np
import pytest

import truenorth as tn
from truenorth.quality.own_velocity import own_velocity
from truenorth.simulation import Sway, Tone, rest, simulate

PLACE = tn.Position.from_degrees(40.0, 118.0)
AMPLITUDE, PERIOD = 0.2, 9.0  # m, s
RMS = 2.0 * np.pi / PERIOD * AMPLITUDE / np.sqrt(2.0)


@pytest.mark.parametrize("imu", ["navigation", "tactical", "industrial", "consumer"])
@pytest.mark.parametrize("rate", [25.0, 100.0])
@pytest.mark.parametrize("way", ["north", "up"])
def test_a_base_that_goes_to_and_fro_has_its_speed(imu, rate, way):
    motion = Sway(PLACE, heading=1.0, **{f"{way}_tones": (Tone(AMPLITUDE, PERIOD, 0.7),)})
    level, same, up = own_velocity(simulate(motion, rate=rate, duration=70.0, imu=imu, seed=1).record)
    found, other = (level, up) if way == "north" else (up, level)
    assert level == same
    assert found == pytest.approx(RMS, rel=0.15)
    assert other < 0.03


@pytest.mark.parametrize(
    ("imu", "most"), [("navigation", 3e-4), ("tactical", 1.5e-3), ("industrial", 5e-3), ("consumer", 0.02)]
)
@pytest.mark.parametrize("duration", [10.0, 60.0])
def test_of_a_base_at_rest_noise_hides_no_more_than_millimetres(imu, most, duration):
    for seed in range(3):
        log = simulate(rest(PLACE, 1.0, 0.02, -0.03), rate=50.0, duration=duration, imu=imu, seed=seed).record
        assert (own_velocity(log) < most).all()


def test_a_log_of_a_moment_says_nothing():
    log = simulate(rest(PLACE, 1.0, 0.0, 0.0), rate=50.0, duration=4.0, imu="tactical", seed=0).record
    assert np.isnan(own_velocity(log)).all()
