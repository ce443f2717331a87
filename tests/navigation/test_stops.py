"""Stops: all sensors that look must agree; and a vehicle that stands keeps its height."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.foreign_rows import CASES
from truenorth.aiding.aids import Odometer
from truenorth.core.position import Position
from truenorth.navigation import Start, navigate
from truenorth.navigation.stops import (
    DISTURBED_VELOCITY,
    STILL_VELOCITY,
    seconds_at_rest,
    updates_at,
    velocity_at_rest,
    zero_updates,
)
from truenorth.quality.innovations import NO_ROTATION
from truenorth.records import GnssRecord, OdometerRecord, VelocityRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(48.0, 11.0, 500.0)
SPEC = imu_spec("industrial")


@pytest.fixture(scope="module")
def standing():
    """Five minutes of an IMU that nothing shakes: at rest, or as well on a smooth road at constant speed."""
    return simulate(rest(PLACE, 0.6), rate=50.0, duration=300.0, imu=SPEC, seed=2).record


T = np.arange(0.5, 300.0, 0.5)
ABSENT = np.full(len(T), np.nan)


def gnss(v_n):
    return GnssRecord(T, 0 * T + PLACE.lat, 0 * T + PLACE.lon, 0 * T, v_n)


def test_a_second_is_a_stop_where_all_that_look_agree(standing):
    drives = np.where((T > 100.0) & (T < 200.0), 14.0, 0.0)
    north = np.stack([0 * T, drives, 0 * T], axis=1)
    alone = seconds_at_rest(standing)[0]
    assert len(alone) > 290
    for logs in (
        {"odometer": OdometerRecord(T, drives, "speed")},
        {"odometer": OdometerRecord(T, np.round(0.5 * drives / 0.04), "pulses", 0.04)},
        {"gnss": gnss(north)},
        {"velocity": VelocityRecord(T, np.where([False, True, False], north, np.nan))},
        {"odometer": OdometerRecord(T, 0 * T, "speed"), "gnss": gnss(north)},  # a wheel that slides
    ):
        found = seconds_at_rest(standing, **logs)[0]
        assert len(found) > 190, logs
        assert not np.any((found > 100.0) & (found < 200.0)), logs
    # Where a receiver has no fix nobody but the IMU looks.
    silent = gnss(np.where(((T > 100.0) & (T < 200.0))[:, None], np.nan, 0.0 * north))
    found = seconds_at_rest(standing, gnss=silent)[0]
    assert len(found) > 190
    assert not np.any((found > 102.0) & (found < 198.0))


@pytest.mark.parametrize("speed", [0.02, 0.06, 0.15])
def test_a_machine_that_creeps_may_have_the_speed_of_its_wheel(standing, speed):
    """A paver goes at 6 cm/s, as smooth as at rest; a wheel to half a centimetre a second, or of pulses of 2 mm, sees it."""
    rng = np.random.default_rng(4)
    time = np.arange(0.1, 300.0, 0.1)
    goes = np.where((time > 100.0) & (time < 200.0), speed, 0.0)
    way = np.floor(np.cumsum(goes * 0.1) / 0.002)
    for log in (
        OdometerRecord(time, goes + 0.005 * rng.standard_normal(len(time)), "speed"),
        OdometerRecord(time, np.diff(way, prepend=0.0), "pulses", 0.002),
    ):
        zero = zero_updates(standing, "auto", log)[0]
        inside = (zero.time > 101.0) & (zero.time < 199.0)
        # All of them are off by the same: together they weigh as one.
        np.testing.assert_allclose(1.0 / np.sqrt(np.sum(1.0 / zero.sigma[inside, 0] ** 2)), speed, rtol=0.15)
        np.testing.assert_allclose(zero.sigma[(zero.time < 99.0) | (zero.time > 201.0)], STILL_VELOCITY, atol=1e-3)


def test_a_vehicle_that_hovers_is_at_rest_as_well_as_its_log_says():
    """Taken for +-.03 m/s, swaying by .1, its zero velocities were "rejected: they contradict the track"."""
    rng = np.random.default_rng(6)
    time = np.arange(0.2, 60.0, 0.2)
    noise = 0.02 * rng.standard_normal((len(time), 3))
    sways = VelocityRecord(time, noise + 0.14 * np.sin(time[:, None] * [0.8, 0.0, 1.1]))
    assert velocity_at_rest(T[T < 60.0], sways) == pytest.approx(0.1, rel=0.1)
    assert velocity_at_rest(T[T < 60.0], VelocityRecord(time, noise), None) == DISTURBED_VELOCITY
    assert velocity_at_rest(np.empty(0), sways) == DISTURBED_VELOCITY


@pytest.mark.parametrize("phase", [0.3, 0.6, 0.9])
def test_a_vehicle_that_rolls_to_rest_is_not_taken_to_stand(standing, phase):
    """Its speed falls by two thirds in 1.5 s: of the seconds found the first had .03 to .05 m/s, of a sigma of .01."""
    time, fade = standing.time, 1.5
    since = time - 100.0 - phase
    speed = np.where(since < 0.0, np.minimum(8.0, 0.8 * (time - 40.0).clip(0.0)), 8.0 * np.exp(-since.clip(0.0) / fade))
    push = np.gradient(speed, time)[:, None] * np.array([0.0, 1.0, 0.0])
    record = replace(standing, accel=standing.accel + push)
    log = gnss(np.interp(T, time, speed)[:, None] * np.array([0.0, 1.0, 0.0]))
    found = seconds_at_rest(record, gnss=log)[0]
    assert np.count_nonzero(found > 100.0) > 180
    assert np.interp(found, time, speed).max() < STILL_VELOCITY


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("stands", [2.0, 4.0, 60.0])
def test_soft_braking_at_the_end_of_a_stop_is_no_rest(standing, sign, stands):
    """.06 m/s^2, below what tells motion from tilt, to rest or from it: seconds of .1 m/s were zero to .01; a slope is rest."""
    time = standing.time
    since = sign * (time - 150.0) + 0.5 * stands
    at = np.array([-60.0, -52.0, -7.0, -3.0, 0.0])
    knots = np.concatenate([at, stands - at[::-1]])
    roll = np.interp(since, knots, [0.0, 8.0, 8.0, 0.18, 0.0, 0.0, 0.18, 8.0, 8.0, 0.0])
    push = np.gradient(sign * roll, time)[:, None] * np.array([0.0, 1.0, 0.0]) + np.array([0.3, 0.1, 0.0])
    scale = standing.interval if standing.kind == "increments" else 1.0
    log = gnss(np.interp(T, time, roll)[:, None] * np.array([0.0, 1.0, 0.0]))
    found = seconds_at_rest(replace(standing, accel=standing.accel + scale * push), gnss=log)[0]
    assert np.interp(found, time, roll).max() < STILL_VELOCITY
    inside = np.abs(found - 150.0) < 0.5 * stands
    assert np.count_nonzero(inside) >= (stands - 6.0 if stands > 10.0 else 0.0)
    assert np.count_nonzero(np.abs(found - 150.0) > 0.5 * stands + 60.0) > 100


def test_a_second_is_compared_with_those_inside_its_stop(standing):
    """A base that rests throughout keeps its ends, and times that a user gives their seconds: those without any motion as rest."""
    alone = seconds_at_rest(standing)[0]
    assert alone[0] < 1.0
    assert alone[-1] > standing.time[-1] - 1.5
    assert len(alone) == len(np.unique(alone)) >= 298
    velocity, rotation = zero_updates(standing, [(20.0, 24.0), (40.0, 41.0)])
    np.testing.assert_allclose(np.sort(velocity.time), [20.5, 21.5, 22.5, 23.5, 40.5], atol=0.75)
    assert set(rotation.time) < set(velocity.time)
    assert len(rotation.time) == 3  # whole seconds of the record inside the first stop
    np.testing.assert_array_equal(velocity.sigma[:, 0] == STILL_VELOCITY, np.isin(velocity.time, rotation.time))


@pytest.mark.slow
def test_a_car_that_rolls_to_rest_is_aligned():
    """Zero velocity at .09 m/s, with a sigma of .01, made 11 of 39 be rejected: a sound log was inconsistent."""
    case = next(case for case in CASES if case.name == "by GNSS, tactical, car")
    assert case.run(1, 9).refused == ""


@pytest.mark.parametrize(("noise", "edge"), [(0.02, 4.0), (0.5, 12.0), (2.5, 22.0)])
def test_places_without_velocities_show_stops(standing, noise, edge):
    """Fixes of a receiver that tells no velocity: no stop is found while they move on, nor a standing base denied for long."""
    rng = np.random.default_rng(3)
    north = 14.0 * np.clip(T - 100.0, 0.0, 100.0) + noise * rng.standard_normal(len(T))
    east = noise * rng.standard_normal(len(T))
    scale = 6.37e6
    log = GnssRecord(T, PLACE.lat + north / scale, PLACE.lon + east / (scale * np.cos(PLACE.lat)), 0 * T)
    found = seconds_at_rest(standing, gnss=log)[0]
    assert not np.any((found > 100.0) & (found < 200.0))
    rests = (found < 100.0 - edge) | (found > 200.0 + edge)
    assert np.count_nonzero(rests) > (0.95 if noise < 1.0 else 0.6) * (200.0 - 2.0 * edge)
    hopeless = GnssRecord(T[::40], log.lat[::40], log.lon[::40], 0 * T[::40])
    assert len(seconds_at_rest(standing, gnss=hopeless)[0]) == 0


def test_height_does_not_wander_while_the_vehicle_stands(standing):
    """A zero velocity a second of .01 m/s lets the height's sigma grow by its random walk, and the height by no more."""
    sigma = np.repeat([5e-3, 0.1, 1.0, SPEC.gyro_bias, SPEC.accel_bias], 3)
    C = rest(PLACE, 0.6).states(0.0).C_nb
    v_n = np.array([0.05, -0.05, 0.05])
    start = Start(0.0, C, v_n, PLACE.lat, PLACE.lon, PLACE.alt, np.zeros(3), np.zeros(3), np.diag(sigma**2))
    result = navigate(standing, start, imu=SPEC, altitude="free", zupt="auto")
    settled = result.time > 10.0
    height, time = result.position[settled, 2], result.time[settled]
    walk = 0.01 * np.sqrt(time - time[0] + 1.0)
    assert np.all(np.abs(height - height[0]) < 4.0 * walk)
    assert np.abs(result.v_n[settled, 2]).max() < 0.02
    grown = np.sqrt(result.position_sigma[-1, 2] ** 2 - result.position_sigma[settled, 2][0] ** 2)
    assert 0.5 * walk[-1] < grown < 1.5 * walk[-1]


