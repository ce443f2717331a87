"""Transfer alignment: the closed loop against the linear filter and the truth, the real recording, bad and odd masters."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from tests import recordings
from tests.runs import few_and_all, some
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_delay import find_delay
from truenorth.alignment.transfer_filter import Assumed, Linear, Matching, axes_along, transfer_filter
from truenorth.alignment.transfer_nominal import Nominal, found_by
from truenorth.alignment.transfer_start import parted_clocks
from truenorth.alignment.transfer_system import seen_states, system_of_motion
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.errors import DataError, UsageError
from truenorth.errors.master import ARM, DELAY, MOUNTING, MasterErrors, TransferModel
from truenorth.filters import kalman
from truenorth.records import ImuRecord, MasterRecord
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


@pytest.fixture(scope="module")
def real():
    return recordings.transfer_fog_mems()


AUTHOR = {
    "gyro": np.array([-0.00103577, 0.0007705, 0.00040954]) / DEG_PER_HOUR,
    "mounting": np.degrees([-0.00154277, 0.00071891, -0.00511199]),  # slave = (I - [mu x]) master
}


@pytest.fixture(scope="module")
def found(real):
    return align_transfer(*real)


def test_the_recording_agrees_with_its_author(found):
    """Gyro bias x, y within 10 and z within 15 deg/h, mounting heading within .15 deg; a delay of 10 to 20 ms."""
    assert found.status == "aligned"
    assert np.all(np.abs(found.gyro_bias / DEG_PER_HOUR - AUTHOR["gyro"]) < [10.0, 10.0, 15.0])
    heading, pitch, roll = np.degrees(found.transfer.mounting)
    mu = AUTHOR["mounting"]
    assert abs(heading + mu[2]) < 0.15
    assert abs(pitch - mu[0]) < 0.15
    assert abs(roll - mu[1]) < 0.15
    assert 0.010 < found.transfer.delay < 0.020
    assert found.transfer.delay_sigma < 0.005


def test_what_level_driving_does_not_tell_apart_is_named(found):
    """Tilt and accelerometer bias go together on a straight road; so does the mounting where nothing filters the velocity."""
    words = " ".join(found.transfer.open)
    assert "tilt about north and accelerometer bias x" in words
    assert any("left open by this motion" in reason for reason in found.reasons)


@pytest.mark.slow
def test_velocity_alone_takes_its_course_and_finds_the_same(real, found):
    slave, master = real
    blind = align_transfer(slave, replace(master, C_nb=None))
    difference = rotation_vector_from_dcm(blind.C_nb @ found.C_nb.T)
    assert np.all(np.abs(difference) < 4 * np.sqrt(np.diag(blind.phi_covariance)))
    assert blind.transfer.matching == "velocity"


@pytest.mark.parametrize("offset", some([1234.5], [0.2]))
def test_a_master_that_is_late_or_on_another_clock_is_recognised(real, found, offset):
    slave, master = real
    late = align_transfer(slave, master.shifted(offset))
    assert late.transfer.delay == pytest.approx(offset + found.transfer.delay, abs=1e-3)
    assert "the found delay is taken" in late.reasons[1]
    np.testing.assert_allclose(late.C_nb, found.C_nb, atol=2e-4)


def test_a_known_delay_is_compensated_without_a_word(real, found):
    slave, master = real
    said = align_transfer(slave, master.shifted(0.2), delay=0.2)
    assert said.transfer.notes == ()
    assert said.transfer.delay == pytest.approx(0.2 + found.transfer.delay, abs=1e-4)


def _without(master, gone):
    kept = ~gone
    return MasterRecord(
        **{name: getattr(master, name)[kept] for name in ("time", "C_nb", "v_n", "lat", "lon", "alt")},
        source="dropping",
    )


def test_ten_seconds_of_silence(real, found):
    slave, master = real
    result = align_transfer(slave, _without(master, (master.time > 20) & (master.time < 30)))
    assert any("silent for 10." in note for note in result.transfer.notes)
    np.testing.assert_allclose(rotation_vector_from_dcm(result.C_nb @ found.C_nb.T), 0, atol=2 * ARCMIN)


@pytest.mark.parametrize("size", some([0.5], [2.0]))
def test_a_jump_is_said_and_taken_up(real, found, size):
    slave, master = real
    v = master.v_n.copy()
    v[250:, 0] += size
    result = align_transfer(slave, replace(master, v_n=v))
    assert result.status == "aligned"  # the rows until it is taken up are no drift of the slave's
    assert len(result.transfer.jumps) == 1
    said = re.search(r"velocity jumped by (\S+) m/s", result.transfer.jumps[0])
    assert float(said[1]) == pytest.approx(size, rel=0.05)
    np.testing.assert_allclose(rotation_vector_from_dcm(result.C_nb @ found.C_nb.T), 0, atol=2 * ARCMIN)


def test_an_attitude_that_jumps_is_refused_for_that_reason(real):
    """By 3 deg of heading: the slave's own velocity does not turn with it."""
    slave, master = real
    turned = dcm_from_euler(math.radians(3.0), 0.0, 0.0) @ master.C_nb
    after = (np.arange(len(master)) >= 250)[:, None, None]
    result = align_transfer(slave, replace(master, C_nb=np.where(after, turned, master.C_nb)))
    assert result.status == "inconsistent"
    assert "align a part without the jump" in result.reasons[0]
    assert any("attitude jumped by 3 deg" in reason for reason in result.reasons)


