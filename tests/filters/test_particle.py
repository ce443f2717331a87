"""The particle filter against exact answers: the Kalman filter, and Bayes' rule on a fine grid.

Each comparison is of the mean over many independent runs of the filter on the same measurements with the exact value, in
units of that mean's own standard deviation: Student's t. Its bounds are two-sided with a false-alarm rate of 1e-3.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.stats import t as student

from tests.filters.dense import random_system
from tests.filters.nonlinear_models import TURNING, conditionally_linear, growth, in_disguise, squared, tracking
from tests.runs import few_and_all, said_by_a_second_process
from truenorth.analysis.consistency import chi_square_band, nees
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import NonlinearSystem, gauss_hermite, kalman, particle


def generators(runs, seed=0):
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(runs)]


def again(system, runs):
    """The same measurements for every run."""
    return replace(system, z=np.broadcast_to(system.z, (runs, *system.z.shape)))


def t_value(values, exact):
    """Of the mean over runs, (runs, ...)."""
    return (values.mean(axis=0) - exact) / (values.std(axis=0, ddof=1) / np.sqrt(len(values)))


def bound(runs, rate=1e-3):
    return student.ppf(1.0 - rate / 2.0, runs - 1)


LINEAR = random_system(S=False, n=3, m=2, epochs=8, seed=5)


@pytest.mark.slow
@few_and_all(100)
@pytest.mark.parametrize("nonlinear", [None, [1], [2, 0]])
def test_on_a_linear_system_it_is_the_kalman_filter_on_average(nonlinear, runs):
    # Mean and variance of 3 states at 3 epochs, and the likelihood, which is unbiased whatever the number of particles:
    # 19 values, .019 of false alarms. 100 runs of 4000 particles: the bias of order 1 / 4000 is below a tenth of the
    # scatter of a mean over 100 runs.
    at = [0, 4, 7]
    exact = kalman(LINEAR, history="full")
    ours = particle(
        again(in_disguise(LINEAR), runs),
        generators=generators(runs),
        particles=4000,
        nonlinear=nonlinear,
        history="full",
        workers=2,
    )
    assert np.abs(t_value(ours.x, exact.x)[at]).max() < bound(runs)
    assert np.abs(t_value(np.diagonal(ours.P, axis1=-2, axis2=-1), exact.sigma**2)[at]).max() < bound(runs)
    assert abs(t_value(np.exp(ours.log_likelihood - exact.log_likelihood), 1.0)) < bound(runs)
    have = np.isfinite(exact.innovation)
    assert np.all(np.isnan(ours.innovation[0]) == ~have)
    # Half of a row's innovation sigma is far more than 4000 particles miss it by.
    sigma = np.sqrt(np.diagonal(exact.innovation_covariance, axis1=-2, axis2=-1))
    assert np.abs(((ours.innovation - exact.innovation) / sigma)[:, have]).max() < 0.5


@pytest.mark.slow
def test_linear_states_need_fewer_particles():
    # The scatter of the mean over runs, with as many particles: the fewer states are drawn, the smaller.
    runs = 100
    system = again(in_disguise(LINEAR), runs)
    scatter = [
        particle(system, generators=generators(runs), particles=500, nonlinear=states).x[:, -1].std(axis=0).sum()
        for states in (None, [2, 0], [2])
    ]
    assert scatter[0] > 1.2 * scatter[1] > 1.44 * scatter[2]


def on_a_grid(z, p, Q, R, x0, P0):
    """Mean, variance of each epoch and log-likelihood by Bayes' rule on a grid."""
    x = np.linspace(-45.0, 45.0, 3001)
    step = x[1] - x[0]
    density = np.exp(-0.5 * (x - x0) ** 2 / P0)
    density /= density.sum() * step
    found, log_likelihood = [], 0.0
    for k in range(len(z)):
        ahead = 0.5 * x + 25.0 * x / (1.0 + x**2) + p[k]
        kernel = np.exp(-0.5 * (x[:, None] - ahead) ** 2 / Q) / np.sqrt(2.0 * np.pi * Q)
        density = kernel @ density * step
        if np.isfinite(z[k]):
            density *= np.exp(-0.5 * (z[k] - x**2 / 20.0) ** 2 / R) / np.sqrt(2.0 * np.pi * R)
        total = density.sum() * step
        log_likelihood += np.log(total)
        density /= total
        mean = (x * density).sum() * step
        found.append((mean, ((x - mean) ** 2 * density).sum() * step))
    return np.array(found), log_likelihood


