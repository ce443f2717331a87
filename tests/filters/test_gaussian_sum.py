"""The Gaussian sum against the dense joint Gaussian, and against Bayes' rule on a circle for an azimuth nobody knows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import Dense, random_system
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import (
    Hypotheses,
    NonlinearSystem,
    around_circle,
    extended,
    gaussian_sum,
    kalman,
    matrix_function,
    split,
    square_root,
    vector_function,
)


def some_hypotheses(n, L, seed=0):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((L, n, n))
    weight = rng.random(L)
    return Hypotheses(weight / weight.sum(), 2.0 * rng.standard_normal((L, n)), root @ np.swapaxes(root, 1, 2))


@pytest.mark.slow
@pytest.mark.parametrize("filter", [kalman, square_root])
def test_on_a_linear_system_it_is_the_dense_sum(filter):
    system, start = random_system(epochs=5, S=False), some_hypotheses(4, 5)
    joint = [Dense.of(replace(system, x0=x, P0=P)) for x, P in zip(start.x, start.P, strict=True)]
    likelihood = start.weight * np.exp([d.log_likelihood() for d in joint])
    posterior = [d.state(4, 5) for d in joint]
    found = gaussian_sum(filter, system, start)
    assert_allclose(found.hypotheses.weight, likelihood / likelihood.sum(), rtol=1e-9)
    assert_allclose(found.log_likelihood, np.log(likelihood.sum()), rtol=1e-9)
    assert_allclose(found.hypotheses.x, [x for x, _ in posterior], rtol=1e-9, atol=1e-9)
    # Mean and covariance of the sum, by their definition.
    w = likelihood / likelihood.sum()
    mean = sum(a * x for a, (x, _) in zip(w, posterior, strict=True))
    second = sum(a * (P + np.outer(x, x)) for a, (x, P) in zip(w, posterior, strict=True))
    assert_allclose(found.hypotheses.mean, mean, rtol=1e-9, atol=1e-9)
    assert_allclose(found.hypotheses.covariance, second - np.outer(mean, mean), rtol=1e-9, atol=1e-9)


def test_runs_are_apart_and_chunks_go_on():
    system, start = random_system(epochs=6, runs=(3,), S=False), some_hypotheses(4, 5)
    together = gaussian_sum(kalman, system, start)
    assert together.hypotheses.weight.shape == (3, 5)
    earlier = gaussian_sum(kalman, system.between(0, 4), start)
    later = gaussian_sum(kalman, system.between(4, 6), earlier)
    assert_array_equal(later.hypotheses.x, together.hypotheses.x)
    assert_allclose(later.hypotheses.weight, together.hypotheses.weight, rtol=1e-12)
    assert_allclose(later.log_likelihood, together.log_likelihood, rtol=1e-12)
    arrays = {name: getattr(system, name) for name in system.axes}
    alone = replace(system, **{name: a if a is None else a[1] for name, a in arrays.items()})
    assert_array_equal(gaussian_sum(kalman, alone, start).hypotheses.x, together.hypotheses.x[1])


@pytest.mark.parametrize("count", [6, 12, 40])
def test_a_split_distribution_is_the_whole_one(count):
    rng = np.random.default_rng(1)
    root = rng.standard_normal((3, 3))
    x, P = rng.standard_normal(3), root @ root.T
    parts = split(x, P, 1, count)
    assert_allclose(parts.mean, x, atol=1e-12)
    assert_allclose(parts.covariance, P, rtol=0.01, atol=0.01 * np.abs(P).max())
    assert np.all(np.linalg.eigvalsh(parts.P) > 0.0)
    sigma = np.sqrt(P[1, 1])
    at = x[1] + sigma * np.linspace(-3.0, 3.0, 61)

    def density(mean, variance):
        return np.exp(-0.5 * (at - mean) ** 2 / variance) / np.sqrt(2.0 * np.pi * variance)

    total = sum(w * density(m[1], C[1, 1]) for w, m, C in zip(parts.weight, parts.x, parts.P, strict=True))
    assert_allclose(total, density(x[1], P[1, 1]), atol=0.01 * density(x[1], P[1, 1]).max())


def test_all_around_the_circle_is_flat():
    parts = around_circle(np.zeros(2), np.diag([1.0, 4.0]), 0, 24)
    at = np.linspace(0.0, 2.0 * np.pi, 500)
    away = (at[:, None] - parts.x[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
    density = np.sum(parts.weight * np.exp(-0.5 * away**2 / parts.P[:, 0, 0]) / np.sqrt(parts.P[:, 0, 0]), axis=1)
    assert_allclose(density, density.mean(), rtol=2e-3)
    assert_array_equal(parts.P[:, 1, 1], 4.0)


# A vehicle that drives at a known speed, seen by a velocity log with a constant error: azimuth, error east, error north.
SPEED, NOISE, LOG_ERROR = 5.0, 0.5, 1.0


@vector_function
def stays(x, p, out):
    for i in range(3):
        out[i] = x[i]


@matrix_function
def stays_jacobian(x, p, out):
    for i in range(3):
        out[i, i] = 1.0


@vector_function
def velocity(x, p, out):
    out[0] = p[0] * np.sin(x[0]) + x[1]
    out[1] = p[0] * np.cos(x[0]) + x[2]


@matrix_function
def velocity_jacobian(x, p, out):
    out[0, 0], out[0, 1] = p[0] * np.cos(x[0]), 1.0
    out[1, 0], out[1, 2] = -p[0] * np.sin(x[0]), 1.0


def driving(azimuth, epochs, seed):
    rng = np.random.default_rng(seed)
    v = SPEED * (1.0 + np.arange(epochs) % 2)
    z = v[:, None] * [np.sin(azimuth), np.cos(azimuth)] + LOG_ERROR * rng.standard_normal(2)
    z += NOISE * rng.standard_normal(z.shape)
    return NonlinearSystem(
        stays,
        velocity,
        np.zeros((1, 3, 3)),
        NOISE**2 * np.eye(2)[None],
        z,
        np.zeros(3),
        np.diag([np.pi**2 / 3.0, LOG_ERROR**2, LOG_ERROR**2]),
        v[:, None],
        stays_jacobian,
        velocity_jacobian,
    )


def on_the_circle(system):
    """Mean and sigma of the azimuth about the likeliest, the log's error integrated out: exact but for the grid."""
    azimuth = np.linspace(-np.pi, np.pi, 20001)[:-1]
    K = len(system.z)
    C = NOISE**2 * np.eye(K) + LOG_ERROR**2
    weight = np.linalg.inv(C)
    log = np.zeros(len(azimuth))
    for axis, direction in ((0, np.sin(azimuth)), (1, np.cos(azimuth))):
        e = system.z[:, axis, None] - system.p * direction
        log -= 0.5 * np.einsum("ka,kl,la->a", e, weight, e)
    density = np.exp(log - log.max())
    density /= density.sum()
    away = (azimuth - azimuth[np.argmax(density)] + np.pi) % (2.0 * np.pi) - np.pi
    mean = np.sum(density * away)
    return azimuth[np.argmax(density)] + mean, np.sqrt(np.sum(density * (away - mean) ** 2))


