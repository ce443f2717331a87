"""Transfer alignment: the real recording, bad and odd masters."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from tests import recordings
from tests.runs import some
from truenorth.alignment import transfer
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_delay import find_delay
from truenorth.alignment.transfer_start import parted_clocks
from truenorth.core.attitude import dcm_from_euler, rotation_vector_from_dcm
from truenorth.core.errors import DataError, UsageError
from truenorth.errors.master import MasterErrors
from truenorth.records import ImuRecord, MasterRecord
from truenorth.simulation import FlexureSpec

ARCMIN, DEG_PER_HOUR = np.radians(1.0 / 60.0), np.radians(1.0) / 3600.0


@pytest.fixture(scope="module")
def real():
    return recordings.transfer_fog_mems()


@pytest.fixture
def without_rivals(monkeypatch):
    """Alignments do not ask which other errors would explain their log: that adds evidence, and turns no attitude."""
    monkeypatch.setattr(transfer, "_rivals", lambda *_: [])


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
    assert "tilt about north, accelerometer bias x and mounting about y" in words
    assert any("left open by this motion" in reason for reason in found.reasons)


@pytest.mark.slow
def test_velocity_alone_takes_its_course_and_finds_the_same(real, found):
    slave, master = real
    blind = align_transfer(slave, replace(master, C_nb=None))
    difference = rotation_vector_from_dcm(blind.C_nb @ found.C_nb.T)
    assert np.all(np.abs(difference) < 4 * np.sqrt(np.diag(blind.phi_covariance)))
    assert blind.transfer.matching == "velocity"


@pytest.mark.usefixtures("without_rivals")
@pytest.mark.parametrize("offset", some([1234.5], [0.2]))
def test_a_master_that_is_late_or_on_another_clock_is_recognised(real, found, offset):
    slave, master = real
    late = align_transfer(slave, master.shifted(offset))
    assert late.transfer.delay == pytest.approx(offset + found.transfer.delay, abs=1e-3)
    assert "the found delay is taken" in late.reasons[1]
    np.testing.assert_allclose(late.C_nb, found.C_nb, atol=2e-4)


@pytest.mark.usefixtures("without_rivals")
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


@pytest.mark.usefixtures("without_rivals")
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


@pytest.mark.usefixtures("without_rivals")
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
    with pytest.raises(UsageError, match="seen by the master's attitude"):
        align_transfer(slave, replace(master, C_nb=None), flexure=FlexureSpec(sigma=(1e-3, 1e-3, 1e-3)))
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


@pytest.mark.usefixtures("without_rivals")
def test_only_what_is_unknown_is_estimated(real):
    slave, master = real
    known = {"delay_sigma": 0.0, "lever_arm_sigma": 0.0, "mounting_sigma": 0.0, "master_errors": "filter=0 s"}
    result = align_transfer(slave, master, delay=0.016, **known)
    assert result.transfer.delay_sigma == 0.0
    assert not result.transfer.delay_estimated
    assert "33 states" in result.method_reason  # the INS, and axes of gyros and accelerometers


@pytest.mark.usefixtures("without_rivals")
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
