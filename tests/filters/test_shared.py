"""Runs that share all but their measurements: the bits of each run by itself, in a tenth of the time."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.core.errors import DataError
from truenorth.filters import LinearSystem, kalman, linear, shared

RUNS, EPOCHS, STATES, ROWS = 11, 30, 5, 2


@pytest.fixture(autouse=True)
def worth(monkeypatch):
    monkeypatch.setattr(shared, "WORTH", 0)


@pytest.fixture
def calls(monkeypatch):
    """How many runs went together, of each call."""
    found = []

    def counted(size, runs, epochs, joseph, out):
        found.append(len(out.x))
        shared.run_shared(size, runs, epochs, joseph, out)

    monkeypatch.setattr(linear, "run_shared", counted)
    return found


def system(varying=False):
    rng = np.random.default_rng(3)
    K = EPOCHS if varying else 1
    z = rng.standard_normal((RUNS, EPOCHS, ROWS))
    z[:, rng.uniform(size=(EPOCHS, ROWS)) < 0.4] = np.nan
    return LinearSystem(
        Phi=np.eye(STATES) + 0.1 * rng.standard_normal((K, STATES, STATES)),
        Q=0.01 * np.eye(STATES)[None] * rng.uniform(0.5, 1.0, (K, 1, 1)),
        H=rng.standard_normal((K, ROWS, STATES)),
        R=np.diag([0.5, 2.0])[None],
        z=z,
        x0=rng.standard_normal((RUNS, STATES)),
        P0=np.eye(STATES),
        u=rng.standard_normal((K, STATES)),
    )


def one(s, run):
    return replace(s, z=s.z[run], x0=s.x0[run])


def same(many, single, run):
    names = ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood")
    return all(np.array_equal(getattr(many, n)[run], getattr(single, n), equal_nan=True) for n in names)


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize("joseph", [False, True])
def test_each_run_has_the_bits_of_itself_alone(varying, joseph, calls):
    s = system(varying)
    for options in ({"history": "full"}, {}):
        many = kalman(s, joseph=joseph, **options)
        assert all(same(many, kalman(one(s, r), joseph=joseph, **options), r) for r in range(RUNS))
    assert calls == [RUNS, RUNS]


def test_blocks_threads_and_chunks_change_no_bit(monkeypatch, calls):
    s = system(True)
    whole = kalman(s, history="full")
    monkeypatch.setattr(shared, "BLOCK", 3)
    assert all(
        same(kalman(s, history="full", workers=w), replace_run(whole, r), r) for w in (1, 2) for r in range(RUNS)
    )
    before = kalman(s.between(0, 10))
    after = kalman(s.between(10, EPOCHS), before.state)
    assert np.array_equal(after.x[:, -1], whole.x[:, -1])
    assert np.array_equal(after.P[:, -1], whole.P[:, -1])
    assert np.array_equal(after.log_likelihood, whole.log_likelihood)
    assert sum(calls) > 4 * RUNS


def replace_run(estimates, run):
    names = ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood")
    return replace(estimates, **{n: getattr(estimates, n)[run] for n in names})


def test_runs_that_differ_in_more_than_measurements_do_not_go_together(calls):
    s = system()
    other_rows = s.z.copy()
    other_rows[3, :, 0] = np.nan
    tied = np.array([[0.5, 0.1], [0.1, 2.0]])
    priors = np.tile(np.eye(STATES), (RUNS, 1, 1))
    priors[4] *= 2.0
    for changed in (
        replace(s, z=other_rows),
        replace(s, R=tied[None]),
        replace(s, P0=priors),
        replace(s, Phi=np.tile(s.Phi, (RUNS, 1, 1, 1))),
        replace(s, S=0.001 * np.ones((1, STATES, ROWS))),
    ):
        many = kalman(changed, history="full")
        single = replace(changed, z=changed.z[4], x0=changed.x0[4])
        if changed.P0.ndim == 3:
            single = replace(single, P0=priors[4])
        if changed.Phi.ndim == 4:
            single = replace(single, Phi=s.Phi)
        assert same(many, kalman(single, history="full"), 4)
    assert calls == []


def test_what_breaks_down_says_where(calls):
    s = system()
    huge = replace(s, P0=1e30 * np.eye(STATES), H=np.ones((1, ROWS, STATES)), R=1e-12 * np.eye(ROWS)[None])
    with pytest.raises(DataError) as many:
        kalman(huge)
    with pytest.raises(DataError) as single:
        kalman(one(huge, 0))
    assert str(many.value) == str(single.value).replace("epoch 0:", "epoch 0 of run 0:").replace(
        "epoch 1:", "epoch 1 of run 0:"
    )
    assert calls == [RUNS]
