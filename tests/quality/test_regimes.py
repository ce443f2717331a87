"""Regimes of motion, on constructed and on real records."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests import recordings
from tests.quality.made import as_increments, base, car, codes
from truenorth.quality import inspect, motion_summary
from truenorth.records import ImuRecord


@pytest.mark.parametrize("arw", [1e-6, 1e-5, 6e-4, 3e-3])
def test_noise_is_not_motion(arw):
    """Per 10 s window and axis a false alarm has p < 1e-6 (16 times the mean of a chi-square-like variance)."""
    motion = motion_summary(base(arw=arw, vrw=arw * 10, duration=300.0))
    assert motion.still_fraction == 1.0
    assert motion.overall == "still"


def test_the_noise_estimate_is_the_noise():
    motion = motion_summary(base(arw=6e-4, duration=300.0))
    # The least of several estimates of the quiet quarter: biased to small values, never to large ones.
    assert np.all((motion.angle_noise > 0.6 * 6e-4) & (motion.angle_noise < 1.05 * 6e-4))


@pytest.mark.parametrize("arw", [1.5e-5, 9e-5])
def test_rough_ground_is_not_the_noise_of_a_log_that_rests_little(arw):
    """20 s of rest, and 280 s that shake as white noise does, 60 times as much as the gyros' own: no second of those is still."""
    record = base(arw=arw, duration=300.0)
    shaken = np.where(record.time > 20.0, 60.0 * arw / np.sqrt(record.interval), 0.0)
    shake = shaken[:, None] * np.random.default_rng(3).standard_normal((len(record), 3))
    motion = motion_summary(ImuRecord(record.time, record.gyro + shake, record.accel))
    rests = motion.time <= 20.5
    assert (motion.kind[rests] == 0).mean() > 0.9
    assert not (motion.kind[~rests] == 0).any()
    assert np.all(motion.angle_noise < 3.0 * arw)


def test_an_axis_that_stands_on_one_value_shows_no_noise():
    """A coarse gyro rests on one count for 15 s: what its counts wander by elsewhere is noise all the same."""
    record = base(arw=6e-4, duration=300.0)
    gyro = np.where((record.time < 15.0)[:, None], record.gyro[0], record.gyro)
    assert motion_summary(ImuRecord(record.time, gyro, record.accel)).still_fraction == 1.0


@pytest.mark.parametrize("phase", [0.0, 60.0])
def test_a_sway_of_as_many_seconds_as_values_goes_nowhere(phase):
    """Of 4 s, whose median is off its mean by up to half its amplitude: a base that sways by 4 cm was seen to gain speed."""
    record = base(arw=1e-6, vrw=1e-5, duration=240.0)
    sway = 0.16 * np.sin(2.0 * np.pi * record.time / 4.0 + np.radians(phase))
    assert motion_summary(replace(record, accel=record.accel + np.outer(sway, [1.0, 0.3, 0.5]))).moves_at is None
    start = np.where((record.time > 100.0) & (record.time < 105.0), 0.3, 0.0)
    moves = motion_summary(replace(record, accel=record.accel + np.outer(sway + start, [1.0, 0.3, 0.5]))).moves_at
    assert moves == pytest.approx(100.0, abs=15.0)  # the sway before it is in the same stretch


@pytest.mark.parametrize("arw", [1e-5, 6e-4])
def test_small_motion_is_disturbance_and_large_motion_is_sway(arw):
    small = motion_summary(base(amplitude=(0.5, 0.3, 0.1), arw=arw))
    assert small.fraction("disturbed") == 1.0
    large = motion_summary(base(amplitude=(5.0, 10.0, 3.0), arw=arw))
    assert large.fraction("swaying") == 1.0
    assert np.degrees(large.angular_amplitude) == pytest.approx(10.0, rel=0.1)  # the largest axis


def test_long_waves_and_lever_arms_stay_sway():
    swell = base(amplitude=(4.0, 10.0, 3.0), period=(12.0, 15.0, 9.0), duration=300.0)
    assert motion_summary(swell).fraction("swaying") == 1.0
    lever = base(amplitude=(5.0, 10.0, 3.0), surge=lambda t: 0.4 * np.sin(t), duration=300.0)
    assert motion_summary(lever).fraction("swaying") == 1.0


def test_disturbance_shows_only_where_it_is():
    """One push of 0.05 deg at 60 s between two minutes of rest."""
    record = base(duration=120.0)
    push = np.where(np.abs(record.time - 60.0) < 0.5, np.radians(0.05), 0.0)
    record = ImuRecord(record.time, record.gyro + push[:, None] * [1, 0, 0], record.accel)
    kinds = [(r.kind, round(r.start), round(r.stop)) for r in motion_summary(record).regimes]
    assert [k for k, _, _ in kinds] == ["still", "disturbed", "still"]
    assert abs(kinds[1][1] - 59) <= 1
    assert abs(kinds[1][2] - 61) <= 1


