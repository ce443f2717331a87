"""Position and acceleration matching: the truth where nothing is noisy, honest sigmas where it is, and what each needs."""

from dataclasses import replace

import numpy as np
import pytest

from tests.alignment.test_transfer_axes import ARM, ship
from tests.alignment.test_transfer_loop import ARCMIN, DEG, DEG_PER_HOUR, SPAN, TACTICAL
from tests.runs import few_and_all, some
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_filter import Assumed, Matching, master_aiding, transfer_filter
from truenorth.alignment.transfer_turns import slopes_at
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.errors import UsageError
from truenorth.errors.master import DELAY, MasterErrors, TransferModel
from truenorth.estimate.linear import rows_along
from truenorth.papers.transfer.truth import Case, Flights
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.simulation.gnss import moved, place_of
from truenorth.state.state import Start, State

ARM_TRUE = np.array([0.5, 1.0, -0.3])
NOISE = {"position": 1.0, "acceleration": 0.02}


def master_of(flight, tau, arm, run=None):
    """Its record; with a run's number with white noise of place and force."""
    spec = MasterSpec(clock_offset=tau, lever_arm=tuple(arm), with_sensors=True)
    if run is None:
        return simulate_sensor(flight, spec, duration=SPAN).record
    spec = replace(spec, velocity_noise=0.05, attitude_noise=ARCMIN)
    record = simulate_sensor(flight, spec, duration=SPAN, seed=5, run=run).record
    rng = np.random.default_rng([6, run])
    lat, lon, alt = moved(record.lat, record.lon, record.alt, NOISE["position"] * rng.standard_normal((len(record), 3)))
    force = record.f_b + NOISE["acceleration"] * rng.standard_normal((len(record), 3))
    return replace(record, lat=lat, lon=lon, alt=alt, f_b=force)


@pytest.mark.parametrize(
    ("kind", "sigma", "tau"), [("position", 0.01, 0.04), ("acceleration", 1e-3, 0.04), ("acceleration", 1e-3, 0.0457)]
)
def test_without_noise_it_finds_the_truth(flight, ideal, kind, sigma, tau):
    """From 3 deg off, the arm known, as a constant speed ties it to the delay: delay to .5 ms, level and heading to .2 arcmin.

    Rows between two samples: the slave's force is that of the row's very time.
    """
    slave, master = simulate(ideal).record, master_of(flight, tau, ARM_TRUE)
    model = TransferModel(1e-7, 1e-6, arm_considered=kind == "acceleration")
    at = flight.states(np.array(0.0))
    P = model.prior(0.1, 3 * DEG, 1e-4, 5 * DEG_PER_HOUR, tau=0.05, arm=1e-3)
    C = dcm_from_rotation_vector([0.02, -0.03, 0.05]) @ at.C_nb
    start, assumed = Start.of(State.at(C, at.lat, at.lon, at.alt, at.v_n), P), Assumed(np.array(ARM_TRUE))
    track = transfer_filter(slave, master, model, start, Matching(sigma, translation=kind), assumed)
    true = flight.states(track.time[-1:]).C_nb
    assert track.sensors[-1][model.slice_of(DELAY)][0] == pytest.approx(tau, abs=5e-4)
    phi = rotation_vector_from_dcm(track.C_nb[-1:] @ np.swapaxes(true, 1, 2))
    np.testing.assert_allclose(phi, 0, atol=0.2 * ARCMIN)


def test_a_position_tells_a_delay_by_the_velocity_of_the_master():
    """Its column is the derivative of where the master is: on an arm of 26 m of a ship that rolls, not that of the slave."""
    way, model, at = ship(np.random.default_rng(1), 60.0), TransferModel(), np.array([41.3, 42.3])

    def measured(late):
        lat, lon, alt, v_n = place_of(way.states(at - late), -ARM)
        master = MasterRecord(at, v_n=v_n, lat=lat, lon=lon, alt=alt, source="made")
        (source,) = master_aiding(master, model, Assumed(ARM), Matching(1.0, translation="position"))
        return rows_along(way.states(at), [source], model.ins)

    (early, _), (now, H), (late, _) = (measured(tau) for tau in (-1e-3, 0.0, 1e-3))
    column = H[:, :, model.slice_of(DELAY)][..., 0]
    np.testing.assert_allclose((late - early) / 2e-3, column, atol=1e-3)
    np.testing.assert_allclose(now, 0.0, atol=1e-4)
    assert np.abs(column - way.states(at).v_n).max() > 0.3  # m/s


