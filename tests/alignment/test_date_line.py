"""The earth is the same all round: a log whose longitudes cross 180 degrees says what it says anywhere else."""

from dataclasses import replace

import numpy as np
import pytest

from tests.alignment.test_in_motion import changed
from truenorth import Position, align
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.alignment.in_motion_speed import speed_at
from truenorth.coarse.odometer import gnss_track
from truenorth.live import GnssFeed
from truenorth.navigation.stops import _speed_of_places


@pytest.fixture(scope="module")
def drive():
    """IMU, wheel and receiver without velocities of a minute on a ring, and the longitude where it stands at first."""
    fixes = {"rate": "2 Hz", "position_noise": "0.05 m", "velocity_noise": "0.05 m/s"}
    scenario = changed(duration="70 s", rate="50 Hz", gnss=fixes)
    sim, aids = scenario.simulate(seed=3), scenario.simulate_aiding(seed=3)
    receiver = replace(aids["gnss"].record, v_n=None, velocity_sigma=None)
    return sim.record, aids["odometer"].record, receiver, float(receiver.lon[0])


def moved(receiver, shift):
    lon = receiver.lon + shift
    return replace(receiver, lon=np.arctan2(np.sin(lon), np.cos(lon)))


@pytest.fixture(scope="module")
def elsewhere(drive):
    """The receiver 10 degrees east of Greenwich, and where it crosses 180 degrees."""
    *_, receiver, lon = drive
    return moved(receiver, np.radians(10.0) - lon), moved(receiver, np.pi - lon)


def test_the_log_crosses(elsewhere):
    assert np.abs(np.diff(elsewhere[1].lon)).max() > 6.0


@pytest.mark.parametrize(
    "shown",
    [
        lambda r: gnss_track(r, r.time[5:-5])[0],
        lambda r: speed_at(r, float(r.time[len(r.time) // 2 - 4])),
        lambda r: _speed_of_places(r)[1],
    ],
)
def test_velocities_of_places(elsewhere, shown):
    here, there = map(shown, elsewhere)
    np.testing.assert_allclose(there, here, atol=1e-6)


def test_places_between_fixes_cross_as_well(elsewhere):
    here, there = (gnss_track(r, r.time[5:-5] + 0.1)[1][:, 1] for r in elsewhere)
    np.testing.assert_allclose(there - there[0], here - here[0], atol=1e-12)


@pytest.mark.parametrize("aid", ["wheel", "gnss"])
def test_alignment(drive, elsewhere, aid):
    record, wheel, *_ = drive
    found = []
    for receiver in elsewhere:
        aids = Gnss(receiver) if aid == "gnss" else Odometer(wheel)
        place = Position(float(receiver.lat[0]), float(receiver.lon[0]), 50.0)
        found.append(align(record, place, imu="industrial", aid=aids))
    here, there = found
    assert there.status == here.status
    np.testing.assert_allclose(there.C_nb, here.C_nb, atol=1e-7)
    np.testing.assert_allclose(there.moving.P, here.moving.P, rtol=1e-4, atol=1e-12)


def test_a_live_receiver_that_stands_there_stands():
    """Its place was the mean of plus and minus 180 degrees, and fixes on the other side had left it."""
    rng = np.random.default_rng(1)
    lon = np.pi + 1.5e-7 * rng.standard_normal(40)
    feed = GnssFeed()
    feed.push(np.arange(40.0), np.full(40, 0.5), np.arctan2(np.sin(lon), np.cos(lon)), np.full(40, 10.0))
    assert abs(abs(feed.place.lon) - np.pi) < 1e-6
    np.testing.assert_array_equal(feed.speed_of(feed.rows), 0.0)