def test_starting_to_drive_is_moving():
    record = base(duration=90.0, surge=lambda t: np.where((t > 60) & (t < 66), 1.5, 0.0))
    first = next(r for r in motion_summary(record).regimes if r.kind == "moving")
    assert first.start == pytest.approx(60.0, abs=1.5)
    assert first.stop == pytest.approx(66.0, abs=1.5)


@pytest.mark.parametrize(("acceleration", "duration"), [(0.3, 13.3), (0.5, 16.0), (0.7, 14.3)])
def test_a_start_is_seen_within_a_second(acceleration, duration):
    """What is cut off there holds no motion: a second later, 24 of 24 logs at rest were refused as those of bases that move."""
    t = 0.01 * np.arange(1, 10_001)
    force = np.zeros((len(t), 3))
    force[:, 2] = 9.81
    force[:, 1] = acceleration * (np.clip((t - 60.0) / 0.5, 0.0, 1.0) - np.clip((t - 60.0 - duration) / 0.5, 0.0, 1.0))
    rng = np.random.default_rng(4)
    noisy = force + 1e-3 * rng.standard_normal(force.shape)
    record = ImuRecord(t, 1e-5 * rng.standard_normal(force.shape), noisy, kind="rates")
    moves = motion_summary(record).moves_at
    assert moves is not None
    assert moves == pytest.approx(60.5, abs=0.6)


def test_a_turn_is_rotating_and_knows_its_bounds():
    record = base(duration=120.0)
    turn = np.where((record.time > 40) & (record.time <= 70), np.radians(6.0), 0.0)
    motion = motion_summary(ImuRecord(record.time, record.gyro + turn[:, None] * [0, 0, 1], record.accel))
    rotating = next(r for r in motion.regimes if r.kind == "rotating")
    assert rotating.start == pytest.approx(40.0, abs=1.5)
    assert rotating.stop == pytest.approx(70.0, abs=1.5)
    assert motion.fraction("moving") == 0.0


def test_a_constant_gyro_bias_is_not_a_turn_but_a_constant_turn_is():
    biased = base(arw=6e-4)
    shifted = ImuRecord(biased.time, biased.gyro + np.radians([0.4, -0.3, 0.2]), biased.accel)
    assert motion_summary(shifted).still_fraction == 1.0
    carousel = base()
    spun = ImuRecord(carousel.time, carousel.gyro + np.radians([0, 0, 6.0]), carousel.accel)
    assert motion_summary(spun).fraction("rotating") == 1.0


def test_rates_and_increments_tell_the_same():
    record = base(amplitude=(2.0, 3.0, 1.0))
    a, b = motion_summary(record), motion_summary(as_increments(record))
    np.testing.assert_array_equal(a.kind, b.kind)
    np.testing.assert_allclose(a.wander, b.wander, rtol=1e-9)


def test_turned_axes_change_nothing():
    C = Rotation.from_euler("ZXY", [90, 180, 0], degrees=True).as_matrix()
    record = base(amplitude=(0.2, 0.3, 0.1))
    a, b = motion_summary(record), motion_summary(record.rotated(C))
    np.testing.assert_array_equal(a.kind, b.kind)
    np.testing.assert_allclose(a.acceleration, b.acceleration, atol=1e-9)


def test_regimes_have_no_holes_and_cover_the_record():
    record = base(duration=75.3, surge=lambda t: np.where(t > 50, np.sin(t), 0.0))
    regimes = motion_summary(record).regimes
    assert regimes[0].start == pytest.approx(record.time[0] - record.interval)
    assert regimes[-1].stop == record.time[-1]
    assert all(a.stop == b.start and a.kind != b.kind for a, b in pairwise(regimes))


@pytest.mark.parametrize(("duration", "interval"), [(2.0, 0.01), (4.0, 0.01), (11.0, 0.01), (60.0, 1.0), (40.0, 0.3)])
def test_short_and_slow_records_do_not_fail(duration, interval):
    record = base(duration=duration, interval=interval)
    motion = motion_summary(record)
    assert motion.overall == ("unknown" if duration < 3 else "still")
    assert json.dumps(inspect(record).to_dict(), allow_nan=False)


def test_a_gap_is_not_motion():
    record = base(duration=120.0)
    keep = (record.time < 50) | (record.time > 53.2)
    cut = ImuRecord(record.time[keep], record.gyro[keep], record.accel[keep])
    assert motion_summary(cut).still_fraction == 1.0


def test_jittered_time_is_not_motion():
    record = base(duration=60.0)
    jitter = np.random.default_rng(1).uniform(-0.003, 0.003, len(record))
    assert motion_summary(ImuRecord(record.time + jitter, record.gyro, record.accel)).still_fraction == 1.0


