"""Gyros of another moment, and a receiver whose clock is left open, in navigation."""

from dataclasses import replace

import numpy as np
import pytest

from tests.navigation.test_navigate import SPEC, drive, fixes
from tests.runs import some
from truenorth.aiding.aids import Gnss
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.earth import earth_rate_n, normal_gravity
from truenorth.core.errors import UsageError
from truenorth.estimate.sensor_delay import gyros_later
from truenorth.navigation import Mounting, navigate
from truenorth.records import GnssRecord, ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.mounting import ONE_CLOCK, Drift
from truenorth.state.state import Start
from truenorth.state.track import Track

__all__ = ["drive"]  # the fixture of a car that turns twice


@pytest.mark.parametrize(("late", "key"), some([(0, None)], [(5, "delay.gyros_late"), (-10, "delay.gyros_early")]))
def test_gyros_of_another_moment_are_found(drive, late, key):
    """By a tenth of a second and more, to 30 ms; sound ones are left alone."""
    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 179.0), sigma=0.3)
    result = navigate(gyros_later(record, late), start, aid=Gnss(gnss), imu=SPEC)
    found = [item for item in result.evidence if item.key.startswith("delay.gyros_")]
    if key is None:
        assert result.status == "navigated"
        assert not found
    else:
        assert [item.key for item in found] == [key]
        assert found[0].figures["delay"] == pytest.approx(abs(late) * record.interval, abs=0.03)


def test_a_late_antenna_that_the_road_swings():
    """1.8 Hz, three metres off, .08 s late: as a derivative alone it is not found within .05 s, and looks like early gyros."""
    dt, lat, late = 0.01, 0.7, 0.08
    rng = np.random.default_rng(3)
    t = dt * np.arange(12_001)
    beats = [(0.02, 1.8, 0.3), (0.02, 1.3, 2.0), (0.6, 0.05, 0.0)]  # rad, Hz, rad

    def turned(t):
        return sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in beats)

    def axes(t):
        return dcm_from_euler(turned(t), 0.0 * t, 0.0 * t)

    C = axes(t)
    dtheta = dt * np.einsum("kji,j->ki", 0.5 * (C[1:] + C[:-1]), earth_rate_n(lat))
    dtheta[:, 2] -= np.diff(turned(t))
    fast, slowly = (
        4.0,
        2.0 * np.pi * 0.05,
    )  # m/s northwards and back, rad/s: without it nothing but the arm would show a delay
    middle = t[1:] - 0.5 * dt
    force = np.array([0.0, 0.0, float(normal_gravity(lat, 0.0))]) + np.outer(
        fast * slowly * np.cos(slowly * middle), [0.0, 1.0, 0.0]
    )
    dvel = dt * np.einsum("kji,kj->ki", axes(middle), force)
    spec = ImuSpec(gyro_random_walk=2e-5, accel_random_walk=2e-4, gyro_bias=1e-6, accel_bias=1e-3)
    record = ImuRecord(
        t[1:],
        dtheta + spec.gyro_random_walk * np.sqrt(dt) * rng.standard_normal(dtheta.shape),
        dvel + spec.accel_random_walk * np.sqrt(dt) * rng.standard_normal(dvel.shape),
        kind="increments",
    )
    arm, at = np.array([0.5, 3.0, 1.0]), np.arange(1.0, 119.0, 0.5)
    then = at - late
    rate = sum(a * 2.0 * np.pi * f * np.cos(2.0 * np.pi * f * then + p) for a, f, p in beats)
    v_n = np.einsum("kij,kj->ki", axes(then), np.cross(rate[:, None] * [0.0, 0.0, -1.0], arm))
    out = np.einsum("kij,j->ki", axes(then), arm)
    off = 0.3 * rng.standard_normal((len(at), 3))
    v_n[:, 1] += fast * np.sin(slowly * then)
    out[:, 1] += fast / slowly * (1.0 - np.cos(slowly * then))
    place = out + off
    gnss = GnssRecord(
        at,
        lat + place[:, 1] / 6_363_000.0,
        0.1 + place[:, 0] / (6_387_000.0 * np.cos(lat)),
        place[:, 2],
        v_n + 0.03 * rng.standard_normal((len(at), 3)),
        np.full((len(at), 3), 0.3),
        np.full((len(at), 3), 0.03),
    )
    P = np.diag(np.repeat([1e-3, 0.05, 1.0, 1e-6, 1e-3], 3) ** 2)
    start = Start(0.0, C[0], np.zeros(3), lat, 0.1, 0.0, np.zeros(3), np.zeros(3), P)
    result = navigate(record, start, aid=Gnss(gnss, Mounting(lever_arm=arm, latency_sigma=0.2)), imu=spec)
    assert result.status == "navigated"
    assert not [item for item in result.evidence if item.key.startswith("delay.")]
    lag = result.estimated()["GNSS lag"]
    assert lag["value"][0] == pytest.approx(late, abs=0.01)