@pytest.mark.parametrize("azimuth", np.radians([-170.0, -60.0, 5.0, 100.0]))
def test_an_unknown_azimuth_is_found(azimuth):
    system = driving(azimuth, 20, seed=3)
    exact, sigma = on_the_circle(system)
    found = gaussian_sum(extended, system, around_circle(system.x0, system.P0, 0, 36))
    # Hypotheses that lie far off end at the right azimuth too, or a whole turn from it: the angles are laid together.
    x = found.hypotheses.x.copy()
    x[:, 0] = exact + (x[:, 0] - exact + np.pi) % (2.0 * np.pi) - np.pi
    laid = replace(found.hypotheses, x=x)
    # At 10 deg of one hypothesis the tangent bends the velocity by 1.5 %: a tenth of a sigma after 20 epochs.
    assert abs(laid.mean[0] - exact) < 0.1 * sigma
    assert_allclose(np.sqrt(laid.covariance[0, 0]), sigma, rtol=0.05)


def test_one_normal_distribution_does_not_find_it():
    # What the sum is for: the same filter from the middle of the circle is sure of a wrong azimuth.
    azimuth = np.radians(-170.0)
    system = driving(azimuth, 20, seed=3)
    alone = extended(system)
    error = (alone.x[-1, 0] - azimuth + np.pi) % (2.0 * np.pi) - np.pi
    assert abs(error) > 10.0 * alone.sigma[-1, 0]


def test_what_cannot_be_separated_stays_apart():
    # z = x^2 / 20: two sides equally likely, whatever is measured.
    @vector_function
    def stay(x, p, out):
        out[0] = x[0]

    @matrix_function
    def stay_jacobian(x, p, out):
        out[0, 0] = 1.0

    @vector_function
    def square(x, p, out):
        out[0] = x[0] ** 2 / 20.0

    @matrix_function
    def square_jacobian(x, p, out):
        out[0, 0] = x[0] / 10.0

    one = np.ones((1, 1, 1))
    z = np.full((10, 1), 5.0)
    system = NonlinearSystem(
        stay, square, 0.0 * one, 0.01 * one, z, np.zeros(1), 100.0 * one[0], None, stay_jacobian, square_jacobian
    )
    found = gaussian_sum(extended, system, split(np.zeros(1), 100.0 * np.ones((1, 1)), 0, 40)).hypotheses
    assert_allclose(found.weight, found.weight[::-1], rtol=1e-9)
    assert_allclose(found.mean, 0.0, atol=1e-9)
    assert_allclose(found.covariance, 100.0, rtol=0.01)  # at -10 and at 10
    assert_allclose(np.abs(found.likeliest[0]), 10.0, rtol=0.01)


def test_bad_input_is_said():
    system, start = random_system(epochs=2, S=False), some_hypotheses(4, 5)
    with pytest.raises(UsageError, match=r"weight has shape \(5,\), x \(4, 4\)"):
        gaussian_sum(kalman, system, replace(start, x=start.x[:4]))
    with pytest.raises(DataError, match="does not sum to 1"):
        gaussian_sum(kalman, system, replace(start, weight=2.0 * start.weight))
    with pytest.raises(UsageError, match="count is 5, expected at least 6"):
        split(np.zeros(2), np.eye(2), 0, 5)
    with pytest.raises(UsageError, match="state is 2"):
        around_circle(np.zeros(2), np.eye(2), 2, 8)
    with pytest.raises(UsageError, match="known exactly"):
        split(np.zeros(2), np.diag([1.0, 0.0]), 1, 8)
