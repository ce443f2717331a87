"""A simulated master INS: its errors are those asked for, in its own axes and on its own clock; a seat that bends."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import come_back
from tests.simulation.made import DRIVE, NOISY_MASTER, PLACE
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.earth import ecef_axes, ecef_from_geodetic
from truenorth.core.errors import UsageError
from truenorth.simulation import (
    Flexed,
    FlexureSpec,
    MasterSpec,
    Sway,
    simulate_sensor,
)


def test_master_errors_are_computed_minus_true():
    run = simulate_sensor(DRIVE, NOISY_MASTER, duration=60.0, seed=2)
    at, e = DRIVE.states(run.sampled), run.errors
    phi = -rotation_vector_from_dcm(run.record.C_nb @ np.swapaxes(at.C_nb, 1, 2))
    np.testing.assert_allclose(phi, e["attitude"], atol=1e-14)
    np.testing.assert_allclose(run.record.v_n - at.v_n, e["velocity"], atol=1e-14)
    place = ecef_from_geodetic(run.record.lat, run.record.lon, run.record.alt) - ecef_from_geodetic(
        at.lat, at.lon, at.alt
    )
    error = np.einsum("kji,kj->ki", ecef_axes(at.lat, at.lon), place)
    np.testing.assert_allclose(error, e["position"], atol=1e-4)  # some 10 m in a tangent plane
    calm = simulate_sensor(DRIVE, replace(NOISY_MASTER, jumps=(), jump_rate=0.0), duration=60.0, seed=2)
    steps = np.array([[t, 0, 0] for t in run.sampled]) * 0
    for moment, east, north in e["jumps"]:
        steps[run.sampled >= moment] += (east, north, 0)
    np.testing.assert_allclose(e["velocity"] - calm.errors["velocity"], steps, atol=1e-14)
    assert len(e["jumps"]) > 1


def test_the_oscillation_of_a_master_obeys_the_error_equations():
    from truenorth.core.earth import normal_gravity, radii

    spec = MasterSpec(rate=0.5, schuler=0.5)
    ferry = Sway(PLACE)
    run = simulate_sensor(ferry, spec, duration=3 * 84.4 * 60, seed=1)
    phi, dv, dp = (run.errors[name] for name in ("attitude", "velocity", "position"))
    g, R = normal_gravity(PLACE.lat, PLACE.alt), np.mean(radii(PLACE.lat)) + PLACE.alt
    slope = lambda x: (x[2:] - x[:-2]) / 4.0  # noqa: E731  # of rows 2 s apart
    near = {"rtol": 1e-4, "atol": 1e-9}
    np.testing.assert_allclose(slope(dv)[:, 0], -g * phi[1:-1, 1], **near)
    np.testing.assert_allclose(slope(dv)[:, 1], g * phi[1:-1, 0], **near)
    np.testing.assert_allclose(slope(phi)[:, 0], -dv[1:-1, 1] / R, **near)
    np.testing.assert_allclose(slope(phi)[:, 1], dv[1:-1, 0] / R, **near)
    np.testing.assert_allclose(slope(phi)[:, 2], dv[1:-1, 0] * np.tan(PLACE.lat) / R, **near)
    np.testing.assert_allclose(slope(dp), dv[1:-1], rtol=1e-4, atol=1e-5)
    crossings = run.sampled[1:][np.diff(np.sign(dv[:, 0])) > 0]
    assert np.diff(crossings) == pytest.approx(84.4 * 60, abs=6.0)


def test_a_master_in_other_axes_and_on_its_own_clock():
    spec = MasterSpec(
        mounting=(0.02, -0.01, 0.03), clock_offset=100.0, clock_drift=1e-3, latency=0.2, with_sensors=True
    )
    run = simulate_sensor(DRIVE, spec, duration=60.0, start=5.0)
    np.testing.assert_allclose(run.record.time, run.sampled + 100.2 + 1e-3 * (run.sampled - 5.0), rtol=1e-15)
    at = DRIVE.states(run.sampled)
    C_ms = dcm_from_euler(0.02, -0.01, 0.03)
    np.testing.assert_allclose(run.record.C_nb @ C_ms, at.C_nb, atol=1e-14)
    f_n = np.einsum("kij,kj->ki", run.record.C_nb, run.record.f_b)
    np.testing.assert_allclose(f_n, np.einsum("kij,kj->ki", at.C_nb, at.f_b), atol=1e-13)
    few = simulate_sensor(DRIVE, MasterSpec(with_attitude=False, with_position=False), duration=60.0).record
    assert few.C_nb is None
    assert few.lat is None


FLEXIBLE = FlexureSpec(sigma=(2e-3, 3e-3, 1e-2), correlation_time=3.0)


def test_a_flexed_slave_is_a_motion_like_any_other():
    """An ideal IMU on it comes back through the strapdown; rates are the derivatives of attitude and of each other."""
    flexed = Flexed(DRIVE, FLEXIBLE, duration=70.0, seed=3)
    _, turned, velocity, _ = come_back(flexed, 100.0, 60.0, every=100)
    assert np.degrees(np.abs(turned).max()) * 3600 < 0.05
    assert np.abs(velocity).max() < 1e-4

    t, h = np.array([7.123, 33.3]), 1e-4
    ahead, at, behind = (flexed.states(t + s) for s in (h, 0.0, -h))
    np.testing.assert_allclose((ahead.w_ib_b - behind.w_ib_b) / (2 * h), at.dw_ib_b, atol=1e-6)
    body = DRIVE.states(t)
    np.testing.assert_allclose(at.C_nb, body.C_nb @ dcm_from_euler(*flexed.angles(t).T), atol=1e-15)
    np.testing.assert_array_equal(at.v_n, body.v_n)
    with pytest.raises(UsageError, match="longer duration"):
        flexed.states(80.0)


def test_flexure_has_its_covariance_between_its_knots_as_at_them():
    """500 runs, three angles: 4.5 sigma (1 in 1e5) for each of six figures."""
    times = np.array([1.037, 2.5, 4.037])  # the first and the last are a correlation time apart
    x = np.array([Flexed(DRIVE, FLEXIBLE, duration=5.0, run=run).angles(times) for run in range(500)]) / FLEXIBLE.sigma
    for product, wanted in ((x[:, 1] ** 2, 1.0), (x[:, 0] * x[:, 2], np.exp(-1.0))):
        assert np.all(np.abs(product.mean(axis=0) - wanted) < 4.5 * product.std(axis=0) / np.sqrt(500))