def growing(epochs, seed):
    rng = np.random.default_rng(seed)
    p = 8.0 * np.cos(1.2 * np.arange(epochs))
    x, z = 0.1, np.empty(epochs)
    for k in range(epochs):
        x = 0.5 * x + 25.0 * x / (1.0 + x**2) + p[k] + np.sqrt(10.0) * rng.standard_normal()
        z[k] = x**2 / 20.0 + rng.standard_normal()
    z[5] = np.nan
    one = np.ones((1, 1, 1))
    return NonlinearSystem(growth, squared, 10.0 * one, one, z[:, None], np.zeros(1), 5.0 * one[0], p[:, None])


@pytest.mark.slow
@few_and_all(100)
def test_on_a_nonlinear_system_it_is_bayes_rule_on_average(runs):
    # Mean and variance at 4 epochs and the likelihood: 9 values, .009 of false alarms.
    at = [0, 5, 12, 19]
    system = growing(20, seed=1)
    exact, log_likelihood = on_a_grid(system.z[:, 0], system.p[:, 0], 10.0, 1.0, 0.0, 5.0)
    ours = particle(again(system, runs), generators=generators(runs), particles=4000, history="full", workers=2)
    values = np.stack([ours.x[..., 0], ours.P[..., 0, 0]], axis=-1)
    assert np.abs(t_value(values, exact)[at]).max() < bound(runs)
    assert abs(t_value(np.exp(ours.log_likelihood - log_likelihood), 1.0)) < bound(runs)
    # And it matters: the Gaussian filter is far from the posterior's mean in units of its sigma.
    gaussian = gauss_hermite(system, order=7, history="full").x[:, 0]
    assert np.max(np.abs(gaussian - exact[:, 0]) / np.sqrt(exact[:, 1])) > 1.0


@pytest.mark.slow
@few_and_all(60)
def test_the_conditionally_linear_model_with_and_without_its_structure(runs):
    # Two samplings of one posterior: two-sample t over the runs of each; 4 states at 2 epochs, .008 of false alarms.
    system = again(conditionally_linear(10, np.random.default_rng(4)), runs)
    few = particle(system, generators=generators(runs, 1), particles=2000, nonlinear=[TURNING], history="full").x
    all_ = particle(system, generators=generators(runs, 2), particles=20_000, history="full", workers=2).x
    for epoch in (3, 9):
        a, b = few[:, epoch], all_[:, epoch]
        t = (a.mean(axis=0) - b.mean(axis=0)) / np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / runs)
        assert np.abs(t).max() < bound(2 * runs - 1)


@pytest.mark.slow
@few_and_all(150)
def test_consistent_on_mildly_nonlinear_tracking(runs):
    # NEES of 4 states over the runs at two epochs: 1 % two-sided each. Velocities are linear given positions. Coarse
    # sensor and manoeuvres: 2000 particles are too few for a prior of 30 m, a fix of 5 m and hardly any noise.
    system, truth = tracking(runs, 15, np.random.default_rng(5), missing=0.1, q=5.0, coarse=4.0)
    ours = particle(system, generators=generators(runs), particles=2000, nonlinear=[0, 1], history="full", workers=2)
    low, high = chi_square_band(4, runs, 0.99)
    for epoch in (7, 14):
        mean = nees(ours.x[:, epoch] - truth[:, epoch], ours.P[:, epoch]).mean()
        assert low < mean < high, (epoch, mean)