def test_an_engine_that_idles_turns_nothing(standing):
    """A tenth of a deg/s at 5 Hz, whole turns in the filter's steps: between an odometer's rows it was seen, and "rejected"."""
    first = standing.between(0.0, 60.0)
    shaken = 1e-4 * np.sin(10.0 * np.pi * first.time + 0.7)[:, None] * [1.0, 0.5, -0.8]
    record = replace(first, gyro=first.gyro + np.diff(shaken, axis=0, prepend=shaken[:1]))
    sigma = np.repeat([5e-3, 0.1, 1.0, SPEC.gyro_bias, SPEC.accel_bias], 3)
    C = rest(PLACE, 0.6).states(0.0).C_nb
    zero = np.zeros(3)
    start = Start(0.0, C, zero, PLACE.lat, PLACE.lon, PLACE.alt, zero, zero, np.diag(sigma**2))
    wheel = T[T < 60.0] + 0.23
    log = Odometer(OdometerRecord(wheel, 0 * wheel, "speed"))
    result = navigate(record, start, aid=log, imu=SPEC, altitude="fixed", zupt="auto", check_clocks=False)
    turns = next(r for r in result.track.residuals if r.name == NO_ROTATION)
    seen = turns.rows > 0
    assert np.count_nonzero(seen) > 50
    assert np.mean(turns.nis[seen] > 21.0) < 0.02  # .999 of sound ones of three rows lie below 16
    assert result.status == "navigated"


