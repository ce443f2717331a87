"""A receiver whose antenna stands for minutes before the vehicle drives: its multipath stays at rest, and changes on the move."""

from dataclasses import replace

import numpy as np
import pytest

from tests.navigation.test_navigate import PLACE, SIGMA, SPEC, fixes
from truenorth.aiding.aids import Gnss
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.navigation import Mounting, Start, navigate
from truenorth.records import GnssRecord
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn

REST = 530.0  # s
STILL, CITY = 0.03, 2.5  # m: noise of rows at rest and on the move
SLOW = 1.3, 3.0  # m: what lasts, at rest and on the move


def about_town(seed):
    """A car that stands, and then drives about blocks of a town; its motion, log and start."""
    legs = [*straight(REST), *accelerate(12.0, 1.5, 0.0)]
    for _ in range(12):
        legs += [*straight(25.0), *turn(np.radians(90.0), np.radians(12.0))]
    motion = course(PLACE, legs, heading=0.7)
    record = simulate(motion, rate=50.0, duration=REST + 380.0, imu=SPEC, seed=seed).record
    s, rng = motion.states(0.0), np.random.default_rng([seed, 1])
    C = dcm_from_rotation_vector(-SIGMA[:3] * rng.standard_normal(3)) @ s.C_nb
    zero = np.zeros(3)
    return motion, record, Start(0.0, C, zero, PLACE.lat, PLACE.lon, PLACE.alt, zero, zero, np.diag(SIGMA**2))


def received(motion, record, seed):
    """Fixes off by the same as long as the car stands; on the move by errors that last for 15 s, and noise."""
    time, rng = np.arange(0.5, record.time[-1], 1.0), np.random.default_rng([seed, 2])
    rests = time < REST
    slow, size, last = np.empty((len(time), 3)), np.where(rests, *SLOW), np.where(rests, 2000.0, 8.0)
    slow[0] = rng.standard_normal(3)
    for k in range(1, len(time)):
        like = np.exp(-1.0 / last[k])
        slow[k] = like * slow[k - 1] + np.sqrt(1.0 - like**2) * rng.standard_normal(3)
    white = np.where(rests, STILL, CITY)
    off = size[:, None] * slow + white[:, None] * rng.standard_normal(slow.shape)
    sound = fixes(motion, time, 1e-9)
    return replace(
        sound,
        lat=sound.lat + off[:, 1] / 6.37e6,
        lon=sound.lon + off[:, 0] / (6.39e6 * np.cos(sound.lat)),
        alt=sound.alt + off[:, 2],
        position_sigma=np.tile(np.hypot(size, white)[:, None], (1, 3)),
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_noise_of_fixes_is_that_of_the_drive(seed):
    """Noise of the rest alone kept a fifth of the drive's fixes out, and the track was lost (a real drive in a city)."""
    motion, record, start = about_town(seed)
    found = navigate(record, start, aid=Gnss(received(motion, record, seed), Mounting()), imu=SPEC)
    assert found.status == "navigated", found.reasons
    (places,) = (r for r in found.track.residuals if r.name == "GNSS position")
    assert places.rejected < 0.05 * len(places.time)
    true = motion.states(found.time)
    assert np.abs((found.v_n - true.v_n) / found.v_sigma)[1:].max() < 4.0


@pytest.mark.slow
def test_a_receiver_without_places_rests_and_drives():
    """There are no fixes whose rest could be quiet."""
    motion, record, start = about_town(0)
    time, rng = np.arange(0.5, record.time[-1], 1.0), np.random.default_rng(5)
    absent, slow = np.full(len(time), np.nan), np.zeros((len(time), 3))
    for k in range(1, len(time)):
        slow[k] = np.exp(-0.1) * slow[k - 1] + 0.2 * np.sqrt(1.0 - np.exp(-0.2)) * rng.standard_normal(3)
    v = motion.states(time).v_n + slow + np.where(time < REST, 0.01, 0.1)[:, None] * rng.standard_normal(slow.shape)
    sigma = np.full(slow.shape, 0.25)
    gnss = GnssRecord(time, absent, absent, absent, v_n=v, velocity_sigma=sigma, source="gnss.csv")
    assert navigate(record, start, aid=Gnss(gnss, Mounting()), imu=SPEC).status == "navigated"
