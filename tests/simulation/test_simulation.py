"""The simulator against the strapdown, the requested noise, and itself."""

import allantools
import numpy as np
import pytest

from tests.helpers import come_back
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import Sway, Tone, ideal_log, rest, simulate
from truenorth.simulation.imu_errors import apply_errors

PLACE = Position.from_degrees(40.0, 118.0)
deg = np.radians

# Configuration A of "Rotary SINS self-alignment under dynamic disturbance", without its rotation.
SHIP = Sway(
    PLACE,
    heading=deg(-30),
    heading_tones=(Tone(deg(5), 7, -np.pi / 3),),
    pitch_tones=(Tone(deg(7), 5, np.pi / 4),),
    roll_tones=(Tone(deg(10), 6, np.pi / 7),),
    east_tones=(Tone(0.02, 7, 0.3),),
    north_tones=(Tone(0.03, 6, 1.0),),
    up_tones=(Tone(0.3, 8, 2.0),),
    lever_arm=(10.0, 30.0, 10.0),
)


@pytest.mark.parametrize("motion", [SHIP, rest(PLACE, 1.0, 0.1, -0.2)], ids=["ship", "rest"])
def test_an_ideal_imu_through_the_strapdown_comes_back(motion):
    """720 s at 100 Hz: .05 arcsec and 1e-4 m/s are wanted."""
    _, turned, velocity, position = come_back(motion, 100.0, 720.0, every=100)
    assert np.degrees(np.max(np.abs(turned))) * 3600 < 0.05
    assert np.max(np.abs(velocity)) < 1e-4
    assert np.max(np.abs(position[:, 2])) < 5e-3


