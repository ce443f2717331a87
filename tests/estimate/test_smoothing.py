"""Smoothing of the closed loop: where the log ends, nothing comes after, and the smoothed epoch is the filtered one."""

import numpy as np
import pytest

from truenorth.aiding.aids import Gnss
from truenorth.aiding.source import Aiding, state
from truenorth.core.position import Position
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track, with_states
from truenorth.navigation.stops import updates_at
from truenorth.records import GnssRecord, ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start

PLACE, SPEC, DURATION = Position.from_degrees(48.0, 11.0), imu_spec("tactical"), 60.0
SIGMA = np.concatenate([np.radians([0.1, 0.1, 2.0]), np.full(3, 0.1), np.full(3, 2.0)])


@pytest.fixture(scope="module")
def drive():
    """A car that stands, drives off, turns and shakes; its motion, log and start."""
    legs = [*straight(20.0), *accelerate(10.0, 1.0, 0.0), *turn(np.radians(80.0), np.radians(8.0)), *straight(40.0)]
    motion = course(PLACE, legs, heading=0.7)
    record = simulate(motion, rate=50.0, duration=DURATION, imu=SPEC, seed=3).record
    shaken = 0.02 * np.sin(2.0 * np.pi * 3.0 * record.time)[:, None] * record.interval
    record = ImuRecord(record.time, record.gyro + shaken, record.accel, "increments")
    s = motion.states(0.0)
    P = np.diag(np.concatenate([SIGMA, np.sqrt(SPEC.bias_variance)]) ** 2)
    return motion, record, Start(0.0, s.C_nb, np.zeros(3), PLACE.lat, PLACE.lon, PLACE.alt, np.zeros(3), np.zeros(3), P)


def received(motion, arm=(0.0, 0.0, 0.0), **mounting):
    """Fixes with velocities, each second."""
    t, rng = np.arange(1.0, DURATION), np.random.default_rng(1)
    s = motion.states(t)
    lat = s.lat + rng.standard_normal(len(t)) / 6.37e6
    gnss = GnssRecord(
        t,
        lat,
        np.full_like(t, 1.0) * s.lon,
        s.alt,
        v_n=s.v_n + 0.05 * rng.standard_normal((len(t), 3)),
        position_sigma=np.ones((len(t), 3)),
        velocity_sigma=np.full((len(t), 3), 0.05),
    )
    return Gnss(gnss, Mounting(lever_arm=arm, **mounting)).sources("free")


def on_a_mast(motion, record):
    return received(motion, (0.5, 1.0, 3.0), lever_arm_sigma=0.1, latency_sigma=0.05)


def zero_updates(motion, record):
    return updates_at(record, np.arange(1.5, 19.0), np.empty(0))


def a_wheel(motion, record):
    t = np.arange(0.5, DURATION, 0.5)
    speed = np.linalg.norm(motion.states(t).v_n, axis=1)
    measured = np.column_stack([np.zeros_like(t), speed, np.zeros_like(t)])
    return [Aiding("wheel", "body velocity", t, measured, np.full((len(t), 3), 0.1), np.array([0.0, -1.0, -0.5]))]


def a_place_that_jumps(motion, record):
    """By 300 m, after two rejections believed: what opens is the place."""
    t = np.arange(1.0, DURATION)
    s = motion.states(t)
    lat = s.lat + (t > 30.0) * 300.0 / 6.37e6
    measured = np.column_stack([lat, s.lon, s.alt])
    return [Aiding("beacon", "position", t, measured, np.ones((len(t), 3)), opens=6, patience=2)]


def a_baro(motion, record):
    t = np.arange(0.5, DURATION)
    measured = np.column_stack([motion.states(t).alt + 3.0, np.full((len(t), 2), np.nan)])
    return [Aiding("baro", "height", t, measured, np.ones((len(t), 3)), states=state("baro", "bias", 5.0))]


SOURCES = (on_a_mast, zero_updates, a_wheel, a_place_that_jumps, a_baro)


@pytest.mark.parametrize("sources", [*[(one,) for one in SOURCES], SOURCES[:3]], ids=lambda given: given[-1].__name__)
def test_the_last_smoothed_epoch_is_the_filtered_one(drive, sources):
    motion, record, start = drive
    aiding = [one for of in sources for one in of(motion, record)]
    model = with_states(InsModel.from_spec(SPEC), aiding)
    filtered, smoothed = (
        navigate_track(record, start, model, aiding, interval=0.2, every=5, smooth=smooth) for smooth in (False, True)
    )
    sigma = filtered.sigma[-1]
    np.testing.assert_allclose(smoothed.sigma[-1], sigma, rtol=1e-6)
    assert np.abs(smoothed.v_n[-1] - filtered.v_n[-1]).max() < 1e-6 * sigma[3:6].min()
    assert np.abs(smoothed.C_nb[-1] - filtered.C_nb[-1]).max() < 1e-6 * sigma[:3].min()
    assert np.abs(smoothed.position[-1] - filtered.position[-1])[:2].max() < 1e-6 * sigma[6:8].min() / 6.4e6
