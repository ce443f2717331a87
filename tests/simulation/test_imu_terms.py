"""Each deterministic term of the IMU's errors against its closed form."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.records.specs import ImuSpec
from truenorth.simulation import Sway, Tone, ideal_log, simulate
from truenorth.simulation.drift import BLOCK, gauss_markov, of_gauss_markov, random_walk
from truenorth.simulation.imu_errors import apply_errors, temperature
from truenorth.simulation.response import respond
from truenorth.simulation.sensing import increments
from truenorth.simulation.streams import STREAMS, stream
from truenorth.simulation.true_errors import SHAPES

T = 0.01
RNG = np.random.default_rng(20)
W, F = RNG.normal(size=(2, 200, 3)) * [[[0.3]], [[10.0]]]  # rates and forces

SHIP = Sway(
    Position.from_degrees(40.0, 118.0),
    heading_tones=(Tone(0.1, 7, 1.0),),
    pitch_tones=(Tone(0.12, 0.7, 0.8),),
    roll_tones=(Tone(0.17, 6, 0.4),),
    up_tones=(Tone(0.3, 8, 2.0),),
    lever_arm=(1.0, 3.0, 1.0),
)


def errors_of(spec: ImuSpec = ImuSpec(), **given: object) -> tuple[np.ndarray, np.ndarray]:  # noqa: B008
    """Error of rate and force."""
    dtheta, dvel, _ = apply_errors(W * T, F * T, T, spec, seed=1, given=given)
    return dtheta / T - W, dvel / T - F


def test_scale_factor_asymmetry_and_misalignment():
    scale, asymmetry = np.array([1e-4, -2e-4, 3e-4]), np.array([5e-5, -4e-5, 3e-5])
    off = np.array([[0, 1e-3, -2e-3], [3e-3, 0, 1e-3], [-1e-3, 2e-3, 0]])
    for group, x in (("gyro", W), ("accel", F)):
        given = {
            f"{group}_scale_factor": scale,
            f"{group}_scale_factor_asymmetry": asymmetry,
            f"{group}_misalignment": off,
        }
        mine, other = errors_of(**given)[:: 1 if group == "gyro" else -1]
        # Each axis: its own scale factor, that of its sign, and the two cross terms.
        expected = x * scale + np.where(x > 0, asymmetry, -asymmetry) * x + x @ off.T
        np.testing.assert_allclose(mine, expected, atol=1e-13)
        np.testing.assert_array_equal(other, errors_of()[0 if group == "accel" else 1])


def test_g_sensitivity():
    G = 1e-6 * np.arange(1.0, 10.0).reshape(3, 3)
    gyro, accel = errors_of(gyro_g_sensitivity=G)
    np.testing.assert_allclose(gyro, np.stack([F @ row for row in G], -1), atol=1e-14)
    np.testing.assert_allclose(accel, 0, atol=1e-13)


@pytest.mark.parametrize("tau", [300.0, math.inf])
def test_temperature_ramp(tau):
    spec = ImuSpec(temperature_start=-10.0, temperature_rate=0.05, temperature_time_constant=tau)
    t = T * (np.arange(200) + 0.5)
    dT = -10.0 + 0.05 * (t if math.isinf(tau) else tau * (1 - np.exp(-t / tau)))
    np.testing.assert_allclose(temperature(spec, T, 200), dT, rtol=1e-12)
    bias, scale = np.array([1e-5, -2e-5, 3e-5]), np.array([1e-5, 2e-5, -3e-5])
    gyro, _ = errors_of(spec, gyro_bias_temperature=bias, gyro_scale_factor_temperature=scale)
    np.testing.assert_allclose(gyro, dT[:, None] * (bias + scale * W), atol=1e-13)


def test_biases_add_and_the_truth_holds_them():
    spec = ImuSpec(gyro_turn_on_bias=1e-4)
    _, _, true = apply_errors(
        W * T, F * T, T, spec, seed=1, given={"gyro_bias": (1e-3, -1e-3, 2e-3), "accel_bias": 0.1}
    )
    gyro, accel = errors_of(spec, gyro_bias=(1e-3, -1e-3, 2e-3), accel_bias=0.1)
    np.testing.assert_array_equal(true.gyro.bias, [1e-3, -1e-3, 2e-3])
    assert np.all(true.gyro.turn_on_bias != 0)
    np.testing.assert_allclose(gyro - true.gyro_bias, 0, atol=1e-13)
    np.testing.assert_allclose(accel, 0.1, atol=1e-13)
    np.testing.assert_array_equal(true.accel_bias, [0.1, 0.1, 0.1])


def test_what_wanders_is_said_to_the_last_digit():
    spec = ImuSpec(
        gyro_bias_instability=1e-4, gyro_rate_random_walk=1e-4, gyro_bias_temperature=1e-5, temperature_rate=0.1
    )
    dtheta, _, true = apply_errors(W * T, F * T, T, spec, seed=4)
    np.testing.assert_allclose(dtheta / T - W, true.gyro.drift, atol=1e-13)
    assert true.accel.drift is None


def sinusoid(w: float, count: int, gain: complex = 1.0) -> np.ndarray:
    """Increments of ``|gain| cos(w t + arg gain)`` of three axes."""
    t = T * np.arange(count + 1)
    return np.diff(np.imag(gain * np.exp(1j * w * t)) / w)[:, None] * np.array([1.0, 2.0, -3.0])


@pytest.mark.parametrize("w", [0.9, 2 * np.pi * 3.0])
@pytest.mark.parametrize("bandwidth", [8.0, 300.0])
@pytest.mark.parametrize("order", [1, 2])
def test_a_low_pass_has_its_gain_and_phase(w, bandwidth, order):
    """8 Hz and 300 Hz, far above half the sampling rate; input of 33 samples a period and more."""
    count, s = 2000, 1j * w / (2 * np.pi * bandwidth)
    gain = 1 / (1 + s) if order == 1 else 1 / (1 + math.sqrt(2) * s + s * s)
    out = respond(sinusoid(w, count), T, bandwidth=bandwidth, order=order, latency=0.0)
    settled = slice(200, None)  # 100 time constants of the slow one
    np.testing.assert_allclose(out[settled], sinusoid(w, count, gain)[settled], atol=2e-9 * T * 3)


def test_at_its_bandwidth_a_sensor_has_lost_three_decibels():
    w = 2 * np.pi * 5.0
    for order in (1, 2):
        out = respond(sinusoid(w, 4000), T, bandwidth=5.0, order=order, latency=0.0)[1000:, 0]
        peak = sinusoid(w, 4000)[1000:, 0]
        assert np.sqrt(np.mean(out**2) / np.mean(peak**2)) == pytest.approx(1 / math.sqrt(2), rel=1e-6)


@pytest.mark.parametrize("latency", [0.0004, 0.01, 0.02, 0.0333, 0.2])
def test_latency_is_the_input_of_an_earlier_time(latency):
    """Against the ideal increments of the motion itself, between edges that lie earlier."""
    ideal = ideal_log(SHIP, rate=100.0, duration=4.0)
    spec = ImuSpec(gyro_latency=latency, accel_latency=latency)
    record = simulate(ideal, imu=spec).record
    earlier = increments(SHIP, ideal.edges - latency)
    inside = math.ceil(latency / T) + 1  # before that the input is said to have been steady
    np.testing.assert_allclose(record.gyro[inside:], earlier[0][inside:], atol=2e-11)
    np.testing.assert_allclose(record.accel[inside:], earlier[1][inside:], atol=2e-10)
    assert np.max(np.abs(record.gyro - ideal.dtheta)) > 1e-6


def test_before_the_log_the_input_was_steady():
    first = np.ones((50, 3))
    out = respond(first, T, bandwidth=7.0, order=2, latency=0.033)
    np.testing.assert_allclose(out, first, atol=1e-11)


def test_a_short_log_has_no_response():
    with pytest.raises(UsageError, match="7 at least"):
        respond(np.ones((5, 3)), T, bandwidth=7.0, order=1, latency=0.0)


@pytest.mark.parametrize("kind", ["increments", "rates"])
def test_size_effect_is_the_force_where_each_accelerometer_sits(kind):
    """Against three motions, each with the IMU's centre in the place of one accelerometer."""
    places = ((0.05, 0.01, 0.0), (0.0, -0.04, 0.02), (0.01, 0.0, 0.06))
    record = simulate(SHIP, imu=ImuSpec(accel_positions=places), duration=20.0, kind=kind).record
    plain = simulate(SHIP, duration=20.0, kind=kind).record
    np.testing.assert_array_equal(record.gyro, plain.gyro)
    for axis, place in enumerate(places):
        arm = tuple(np.add(SHIP.lever_arm, place))
        there = simulate(replace(SHIP, lever_arm=arm), duration=20.0, kind=kind).record
        # Gravity and the earth's rate change by 1e-8 of themselves over centimetres.
        scale = T if kind == "increments" else 1.0
        np.testing.assert_allclose(record.accel[:, axis], there.accel[:, axis], atol=2e-7 * scale)
        assert np.max(np.abs(plain.accel[:, axis] - there.accel[:, axis])) > 1e-3 * scale


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gyro_baias": 1.0}, "did you mean 'gyro_bias'"),
        ({"accel_g_sensitivity": np.zeros((3, 3))}, "not known"),
        ({"gyro_bias": [1.0, 2.0]}, "3 finite numbers"),
        ({"gyro_misalignment": 1e-3}, "3 x 3"),
        ({"gyro_misalignment": np.eye(3)}, "gyro_scale_factor"),
        ({"accel_bias": [0.0, np.nan, 0.0]}, "finite"),
    ],
)
def test_given_errors_that_make_no_sense(given, said):
    with pytest.raises(UsageError, match=said):
        simulate(SHIP, duration=1.0, errors=given)