def test_rlg_on_a_parked_vehicle_is_disturbed():
    motion = motion_summary(recordings.rlg_vehicle_xian()[0])
    assert motion.overall == "disturbed"
    assert motion.fraction("still") + motion.fraction("disturbed") == 1.0
    assert motion.kind[:30].tolist() == [1] * 30  # people get in: minutes of arc


def test_navigation_grade_in_a_laboratory_is_still():
    assert motion_summary(recordings.navgrade_static_beijing()[0]).still_fraction == 1.0


def test_fog_with_idling_engine_is_disturbed():
    motion = motion_summary(recordings.fog_gps_xian()[0])
    assert motion.overall == "disturbed"
    assert motion.fraction("still") + motion.fraction("disturbed") == 1.0


def test_coarsely_quantised_mems_is_still_for_hours():
    assert motion_summary(recordings.static_adis16405()[0]).still_fraction == 1.0


@pytest.mark.parametrize("direction", ["north", "east"])
def test_xsens_is_still(direction):
    assert motion_summary(recordings.xsens_four_headings(direction)[0]).still_fraction == 1.0


def test_cart_is_still_then_moves():
    record = recordings.stim300_cart_chicago()[0]
    still, moving = motion_summary(record).regimes[:2]
    assert (still.kind, moving.kind) == ("still", "moving")
    assert still.stop - record.time[0] == pytest.approx(84.0, abs=2.0)


def test_table_is_still_then_rotates():
    motion = motion_summary(recordings.mems_rotation_table()[0])
    rotating = motion.regimes[-1]
    assert rotating.kind == "rotating"
    assert rotating.start == pytest.approx(129.0, abs=1.5)
    assert motion.regimes[0].kind == "still"
    assert motion.regimes[0].stop == pytest.approx(129.0, abs=1.5)


def test_car_is_still_then_moves():
    still, moving = motion_summary(car()).regimes
    assert (still.kind, moving.kind) == ("still", "moving")
    assert still.stop == pytest.approx(21.6, abs=1.5)


def test_real_records_raise_no_false_alarm():
    """Right units and axes: no error, no warning, on every recording read as it is meant."""
    for record, *_ in (
        recordings.rlg_vehicle_xian(),
        recordings.navgrade_static_beijing(),
        recordings.fog_gps_xian(),
        recordings.xsens_four_headings("north"),
        recordings.stim300_cart_chicago(),
        recordings.mems_rotation_table(),
    ):
        assert codes(inspect(record), "error", "warning") == set(), record.source


def test_the_car_shows_its_gap_and_its_axes():
    found = inspect(car())
    assert codes(found) == {"gaps", "axes_down"}
    assert found.sampling.gap_lengths == pytest.approx([0.53], abs=0.01)


def test_earth_rate_gives_the_latitude():
    record, position = recordings.rlg_vehicle_xian()
    assert "earth_rate" in codes(inspect(record, position.lat), "note")
    assert "latitude" in codes(inspect(record, -position.lat), "warning")  # the wrong hemisphere


@pytest.mark.parametrize("length", [3.2, 60.0])
def test_in_a_gap_nothing_rests(length):
    """Between two rows a straight line shows no motion: of a phone in the hand 85 s without a row were its longest rest."""
    time = 0.01 * np.arange(1, 12001)
    rng = np.random.default_rng(7)
    gyro = 0.5 * np.sin(2.0 * np.pi * time[:, None] / np.array([3.0, 4.0, 5.0])) + 1e-3 * rng.standard_normal(
        (12000, 3)
    )
    accel = np.array([0.0, 0.0, 9.8]) + 0.01 * rng.standard_normal((12000, 3))
    keep = (time < 40.0) | (time > 40.0 + length)
    cut = ImuRecord(time[keep], gyro[keep], accel[keep], "rates")
    assert "still" not in {stretch.kind for stretch in motion_summary(cut).regimes}
    found = inspect(cut)
    assert found.noise_from is None
    assert codes(found) >= {"gaps", "no_rest"}


@pytest.mark.parametrize(
    ("gyro", "accel", "stays"), [(130.0, 0.2, False), (130.0, 0.002, True), (3.0, 0.2, True), (3.0, 0.002, True)]
)
def test_no_sensors_at_rest_are_as_loud_as_a_walk(gyro, accel, stays):
    """At 10 Hz the steps of one who walks look white, in deg/sqrt(h) and m/s^2/sqrt(Hz): it was rest, and its noise was given."""
    time, rng = 0.1 * np.arange(1, 3001), np.random.default_rng(12)
    rates = np.radians(gyro) / 60.0 / np.sqrt(0.1) * rng.standard_normal((3000, 3))
    forces = np.array([0.0, 0.0, 9.8]) + accel / np.sqrt(0.1) * rng.standard_normal((3000, 3))
    record = ImuRecord(time, rates, forces, "rates")
    still = motion_summary(record).still_fraction
    assert still > 0.9 if stays else still < 0.1
    assert (inspect(record).noise_from is not None and inspect(record).noise_from.kind == "still") == stays