@pytest.mark.parametrize("hertz", [10.0, 13.0, 30.0])
def test_an_engine_in_phase_with_the_rows_is_no_bias(standing, hertz):
    """Turned so far in the .05 s before each row: the mean of independent angles, however many turns a second are whole."""
    rows = {a.name: a for a in updates_at(standing, np.arange(0.5, 200.0), np.empty(0))}
    time = rows[NO_ROTATION].time
    assert np.array_equal(time, rows["zero velocity"].time)
    assert np.abs(time - np.arange(0.5, 200.0)).max() < 0.5 - 0.2  # a step of the filter before it is at rest, too
    for phase in np.linspace(0.0, np.pi, 7):
        angle = np.sin(2.0 * np.pi * hertz * time + phase) - np.sin(2.0 * np.pi * hertz * (time - 0.05) + phase)
        # At the middles of the seconds each angle is the same: a mean of up to 2, not of some tenths
        assert abs(angle.mean()) < 4.0 * np.sqrt(np.mean(angle**2) / len(time))


def test_an_ins_that_falls_for_minutes_is_no_fault_of_the_aiding(standing):
    """A start of poor biases, with an odometer: what the log's axes are is shown by the first seconds or not at all."""
    sigma = np.repeat([5e-3, 0.1, 1.0, 5e-3, 0.5], 3)
    C = rest(PLACE, 0.6).states(0.0).C_nb
    start = Start(
        0.0, C, np.zeros(3), PLACE.lat, PLACE.lon, PLACE.alt, np.zeros(3), np.array([0.0, 0.0, 0.5]), np.diag(sigma**2)
    )
    result = navigate(standing, start, aid=Odometer(OdometerRecord(T, 0 * T, "speed")), imu=SPEC, check_clocks=False)
    assert result.position[-1, 2] == pytest.approx(PLACE.alt, abs=10.0)
