"""A filter takes a larger kernel that is there rather than compile its own for a few epochs: to the same bits."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from tests.filters.dense import random_system
from truenorth.core.linalg import padded
from truenorth.filters import kalman, linear
from truenorth.filters.kalman import Kalman

ONE_RUN = SimpleNamespace(x=np.zeros((1, 1, 12)))


@pytest.fixture
def there(monkeypatch):
    """Sizes of the kernels that are there."""
    sizes = set()
    monkeypatch.setattr(linear.linear_runs, "is_there", lambda size, *rest: len(size) in sizes)
    return sizes


@pytest.fixture
def under_way(monkeypatch):
    """Sizes of the kernels that another process compiles."""
    sizes = set()
    monkeypatch.setattr(linear.linear_runs, "is_under_way", lambda size, *rest: len(size) in sizes)
    return sizes


def taken(sizes, epochs=100):
    return len(sizes.for_call(padded(12), None, epochs, Kalman(True), ONE_RUN))


def test_the_own_size_is_taken_where_it_is_there_or_no_other(there, under_way):
    assert taken(linear._Sizes(1000)) == 12
    there |= {12, 40}
    assert taken(linear._Sizes(1000)) == 12


def test_a_larger_one_is_taken_for_so_many_epochs(there, under_way):
    there |= {40}
    sizes = linear._Sizes(1000)
    assert [taken(sizes) for _ in range(12)] == 10 * [40] + 2 * [12]
    sizes = linear._Sizes(1000)
    assert taken(sizes) == 40
    there |= {12}
    assert taken(sizes) == 12


def test_nobody_waits_for_the_own_one_where_a_larger_one_is_there(there, under_way):
    under_way |= {40}
    assert taken(linear._Sizes(1000)) == 40
    under_way |= {12}
    assert taken(linear._Sizes(1000)) == 12
    there |= {40}
    assert taken(linear._Sizes(1000)) == 40


def test_the_bits_are_the_same(there, monkeypatch):
    system = random_system(n=10, epochs=40)
    own = kalman(system, history="full")
    there |= {40}
    monkeypatch.setattr(linear, "_sizes", linear._Sizes(1000))
    larger = kalman(system, history="full")
    assert linear._sizes.epochs.total() == 40
    for name in ("x", "P", "innovation", "innovation_covariance", "nis", "log_likelihood"):
        np.testing.assert_array_equal(getattr(larger, name), getattr(own, name))
