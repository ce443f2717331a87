"""Bases at rest by cells of attitude: as without them but for thousandths of a sigma, and to the same bits whoever came before."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from truenorth import align, imu_spec
from truenorth.core.attitude import dcm_from_euler, misalignment, quaternion_from_dcm
from truenorth.core.position import Position
from truenorth.estimate import cells
from truenorth.estimate.cells import STEP, cell_of, in_few_cells
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.known import Common
from truenorth.simulation import Sway, simulate
from truenorth.strapdown.inertial import integrate

PLACE = Position.from_degrees(45.0)
HALF_TURNS = ((1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0))


def record_of(heading: float, seed: int, duration: float = 300.0):
    rest = Sway(PLACE, np.radians(heading), np.radians(3.0), np.radians(-2.0))
    return simulate(rest, rate=50.0, duration=duration, imu=imu_spec("navigation"), seed=seed).record


def forget() -> None:
    cells._common.cache_clear()


def test_state_with_known_gains_is_that_of_the_filter():
    rng = np.random.default_rng(1)
    n, m, K = 6, 3, 40
    root, own = rng.normal(size=(K, n, n)), rng.normal(size=(K, n + m, n + m))
    noise = own @ own.swapaxes(1, 2)
    Q, R, S = noise[:, :n, :n], noise[:, n:, n:], noise[:, :n, n:]
    arrays = 0.4 * root, Q, rng.normal(size=(K, m, n)), R, rng.normal(size=(K, m)), rng.normal(size=n), np.eye(n)
    system = LinearSystem(*arrays, S=S)
    shared = Common(system).with_log(system.z, system.x0, system.P0)
    found, expected = shared.known().estimates_of(system.z, system.x0, "full"), kalman(system, history="full")
    for name in ("x", "sigma", "P", "innovation", "innovation_covariance", "nis", "log_likelihood"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-9, atol=1e-9, err_msg=name)
    last, own_last = shared.known().estimates_of(system.z, system.x0, "last"), kalman(system, innovations=True)
    for name in ("x", "sigma", "P", "innovation", "nis"):
        np.testing.assert_allclose(getattr(last, name), getattr(own_last, name), rtol=1e-9, atol=1e-9, err_msg=name)


def test_what_is_put_in_its_place_is_not_known():
    system = LinearSystem(
        np.eye(2)[None], np.eye(2)[None], np.eye(2)[None], np.eye(2)[None], np.zeros((5, 2)), np.zeros(2), np.eye(2)
    )
    shared = Common(system).with_log(system.z, system.x0, system.P0)
    assert shared.with_made(R=2.0 * system.R).known() is not None
    assert shared.with_made(H=2.0 * system.H).known() is None
    assert shared.with_arrays(Q=2.0 * system.Q).known() is None


def test_noise_with_more_variance_is_one_array_for_all_logs():
    system = LinearSystem(*[np.eye(2)[None]] * 4, np.zeros((5, 2)), np.zeros(2), np.eye(2))
    common = Common(system)
    R = common.noise_with(np.array([1.0, 2.0]))
    assert np.array_equal(R, system.R + np.diag([1.0, 2.0]))
    assert common.noise_with(np.array([1.0, 2.0])) is R
    assert common.known_with(R, system.P0) is common.known_with(R.copy(), system.P0)


@pytest.mark.parametrize("heading", [0.0, 37.0, 179.0])
def test_cell_is_near_and_of_its_log_alone(heading):
    log = integrate(record_of(heading, 1))
    C = dcm_from_euler(np.radians(heading), np.radians(3.0), np.radians(-2.0))
    cell = cell_of(C, log, PLACE.lat)
    assert np.abs(misalignment(cell, C)).max() < 2.0 * STEP
    np.testing.assert_allclose(cell @ cell.T, np.eye(3), atol=1e-15)
    assert (
        cell_of(dcm_from_euler(np.radians(heading + 0.02), np.radians(3.0), np.radians(-2.0)), log, PLACE.lat)
        is not None
    )


def test_log_that_turns_has_no_cell():
    record = record_of(10.0, 1)
    turned = type(record)(
        record.time, record.gyro + np.array([0.0, 0.0, 1e-4]), record.accel, record.kind, record.source
    )
    assert cell_of(dcm_from_euler(np.radians(10.0), 0.0, 0.0), integrate(turned), PLACE.lat) is None


def test_few_cells_where_the_gyros_find_north():
    assert in_few_cells(imu_spec("navigation"), PLACE.lat)
    assert not in_few_cells(imu_spec("consumer"), PLACE.lat)


def test_same_bits_whoever_came_before():
    first, second = (align(record_of(37.0, seed), PLACE, "navigation") for seed in (1, 2))
    forget()
    again = align(record_of(37.0, 2), PLACE, "navigation")
    for name in ("C_nb", "phi_covariance", "phi_floor", "gyro_bias", "accel_bias", "gyro_bias_sigma"):
        np.testing.assert_array_equal(getattr(second, name), getattr(again, name), err_msg=name)
    assert second.evidence == again.evidence
    assert not np.array_equal(first.C_nb, second.C_nb)


def test_as_without_cells(monkeypatch):
    records = [record_of(37.0, seed) for seed in range(4)]
    found = [align(record, PLACE, "navigation") for record in records]
    monkeypatch.setattr("truenorth.alignment.procedure.in_few_cells", lambda spec, lat: False)
    for record, cell in zip(records, found, strict=True):
        own = align(record, PLACE, "navigation")
        assert own.status == cell.status
        assert [e.key for e in own.evidence] == [e.key for e in cell.evidence]
        off = misalignment(cell.C_nb, own.C_nb) / np.sqrt(own.phi_covariance.diagonal())
        assert np.abs(off).max() < 0.01
        assert np.abs((cell.gyro_bias - own.gyro_bias) / own.gyro_bias_sigma).max() < 0.02
        np.testing.assert_allclose(cell.phi_covariance.diagonal(), own.phi_covariance.diagonal(), rtol=2e-3)


def test_quaternion_is_that_of_the_library():
    for C in (
        np.eye(3),
        *Rotation.random(50, rng=np.random.default_rng(1)).as_matrix(),
        *(np.diag(d) for d in HALF_TURNS),
    ):
        q = np.array(cells._quaternion(C.tolist()))
        np.testing.assert_allclose(np.sign(q @ quaternion_from_dcm(C)) * q, quaternion_from_dcm(C), atol=1e-15)
