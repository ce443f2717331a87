"""Transfer alignment: the closed and the open loop against the linear filter and the truth."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_filter import Assumed, Linear, Matching, axes_along, transfer_filter
from truenorth.alignment.transfer_nominal import Nominal, found_by
from truenorth.alignment.transfer_system import seen_states, system_of_motion
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.errors.master import ARM, DELAY, MOUNTING, TransferModel
from truenorth.filters import kalman
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import FlexureSpec, MasterSpec, ideal_log, simulate, simulate_sensor
from truenorth.state.state import Start, State

DEG, ARCMIN, DEG_PER_HOUR = np.radians(1.0), np.radians(1.0 / 60.0), np.radians(1.0) / 3600.0
SPAN = 60.0
TACTICAL = replace(imu_spec("tactical"), gyro_scale_factor=0.0, gyro_misalignment=0.0, accel_scale_factor=0.0)
TACTICAL = replace(TACTICAL, accel_misalignment=0.0, gyro_bias_instability=0.0, accel_bias_instability=0.0)
ARM_TRUE, MOUNT_TRUE, TAU_TRUE = (0.5, 1.0, -0.3), (0.02, -0.01, 0.015), 0.04
MASTER = MasterSpec(
    latency=TAU_TRUE, lever_arm=ARM_TRUE, mounting=MOUNT_TRUE, velocity_noise=0.05, attitude_noise=2 * ARCMIN
)


def _phi(result, flight):
    """True misalignment of an answer, rad."""
    true = flight.states(np.array(result.time)).C_nb
    return -rotation_vector_from_dcm(result.C_nb @ true.T)


def _start(flight, model, C_mb_true):
    at = flight.states(np.array(0.0))
    P = model.prior(0.1, 1e-6, 1e-2, 5 * DEG_PER_HOUR, tau=0.05, arm=1.0, mounting=3 * DEG, C_nb=at.C_nb)
    C = at.C_nb @ C_mb_true.T
    return Start.of(State.at(C, at.lat, at.lon, at.alt, at.v_n), P)


def test_the_motion_found_begins_where_the_slave_did(flight, ideal):
    """Led back from the end by ideal gyros: to an arcsec at the start, with what was found of seat and delay."""
    spec = replace(MASTER, velocity_noise=0.0, attitude_noise=0.0)
    slave, master = simulate(ideal).record, simulate_sensor(flight, spec, duration=SPAN).record
    model = TransferModel(1e-7, 1e-6, mounting=True)
    track = transfer_filter(
        slave, master, model, _start(flight, model, dcm_from_euler(*MOUNT_TRUE)), Matching(1e-3, 1e-5)
    )
    found = found_by(slave, track, model)
    true = flight.states(np.array(0.0)).C_nb
    end = rotation_vector_from_dcm(track.C_nb[-1] @ flight.states(track.time[-1]).C_nb.T)
    np.testing.assert_allclose(rotation_vector_from_dcm(found.C_nb @ true.T), end, atol=ARCMIN / 60.0)
    for part in (MOUNTING, DELAY):
        at = model.slice_of(part)
        np.testing.assert_array_equal(found.values[at], track.sensors[-1, at])


def test_without_noise_it_finds_the_truth(flight, ideal):
    """Delay to .02 ms, lever arm to 5 mm, mounting and attitude to .02 arcmin: R stays, the data are exact."""
    spec = replace(MASTER, velocity_noise=0.0, attitude_noise=0.0)
    slave, master = simulate(ideal).record, simulate_sensor(flight, spec, duration=SPAN).record
    C_mb = dcm_from_euler(*MOUNT_TRUE)
    model = TransferModel(1e-7, 1e-6, mounting=True)
    track = transfer_filter(slave, master, model, _start(flight, model, C_mb), Matching(1e-3, 1e-5))
    aux = track.sensors[-1]
    assert aux[model.slice_of(DELAY)][0] == pytest.approx(TAU_TRUE, abs=2e-5)
    np.testing.assert_allclose(aux[model.slice_of(ARM)], ARM_TRUE, atol=5e-3)
    np.testing.assert_allclose(
        rotation_vector_from_dcm(axes_along(track, Assumed())[-1].T @ C_mb), 0, atol=0.02 * ARCMIN
    )
    true = flight.states(track.time[-1:]).C_nb
    np.testing.assert_allclose(
        rotation_vector_from_dcm(track.C_nb[-1:] @ np.swapaxes(true, 1, 2)), 0, atol=0.02 * ARCMIN
    )


def test_its_covariance_is_that_of_the_linear_filter(flight, ideal):
    """Along the true motion, the same rows: sigmas within 2 % before the turn, .5 % from then on.

    Before it heading and mounting cannot be separated: a filter that linearises about its own corrections has there a tenth of
    the sigma that it should have.
    """
    spec, C_mb = replace(MASTER, lever_arm=(0.0, 0.0, 0.0)), dcm_from_euler(*MOUNT_TRUE)
    slave, master = simulate(ideal).record, simulate_sensor(flight, spec, duration=SPAN).record
    model = TransferModel(TACTICAL.gyro_random_walk, TACTICAL.accel_random_walk, mounting=True)
    start = _start(flight, model, C_mb)
    C_nb = flight.states(master.time - TAU_TRUE).C_nb
    linear = Linear(C_nb @ C_mb.T, C_nb)
    matching = Matching(0.05, 2 * ARCMIN)
    track = transfer_filter(slave, master, model, start, matching, Assumed(delay=TAU_TRUE), linear=linear)
    R = np.repeat([0.05**2, (2 * ARCMIN) ** 2], 3)
    system = system_of_motion(flight, model, start.P, R, SPAN - 0.1, step=0.1, C_mb=C_mb)
    expected = np.squeeze(kalman(system, history="sigma", innovations=False).sigma)
    seen = seen_states(model)
    for at, tolerance in ((5.0, 0.02), (9.0, 0.02), (20.0, 0.005), (30.0, 0.005), (59.0, 0.005)):
        k, j = np.argmin(np.abs(track.time - at)), round(at / 0.1) - 1
        np.testing.assert_allclose(track.sigma[k][seen], expected[j], rtol=tolerance)


def test_an_open_loop_does_not_depend_on_what_it_is_about(flight, ideal):
    """About a motion 1 mrad and 2 ms off, the answer moves by 3 % of that at the most: the prior counts as it was given.

    The covariance is that of the linear filter along the true motion, before the turn too, without any attitudes given.
    """
    spec, C_mb = replace(MASTER, lever_arm=(0.0, 0.0, 0.0)), dcm_from_euler(*MOUNT_TRUE)
    slave, master = simulate(ideal).record, simulate_sensor(flight, spec, duration=SPAN).record
    model = TransferModel(TACTICAL.gyro_random_walk, TACTICAL.accel_random_walk, mounting=True)
    start, matching = _start(flight, model, C_mb), Matching(0.05, 2 * ARCMIN)
    mount, tau = model.slice_of(MOUNTING), model.slice_of(DELAY)
    values = np.zeros(model.states)
    values[mount] = rotation_vector_from_dcm(C_mb)
    true = Nominal(flight.states(np.array(0.0)).C_nb, values, np.inf)
    off = np.zeros(model.states)
    off[:3], off[mount], off[tau] = [1e-3, -5e-4, 7e-4], [-5e-4, 1e-3, 3e-4], 2e-3
    first, other = (
        transfer_filter(slave, master, model, start, matching, Assumed(delay=TAU_TRUE), nominal=about)
        for about in (true, true.corrected(off, mount))
    )
    sigma = first.sigma[-1]
    moved = other.sensors[-1] - first.sensors[-1]
    moved[:3] = rotation_vector_from_dcm(first.C_nb[-1] @ other.C_nb[-1].T)
    assert np.abs(off / sigma).max() > 5.0
    assert np.abs(moved / sigma).max() < 0.03 * np.abs(off / sigma).max()
    np.testing.assert_allclose(other.sigma[-1], sigma, rtol=0.01)
    R = np.repeat([0.05**2, (2 * ARCMIN) ** 2], 3)
    system = system_of_motion(flight, model, start.P, R, SPAN - 0.1, step=0.1, C_mb=C_mb)
    expected, seen = np.squeeze(kalman(system, history="sigma", innovations=False).sigma), seen_states(model)
    for at in (5.0, 9.0, 20.0, 59.0):
        k, j = np.argmin(np.abs(first.time - at)), round(at / 0.1) - 1
        np.testing.assert_allclose(first.sigma[k][seen], expected[j], rtol=0.02)


@pytest.mark.slow
@few_and_all(12, few=4)
def test_sigmas_are_honest(flight, ideal, runs):
    """NEES of attitude, gyro bias, delay, arm: ten numbers a flight, false alarms 1 in 1000 on either side."""
    total = 0.0
    for run in range(runs):
        simulation = simulate(ideal, imu=TACTICAL, seed=5, run=run)
        rng = np.random.default_rng([5, run])
        arm, tau, mount = rng.standard_normal(3), 0.05 * rng.standard_normal(), 3 * DEG * rng.standard_normal(3)
        heading, pitch, roll = mount[2], mount[0], mount[1]
        spec = replace(MASTER, latency=0.0, clock_offset=tau, lever_arm=tuple(arm), mounting=(-heading, pitch, roll))
        master = simulate_sensor(flight, spec, duration=SPAN, seed=5, run=run).record
        result = align_transfer(simulation.record, master, TACTICAL, velocity_noise=0.05, attitude_noise=2 * ARCMIN)
        t = result.transfer
        phi = _phi(result, flight)
        total += phi @ np.linalg.solve(result.phi_covariance, phi)
        total += np.sum(((result.gyro_bias - simulation.errors.gyro_bias) / result.gyro_bias_sigma) ** 2)
        total += ((t.delay - tau) / t.delay_sigma) ** 2 + np.sum(((t.lever_arm - arm) / t.lever_arm_sigma) ** 2)
        assert result.status == "aligned"
    numbers = 10 * runs
    assert abs(total / numbers - 1.0) < 3.3 * np.sqrt(2 / numbers)


@pytest.mark.slow  # a kernel of its own size
def test_flexure_states_take_up_a_seat_that_bends(flight):
    """On a bending seat the filter without them is overconfident; with them the error is within 4 sigma."""
    from truenorth.simulation import Flexed

    bend = FlexureSpec(sigma=(6 * ARCMIN, 3 * ARCMIN, 3 * ARCMIN), correlation_time=5.0)
    moving = Flexed(flight, bend, duration=SPAN, seed=3)
    slave = simulate(ideal_log(moving, rate=100.0, duration=SPAN), imu=TACTICAL, seed=3).record
    master = simulate_sensor(flight, replace(MASTER, attitude_noise=0.2 * ARCMIN), duration=SPAN, seed=3).record
    noise = {"velocity_noise": 0.05, "attitude_noise": 0.2 * ARCMIN}
    with_states, without = (align_transfer(slave, master, TACTICAL, flexure=f, **noise) for f in (bend, None))

    def nees(result):
        phi = _phi(result, moving)
        return phi @ np.linalg.solve(result.phi_covariance, phi)

    assert nees(with_states) < 18.0  # 99.95 % of three
    assert nees(without) > 30.0 or without.status == "inconsistent"


def test_ideal_spec_of_the_slave_is_possible(flight, ideal):
    """A specification of zeros: the covariance must not break down."""
    slave = simulate(ideal).record
    master = simulate_sensor(flight, MASTER, duration=SPAN).record
    assert align_transfer(slave, master, ImuSpec()).status == "aligned"