@pytest.mark.slow
@few_and_all(12, few=1)
@pytest.mark.parametrize("grade", ["tactical", "consumer"])
def test_positions_of_a_master_far_away(grade, runs):
    """15 to 40 m away, the arm known to .5 m, its axes to 3 deg: aligned and honest; two of five were refused.

    The master's velocity is .05 m/s off, as is said of it: against its positions it is turned by half a degree.
    """
    spec, total, errors = imu_spec(grade), 0.0, MasterErrors(velocity=0.05)
    for run in range(runs):
        rng = np.random.default_rng([44, run])
        way, toward = ship(rng, 200.0), rng.standard_normal(3) * [1.0, 1.0, 0.3]
        arm = rng.uniform(15.0, 40.0) * toward / np.linalg.norm(toward)
        late, mount = 0.05 * rng.standard_normal(), 3 * DEG * rng.standard_normal(3)
        sensor = MasterSpec(clock_offset=late, lever_arm=tuple(arm), mounting=tuple(mount), velocity=0.05)
        slave = simulate(way, rate=100.0, duration=200.0, imu=spec, seed=44, run=run).record
        master = simulate_sensor(way, sensor, duration=200.0, seed=44, run=run).record
        given = tuple(arm + 0.5 * rng.standard_normal(3))
        known = {"lever_arm": given, "lever_arm_sigma": 0.5, "master_errors": errors}
        answer = align_transfer(slave, master, spec, matching="position", **known)
        t, phi = answer.transfer, -rotation_vector_from_dcm(answer.C_nb @ way.states(np.array(answer.time)).C_nb.T)
        ratio = phi / np.sqrt(np.diag(answer.phi_covariance))
        rest = np.append((t.lever_arm - arm) / t.lever_arm_sigma, (t.delay - late) / t.delay_sigma)
        assert answer.status == "aligned", answer.reasons
        assert max(np.abs(ratio).max(), np.abs(rest).max()) < 4.0, (ratio, rest)
        total += float(ratio @ ratio)
    assert total / (3 * runs) < 1.0 + 3.1 * np.sqrt(2 / (3 * runs))  # false alarms 1 in 1000


@pytest.mark.slow
@pytest.mark.parametrize("matching", some(["position", "acceleration+attitude"], ["acceleration", "position+attitude"]))
def test_sigmas_are_honest(flight, ideal, matching):
    """Attitude and gyro bias over 6 flights, and the delay: 42 numbers, false alarms 1 in 1000 above; the arm known to 2 cm."""
    total, runs = 0.0, 6
    for run in range(runs):
        simulation = simulate(ideal, imu=TACTICAL, seed=15, run=run)
        tau = 0.05 * float(np.random.default_rng([15, run]).standard_normal())
        master = master_of(flight, tau, ARM_TRUE, run)
        known = {"lever_arm": tuple(ARM_TRUE), "lever_arm_sigma": 0.02, "mounting_sigma": 0.02}
        result = align_transfer(simulation.record, master, TACTICAL, matching=matching, **known)
        t = result.transfer
        assert t.matching == matching
        true = flight.states(np.array(result.time)).C_nb
        phi = -rotation_vector_from_dcm(result.C_nb @ true.T)
        total += phi @ np.linalg.solve(result.phi_covariance, phi)
        total += np.sum(((result.gyro_bias - simulation.errors.gyro_bias) / result.gyro_bias_sigma) ** 2)
        total += ((t.delay - tau) / t.delay_sigma) ** 2
        kind = matching.partition("+")[0]
        assert getattr(t, f"{kind}_noise") == pytest.approx(NOISE[kind], rel=0.3)
    numbers = 7 * runs
    assert total / numbers < 1.0 + 3.1 * np.sqrt(2 / numbers)


def test_a_slope_does_not_see_a_manoeuvre_before_it_begins(flight):
    """Two seconds at rest in the air, then a jerk of 20 m/s^3: the derivatives before it are those of the noise."""
    t = 0.01 * np.arange(1.0, 401.0)
    force = np.array([0.0, 0.0, 9.8]) + 20.0 * np.maximum(t - 2.0, 0.0)[:, None] * np.array([1.0, 0.0, 0.0])
    rng = np.random.default_rng(2)
    force[:, :] += 1e-3 * rng.standard_normal(force.shape)
    record = ImuRecord(t, np.zeros_like(force), force, kind="rates")
    at = np.arange(0.24, 3.0, 0.1)  # the last before it at 1.94 s
    slopes = slopes_at(record, at)[:, 3]
    assert np.abs(slopes[at < 2.0]).max() < 0.2
    np.testing.assert_allclose(slopes[at > 2.2], 20.0, rtol=0.02)


@pytest.mark.slow
def test_acceleration_is_honest_with_an_arm_that_is_not_known():
    """Delay 50 ms and arm 1 m, one sigma each, drawn; level and heading after a hard turn, 20 flights: false alarms 1 in 1000."""
    flights, total, runs = Flights(Case("drawn", 77, space_time="drawn"), 5), 0.0, 20
    for run in range(runs):
        r = flights(run)
        spans = {"lever_arm_sigma": 1.0, "delay_sigma": 0.05, "mounting_sigma": DEG}
        spec = flights.scenario.imu_spec
        answer = align_transfer(r.slave.between(0.0, 150.0), r.felt, spec, matching="acceleration", **spans)
        phi = -rotation_vector_from_dcm(answer.C_nb @ r.motion.states(np.array(answer.time)).C_nb.T)
        total += phi @ np.linalg.solve(answer.phi_covariance, phi)
    assert total / (3 * runs) < 1.0 + 3.1 * np.sqrt(2 / (3 * runs))


def test_what_each_needs(flight, ideal):
    slave, master = simulate(ideal).record, master_of(flight, 0.0, ARM_TRUE)
    with pytest.raises(UsageError, match="needs its specific force"):
        align_transfer(slave, replace(master, f_b=None), matching="acceleration")
    with pytest.raises(UsageError, match="needs its position"):
        align_transfer(slave, replace(master, lat=None, lon=None, alt=None), matching="position+attitude")
    with pytest.raises(UsageError, match="position_noise is given, and velocity is matched"):
        align_transfer(slave, master, matching="velocity", position_noise=1.0)
