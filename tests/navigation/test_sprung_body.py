"""A wheel on a vehicle whose body heaves and pitches on its springs: what its constraints say of sensors, and what not."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.stats import chi2

from tests.runs import few_and_all
from truenorth import ImuRecord, ImuSpec, OdometerRecord
from truenorth.aiding import sprung
from truenorth.aiding.aids import Odometer
from truenorth.aiding.sprung import BOX, GRID, of_the_path, quick_kernel, quick_motion
from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.errors.axes import standing
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track, with_states
from truenorth.navigation import Mounting
from truenorth.state.layout import ACCEL_AXES
from truenorth.state.state import Start

SPEED = 15.0  # m/s
T = 0.01
SPEC = ImuSpec(
    gyro_bias=np.radians(1000.0) / 3600.0,
    gyro_random_walk=np.radians(1.0) / 60.0,
    gyro_scale_factor=0.01,
    accel_bias=0.3,
    accel_random_walk=3e-3,
    accel_scale_factor=0.01,
    name="consumer, of constants",
)


def tones(time, rms, low, high, rng):
    """A body's motion on an uneven road."""
    f, phase, size = rng.uniform(low, high, 12), rng.uniform(0.0, 2.0 * np.pi, 12), rng.standard_normal(12)
    size *= rms * np.sqrt(2.0 / np.sum(size**2))
    return np.sin(2.0 * np.pi * np.outer(time, f) + phase) @ size


def straight_on(heave, pitch, seconds=60.0, biases=(0.0, 0.0)):
    """IMU and wheel of a body on a straight level road, and its velocity up, body axes, at the wheel's times."""
    ends = np.arange(0.0, seconds + 0.5 * T, T)
    p, w = pitch(ends), heave(ends)
    middle = 0.5 * (p[1:] + p[:-1])
    up = np.diff(w) + GRAVITY_EQUATOR * T
    zero = np.zeros_like(up)
    gyro = np.stack([np.diff(p) + biases[0] * T, zero, zero], axis=1)
    accel = np.stack([zero, up * np.sin(middle), up * np.cos(middle) + biases[1] * T], axis=1)
    times = np.arange(0.1, seconds, 0.1)
    at = np.round(times / T).astype(int)
    wheel = OdometerRecord(times, np.full_like(times, SPEED), "speed")
    return ImuRecord(ends[1:], gyro, accel, "increments"), wheel, (w * np.cos(p) - SPEED * np.sin(p))[at]


def test_a_polynomial_has_no_quick_part():
    kernel = quick_kernel(BOX / GRID)
    x = np.linspace(-1.0, 1.0, len(kernel))
    for power in range(4):
        assert abs(np.sum(kernel * x**power)) < 1e-12


def test_heave_and_pitch_are_taken_off_and_biases_are_not():
    """Of tones from .7 Hz on a twentieth is left; biases of a consumer IMU add nothing away from the ends."""
    record, wheel, up = straight_on(
        lambda t: 0.05 * np.sin(2.0 * np.pi * 1.5 * t),
        lambda t: 0.006 * np.sin(2.0 * np.pi * 0.7 * t),
        biases=(5e-3, 0.3),
    )
    (source,) = Odometer(wheel, Mounting()).sources("free")
    left = up - quick_motion(record, source)[:, 2]
    inside = slice(40, -40)
    assert np.std(up[inside]) > 0.07
    assert np.std(left[inside]) < 0.05 * np.std(up[inside])


def test_a_body_that_does_not_move_on_its_springs_has_the_constraints_of_its_wheel():
    """And other sensors are left as they are. Biases of a consumer IMU are no quick motion, but for the ends."""
    record, wheel, _ = straight_on(np.zeros_like, np.zeros_like, biases=(5e-3, 0.3))
    (source,) = Odometer(wheel, Mounting()).sources("free")
    np.testing.assert_allclose(quick_motion(record, source)[40:-40], 0.0, atol=1e-6)
    assert of_the_path([source], record)[0] is source
    shaken, wheel, _ = straight_on(lambda t: 0.05 * np.sin(9.0 * t), np.zeros_like)
    (source,) = Odometer(wheel, Mounting()).sources("free")
    (of_path,) = of_the_path([source], shaken)
    assert of_path.measured.shape[1] == source.measured.shape[1] + 9
    assert of_the_path([of_path], shaken)[0] is of_path
    none = replace(source, time=source.time[:0], measured=source.measured[:0], sigma=source.sigma[:0])
    assert of_the_path([none], shaken)[0] is none


def test_a_long_log_is_looked_at_in_parts(monkeypatch):
    record, wheel, _ = straight_on(lambda t: 0.05 * np.sin(9.0 * t), lambda t: 0.006 * np.sin(5.0 * t))
    (source,) = Odometer(wheel, Mounting()).sources("free")
    whole = quick_motion(record, source)
    monkeypatch.setattr(sprung, "BLOCK", 20.0)
    np.testing.assert_allclose(quick_motion(record, source), whole, atol=0.02 * np.abs(whole).max())


def scale_found(source, record, spec, *, of_path):
    """The upward accelerometer's scale as a pass finds it, and its sigma."""
    sigma = np.repeat([np.radians(1.0), 0.1, 3.0, spec.gyro_bias, spec.accel_bias], 3)
    zero = np.zeros(3)
    start = Start(0.0, np.eye(3), np.array([0.0, SPEED, 0.0]), 0.0, 0.0, 0.0, zero, zero, np.diag(sigma**2))
    used = of_the_path([source], record) if of_path else [source]
    model = with_states(InsModel.from_spec(spec, standing=standing()), used)
    track = navigate_track(record, start, model, used)
    upward = track.layout.slice_of(ACCEL_AXES).stop - 1
    return track.sensors[-1, upward], track.sigma[-1, upward]


@pytest.mark.slow
@few_and_all(40, few=20)
def test_a_body_on_springs_shows_no_scale_of_its_upward_accelerometer(runs):
    """Heave and pitch of a car: without the body's path the scale is four of its sigmas too large, a heave taken for a scale."""
    path, road = [], []
    for run in range(runs):
        rng = np.random.default_rng([7, run])
        scale, bias = SPEC.accel_scale_factor * rng.standard_normal(), rng.standard_normal(2)
        record, wheel, _ = straight_on(
            partial(tones, rms=0.05, low=0.8, high=4.0, rng=rng),
            partial(tones, rms=0.004, low=0.7, high=1.8, rng=rng),
            seconds=150.0,
            biases=bias * [SPEC.gyro_bias, SPEC.accel_bias],
        )
        accel = record.accel * [1.0, 1.0, 1.0 + scale]
        accel += SPEC.accel_random_walk * np.sqrt(T) * rng.standard_normal(accel.shape)
        gyro = record.gyro + SPEC.gyro_random_walk * np.sqrt(T) * rng.standard_normal(accel.shape)
        shown = ImuRecord(record.time, gyro, accel, "increments")
        (source,) = Odometer(wheel, Mounting()).sources("free")
        for ratios, of_path in ((path, True), (road, False)):
            found, sigma = scale_found(source, shown, SPEC, of_path=of_path)
            ratios.append((found - scale) / sigma)
    low, high = np.sqrt(chi2.ppf([5e-4, 1.0 - 5e-4], runs) / runs)
    assert np.abs(path).max() < 4.0
    assert low < np.sqrt(np.mean(np.square(path))) < high
    assert abs(np.mean(path)) < 3.3 / np.sqrt(runs)
    assert np.mean(road) > 2.0