@pytest.mark.slow
@pytest.mark.parametrize("how", ["steps", "runs"])
def test_a_clock_that_steps_or_runs_at_another_rate_is_named(real, how):
    """A second in the middle of the log, or 2 %: neither is a bad specification nor a lever arm."""
    slave, master = real
    time = master.time + (master.time > 25.0) if how == "steps" else 1.02 * master.time
    result = align_transfer(slave, replace(master, time=time))
    assert result.status == "inconsistent"
    assert "one of the clocks steps or runs at another rate" in result.reasons[0]
    assert sum("jumped by" in reason for reason in result.reasons) <= 3


def test_clocks_that_agree_are_not_parted(real):
    slave, master = real
    assert parted_clocks(slave, master, np.eye(3), 0.0) is None
    assert parted_clocks(slave, master.shifted(300.0), np.eye(3), 300.0) is None
    assert parted_clocks(slave, replace(master, C_nb=None), np.eye(3), 0.0) is None
    assert parted_clocks(slave, master[:5], np.eye(3), 0.0) is None
    assert parted_clocks(slave, master, np.eye(3), 1e4) is None


def test_a_master_that_runs_before_and_after_the_slave_has_one_clock():
    """What it shows there is like something that the slave shows, by chance: sound logs were refused for "417 s"."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 300.0, 0.1)
    turns = np.cumsum(np.convolve(rng.standard_normal(len(time)), np.ones(40) / 40.0, "same")) * 0.02
    turns[time > 200.0] = turns[(time > 100.0) & (time <= 200.0)][
        : np.count_nonzero(time > 200.0)
    ]  # the same turns once more
    C = dcm_from_euler(turns, 0.0 * turns, 0.0 * turns)
    gyro = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:]) / 0.1
    slave = ImuRecord(time[1:], gyro, np.tile([0.0, 0.0, 9.8], (len(gyro), 1)))
    master = MasterRecord(time, C)
    assert parted_clocks(slave.between(90.0, 170.0), master, np.eye(3), 0.0) is None
    late = replace(master, time=time + (time > 130.0))
    assert parted_clocks(slave.between(90.0, 170.0), late, np.eye(3), 0.0) is not None


def test_wild_rows_are_left_out(real, found):
    slave, master = real
    v = master.v_n.copy()
    v[100::37, 0] += 3.0
    result = align_transfer(slave, replace(master, v_n=v))
    assert result.transfer.rejected == 11
    np.testing.assert_allclose(rotation_vector_from_dcm(result.C_nb @ found.C_nb.T), 0, atol=ARCMIN)


def test_wrong_axes_of_the_slave_are_a_contradiction(real):
    slave, master = real
    result = align_transfer(slave.rotated([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]), master)
    assert result.status == "inconsistent"
    assert "mounting" in result.reasons[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{"imu": "tactical"}, {"imu": "navigation"}, {"imu": "tactical", "matching": "velocity"}]
)
def test_a_specification_that_is_far_too_good_is_a_contradiction(real, options):
    """Gyro biases of 200 deg/h where 1 deg/h is promised: the answer would be half a degree off."""
    result = align_transfer(*real, **options)
    assert result.status == "inconsistent"
    assert "larger than its specification" in result.reasons[0]


def test_clocks_that_cannot_be_brought_together_are_refused(real):
    slave, master = real
    other = replace(master, C_nb=None).between(30.0, 50.0).shifted(300.0)
    with pytest.raises(DataError, match="no shift makes their motion agree"):
        align_transfer(slave.between(0.0, 20.0), other)


def test_the_delay_by_motion_alone(real):
    slave, master = real
    for shift in (0.0, -3.21, 500.0):
        for record in (master, replace(master, C_nb=None)):
            delay = find_delay(slave, record.shifted(shift), np.eye(3))
            assert delay.sure
            assert delay.delay - shift == pytest.approx(0.015, abs=0.02)


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


def test_the_answer_can_be_drawn_saved_and_said(found, tmp_path):
    summary = json.loads(json.dumps(found.summary(), allow_nan=False))
    assert summary["matching"] == "both"
    assert 10 < summary["delay_ms"] < 20
    assert summary["delay_estimated"] is True
    assert len(found.to_frame()) == 499
    assert found.plot() is not None
    names = {path.name for path in found.save(tmp_path)}
    assert {"summary.json", "history.parquet", "report.html"} <= names


def test_the_history_converges_on_the_answer(found):
    """What each epoch said of the final attitude is within its sigmas: no epoch beyond five."""
    value, sigma = found.convergence
    late = found.history.time > 20
    assert np.all(np.abs(value - found.euler)[late] < 5 * sigma[late])


def test_navigation_goes_on_with_the_velocity_it_had(real, found):
    """Not from rest: the start's velocity is the master's within .2 m/s, and its attitude covariance the answer's."""
    from truenorth.navigation.start import start_from_alignment

    start = start_from_alignment(found)
    np.testing.assert_allclose(start.v_n, real[1].v_n[-1], atol=0.2)
    assert np.linalg.norm(start.v_n) > 10.0
    np.testing.assert_allclose(np.diag(start.P)[:3], np.diag(found.phi_covariance), rtol=1e-6)
    np.testing.assert_allclose(np.diag(start.P)[9:12], found.gyro_bias_sigma**2, rtol=1e-6)


