"""Extended, iterated and quadrature filters: what they are on linear models, and what they promise on others."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.filters.dense import one_run, random_system
from tests.filters.nonlinear_models import TURNING, conditionally_linear, in_disguise, tracking
from tests.runs import said_by_a_second_process
from truenorth.analysis.consistency import chi_square_band, nees
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import (
    Gate,
    StrongTracking,
    cubature,
    extended,
    gated,
    gauss_hermite,
    iterated,
    kalman,
    strong_tracking,
    unscented,
)

FIELDS = ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood")
TIGHT = {"rtol": 1e-11, "atol": 1e-11}


def named(kappa=0.0):
    return {
        "extended": extended,
        "iterated": iterated,
        "unscented": lambda s, state=None, **o: unscented(s, state, alpha=1.0, beta=2.0, kappa=kappa, **o),
        "cubature": cubature,
        "gauss_hermite 3": lambda s, state=None, **o: gauss_hermite(s, state, order=3, **o),
        "gauss_hermite 5": lambda s, state=None, **o: gauss_hermite(s, state, order=5, **o),
        "reduced": lambda s, state=None, **o: gauss_hermite(s, state, order=7, nonlinear=[TURNING], **o),
        "reduced to two": lambda s, state=None, **o: cubature(s, state, nonlinear=[3, 1], **o),
    }


FILTERS = named()


@pytest.mark.parametrize("name", FILTERS)
def test_on_a_linear_system_every_filter_is_the_kalman_filter(name):
    linear = random_system(S=False, epochs=20)
    ours, exact = FILTERS[name](in_disguise(linear), history="full"), kalman(linear, history="full")
    for field in FIELDS:
        assert_allclose(getattr(ours, field), getattr(exact, field), **TIGHT)


def test_close_unscented_nodes_cost_digits_and_no_more():
    # Nodes at alpha = 1e-3 of a sigma: means are differences of function values over alpha^2.
    linear = random_system(S=False, epochs=20)
    ours = unscented(in_disguise(linear), alpha=1e-3, beta=2.0, kappa=0.0, history="full")
    exact = kalman(linear, history="full")
    assert_allclose(ours.x, exact.x, rtol=1e-8, atol=1e-8)
    assert_allclose(ours.P, exact.P, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["extended", "gauss_hermite 3", "reduced"])
def test_options_on_a_linear_system_are_the_linear_filters(name):
    linear = random_system(S=False, epochs=40, seed=3)
    linear = replace(linear, z=4.0 * linear.z)
    ours = FILTERS[name](in_disguise(linear), tracking=StrongTracking(softening=1.5, rho=0.8, cap=3.0), history="full")
    exact = strong_tracking(linear, softening=1.5, rho=0.8, cap=3.0, history="full")
    assert np.sum(exact.adaptation > 1.0) > 3
    for field in (*FIELDS, "adaptation"):
        assert_allclose(getattr(ours, field), getattr(exact, field), **TIGHT)
    for by in ("row", "epoch"):
        ours = FILTERS[name](in_disguise(linear), gate=Gate(0.9, by, 3), history="full")
        exact = gated(linear, probability=0.9, by=by, patience=3, history="full")
        assert np.nansum(exact.adaptation == 0.0) > 3
        for field in (*FIELDS, "adaptation"):
            assert_allclose(getattr(ours, field), getattr(exact, field), **TIGHT)


@pytest.mark.parametrize("order", [3, 5, 7])
def test_nodes_in_the_nonlinear_state_only_are_those_in_all(order):
    system = conditionally_linear(15, np.random.default_rng(0))
    few = gauss_hermite(system, order=order, nonlinear=[TURNING], history="full")
    # The tensor rule's nodes are along the Cholesky columns: with the nonlinear state first they are the same integral.
    all_ = gauss_hermite(system, order=order, nonlinear=[TURNING, 0, 1, 3], history="full")
    for field in FIELDS:
        assert_allclose(getattr(few, field), getattr(all_, field), rtol=1e-9, atol=1e-9)
    tangent = extended(system, history="full")
    assert np.abs(few.x - tangent.x).max() > 0.05  # else nothing was nonlinear


def test_strong_tracking_with_few_nodes_is_that_with_all():
    system = conditionally_linear(15, np.random.default_rng(1))
    system = replace(system, z=3.0 * system.z)
    options = {"order": 5, "tracking": StrongTracking(cap=1.5), "history": "full"}
    few = gauss_hermite(system, nonlinear=[TURNING], **options)
    all_ = gauss_hermite(system, nonlinear=[TURNING, 0, 1, 3], **options)
    assert np.sum(few.adaptation > 1.0) > 3
    for field in (*FIELDS, "adaptation"):
        assert_allclose(getattr(few, field), getattr(all_, field), rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("by", ["epoch", "row"])
def test_a_gate_judges_before_the_factor_acts(by):
    """What it rejects is as if it had not been measured: it makes no factor, now or later."""
    system = conditionally_linear(15, np.random.default_rng(5))
    z = system.z.copy()
    z[7] += 1e3
    options = {
        "order": 3,
        "nonlinear": [TURNING],
        "tracking": StrongTracking(),
        "history": "full",
        "gate": Gate(1 - 1e-9, by),
    }
    hit = gauss_hermite(replace(system, z=z), **options)
    z[7] = np.nan
    absent = gauss_hermite(replace(system, z=z), **options)
    assert np.all(hit.adaptation[7, 1:] == 0.0)
    for field in ("x", "P", "log_likelihood"):
        assert_allclose(getattr(hit, field), getattr(absent, field), rtol=1e-12, atol=1e-12)
    assert_array_equal(hit.adaptation[:, 0], absent.adaptation[:, 0])


def test_iteration_finds_the_largest_posterior_density():
    # One epoch of precise bearings of a badly known target: the maximum of the posterior, by SciPy.
    from scipy.optimize import minimize

    system, _ = tracking(1, 1, np.random.default_rng(3))
    system = replace(system, z=system.z[0], R=system.R * 1e-2, P0=system.P0 * 4.0)
    prior = extended(replace(system, z=np.full((1, 2), np.nan)))
    L = np.linalg.cholesky(np.linalg.inv(prior.P[0]))

    def half_square(x):
        h = np.array([np.hypot(x[0], x[1]), np.arctan2(x[0], x[1])])
        return 0.5 * np.sum((L.T @ (x - prior.x[0])) ** 2) + 0.5 * np.sum((system.z[0] - h) ** 2 / np.diag(system.R[0]))

    ours = iterated(system, iterations=50, tolerance=1e-12)
    best = minimize(half_square, ours.x[0], method="BFGS", options={"gtol": 1e-10})
    assert_allclose(ours.x[0], best.x, atol=1e-3 * ours.sigma[0].min())
    assert np.max(np.abs(extended(system).x[0] - best.x) / ours.sigma[0]) > 0.1
    assert_array_equal(iterated(system, iterations=1).x, extended(system).x)


@pytest.mark.slow
@pytest.mark.parametrize("name", FILTERS)
def test_consistent_on_mildly_nonlinear_tracking(name):
    # NEES of 4 states over 400 runs, at three epochs far apart: 1 % two-sided each, so .03 of false alarms a filter.
    system, truth = tracking(400, 60, np.random.default_rng(11), missing=0.2)
    estimates = FILTERS[name](system, history="full", workers=2)
    low, high = chi_square_band(4, 400, 0.99)
    for epoch in (2, 25, 59):
        mean = nees(estimates.x[:, epoch] - truth[:, epoch], estimates.P[:, epoch]).mean()
        assert low < mean < high, (epoch, mean)


@pytest.mark.parametrize("name", FILTERS)
def test_chunks_give_the_bits_of_the_batch(name):
    system = conditionally_linear(15, np.random.default_rng(2))
    system = replace(system, z=4.0 * system.z)
    options = {"history": "full", "gate": Gate(0.9, patience=2)}
    if name != "iterated":
        options["tracking"] = StrongTracking(cap=5.0)
    batch = FILTERS[name](system, **options)
    state, at = None, 0
    for stop in (1, 2, 9, 15):
        chunk = FILTERS[name](system.between(at, stop), state, **options)
        for field in ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "adaptation"):
            assert_array_equal(getattr(chunk, field), getattr(batch, field)[at:stop])
        state, at = chunk.state, stop
    assert_array_equal(state.P, batch.state.P)
    assert_array_equal(state.log_likelihood, batch.log_likelihood)


def test_runs_are_those_alone_to_the_bit():
    linear = random_system(S=False, runs=(2, 3), epochs=6)
    for filter_ in (FILTERS["extended"], FILTERS["gauss_hermite 3"], FILTERS["reduced"]):
        together = filter_(in_disguise(linear), history="full", workers=2)
        for index in np.ndindex(2, 3):
            alone = filter_(in_disguise(one_run(linear, index)), history="full")
            for field in FIELDS:
                assert_array_equal(getattr(together, field)[index], getattr(alone, field))


def test_histories_are_opt_in():
    system = conditionally_linear(6, np.random.default_rng(2))
    full, last = extended(system, history="full"), extended(system)
    assert (full.x.shape, full.P.shape, full.nis.shape) == ((6, 4), (6, 4, 4), (6,))
    assert (last.x.shape, last.P.shape, last.nis.shape) == ((1, 4), (1, 4, 4), (0,))
    assert_array_equal(last.P[0], full.P[-1])
    assert_array_equal(last.log_likelihood, full.log_likelihood)


@pytest.mark.slow
def test_a_second_process_compiles_nothing():
    # Another model, another run count, read-only or not, any option: one kernel a padded size.
    program = """