@pytest.mark.slow
def test_a_delay_that_an_alignment_has_found_is_taken_over(drive):
    motion, record, start = drive
    times = np.arange(1.0, 179.0)
    sound = fixes(motion, times, sigma=0.3)
    gnss = replace(sound, time=sound.time + 0.15)  # five sigmas of what places of 0.3 m show here
    found = replace(start, gnss_delay=(0.14, 0.01), gnss_drift=ONE_CLOCK)
    result = navigate(record, found, aid=Gnss(gnss), imu=SPEC)
    assert "gnss.delay_taken_over" in {item.key for item in result.evidence}
    assert not any(item.key.startswith("second_look") for item in result.evidence)
    plain = navigate(record, start, aid=Gnss(gnss, Mounting()), imu=SPEC)
    assert "second_look.late" in {item.key for item in plain.evidence}
    lag = result.track.layout.slice_of("GNSS lag").start
    left, sigma = result.track.sensors[-1, lag], result.track.sigma[-1, lag]
    assert abs(left - 0.15) < 4.0 * sigma  # the whole delay, not what is left of it
    assert sigma < 0.01
    said = navigate(record, found, aid=Gnss(gnss, Mounting(latency=0.15)), imu=SPEC)
    assert "gnss.delay_taken_over" not in {item.key for item in said.evidence}


@pytest.mark.parametrize("ppm", some([0.0, 500.0], [-500.0, 100.0, 1e4]))
def test_clocks_that_run_apart(drive, ppm):
    """Delay and rate at the end; of a clock that is off by 1 % the velocity, too, which the two count by seconds of their own."""
    motion, record, start = drive
    fast = 1.0 + 1e-6 * ppm
    sound = fixes(motion, np.arange(1.0, 179.0), sigma=0.3)
    gnss = replace(sound, time=sound.time + 0.1)
    logged = replace(record, time=record.time * fast)
    result = navigate(logged, start, aid=Gnss(gnss, Mounting(latency_sigma=0.2)), imu=SPEC)
    assert result.status == "navigated"
    lag = result.estimated()["GNSS lag"]
    end = result.track.time[-1]
    true = 0.1 + end * (1.0 / fast - 1.0)
    assert abs(lag["value"][0] - true) < 4.0 * lag["sigma"][0] < 0.3
    assert abs(lag["value"][1] - (1.0 - fast)) < 4.0 * lag["sigma"][1]
    said = {item.key for item in result.evidence if item.key.startswith("clock.")}
    assert said <= ({"clock.runs_fast"} if ppm >= 500.0 else {"clock.runs_slow"} if ppm < 0.0 else set())
    error = result.track[-1:].errors_against(Track.along(motion.states(np.array([end / fast]))))[0]
    assert np.all(np.abs(error) < 4.0 * result.track.sigma[-1, :9])


def test_a_rate_that_an_alignment_has_found_is_taken_over(drive):
    motion, record, start = drive
    sound = fixes(motion, np.arange(1.0, 179.0), sigma=0.3)
    gnss = replace(sound, time=sound.time + 0.1)
    logged = replace(record, time=record.time * (1.0 - 3e-4))
    found = replace(start, gnss_delay=(0.1, 0.02), gnss_drift=Drift(3e-4, 3e-5, start.time))
    lag = navigate(logged, found, aid=Gnss(gnss), imu=SPEC).estimated()["GNSS lag"]
    assert abs(lag["value"][0] - 0.1 - 3e-4 * record.time[-1]) < 4.0 * lag["sigma"][0] < 0.06
    assert abs(lag["value"][1] - 3e-4) < 4.0 * lag["sigma"][1] < 1.3e-4


def test_stamps_of_a_clock_that_runs_apart():
    """What is late at a stamp, and the stamp of what holds then, undo each other."""
    mounting = Mounting(latency=0.3, drift=Drift(0.01, 0.0, 7.0))
    stamps = np.array([0.0, 7.0, 500.0])
    np.testing.assert_allclose(mounting.late_at(stamps), 0.3 + 0.01 * (stamps - 7.0))
    np.testing.assert_allclose(mounting.stamped(stamps - mounting.late_at(stamps)), stamps, atol=1e-12)
    assert Mounting().clock.rate_sigma == 0.0  # a latency that is known stays as it is
    with pytest.raises(UsageError, match="drift"):
        Mounting(drift=Drift(np.nan, 0.0, 0.0))


def test_an_arm_that_is_estimated_is_shown_whole(drive):
    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 179.0), sigma=0.05, arm=(0.5, 2.0, 1.0))
    given = Mounting(lever_arm=(0.5, 1.0, 1.0), lever_arm_sigma=1.0)
    arm = navigate(record, start, aid=Gnss(gnss, given), imu=SPEC).estimated()["GNSS lever arm"]
    assert abs(arm["value"][1] - 2.0) < 4.0 * arm["sigma"][1]
    assert arm["sigma"][1] < 0.2