def test_bad_requests(real):
    slave, master = real
    with pytest.raises(UsageError, match="needs its attitude"):
        align_transfer(slave, replace(master, C_nb=None), matching="attitude")
    with pytest.raises(UsageError, match="match attitude too"):
        align_transfer(slave, master, matching="velocity", flexure=FlexureSpec(sigma=(1e-3, 1e-3, 1e-3)))
    with pytest.raises(UsageError, match="lever_arm is"):
        align_transfer(slave, master, lever_arm=(1.0, 2.0))
    with pytest.raises(UsageError, match="delay_sigma is -1 s"):
        align_transfer(slave, master, delay_sigma=-1.0)
    with pytest.raises(UsageError, match="mounting_sigma is -2 deg"):
        align_transfer(slave, master, mounting_sigma=math.radians(-2.0))
    with pytest.raises(UsageError, match="or the slave's `heading`"):
        align_transfer(slave, replace(master, C_nb=None, v_n=0.0 * master.v_n))
    with pytest.raises(UsageError, match="`place`"):
        align_transfer(slave, replace(master, lat=None, lon=None, alt=None))
    with pytest.raises(DataError, match="gap of"):
        align_transfer(slave._with(time=np.where(slave.time > 25, slave.time + 5, slave.time)), master)


def test_only_what_is_unknown_is_estimated(real):
    slave, master = real
    known = {"delay_sigma": 0.0, "lever_arm_sigma": 0.0, "mounting_sigma": 0.0, "master_errors": "filter=0 s"}
    result = align_transfer(slave, master, delay=0.016, **known)
    assert result.transfer.delay_sigma == 0.0
    assert not result.transfer.delay_estimated
    assert "33 states" in result.method_reason  # the INS, and axes of gyros and accelerometers


def test_ideal_spec_of_the_slave_is_possible(flight, ideal):
    """A specification of zeros: the covariance must not break down."""
    slave = simulate(ideal).record
    master = simulate_sensor(flight, MASTER, duration=SPAN).record
    assert align_transfer(slave, master, ImuSpec()).status == "aligned"


def test_errors_of_the_master_count_in_sigma_and_not_in_the_sigma_against_it(real, found):
    """The mean of 2 arcmin of heading cannot be seen by a slave: absolute sigma is no less; the answer hardly moves."""
    slave, master = real
    result = align_transfer(slave, master, master_errors="navigation")
    heading = np.sqrt(result.phi_covariance[2, 2])
    assert heading > 0.9 * 2.0 * ARCMIN
    assert result.transfer.relative_sigma[0] < 0.8 * heading
    np.testing.assert_allclose(found.transfer.relative_sigma[0], np.sqrt(found.phi_covariance[2, 2]), rtol=1e-2)
    off = rotation_vector_from_dcm(result.C_nb @ found.C_nb.T)
    assert np.all(np.abs(off) < 3 * np.sqrt(np.diag(result.phi_covariance)))
    with pytest.raises(UsageError, match="expected one of navigation"):
        align_transfer(slave, master, master_errors="perfect")
    assert "transfer.absolute" in [item.key for item in result.evidence]
    assert "transfer.relative" in [item.key for item in found.evidence]


@pytest.mark.slow
def test_positions_bear_the_masters_velocity_error_into_navigation(real):
    """The slave's velocity is against the master's: what navigation begins with has the error that was said of it."""
    slave, master = real
    errors = [MasterErrors(level=1e-4, heading=1e-3, velocity=v) for v in (0.0, 0.4)]
    sound, stated = (align_transfer(slave, master, matching="position", master_errors=e).transfer.P for e in errors)
    np.testing.assert_allclose(np.diag(stated - sound)[3:6], 0.16, rtol=1e-6)
