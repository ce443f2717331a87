"""A wheel in another unit, or that counts the other way: named with a receiver and without; sound ones pass."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth as tn
from tests.quality.test_clock_apart import PLACE, SPEC, drive
from truenorth.aiding.aids import WHEEL, Odometer
from truenorth.core.errors import DataError
from truenorth.quality.wheel_unit import check_unit
from truenorth.records import GnssRecord, OdometerRecord
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight

RATE = 10.0


def wheel(motion, duration=240.0, late=0.0, seed=1):
    """Times and speeds of a wheel with 1 % of scale and some noise."""
    t = np.arange(0.3, duration - 1.0, 1.0 / RATE)
    s = motion.states(np.maximum(t - late, 0.0))
    v = np.einsum("kji,kj->ki", s.C_nb, s.v_n)[:, 1]
    return t, 1.01 * v + 0.02 * np.random.default_rng(seed).standard_normal(len(t))


@pytest.fixture(scope="module")
def drives():
    return [drive(seed) for seed in range(1, 7)]


@pytest.mark.parametrize("receiver", [True, False])
@pytest.mark.parametrize(
    ("unit", "factor"),
    [("km/h", 3.6), ("mph", 2.23694), ("knots", 1.94384), ("ft/s", 3.28084), ("cm/s", 100.0), ("mm/s", 1000.0)],
)
def test_the_unit_of_a_speed_is_named(drives, unit, factor, receiver):
    for motion, record, gnss in drives:
        t, v = wheel(motion)
        with pytest.raises(DataError, match=rf"column speed: counts .* these values seem to be {unit}:"):
            check_unit(record, OdometerRecord(t, factor * v, kind="speed"), gnss if receiver else None, WHEEL)


@pytest.mark.parametrize("receiver", [True, False])
def test_what_else_a_wheel_may_count(drives, receiver):
    """Speeds in the place of distances, metres a second taken for km/h, a pulse of another size, the other way."""
    for motion, record, gnss in drives:
        t, v = wheel(motion)
        given = gnss if receiver else None
        for odometer, said in (
            (OdometerRecord(t, v), "call the column speed"),
            (OdometerRecord(t, v / 3.6, kind="speed"), "the heading says km/h"),
            (OdometerRecord(t, np.round(v / RATE / 0.02), kind="pulses", pulse_size=0.05), r"pulse size of 0\.0[12]"),
            (OdometerRecord(t, -v, kind="speed"), "expected forward to be positive"),
        ):
            with pytest.raises(DataError, match=said):
                check_unit(record, odometer, given, WHEEL)


@pytest.mark.parametrize("receiver", [True, False])
@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, 3.0])
def test_a_sound_wheel_passes(drives, receiver, late):
    """On time or late, with a sign or without, of any kind, with 10 % of scale."""
    for motion, record, gnss in drives:
        t, v = wheel(motion, late=late)
        for odometer in (
            OdometerRecord(t, v, kind="speed"),
            OdometerRecord(t, 1.1 * v / RATE),
            OdometerRecord(t, np.abs(v), kind="speed", signed=False),
            OdometerRecord(t, np.round(v / RATE / 0.05), kind="pulses", pulse_size=0.05),
        ):
            check_unit(record, odometer, gnss if receiver else None, WHEEL)


def test_counts_that_have_nothing_to_do_with_the_drive_are_not_judged(drives):
    """What the IMU feels shows no unit of them, and a receiver's speed has no ratio to them."""
    for seed, (motion, record, gnss) in enumerate(drives):
        t, _ = wheel(motion)
        wander = np.cumsum(np.random.default_rng(seed).standard_normal(len(t)))
        for given in (gnss, None):
            check_unit(record, OdometerRecord(t, 3.0 * np.abs(wander), kind="speed"), given, WHEEL)


@pytest.mark.parametrize(("speed", "noise"), [(1.0, 0.5), (1.3, 0.3), (1.4, 0.2), (0.6, 0.5)])
def test_a_slow_vehicle_whose_receiver_is_noisy_passes(speed, noise):
    """Rows that noise lifts beyond a threshold are faster than the wheel, all of them."""
    for seed in range(4):
        motion, record, gnss = drive(seed, speed=speed)
        t, v = wheel(motion)
        loud = gnss.v_n + noise * np.random.default_rng(seed).standard_normal(gnss.v_n.shape)
        check_unit(record, OdometerRecord(t, v, kind="speed"), replace(gnss, v_n=loud), WHEEL)


@pytest.mark.parametrize("receiver", [True, False])
def test_a_wheel_aside_in_circles_passes(receiver):
    """At 2.2 m aside, in turns of 5 m, it goes 1.4 times as far as the IMU."""
    motion, record, gnss = drive(2, speed=3.0, turning=(30.0, 35.0), straights=(0.1, 1.0))
    t, v = wheel(motion)
    turning = np.interp(t, record.time, record.gyro[:, 2] / record.interval)
    mounting = replace(WHEEL, lever_arm=np.array([2.2, 0.0, 0.0]), lever_arm_sigma=0.05)
    wide = OdometerRecord(t, v + 2.2 * turning, kind="speed")
    check_unit(record, wide, gnss if receiver else None, mounting)


def test_a_receiver_on_another_clock_is_no_other_unit():
    """It drives off from a village 60 s later than the wheel says."""
    legs = [*straight(100.0), *accelerate(22.0, 1.4, 8.0), *straight(500.0)]
    motion = course(PLACE, legs, heading=1.0, speed=8.0)
    record = simulate(motion, rate=50.0, duration=240.0, imu=SPEC, seed=1).record
    t = np.arange(70.0, 170.0, 0.2)
    s = motion.states(t - 60.0)
    gnss = GnssRecord(t, s.lat, s.lon, s.alt, v_n=s.v_n)
    check_unit(record, OdometerRecord(*wheel(motion), kind="speed"), gnss, WHEEL)


def test_the_alignment_and_the_navigation_say_so(drives):
    motion, record, _ = drives[0]
    t, v = wheel(motion)
    with pytest.raises(DataError, match="km/h"):
        tn.align(record, (48.0, 11.0, 500.0), SPEC, aid=Odometer(OdometerRecord(t, 3.6 * v, kind="speed")))
