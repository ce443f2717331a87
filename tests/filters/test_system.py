"""What a linear system refuses, and how it says so."""

from dataclasses import replace

import numpy as np
import pytest

from tests.filters.dense import assert_infinite_is_named, random_system
from tests.helpers import changed
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import LinearSystem


@pytest.fixture
def system() -> LinearSystem:
    return random_system(runs=(2,), epochs=5)


@pytest.mark.parametrize("name", ["Phi", "Q", "H", "R", "z", "x0", "P0", "u", "S"])
def test_an_infinite_number_is_named_with_its_place(system, name):
    assert_infinite_is_named(system, name)


@pytest.mark.parametrize("name", ["Phi", "Q", "H", "R", "x0", "P0", "u", "S"])
def test_nan_is_for_measurements_only(system, name):
    a = getattr(system, name)
    with pytest.raises(DataError, match=f"LinearSystem: {name} is nan at .*expected a finite number"):
        replace(system, **{name: changed(a, (0,) * a.ndim, np.nan)})


def test_large_finite_numbers_pass(system):
    # Their sum overflows, they do not.
    replace(system, u=np.full_like(system.u, 1e308))


@pytest.mark.parametrize(
    ("name", "shape", "message"),
    [
        ("Phi", (5, 4, 3), r"Phi has shape \(5, 4, 3\), expected \(..., K, n, n\) with n = 4 as in x0"),
        ("Q", (4, 4), r"Q has shape \(4, 4\), expected \(..., K, n, n\) \(a constant matrix needs a time axis"),
        ("H", (5, 2, 4), r"H has shape .* with m = 3 as in z"),
        ("H", (4, 3, 4), r"H has shape .* with K = 5 as in Phi or 1"),
        ("R", (5, 3), r"R has shape \(5, 3\), expected \(..., K, m, m\)"),
        ("z", (4, 3), r"z has shape .* with K = 5 as in Phi or 1"),
        ("P0", (4, 5), r"P0 has shape .* with n = 4 as in x0"),
        ("u", (5, 3), r"u has shape .* with n = 4 as in x0"),
        ("S", (5, 3, 4), r"S has shape .* with n = 4 as in x0"),
        ("Phi", (0, 4, 4), r"Phi has no epochs"),
        ("z", (3, 5, 3), r"the run axes do not broadcast: Phi \(2, 5, 4, 4\)"),
    ],
)
def test_a_wrong_shape_is_named(system, name, shape, message):
    with pytest.raises(UsageError, match=message):
        replace(system, **{name: np.zeros(shape)})


def test_text_is_not_a_matrix(system):
    with pytest.raises(UsageError, match="H is not an array of numbers"):
        replace(system, H="no")


@pytest.mark.parametrize("name", ["Q", "R", "P0"])
def test_a_negative_variance_is_named(system, name):
    a = getattr(system, name)
    with pytest.raises(DataError, match=f"{name} has the variance -1.0 at"):
        replace(system, **{name: changed(a, (0,) * (a.ndim - 2) + (1, 1), -1.0)})


@pytest.mark.parametrize("name", ["Q", "R", "P0"])
def test_asymmetry_is_named_rounding_is_not(system, name):
    a = getattr(system, name)
    index = (1,) + (0,) * (a.ndim - 3) + (2, 1)
    replace(system, **{name: changed(a, index, a[index] * (1.0 + 1e-14))})
    with pytest.raises(DataError, match=rf"{name} is not symmetric at .*run 1, element \[2, 1\]"):
        replace(system, **{name: changed(a, index, a[index] + 1e-3)})


@pytest.mark.parametrize("name", ["R", "P0"])
def test_an_indefinite_matrix_is_named(system, name):
    # All 2x2 minors are positive, the whole is not.
    a = getattr(system, name)
    bad = np.broadcast_to(np.eye(a.shape[-1]), a.shape).copy()
    bad[1, ..., :3, :3] = [[1.0, -0.6, -0.6], [-0.6, 1.0, -0.6], [-0.6, -0.6, 1.0]]
    with pytest.raises(DataError, match=f"{name} is not positive semidefinite at .*run 1"):
        replace(system, **{name: bad})


def test_a_correlation_above_one_is_named(system):
    Q = changed(system.Q, (0, 3), np.eye(4))
    Q[0, 3, 0, 1] = Q[0, 3, 1, 0] = 1.1
    with pytest.raises(DataError, match="Q is not positive semidefinite at epoch 3, run 0"):
        replace(system, Q=Q)


def test_semidefinite_matrices_pass(system):
    one = np.outer([1.0, 1e-8, 0.0, -3.0], [1.0, 1e-8, 0.0, -3.0])
    replace(system, Q=one[None], P0=one, R=np.ones((1, 3, 3)))


@pytest.mark.parametrize("name", ["Phi", "Q", "H", "R", "x0", "P0", "u", "S"])
def test_arrays_that_take_the_place_of_others_are_checked(system, name):
    a = getattr(system, name)
    np.testing.assert_array_equal(getattr(system.with_arrays(**{name: 0.5 * a}), name), 0.5 * a)
    assert getattr(system, name) is a
    with pytest.raises(DataError, match=f"LinearSystem: {name} is nan at"):
        system.with_arrays(**{name: changed(a, (0,) * a.ndim, np.nan)})
    with pytest.raises(UsageError, match="LinearSystem: "):
        system.with_arrays(**{name: np.concatenate([a, a], axis=-1)})


def test_between_takes_epochs_and_leaves_constants():
    system = replace(random_system(epochs=5), H=np.zeros((1, 3, 4)))
    part = system.between(2, 4)
    assert (part.epochs, system.epochs) == (2, 5)
    assert part.H.shape == (1, 3, 4)
    assert np.array_equal(part.Phi, system.Phi[2:4])
