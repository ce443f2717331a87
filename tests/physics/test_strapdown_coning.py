"""Coning and sculling: the coefficients from the coning equation, the drifts that theory leaves, and the rate rule."""

from fractions import Fraction
from math import factorial

import numpy as np
import pytest

from truenorth.core.attitude import rotation_vector_from_quaternion
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import DataError, UsageError
from truenorth.records import ImuRecord
from truenorth.state.state import State
from truenorth.strapdown.coning import BEFORE, WITHIN, coefficients
from truenorth.strapdown.increments import increments, last_rows
from truenorth.strapdown.level import go_on, inertial_integrals, integrate_attitude, mechanise, underway

ALGORITHMS = ("previous", "1", "2", "3", "4")


def taylor_of_sine(p: int, power: int) -> Fraction:
    """Coefficient of ``lambda^power`` in ``sin(p lambda)``."""
    sign = (-1) ** ((power - 1) // 2)
    return Fraction(sign * p**power, factorial(power)) if power % 2 else Fraction(0)


def taylor_of_cross(p: int, power: int) -> Fraction:
    """The same of ``2 (1 - cos lambda) sin(p lambda)``: two increments p samples apart, crossed."""
    cosine = {j: Fraction(-2 * (-1) ** (j // 2), factorial(j)) for j in range(2, power + 1, 2)}
    return sum((c * taylor_of_sine(p, power - j) for j, c in cosine.items()), Fraction(0))


def residual(algorithm: str, phase: np.ndarray) -> np.ndarray:
    """Drift of an update per squared half-angle that the algorithm leaves, of the coning phase in a sample."""
    k, k_before = coefficients(algorithm)
    N = len(k) + 1
    made = sum(k[N - 1 - p] * 2 * (1 - np.cos(phase)) * np.sin(p * phase) for p in range(1, N))
    made = made + k_before * 2 * (1 - np.cos(phase)) * np.sin(phase)
    return 0.5 * (N * phase - np.sin(N * phase)) - made


@pytest.mark.parametrize("N", [2, 3, 4])
def test_coefficients_solve_the_coning_equation_in_rationals(N):
    """The N - 1 lowest orders, 3, 5 .. 2N - 1, of both sides are equal, and the system has one solution."""
    powers = range(3, 2 * N, 2)
    k = [Fraction(c).limit_denominator(1000) for c in WITHIN[str(N)]]
    for power in powers:
        made = sum(k[N - 1 - p] * taylor_of_cross(p, power) for p in range(1, N))
        assert made == Fraction(1, 2) * -taylor_of_sine(N, power)
    system = np.array([[float(taylor_of_cross(p, power)) for p in range(1, N)] for power in powers])
    assert np.linalg.matrix_rank(system) == N - 1


def test_coefficient_of_the_sample_before():
    assert Fraction(BEFORE["previous"]).limit_denominator(1000) * taylor_of_cross(1, 3) == Fraction(1, 12)


def coning_increments(half_angle: float, phase: float, count: int) -> np.ndarray:
    """Exact angle increments, T = 1 s, of ``q = cos(a/2) + sin(a/2) (cos Wt, sin Wt, 0)``, with W = phase in rad/s.

    ``w_ib_b = 2 q* q'`` has the components ``-W sin a sin Wt, W sin a cos Wt, W (1 - cos a)``.
    """
    t = np.arange(count + 1.0)
    s = np.sin(half_angle)
    integral = np.stack([s * np.cos(phase * t), s * np.sin(phase * t), -phase * (1 - np.cos(half_angle)) * t], axis=1)
    return np.diff(integral, axis=0)


def coning_attitude(half_angle: float, phase: float, t: np.ndarray) -> np.ndarray:
    s = np.sin(half_angle / 2)
    return np.stack(
        [np.full_like(t, np.cos(half_angle / 2)), s * np.cos(phase * t), s * np.sin(phase * t), 0 * t], axis=1
    )


def turned_away(q: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Rotation vectors of ``q truth*``, in the inertial frame."""
    w, v, wt, vt = q[:, :1], q[:, 1:], truth[:, :1], -truth[:, 1:]
    product = np.hstack([w * wt - np.sum(v * vt, axis=1)[:, None], w * vt + wt * v + np.cross(v, vt)])
    return rotation_vector_from_quaternion(product)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("phase", [0.3, 0.6, 1.0])
def test_coning_drift_is_what_theory_leaves(algorithm, phase):
    """Half-angle 1 mrad: what theory to second order in it leaves out is a millionth of the correction."""
    a, N = 1e-3, len(WITHIN[algorithm]) + 1
    updates = 4000
    q = integrate_attitude(
        coning_increments(a, phase, updates * N), coning_attitude(a, phase, np.zeros(1))[0], algorithm
    )
    t = N * np.arange(updates + 1.0)
    error = turned_away(q, coning_attitude(a, phase, t))[:, 2]
    drift = np.polyfit(np.arange(updates + 1), error, 1)[0]
    correction = 0.5 * a**2 * (N * phase - np.sin(N * phase))
    assert drift == pytest.approx(-(a**2) * residual(algorithm, phase), rel=1e-2, abs=2e-6 * correction)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_order_and_leading_coefficient_of_the_drift(algorithm):
    """An update leaves ``c (W T)^(2N+1) a^2``; c from the first order at which the coning equation fails."""
    k = [Fraction(c).limit_denominator(1000) for c in WITHIN[algorithm]]
    N = len(k) + 1
    power = 5 if algorithm == "previous" else 2 * N + 1
    c = Fraction(-1, 2) * taylor_of_sine(N, power)
    c -= sum(k[N - 1 - p] * taylor_of_cross(p, power) for p in range(1, N))
    c -= Fraction(BEFORE[algorithm]).limit_denominator(1000) * taylor_of_cross(1, power)
    assert c != 0
    phase = 0.05 if power < 7 else 0.2
    assert residual(algorithm, phase) == pytest.approx(float(c) * phase**power, rel=0.1)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("phase", [0.3, 0.6, 1.0])
def test_sculling_drift_is_what_theory_leaves(algorithm, phase):
    """Turning about up by ``A sin Wt`` under a force ``F sin Wt`` along y: the residual of coning, with A F/W for a^2.

    The mean force, along west, is ``F J1(A)``, A/2 of F; the truth is integrated by a fine quadrature. At the equator,
    with height held, the earth's rate in the gyros keeps n where it is and no Coriolis force is left.
    """
    A, F, N = 1e-3, 50.0, len(WITHIN[algorithm]) + 1
    updates, T = 3000, 1e-2
    count = updates * N
    W = phase / T
    t = T * np.arange(count + 1)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    inside = t[:-1, None] + T / 2 * (1 + nodes)
    turn = A * np.sin(W * inside)

    def integral(f):
        return f @ weights * T / 2

    zero = np.zeros(count)
    earth = [EARTH_RATE * integral(np.sin(turn)), EARTH_RATE * integral(np.cos(turn))]
    dtheta = np.stack([*earth, np.diff(A * np.sin(W * t))], axis=1)
    dvel = np.stack([zero, np.diff(-F / W * np.cos(W * t)), zero], axis=1)
    east = np.concatenate([[0], np.cumsum(integral(-F * np.sin(W * inside) * np.sin(turn)))])

    record = ImuRecord(t[1:], dtheta, dvel, "increments")
    out = mechanise(record, State.at(np.eye(3), 0.0), algorithm=algorithm, altitude="fixed")
    error = out.v_n[:, 0] - east[N::N]
    drift = np.polyfit(np.arange(1, updates + 1), error, 1)[0]
    correction = A * F / W * 0.5 * (N * phase - np.sin(N * phase))
    theory = A * F / W * residual(algorithm, phase)
    assert drift == pytest.approx(theory, rel=1e-2, abs=2e-5 * correction)
    if algorithm == "previous":
        dtheta[:, :2] = 0.0
        _, v, _ = inertial_integrals(dtheta, dvel, np.full(count, T), np.arange(count + 1))
        drift = np.polyfit(np.arange(updates + 1), v[:, 0] - east, 1)[0]
        assert drift == pytest.approx(theory, rel=1e-2, abs=1e-6 * correction)


@pytest.mark.parametrize("angle", [1e-3, 0.0999, 0.1001, 2.0])
def test_a_rate_and_force_that_stand_still_in_the_body_are_exact(angle):
    """On both sides of the series' limit of .1 rad; closed form of ``int exp([w x] t) f dt``."""
    axis = np.array([2.0, -1.0, 2.0]) / 3
    f = np.array([0.3, 9.0, -2.0])
    _, v, _ = inertial_integrals([angle * axis], [f], [1.0], [1])
    along = axis * (axis @ f)
    expected = along + np.sin(angle) / angle * (f - along) + 2 * np.sin(angle / 2) ** 2 / angle * np.cross(axis, f)
    np.testing.assert_allclose(v[0], expected, rtol=0, atol=2e-14)


def test_unknown_algorithm():
    with pytest.raises(UsageError, match="choose one of previous, 1, 2, 3, 4"):
        integrate_attitude(np.zeros((4, 3)), algorithm="5")


# Rates.


def rates(of, times):
    w = of(times)
    return ImuRecord(times, np.stack([w, 2 * w, -w], 1), np.stack([3 * w, w, w], 1))


def test_increments_are_given_back():
    record = ImuRecord([0.0, 1.0], np.ones((2, 3)), np.ones((2, 3)), "increments")
    dtheta, dvel = increments(record)
    assert dtheta is record.gyro
    assert dvel is record.accel


def test_a_quadratic_rate_is_integrated_exactly():
    t = 5.0 + 0.1 * np.arange(50)
    dtheta, dvel = increments(rates(lambda t: 1 + t - 0.3 * t**2, t))

    def integral(t):
        return t + t**2 / 2 - 0.1 * t**3

    exact = np.diff(integral(t))
    np.testing.assert_allclose(dtheta[2:, 0], exact[1:], rtol=1e-13)
    np.testing.assert_allclose(dvel[2:, 0], 3 * exact[1:], rtol=1e-13)
    assert dtheta[1, 0] == pytest.approx(exact[0], rel=1e-2)


def test_a_sinusoid_is_late_and_small_as_stated():
    """Phase x an interval: late by x^3/24 rad, smaller by 11 x^4/720."""
    x = 0.2
    t = x * np.arange(400)
    dtheta, _ = increments(rates(np.sin, t))
    exact = np.diff(-np.cos(t))
    basis = np.stack([exact, np.gradient(exact, x)], axis=1)[3:-3]
    size, quadrature = np.linalg.lstsq(basis, dtheta[4:-3, 0], rcond=None)[0]
    assert quadrature == pytest.approx(-(x**3) / 24, rel=0.05)
    assert size - 1 == pytest.approx(-11 * x**4 / 720, rel=0.1)


def test_next_to_a_gap_the_trapezoid():
    t = np.r_[0.0:1.0:0.1, 1.5:2.0:0.1]
    record = rates(np.cos, t)
    dtheta, _ = increments(record)
    row = int(np.flatnonzero(np.diff(t) > 0.3)[0]) + 1
    assert list(record.gaps) == [row]
    for k in (row, row + 1):
        assert dtheta[k, 0] == pytest.approx((t[k] - t[k - 1]) * (np.cos(t[k]) + np.cos(t[k - 1])) / 2, rel=1e-14)
    k = row + 2
    expected = 0.1 / 12 * (5 * np.cos(t[k]) + 8 * np.cos(t[k - 1]) - np.cos(t[k - 2]))
    assert dtheta[k, 0] == pytest.approx(expected, rel=1e-12)


def test_chunks_must_follow_each_other():
    record = rates(np.cos, np.arange(10.0))
    with pytest.raises(DataError, match=r"begins at 0\.0+ s, but the one before it ended at 9\.0+ s"):
        increments(record, last_rows(record))
    other = ImuRecord(np.arange(10.0, 12.0), np.ones((2, 3)), np.ones((2, 3)), "increments")
    state, _ = go_on(record, underway(State.at(np.eye(3), 0.7)))
    with pytest.raises(DataError, match="holds increments, the one before it rates"):
        go_on(other, state)
