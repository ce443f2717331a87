"""What a nonlinear system refuses, and how it says so; its Jacobians held against finite differences."""

from dataclasses import replace

import numpy as np
import pytest

from tests.filters.dense import assert_infinite_is_named, random_system
from tests.filters.nonlinear_models import (
    TURNING,
    conditionally_linear,
    in_disguise,
    linear_transition,
    linear_transition_jacobian,
    tracking,
)
from tests.helpers import changed
from truenorth.core.errors import DataError, UsageError
from truenorth.filters import check_jacobians, matrix_function, vector_function


@pytest.fixture
def system():
    return in_disguise(random_system(S=False, runs=(2,), epochs=5))


@pytest.mark.parametrize("name", ["Q", "R", "z", "x0", "P0", "p"])
def test_an_infinite_number_is_named_with_its_place(system, name):
    assert_infinite_is_named(system, name)


@pytest.mark.parametrize(
    ("name", "shape", "message"),
    [
        ("Q", (5, 3, 3), r"Q has shape \(5, 3, 3\), expected \(..., K, n, n\) with n = 4 as in x0"),
        ("R", (3, 3), r"R has shape \(3, 3\), expected \(..., K, m, m\) \(a constant matrix needs a time axis"),
        ("z", (4, 3), r"z has shape .* with K = 5 as in .* or 1"),
        ("P0", (3, 3), r"P0 has shape .* with n = 4 as in x0"),
        ("p", (4, 33), r"p has shape .* with K = 5 as in .* or 1"),
        ("Q", (3, 5, 4, 4), r"the run axes do not broadcast: Q \(3, 5, 4, 4\)"),
    ],
)
def test_a_wrong_shape_is_named(system, name, shape, message):
    with pytest.raises(UsageError, match=f"NonlinearSystem: {message}"):
        replace(system, **{name: np.zeros(shape)})


def test_an_indefinite_noise_is_named_with_its_epoch(system):
    R = changed(system.R, (1, 3), [[1.0, -0.6, -0.6], [-0.6, 1.0, -0.6], [-0.6, -0.6, 1.0]])
    with pytest.raises(DataError, match="NonlinearSystem: R is not positive semidefinite at epoch 3, run 1"):
        replace(system, R=R)
    with pytest.raises(
        DataError, match=r"NonlinearSystem: R has the variance -1.0 at epoch 2, run 0, element \[1, 1\]"
    ):
        replace(system, R=changed(system.R, (0, 2, 1, 1), -1.0))


@vector_function
def too_far(x, p, out):
    out[len(x)] = 0.0


@vector_function
def forgetful(x, p, out):
    out[0] = 1.0


@vector_function
def meddling(x, p, out):
    x[0] = 0.0
    out[:] = x


def test_a_function_is_tried(system):
    for function, message in (
        (lambda x, p, out: None, "transition is <function .*decorated with truenorth.filters.vector_function"),
        (linear_transition_jacobian, "transition is .*decorated with truenorth.filters.vector_function"),
        (too_far, "transition does not fit the arrays it is given, x of 4 numbers, p of 32 and out of shape"),
        (meddling, "transition changes its arguments"),
    ):
        with pytest.raises(UsageError, match=message):
            replace(system, transition=function)
    with pytest.raises(UsageError, match=r"transition_jacobian is .*matrix_function"):
        replace(system, transition_jacobian=linear_transition)
    with pytest.raises(DataError, match=r"transition leaves out\[1\] not finite at epoch 0"):
        replace(system, transition=forgetful)


def test_other_arrays_are_checked_and_functions_not_tried_again(system, monkeypatch):
    replaced = replace(system, x0=system.x0 + 1.0)
    monkeypatch.setattr("truenorth.filters.nonlinear_system._try", lambda *_: pytest.fail("tried again"))
    other = system.with_arrays(x0=system.x0 + 1.0)
    for name in system.axes:
        np.testing.assert_array_equal(getattr(other, name), getattr(replaced, name))
    assert other.transition is system.transition
    np.testing.assert_array_equal(system.x0 + 1.0, other.x0)
    with pytest.raises(DataError, match="x0 is inf"):
        system.with_arrays(x0=np.full_like(system.x0, np.inf))
    with pytest.raises(UsageError, match="n = 2 as in x0"):
        system.with_arrays(x0=system.x0[..., :2])


@matrix_function
def a_sign_is_wrong(x, p, out):
    s, c = np.sin(x[2]), np.cos(x[2])
    out[0, 0], out[0, 1], out[0, 2] = c, s, s * x[0] + c * x[1] - 0.5 * s
    out[1, 1] = out[1, 3] = 1.0


@matrix_function
def a_ten_thousandth_is_wrong(x, p, out):
    out[0, 0], out[1, 1], out[2, 2], out[3, 3] = 1.0, 1.0, 1.0, 1.0
    out[0, 2] = p[0]
    out[1, 3] = p[0] * 1.0001


def test_jacobians_are_right_or_named():
    rng = np.random.default_rng(0)
    system = conditionally_linear(5, rng)
    found = check_jacobians(system, rng, points=30, nonlinear=[TURNING])
    assert max(found.transition, found.measurement) < 1e-7
    with pytest.raises(DataError, match=r"measurement_jacobian has .* in element \[0, 2\] at epoch"):
        check_jacobians(replace(system, measurement_jacobian=a_sign_is_wrong), rng)
    target, _ = tracking(1, 3, rng)
    found = check_jacobians(target, rng)
    assert max(found.transition, found.measurement) < 1e-7
    with pytest.raises(DataError, match=r"transition_jacobian has 1.0001 in element \[1, 3\]"):
        check_jacobians(replace(target, transition_jacobian=a_ten_thousandth_is_wrong), rng)


def test_states_that_are_not_linear_are_named():
    rng = np.random.default_rng(0)
    system = conditionally_linear(5, rng)
    with pytest.raises(DataError, match=r"transition_jacobian changes in element \[0, 1\] .*\(now \[0\]\)"):
        check_jacobians(system, rng, nonlinear=[0])


def test_one_jacobian_is_enough_none_is_not():
    rng = np.random.default_rng(0)
    system = replace(conditionally_linear(5, rng), transition_jacobian=None)
    found = check_jacobians(system, rng)
    assert np.isnan(found.transition)
    assert found.measurement < 1e-7
    with pytest.raises(UsageError, match="neither transition_jacobian nor measurement_jacobian"):
        check_jacobians(replace(system, measurement_jacobian=None), rng)
    with pytest.raises(UsageError, match="points is -1"):
        check_jacobians(system, rng, points=-1)


def test_a_column_that_is_zero_is_no_division():
    # A row that measures nothing: any element there is wrong.
    rng = np.random.default_rng(0)
    system = in_disguise(random_system(S=False))
    p = np.array(system.p)
    p[..., 20:] = 0.0
    check_jacobians(replace(system, p=p), rng)
    zero = replace(conditionally_linear(5, rng), measurement=nothing)
    with pytest.raises(DataError, match=r"measurement_jacobian has .* but a central difference gives 0,"):
        check_jacobians(zero, rng)


@vector_function
def nothing(x, p, out):
    out[0] = out[1] = 0.0