import sys
import numpy as np
from tests.filters.dense import random_system
from tests.filters.nonlinear_models import conditionally_linear, in_disguise, tracking
from truenorth.filters import Gate, StrongTracking, extended, gauss_hermite, iterated

for system in (in_disguise(random_system(S=False)), tracking(3, 4, np.random.default_rng(0))[0]):
    extended(system, history="full")
    iterated(system, extended(system).state)
    gauss_hermite(system, order=3, gate=Gate(), tracking=StrongTracking(), workers=2)
    gauss_hermite(system, order=3, nonlinear=[0])
stats = sys.modules["truenorth.filters.nonlinear"].nonlinear_runs.stats
print(sum(stats.cache_misses.values()), sum(stats.cache_hits.values()))
hits = [f.compiled.cache_hits for f in (system.transition, system.measurement_jacobian)]
print(*hits)
"""
    expected = ["0", "1", "1", "1"]
    assert said_by_a_second_process(program, expected.__eq__) == expected


def test_what_a_filter_needs_is_said():
    system = in_disguise(random_system(S=False), jacobians=False)
    cubature(system)
    for filter_ in (extended, iterated, FILTERS["reduced"]):
        with pytest.raises(UsageError, match="transition_jacobian is not given"):
            filter_(system)
    system = in_disguise(random_system(S=False))
    for filter_, options, message in (
        (iterated, {"iterations": 0}, "iterations is 0"),
        (iterated, {"tolerance": -1.0}, "tolerance is -1"),
        (gauss_hermite, {"order": 1}, "order is 1"),
        (gauss_hermite, {"order": 25}, "order 25 in 4 dimensions makes 390625 nodes"),
        (gauss_hermite, {"order": 3, "nonlinear": [4]}, r"nonlinear is \[4\], expected different states"),
        (gauss_hermite, {"order": 3, "nonlinear": [1, 1]}, r"nonlinear is \[1, 1\]"),
        (gauss_hermite, {"order": 3, "nonlinear": []}, r"nonlinear is \[\], expected a list"),
        (unscented, {"alpha": 0.0, "beta": 2.0, "kappa": 0.0}, "alpha is 0"),
        (unscented, {"alpha": 1.0, "beta": 2.0, "kappa": -4.0}, "kappa is -4"),
        (unscented, {"alpha": 1.0, "beta": np.nan, "kappa": 0.0}, "beta is nan"),
    ):
        with pytest.raises(UsageError, match=message):
            filter_(system, **options)
    for options, message in (
        ({"softening": 0.5}, "softening is 0.5"),
        ({"cap": 0.0}, "cap is 0"),
        ({"rho": -1.0}, "rho"),
    ):
        with pytest.raises(UsageError, match=message):
            StrongTracking(**options)
    with pytest.raises(UsageError, match="probability is 2"):
        Gate(2.0)
    with pytest.raises(UsageError, match="the state remembers 0 figures, expected 2"):
        extended(conditionally_linear(3, np.random.default_rng(0)), extended(system).state, gate=Gate())


def test_a_filter_that_breaks_down_says_where():
    system = conditionally_linear(8, np.random.default_rng(0), runs=(2,), missing=0.0)
    p, z = np.broadcast_to(system.p, (2, 8, 1)).copy(), system.z.copy()
    p[1, 5:7], z[1, 5:] = 1.7e308, np.nan  # the state of epoch 6 is beyond the largest number
    for filter_ in (extended, FILTERS["gauss_hermite 3"], FILTERS["reduced"]):
        with pytest.raises(DataError, match=r"epoch 6 of run 1: transition, measurement or a Jacobian .* not finite"):
            filter_(replace(system, p=p, z=z))
    with pytest.raises(DataError, match="epoch 0 of run 0: the variance of an innovation"):
        extended(replace(system, R=0.0 * system.R, Q=0.0 * system.Q, P0=0.0 * system.P0))


def test_exact_knowledge_is_no_harm():
    # No variance in a state: its Cholesky column is zero.
    linear = random_system(S=False, epochs=10, missing=0.0)
    P0, Q = linear.P0.copy(), linear.Q.copy()
    P0[1], P0[:, 1] = 0.0, 0.0
    Q *= 0.0
    linear = replace(linear, P0=P0, Q=Q, Phi=np.eye(4)[None])
    for name in ("cubature", "gauss_hermite 3", "reduced", "reduced to two"):
        ours, exact = FILTERS[name](in_disguise(linear)), kalman(linear)
        assert_allclose(ours.x, exact.x, **TIGHT)
        assert_allclose(ours.P, exact.P, **TIGHT)
        assert ours.sigma[0, 1] == 0.0
