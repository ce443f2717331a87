"""Logs of seconds, of an IMU that rests, is turned for a while, or turns all the time: no specification, honest sigmas."""

import math

import numpy as np
import pytest

from tests.runs import few_and_all, some
from truenorth import ImuRecord, align, imu_spec
from truenorth.core.attitude import dcm_from_euler, misalignment
from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.core.position import Position
from truenorth.quality.regimes import KINDS, motion_summary
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(50.0, 10.0)
DT = 0.01
RATES = {  # deg/s about the vertical of a time and a duration, s
    "rests": lambda t, T: 0.0 * t,
    "is turned": lambda t, T: np.where((t > 0.4 * T) & (t < 0.7 * T), 60.0, 0.0),
    "is turned for 3 s": lambda t, T: np.where((t > 0.5 * T) & (t < 0.5 * T + 3.0), 50.0, 0.0),
    "turns": lambda t, T: np.full(len(t), 40.0),
}


def log(kind, duration, imu, seed):
    """A level IMU with biases and noise of a preset, and its attitude at the end."""
    rng, spec = np.random.default_rng(seed), imu_spec(imu)
    n = round(duration / DT)
    t = DT * np.arange(1, n + 1)
    rate = np.radians(RATES[kind](t, duration))
    turned = np.cumsum(rate) * DT
    north, up = EARTH_RATE * math.cos(PLACE.lat), EARTH_RATE * math.sin(PLACE.lat)
    gyro = np.column_stack([np.sin(turned) * north, np.cos(turned) * north, rate + up])
    accel = np.tile([0.0, 0.0, float(normal_gravity(PLACE.lat, 0.0))], (n, 1))
    noise = [rng.standard_normal((n, 3)) / math.sqrt(DT) for _ in range(2)]
    bias = rng.standard_normal((2, 3))
    gyro = gyro + spec.gyro_bias * bias[0] + spec.gyro_random_walk * noise[0]
    accel = accel + spec.accel_bias * bias[1] + spec.accel_random_walk * noise[1]
    return ImuRecord(t, gyro, accel), dcm_from_euler(-turned[-1], 0.0, 0.0)


def off(kind, duration, imu, said, seed):
    """The status, and errors of level, and of heading where it is said, in sigmas."""
    record, C_nb = log(kind, duration, imu, seed)
    answer = align(record, PLACE, said)
    if answer.status == "aligned":
        return answer.status, misalignment(answer.C_nb, C_nb) / np.sqrt(np.diag(answer.phi_covariance))
    return answer.status, level_off(answer, C_nb)


def level_off(answer, C_nb):
    """(2,) errors of level in sigmas, whatever the heading."""
    up = answer.C_nb @ C_nb[2]
    return np.array([up[1], -up[0]]) / np.sqrt(np.diag(answer.phi_covariance)[:2])


@few_and_all(24, 2)
@pytest.mark.parametrize("imu", ["consumer", "industrial", "tactical"])
@pytest.mark.parametrize("duration", [2.0, 5.0, 12.0])
def test_seconds_of_rest_without_a_specification(runs, imu, duration):
    """Biases were taken as those of a navigation grade: of industrial IMUs level was up to 85 sigmas off, `level_only`."""
    found = [off("rests", duration, imu, None, seed) for seed in range(runs)]
    errors = np.array([phi[:2] for _, phi in found])
    assert np.abs(errors).max() < 4.0
    assert np.sqrt(np.mean(errors**2)) < 1.0 + 2.0 / math.sqrt(runs)
    assert all(status in ("level_only", "not_converged") for status, _ in found)


@few_and_all(40, 2)
@pytest.mark.parametrize("duration", [20.0, 40.0])
def test_half_a_minute_of_rest_without_a_specification(runs, duration):
    """Tilts hardly show gyros' noise so soon: taken for a navigation grade, a tactical heading was 5.6 sigmas off, `aligned`."""
    for seed in range(runs):
        _, phi = off("rests", duration, "tactical", None, seed)
        assert np.abs(phi).max() < 4.0