def test_rates_and_forces_are_the_derivatives_of_the_truth():
    """Central differences of attitude, velocity and position."""
    t = np.array([3.3, 101.7])
    h = 1e-4
    ahead, at, behind = (SHIP.states(t + s * h) for s in (1, 0, -1))
    from truenorth.core.earth import earth_rate_n, gravity_n, radii, transport_rate_n

    w_nb_n = rotation_vector_from_dcm(ahead.C_nb @ np.swapaxes(behind.C_nb, 1, 2)) / (2 * h)
    w_in_n = earth_rate_n(at.lat) + transport_rate_n(at.lat, at.alt, at.v_n)
    w_ib_n = np.einsum("kij,kj->ki", at.C_nb, at.w_ib_b)
    np.testing.assert_allclose(w_ib_n, w_nb_n + w_in_n, atol=1e-8)
    a = (ahead.v_n - behind.v_n) / (2 * h)
    f_n = a + np.cross(w_in_n + earth_rate_n(at.lat), at.v_n) - gravity_n(at.lat, at.alt)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", at.C_nb, at.f_b), f_n, atol=1e-6)
    R_M, R_N = radii(at.lat)
    np.testing.assert_allclose((ahead.lat - behind.lat) / (2 * h) * (R_M + at.alt), at.v_n[:, 1], rtol=1e-5, atol=1e-6)
    east = (ahead.lon - behind.lon) / (2 * h) * (R_N + at.alt) * np.cos(at.lat)
    # Displacements of tens of metres are taken in the tangent plane: a part in 1e5 of the velocity, .2 mm of position.
    np.testing.assert_allclose(east, at.v_n[:, 0], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose((ahead.alt - behind.alt) / (2 * h), at.v_n[:, 2], atol=1e-7)


@pytest.mark.slow
def test_allan_deviation_is_what_was_asked_for():
    """Random walks at 1 s within 3 % (each of 6 estimates has 1 %: a false alarm in 1 of 60 sets of seeds)."""
    spec = ImuSpec(gyro_random_walk=2e-5, accel_random_walk=3e-4, name="white")
    record = simulate(rest(PLACE), imu=spec, rate=50.0, duration=6000.0, seed=8).record
    for increments, walk in ((record.gyro, 2e-5), (record.accel, 3e-4)):
        for axis in range(3):
            rates = increments[:, axis] * 50.0
            _, deviation, _, _ = allantools.oadev(rates - rates.mean(), rate=50.0, data_type="freq", taus=[1.0])
            assert deviation[0] == pytest.approx(walk, rel=0.03)


def test_a_gauss_markov_bias_has_its_variance_and_correlation():
    """400 stretches: sample variance within 4 of its sigmas, 1/sqrt(600)."""
    spec = ImuSpec(gyro_bias_instability=1e-6, correlation_time=100.0, name="drift")
    first, late = [], []
    for run in range(400):
        zero = np.zeros((101, 3))
        drift = apply_errors(zero, zero, 1.0, spec, seed=3, run=run)[0]
        first.append(drift[0])
        late.append(drift[100])
    a, b = np.array(first).ravel(), np.array(late).ravel()
    assert np.var(a) == pytest.approx(1e-12, rel=4 / np.sqrt(600))
    assert np.var(b) == pytest.approx(1e-12, rel=4 / np.sqrt(600))
    assert np.mean(a * b) / 1e-12 == pytest.approx(np.exp(-1.0), abs=4 / np.sqrt(1200))


def test_pure_integration_spreads_as_theory_says():
    """200 runs of 100 s: variance of the angle and velocity sums within 4 of their sigmas (relative sqrt(2/600))."""
    spec = ImuSpec(gyro_random_walk=1e-5, accel_random_walk=1e-4, gyro_bias=1e-7, accel_bias=1e-4, name="walks")
    ideal = ideal_log(rest(PLACE), rate=10.0, duration=100.0)
    angle, velocity = [], []
    for run in range(200):
        record = simulate(ideal, imu=spec, seed=12, run=run).record
        angle.append((record.gyro - ideal.dtheta).sum(axis=0))
        velocity.append((record.accel - ideal.dvel).sum(axis=0))
    tolerance = 4 * np.sqrt(2 / 600)
    assert np.mean(np.square(angle)) == pytest.approx(1e-10 * 100 + (1e-7 * 100) ** 2, rel=tolerance)
    assert np.mean(np.square(velocity)) == pytest.approx(1e-8 * 100 + (1e-4 * 100) ** 2, rel=tolerance)


def test_same_seed_same_bits_and_runs_do_not_know_each_other():
    spec = imu_spec("tactical")
    ideal = ideal_log(rest(PLACE), rate=10.0, duration=20.0)
    once = [simulate(ideal, imu=spec, seed=5, run=run).record for run in range(4)]
    alone = simulate(ideal, imu=spec, seed=5, run=3).record
    np.testing.assert_array_equal(alone.gyro, once[3].gyro)
    assert not np.array_equal(once[2].gyro, once[3].gyro)
    other = simulate(ideal, imu=spec, seed=5, run=3, scenario=1).record
    assert not np.array_equal(alone.gyro, other.gyro)


def test_quantisation_carries_its_residue():
    spec = ImuSpec(gyro_quantisation=1e-4, accel_quantisation=1e-3, name="counts")
    ideal = ideal_log(SHIP, rate=100.0, duration=50.0)
    record = simulate(ideal, imu=spec).record
    counts = record.gyro / 1e-4
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.max(np.abs(np.cumsum(record.gyro - ideal.dtheta, axis=0))) < 1.0001e-4


def test_saturation():
    spec = ImuSpec(gyro_range=0.05, name="narrow")
    record = simulate(SHIP, imu=spec, rate=100.0, duration=20.0).record
    assert np.max(np.abs(record.gyro)) <= 0.05 * 0.01 * (1 + 1e-12)


def test_nonsense_is_refused():
    with pytest.raises(UsageError, match="rate 0"):
        ideal_log(rest(PLACE), rate=0.0, duration=10.0)


def test_an_imu_is_named_as_everywhere():
    found = [simulate(rest(PLACE), duration=1.0, imu=imu).record for imu in ("navigation", imu_spec("navigation"))]
    np.testing.assert_array_equal(found[0].gyro, found[1].gyro)
    with pytest.raises(UsageError, match="navigatoin"):
        simulate(rest(PLACE), duration=1.0, imu="navigatoin")
