"""Random terms of the IMU's errors against their laws.

Allan variances are averaged over 180 independent series and compared with theory in units of their own standard error:
beyond 4.5 (Student, 179 degrees of freedom) 1 check in 80,000 fails by chance. Variances over 200 runs of three axes
lie in the band of chi-square with 600 degrees of freedom that 1 in 10,000 leaves.
"""

import math

import allantools
import numpy as np
import pytest
from scipy.stats import chi2

from truenorth.records.specs import ImuSpec
from truenorth.simulation.drift import gauss_markov
from truenorth.simulation.imu_errors import apply_errors

T = 0.1
SERIES = 60  # of three axes
SCALE = 1e-6


def rates(count: int, interval: float, run: int, seed: int = 3, **terms: float) -> tuple[np.ndarray, np.ndarray]:
    """Error of gyros and accelerometers, (count, 3), rad/s and m/s^2: the terms of both groups alike."""
    spec = ImuSpec(correlation_time=terms.pop("correlation_time", 300.0), **each(terms))
    zero = np.zeros((count, 3))
    dtheta, dvel, _ = apply_errors(zero, zero, interval, spec, seed=seed, run=run)
    return dtheta / interval, dvel / interval


def each(terms: dict[str, float]) -> dict[str, float]:
    return {f"{group}_{name}": value for group in ("gyro", "accel") for name, value in terms.items()}


def check_allan(expected, taus, count, **terms):
    """The mean Allan variance over all series against ``expected(tau)``."""
    found = {0: [], 1: []}
    for run in range(SERIES):
        for group, series in enumerate(rates(count, T, run, **dict(terms))):
            for axis in range(3):
                # allantools takes rates as fractional frequency; its mean does not matter.
                _, deviation, _, _ = allantools.oadev(series[:, axis], rate=1 / T, data_type="freq", taus=taus)
                found[group].append(np.square(deviation))
    for values in found.values():
        mean = np.mean(values, axis=0)
        error = np.std(values, axis=0, ddof=1) / math.sqrt(len(values))
        assert np.all(error < 0.1 * mean)  # the check means something
        np.testing.assert_array_less(np.abs(mean - [expected(tau) for tau in taus]) / error, 4.5)


def test_allan_variance_of_random_walks():
    check_allan(lambda tau: SCALE**2 / tau, [T, 1.0, 5.0], 1000, random_walk=SCALE)


def test_allan_variance_of_sample_noise():
    """Per sample: a random walk of ``sigma sqrt(T)``."""
    check_allan(lambda tau: SCALE**2 * T / tau, [T, 1.0, 5.0], 1000, sample_noise=SCALE)


def test_allan_variance_of_a_rate_random_walk():
    """IEEE Std 952, C.1.4; already at one interval, since the walk is integrated exactly."""
    check_allan(lambda tau: SCALE**2 * tau / 3, [T, 1.0, 5.0], 1000, rate_random_walk=SCALE)


def test_allan_variance_of_bias_instability():
    """Gauss-Markov, IEEE Std 952, C.1.5; its maximum .617 sigma lies at 1.89 tau_c."""
    tau_c = 2.0

    def expected(tau):
        x = tau / tau_c
        return 2 * SCALE**2 / x * (1 - (3 - 4 * math.exp(-x) + math.exp(-2 * x)) / (2 * x))

    assert math.sqrt(expected(1.89 * tau_c)) == pytest.approx(0.617 * SCALE, rel=2e-3)
    check_allan(expected, [T, 2.0, 3.8, 10.0], 1000, bias_instability=SCALE, correlation_time=tau_c)


def test_allan_variance_of_quantisation():
    """``3 Q^2/tau^2`` with ``Q = step/sqrt(12)``, on white noise that makes the residues of all samples independent."""
    step, sigma = SCALE, 0.6 * SCALE  # of one increment
    walk = sigma / math.sqrt(T)

    def expected(tau):
        return walk**2 / tau + 3 * (step**2 / 12) / tau**2

    assert expected(T) > 1.5 * walk**2 / T
    check_allan(expected, [T, 0.5], 1000, random_walk=walk, quantisation=step)


def test_all_at_once():
    """The variances of independent terms add."""
    terms = {
        "random_walk": SCALE,
        "rate_random_walk": SCALE,
        "bias_instability": SCALE,
        "bias": 10.0,
        "scale_factor": 0.1,
    }

    def expected(tau):
        x = tau / 2.0
        drift = 2 * SCALE**2 / x * (1 - (3 - 4 * math.exp(-x) + math.exp(-2 * x)) / (2 * x))
        return SCALE**2 * (1 / tau + tau / 3) + drift

    check_allan(expected, [T, 2.0], 600, correlation_time=2.0, **terms)


@pytest.mark.parametrize(
    ("terms", "angle", "area"),
    [
        ({"bias": 1.0}, lambda t: t**2, lambda t: t**4 / 4),
        ({"turn_on_bias": 1.0}, lambda t: t**2, lambda t: t**4 / 4),
        ({"random_walk": 1.0}, lambda t: t, lambda t: t**3 / 3),
        ({"sample_noise": 1.0}, lambda t: T * t, lambda t: T * t**3 / 3),
        ({"rate_random_walk": 1.0}, lambda t: t**3 / 3, lambda t: t**5 / 20),
        (
            {"bias_instability": 1.0, "correlation_time": 20.0},
            lambda t: 2 * 20**2 * (t / 20 - 1 + math.exp(-t / 20)),
            None,
        ),
    ],
    ids=["bias", "turn-on", "random walk", "sample noise", "rate random walk", "Gauss-Markov"],
)
def test_pure_integration_spreads_as_theory_says(terms, angle, area):
    """Integral and double integral (velocity and position of accelerometers) of 200 runs of 100 s."""
    t, runs = 100.0, 200
    count = round(t / T)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 3 * runs)
    once, twice = [], []
    for run in range(runs):
        _, accel = rates(count, T, run, seed=11, **dict(terms))
        velocity = T * np.cumsum(accel, axis=0)
        once.append(velocity[-1])
        twice.append(T * (velocity.sum(axis=0) - 0.5 * velocity[-1]))
    assert low < np.sum(np.square(once)) / angle(t) < high
    if area is not None:
        assert low < np.sum(np.square(twice)) / area(t) < high


def test_a_gauss_markov_bias_is_stationary_and_forgets():
    """Variance of its interval means, first and last, and their correlation: exact at any ratio of T and tau."""
    rng = np.random.default_rng(2)
    for interval, tau in ((1.0, 1000.0), (1.0, 3.0), (5.0, 1.0)):
        x = np.stack([gauss_markov(1.0, tau, interval, 3, rng) for _ in range(4000)]).reshape(4000, 3, 3)
        a = interval / tau
        variance = 2 * tau**2 * (a + np.expm1(-a))
        covariance = [tau**2 * np.expm1(-a) ** 2 * math.exp(-a * lag) for lag in (0, 1)]
        count = 3 * 4000
        for row in range(3):
            assert np.mean(x[:, row] ** 2) / variance == pytest.approx(1, abs=4.5 * math.sqrt(2 / count))
        for second, wanted in ((1, covariance[0]), (2, covariance[1])):
            spread = math.sqrt((1 + (wanted / variance) ** 2) / count)
            assert np.mean(x[:, 0] * x[:, second]) / variance == pytest.approx(wanted / variance, abs=4.5 * spread)