def test_every_constant_term_can_be_given():
    for group in ("gyro", "accel"):
        for term, shape in SHAPES.items():
            if (group, term) == ("accel", "g_sensitivity"):
                continue
            value = np.full(shape, 1e-3) - (1e-3 * np.eye(3) if term == "misalignment" else 0.0)
            _, _, true = apply_errors(W * T, F * T, T, ImuSpec(), seed=0, given={f"{group}_{term}": value})
            np.testing.assert_array_equal(true.constants()[f"{group}_{term}"], value)


@pytest.mark.parametrize(
    "terms",
    [{"bias_instability": 1e-4}, {"rate_random_walk": 1e-4}, {"bias_instability": 1e-4, "rate_random_walk": 1e-4}],
)
@pytest.mark.parametrize("walk", [0.0, 1e-3])
def test_errors_added_in_one_pass_are_those_added_one_by_one(terms, walk):
    """To the bit, and with the numbers that NumPy's generator gives, across the rows that are drawn at once."""
    count = 2 * BLOCK + 3
    ideal = np.random.default_rng(1).standard_normal((count, 3))
    spec = ImuSpec(**{f"gyro_{name}": value for name, value in terms.items()}, gyro_bias=1e-2, gyro_random_walk=walk)
    found, _, true = apply_errors(ideal, ideal, T, spec, seed=5, run=2)
    expected = ideal + true.gyro.constant_bias * T
    wander = np.zeros((count, 3))
    for name in terms:
        rng = stream(5, 0, 2, STREAMS[f"gyro_{name}"])
        wander += (
            gauss_markov(1e-4, spec.correlation_time, T, count, rng)
            if name == "bias_instability"
            else random_walk(1e-4, T, count, rng)
        )
    expected += wander
    if walk:
        white = stream(5, 0, 2, STREAMS["gyro_random_walk"])
        expected += white.standard_normal((count, 3)) * (walk * np.sqrt(T))
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(true.gyro.drift, wander / T)
    assert true.accel.drift is None


def test_the_recursion_takes_the_numbers_of_the_generator():
    recursion, count = of_gauss_markov(1e-4, 300.0, T), BLOCK + 5
    first, *e = stream(1, 2, 3, 4).standard_normal((count + 1, 3))
    x = [recursion.before * first + recursion.alpha * e[0]]
    for before, now in pairwise(e):
        x.append(recursion.decay * x[-1] + recursion.alpha * now + recursion.beta * before)
    np.testing.assert_array_equal(gauss_markov(1e-4, 300.0, T, count, stream(1, 2, 3, 4)), x)