@few_and_all(16, 2)
@pytest.mark.parametrize("rate", [10, 20])
def test_a_base_that_trembles_without_a_specification(runs, rate):
    """An Allan variance takes the tremble for quantisation; the biases of a navigation grade were usual of the noise it left."""
    spec, step = imu_spec("industrial"), 1.0 / rate
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        t = step * np.arange(1, 60 * rate + 1)
        turn = 2.0 * math.pi * rng.uniform(1.0, rate / 3.0, 6)
        phase, shake = rng.uniform(0.0, 2.0 * math.pi, 6), rng.uniform(0.02, 0.05)
        tremble = np.column_stack([np.cos(w * t + p) for w, p in zip(turn, phase, strict=True)])
        noise = rng.standard_normal((len(t), 6)) / math.sqrt(step)
        gyro = 2e-4 * turn[:3] * tremble[:, :3] + spec.gyro_bias * rng.standard_normal(3)
        bias = spec.accel_bias * rng.standard_normal(3)
        accel = shake * tremble[:, 3:] + bias + [0.0, 0.0, float(normal_gravity(PLACE.lat, 0.0))]
        record = ImuRecord(
            t, gyro + spec.gyro_random_walk * noise[:, :3], accel + spec.accel_random_walk * noise[:, 3:]
        )
        answer = align(record, PLACE)
        assert answer.status == "level_only"
        assert np.abs(level_off(answer, np.eye(3))).max() < 4.0


@few_and_all(8, 1)
@pytest.mark.parametrize("size", [0.05, 0.3, 3.0])
@pytest.mark.parametrize("duration", some([4.0, 19.0], [10.0]))
@pytest.mark.parametrize("imu", some(["navigation", "consumer"], ["tactical"]))
def test_seconds_of_sway(runs, imu, duration, size):
    """The mean attitude was given as that of the last second: level was 5 to 13 sigmas off, `level_only`."""
    for seed in range(runs):
        tones = [("roll", 1.0, 4.0 + seed), ("pitch", 0.7, 3.1 + 0.5 * seed), ("heading", 0.5, 6.0 + seed)]
        motion = {name: [{"amplitude": f"{part * size} deg", "period": f"{T} s"}] for name, part, T in tones}
        content = {
            "name": "short",
            "duration": f"{duration} s",
            "rate": "100 Hz",
            "position": {"lat": "50 deg", "lon": "10 deg"},
            "imu": imu,
            "motion": {"kind": "sway", "heading": f"{40 * seed} deg", "tones": motion},
        }
        made = read_scenario(content).simulate(seed=seed, run=0)
        for said in (None, imu):
            answer = align(made.record, PLACE, said)
            assert answer.status in ("level_only", "not_converged", "aligned"), answer.reasons
            assert np.abs(level_off(answer, made.truth.C_nb[-1])).max() < 4.0


@few_and_all(12, 1)
@pytest.mark.parametrize("kind", ["is turned", "turns"])
@pytest.mark.parametrize("duration", some([5.0, 18.0], [8.0, 12.0]))
def test_a_short_log_in_which_the_imu_turns(runs, kind, duration):
    """It ended in a recursion without end, or with a level that was 5 sigmas off."""
    for seed in range(runs):
        for said in (None, "consumer"):
            status, phi = off(kind, duration, "consumer", said, seed)
            assert status in ("level_only", "not_converged")
            assert np.abs(phi[:2]).max() < 4.0


@pytest.mark.parametrize("imu", ["tactical", "navigation"])
def test_a_turn_of_seconds_in_a_log_at_rest(imu):
    """Mean rates are those of the turn: sound logs were refused, as with gyros that miss the earth's rate."""
    status, phi = off("is turned for 3 s", 100.0, imu, imu, 3)
    assert status == "aligned"
    assert np.abs(phi).max() < 4.0


@pytest.mark.parametrize("seconds", [1, 2, 3, 5])
def test_a_turn_of_seconds_is_rotation(seconds):
    n = 6000
    gyro = np.random.default_rng(1).normal(0.0, 1e-4, (n, 3))
    gyro[3000 : 3000 + 100 * seconds, 2] += math.radians(40.0)
    record = ImuRecord(DT * np.arange(1, n + 1), gyro, np.tile([0.0, 0.0, 9.8], (n, 1)))
    kind = motion_summary(record).kind
    assert set(kind[30 : 30 + seconds]) == {KINDS.index("rotating")}
    assert KINDS.index("rotating") not in {*kind[:28], *kind[33 + seconds :]}


@pytest.mark.parametrize("period", [4.0, 8.0, 15.0])
def test_a_sway_that_begins_and_ends_is_no_rotation(period):
    """Of groups of waves, and of one wave alone."""
    t = DT * np.arange(1, 12001)
    rate = np.radians(5.0) * 2.0 * math.pi / period * np.cos(2.0 * math.pi * t / period)
    rate *= (t > 40.0) & (t < 40.0 + 2.0 * period)
    gyro = np.column_stack([rate, 0.5 * rate, 0.0 * rate]) + np.random.default_rng(1).normal(0.0, 1e-4, (len(t), 3))
    record = ImuRecord(t, gyro, np.tile([0.0, 0.0, 9.8], (len(t), 1)))
    assert KINDS.index("rotating") not in set(motion_summary(record).kind)
