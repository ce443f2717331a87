"""Noise from a log, against simulated IMUs of known specification and allantools."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from tests.runs import some
from truenorth.analysis.allan import NoiseCoefficients
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.core.units import parse
from truenorth.errors.staying import StaticModel
from truenorth.quality.noise import gauss_markov_variance, noise_from_log, with_terms_seen
from truenorth.records import ImuRecord
from truenorth.records.one_pass import _lower_quartiles
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import rest, simulate

KNOWN = ImuSpec(
    gyro_random_walk=parse("0.01 deg/sqrt(h)", "angle_random_walk"),
    gyro_bias_instability=parse("0.05 deg/h", "angular_rate"),
    accel_random_walk=parse("50 ug/sqrt(Hz)", "velocity_random_walk"),
    accel_bias_instability=parse("30 ug", "acceleration"),
    correlation_time=200.0,
)


def log(spec: ImuSpec, hours: float = 4.0, seed: int = 0) -> ImuRecord:
    motion = rest(Position.from_degrees(40.0, 118.0), 0.6)
    return simulate(motion, rate=10.0, duration=3600.0 * hours, imu=spec, seed=seed).record


def test_the_curve_of_a_gauss_markov_bias():
    # Its limits are a rate random walk b sqrt(2 / T) and white noise b sqrt(2 T); its top .617 b at 1.89 T (IEEE 952, C.20).
    assert_allclose(gauss_markov_variance([1e-3], 100.0), [2.0 / 100.0 * 1e-3 / 3.0], rtol=1e-4)
    assert_allclose(gauss_markov_variance([1e6], 1.0), [2.0 / 1e6], rtol=1e-5)
    tau = np.linspace(150.0, 230.0, 801)
    curve = np.sqrt(gauss_markov_variance(tau, 100.0))
    assert_allclose(tau[np.argmax(curve)], 189.0, atol=1.0)
    assert_allclose(curve.max(), 0.617, atol=1e-3)
    both = gauss_markov_variance([0.01 - 1e-9, 0.01 + 1e-9], 1.0)
    assert_allclose(both[0], both[1], rtol=1e-6)


def test_the_curve_is_what_allantools_measures():
    # Mean variance over 60 channels of 40 correlation times: its sigma is below 4 % up to tau = 2 T; 5 of them: p < 1e-5.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import allantools
    rng, T = np.random.default_rng(0), 50.0
    decay = np.exp(-1.0 / T)
    noise = np.sqrt(1.0 - decay**2) * rng.standard_normal((60, 2500))
    rates = lfilter([1.0], [1.0, -decay], noise, axis=1)[:, 500:]
    taus = [8.0, 20.0, 50.0, 100.0]
    measured = [allantools.oadev(rate, rate=1.0, data_type="freq", taus=taus)[1] ** 2 for rate in rates]
    assert_allclose(np.mean(measured, axis=0), gauss_markov_variance(taus, T), rtol=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", some([0], [1, 2]))
def test_a_simulated_imu_is_found(seed):
    # 4 h, 72 correlation times. Scatter of a channel over 240: random walk .8 %, slope of the bias 10 %; the worst of three
    # axes lies 1 sigma higher. Bounds at 5 sigma.
    found = noise_from_log(log(KNOWN, seed=seed))
    assert found.spec.name == "from log"
    for group in ("gyro", "accel"):
        walk, instability = f"{group}_random_walk", f"{group}_bias_instability"
        assert_allclose(getattr(found.spec, walk), getattr(KNOWN, walk), rtol=0.03)
        slope = [getattr(s, instability) * np.sqrt(2.0 / s.correlation_time) for s in (found.spec, KNOWN)]
        assert 0.6 < slope[0] / slope[1] < 1.6
    assert 0.4 < found.spec.correlation_time / 200.0 < 2.5
    assert found.spec.gyro_quantisation == found.spec.accel_quantisation == 0.0
    assert_allclose(found.random_walk, [[KNOWN.gyro_random_walk] * 3, [KNOWN.accel_random_walk] * 3], rtol=0.03)
    # ... and it is what the filter of an alignment takes.
    assert_allclose(StaticModel.of(found.spec).gyro_random_walk, KNOWN.gyro_random_walk, rtol=0.03)


@pytest.mark.slow
def test_quantisation_is_separated_from_random_walk():
    spec = replace(KNOWN, gyro_quantisation=3e-6, accel_quantisation=6e-4)  # about three sigma of a sample's noise
    found = noise_from_log(log(spec, hours=1.0)).spec
    assert_allclose(found.gyro_quantisation, 3e-6, rtol=0.05)
    assert_allclose(found.accel_quantisation, 6e-4, rtol=0.05)
    assert_allclose(found.gyro_random_walk, KNOWN.gyro_random_walk, rtol=0.1)


def test_white_noise_alone_shows_nothing_else():
    rng = np.random.default_rng(1)
    data = rng.standard_normal((20_000, 3))
    found = noise_from_log(ImuRecord(np.arange(20_000) * 0.01, data, 5.0 * data), like="navigation")
    assert_allclose(found.random_walk, [[0.1] * 3, [0.5] * 3], rtol=0.05)
    assert found.spec.gyro_bias_instability < 0.02  # of a sigma of 1 a sample: less than the deviation at any tau
    preset = imu_spec("navigation")
    assert found.spec.gyro_bias == preset.gyro_bias
    assert found.spec.accel_scale_factor == preset.accel_scale_factor


@pytest.mark.slow
def test_scaling_the_data_scales_the_noise():
    record = log(KNOWN, hours=0.5)
    once, twice = (
        noise_from_log(record),
        noise_from_log(ImuRecord(record.time, 2 * record.gyro, 2 * record.accel, record.kind)),
    )
    assert_allclose(twice.random_walk, 2.0 * once.random_walk, rtol=1e-9)
    assert_allclose(twice.bias_instability, 2.0 * once.bias_instability, rtol=1e-9)
    assert once.spec.correlation_time == twice.spec.correlation_time


def test_bad_records_are_refused():
    time = np.arange(100) * 0.1
    few = ImuRecord(time[:10], np.ones((10, 3)), np.ones((10, 3)))
    with pytest.raises(UsageError, match="10 rows"):
        noise_from_log(few)
    time = np.delete(np.arange(101) * 0.1, 50)
    with pytest.raises(UsageError, match=r"a gap of 0\.2 s before row 51"):
        noise_from_log(ImuRecord(time, np.ones((100, 3)), np.ones((100, 3))))


def coefficients(bias_instability: float, rate_random_walk: float) -> NoiseCoefficients:
    none, sigma = np.zeros(3), np.full(3, np.nan)
    one = np.array([0.0, 1.0, 0.0])
    return NoiseCoefficients(
        none, one, bias_instability * one, rate_random_walk * one, sigma, sigma, sigma, sigma, None
    )  # type: ignore[arg-type]  # no curve


def test_a_file_holds_the_slow_terms_that_the_table_shows():
    """A bias that goes on wandering is a rate random walk; one that nothing shows is none; one that is seen stays as fitted."""
    spec = replace(KNOWN, correlation_time=800.0)
    found = with_terms_seen(spec, coefficients(0.0, 0.0), coefficients(0.0, 1e-6))
    assert (found.gyro_bias_instability, found.gyro_rate_random_walk, found.accel_bias_instability) == (0.0, 0.0, 0.0)
    assert found.accel_rate_random_walk == pytest.approx(KNOWN.accel_bias_instability / 20.0)
    assert with_terms_seen(spec, coefficients(1e-6, 0.0), coefficients(1e-6, 1e-6)) == spec


@pytest.mark.parametrize("count", [1, 2, 5, 30])
def test_lower_quartiles_are_numpys(count):
    values = np.random.default_rng(count).standard_normal((count, 6))
    np.testing.assert_allclose(_lower_quartiles(values), np.quantile(values, 0.25, axis=0), rtol=1e-15, atol=1e-15)