@pytest.mark.parametrize("nonlinear", [None, [TURNING]])
def test_chunks_give_the_bits_of_the_batch(nonlinear):
    system = conditionally_linear(12, np.random.default_rng(0))
    options = {"particles": 50, "nonlinear": nonlinear, "history": "full"}
    batch = particle(system, generators=np.random.default_rng(3), **options)
    assert (batch.adaptation < 25.0).sum() > 2  # resampled, more than once
    rng, state, at = np.random.default_rng(3), None, 0
    for stop in (1, 5, 12):
        chunk = particle(system.between(at, stop), state, generators=rng, **options)
        for field in ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "adaptation"):
            assert_array_equal(getattr(chunk, field), getattr(batch, field)[at:stop])
        state, at = chunk.state, stop
    assert_array_equal(state.log_likelihood, batch.log_likelihood)


def test_a_run_does_not_depend_on_how_many_there_are():
    system = conditionally_linear(6, np.random.default_rng(0), runs=(5,))
    five = particle(system, generators=generators(5), particles=30, workers=2)
    three = particle(replace(system, z=system.z[:3]), generators=generators(3), particles=30)
    assert_array_equal(five.x[:3], three.x)
    assert_array_equal(five.log_likelihood[:3], three.log_likelihood)


def test_resampling_is_systematic():
    # Without resampling weights are those of the prior's draws; with threshold 1 each epoch starts evenly.
    system = conditionally_linear(8, np.random.default_rng(0), missing=0.0)
    never, always = (
        particle(system, generators=np.random.default_rng(1), particles=200, threshold=t, history="full")
        for t in (0.0, 1.0)
    )
    assert_array_equal(never.adaptation[0], always.adaptation[0])
    assert never.adaptation[-1, 0] < 0.5 * always.adaptation[-1, 0]


def test_a_second_process_compiles_nothing():
    program = """
import sys
import numpy as np
from tests.filters.nonlinear_models import TURNING, conditionally_linear
from truenorth.filters import particle

system = conditionally_linear(3, np.random.default_rng(0))
for states in (None, [TURNING]):
    for history in ("last", "full"):
        particle(system, generators=np.random.default_rng(0), particles=10, nonlinear=states, history=history)
stats = sys.modules["truenorth.filters.particle"].particle_run.stats
print(sum(stats.cache_misses.values()), sum(stats.cache_hits.values()))
"""
    expected = ["0", "1"]
    assert said_by_a_second_process(program, expected.__eq__) == expected


def test_options_are_checked():
    system = conditionally_linear(3, np.random.default_rng(0), runs=(2,))
    rng = np.random.default_rng(0)
    for options, message in (
        ({"generators": rng}, "generators are 1, expected one numpy.random.Generator for each of 2 runs"),
        ({"generators": [rng, rng]}, "two runs share one"),
        ({"generators": [0, 1]}, "generators are 2, expected one numpy.random.Generator"),
        ({"generators": generators(2), "particles": 1}, "particles is 1"),
        ({"generators": generators(2), "threshold": 2.0}, "threshold is 2"),
        ({"generators": generators(2), "nonlinear": [7]}, r"nonlinear is \[7\]"),
    ):
        with pytest.raises(UsageError, match=message):
            particle(system, **options)
    with pytest.raises(UsageError, match="transition_jacobian is not given, but a particle filter with linear states"):
        particle(replace(system, transition_jacobian=None), generators=generators(2), nonlinear=[TURNING])
    state = particle(system, generators=generators(2), particles=10).state
    with pytest.raises(UsageError, match="the state remembers 50 figures, expected 100"):
        particle(system, state, generators=generators(2), particles=20)


def test_a_filter_that_breaks_down_says_where():
    system = conditionally_linear(3, np.random.default_rng(0), missing=0.0)
    with pytest.raises(DataError, match="epoch 0: the variance of an innovation"):
        particle(replace(system, R=0.0 * system.R), generators=np.random.default_rng(0), particles=10)
