"""A whole bias taken apart: against the dense joint Gaussian of a constant and a sampled Gauss-Markov process."""

import numpy as np
import pytest

from truenorth.errors.axes import standing
from truenorth.errors.model import InsModel
from truenorth.errors.whole_bias import about_average, taken_apart, time_average
from truenorth.records.specs import imu_spec
from truenorth.state.layout import ACCEL_AXES, BA, BG, GYRO_AXES, PHI, SLOW_ACCEL, SLOW_GYRO, STATES
from truenorth.state.prior import WholeBiases

SPEC = imu_spec("navigation")
MODEL = InsModel.from_spec(SPEC)


@pytest.mark.parametrize("x", [1e-4, 0.02, 1.0, 20.0])
def test_time_average_is_that_of_the_sampled_process(x):
    t = (np.arange(2000) + 0.5) * x / 2000
    sampled = np.exp(-np.abs(t[:, None] - t))
    assert time_average(x)[0] == pytest.approx(sampled.mean(), rel=1e-5)
    assert time_average(x)[1] == pytest.approx(np.exp(t - x).mean(), rel=1e-5)


@pytest.mark.parametrize(("before", "after"), [(1e-4, 1e-4), (0.4, 0.0), (0.0, 0.4), (1.5, 0.5), (30.0, 10.0)])
def test_a_value_about_the_mean_is_that_of_the_sampled_process(before, after):
    t = (np.arange(2000) + 0.5) * (before + after) / 2000
    mean = np.exp(-np.abs(t[:, None] - t)).mean()
    sampled = 1.0 + mean - 2.0 * np.exp(-np.abs(t - before)).mean()
    assert about_average(before, after) == pytest.approx(sampled, rel=1e-3)


def test_parts_are_those_of_the_joint_gaussian():
    """A gyro's mean bias over 300 s measured with an error, and a heading that hangs on it, by hand."""
    averaged, c, s = 300.0, SPEC.gyro_bias**2, SPEC.gyro_bias_instability**2
    t = (np.arange(1500) + 0.5) * averaged / 1500
    joint = np.zeros((1502, 1502))  # constant, path, value at the end
    joint[0, 0] = c
    times = np.append(t, averaged)
    joint[1:, 1:] = s * np.exp(-np.abs(times[:, None] - times) / SPEC.correlation_time)
    see = np.zeros(1502)
    see[0], see[1:1501] = 1.0, 1.0 / 1500
    gain = joint @ see / (see @ joint @ see + 0.3 * c)
    after = joint - np.outer(gain, see @ joint)
    P15 = np.zeros((STATES, STATES))
    P15[BG, BG] = np.eye(3) * (see @ after @ see)
    P15[PHI, BG] = P15[BG, PHI] = -2.0 * P15[BG, BG]
    P15[PHI, PHI] = 5.0 * P15[BG, BG]
    measured = 3.0 * SPEC.gyro_bias
    whole = WholeBiases(np.repeat([c, SPEC.accel_bias**2], 3), averaged)
    bias = np.append(np.full(3, see @ gain * measured), np.zeros(3))
    P, values = taken_apart(MODEL, P15, bias, whole)
    slow = MODEL.layout.slice_of(SLOW_GYRO)
    ends = [0, 1501]
    for i in range(3):
        at = [BG.start + i, slow.start + i]
        np.testing.assert_allclose(P[np.ix_(at, at)], after[np.ix_(ends, ends)], rtol=1e-4)
        np.testing.assert_allclose(P[i, at], -2.0 * (after @ see)[ends], rtol=1e-4)
        np.testing.assert_allclose(values[at], (gain * measured)[ends], rtol=1e-4)
    assert np.linalg.eigvalsh(P / np.sqrt(np.outer(np.diag(P) + 1e-30, np.diag(P) + 1e-30)))[0] > -1e-9


def test_what_holds_at_the_start_adds_up_again():
    P15 = np.diag(np.linspace(1.0, 2.0, STATES))
    P15[BG, BG] *= SPEC.gyro_bias**2
    P15[BA, BA] *= 1e-2 * SPEC.accel_bias**2
    bias = np.arange(1.0, 7.0)
    constant = np.repeat([SPEC.gyro_bias**2, SPEC.accel_bias**2], 3)
    P, values = taken_apart(MODEL, P15, bias, WholeBiases(constant))
    add = np.eye(STATES, MODEL.states)
    add[BG, MODEL.layout.slice_of(SLOW_GYRO)] = add[BA, MODEL.layout.slice_of(SLOW_ACCEL)] = np.eye(3)
    np.testing.assert_allclose(add @ P @ add.T, P15, rtol=1e-9, atol=1e-25)
    np.testing.assert_allclose((add @ values)[BG.start :], bias)


def test_groups_that_are_known_go_on_with_what_ties_them():
    """Scale factors and misalignments behind the fifteen: with their values and covariances; left out where a model lacks them."""
    spec = imu_spec("consumer")
    model = InsModel.from_spec(spec, standing=standing())
    own = {name: model.layout.slice_of(name) for name in (GYRO_AXES, ACCEL_AXES)}
    known = {name: np.full(9, 0.001 * (k + 1)) for k, name in enumerate(own)}
    at = np.concatenate([np.arange(STATES), *(np.arange(s.start, s.stop) for s in own.values())])
    sigma = np.concatenate([np.full(BG.start, 0.01), np.sqrt(spec.bias_variance), np.full(18, 0.005)])
    mixed = np.random.default_rng(3).standard_normal((33, 40))
    joint = np.corrcoef(mixed) * np.outer(sigma, sigma)
    bias, whole = 0.5 * np.sqrt(spec.bias_variance), WholeBiases(spec.constant_variance)
    P, values = taken_apart(model, joint, bias, whole, known)
    add = np.eye(model.states)[at]
    add[BG, model.layout.slice_of(SLOW_GYRO)] = add[BA, model.layout.slice_of(SLOW_ACCEL)] = np.eye(3)
    got = add @ P @ add.T
    free = np.ones(33, bool)
    free[BG.start : BA.stop] = False  # the whole biases here are known worse than a priori in some directions
    np.testing.assert_allclose(got[np.ix_(free, free)], joint[np.ix_(free, free)], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(got[~free][:, free], joint[~free][:, free], rtol=1e-9, atol=1e-15)
    for name, there in own.items():
        np.testing.assert_array_equal(values[there], known[name])
    plain, without = taken_apart(MODEL, joint, bias, whole, known), taken_apart(MODEL, joint[:15, :15], bias, whole)
    np.testing.assert_allclose(plain[0], without[0], rtol=1e-12, atol=0)
