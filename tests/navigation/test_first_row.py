"""A start that lies within a row of the IMU, as that of a transfer does: the row counts from there."""

import functools
import math

import numpy as np
import pytest

import truenorth as tn
from truenorth.core.attitude import misalignment
from truenorth.live import Navigator
from truenorth.navigation import Start
from truenorth.navigation.procedure import FINE
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, simulate

PLACE, SPEC = tn.Position.from_degrees(45.0, 10.0), imu_spec("navigation")
SIGMA = np.repeat([1e-4, 0.01, 3.0, SPEC.gyro_bias, SPEC.accel_bias], 3)
SHIP = Sway(PLACE, roll_tones=(Tone(0.1, 9.0, 0.4),), pitch_tones=(Tone(0.05, 7.0),), lever_arm=(1.0, 5.0, 2.0))


def start_at(time, within=True):
    q, zero = SHIP.states(time), np.zeros(3)
    place = (float(q.lat), float(q.lon), float(q.alt))
    return Start(time, q.C_nb, q.v_n, *place, zero, zero, np.diag(SIGMA**2), within=within)


def live(record, start):
    run = Navigator(start, SPEC, kind=record.kind, altitude="free")
    run.push(record.time, record.gyro, record.accel)
    return run.answer.time, run.answer.C_nb, run.answer.motion.v_n


def batch(record, start):
    track = tn.navigate(record, start, imu=SPEC, altitude="free").track
    return track.time[-1], track.C_nb[-1], track.v_n[-1]


@pytest.mark.parametrize("by", [batch, live])
@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("time", [2.001, 2.011, 2.029, 2.039])  # of rows of 40 ms
def test_the_turn_from_the_epoch_on_counts_and_no_other(by, kind, time):
    record = simulate(SHIP, rate=25.0, duration=10.0, kind=kind).record
    at, C_nb, v_n = by(record, start_at(time))
    true = SHIP.states(at)
    assert np.abs(misalignment(C_nb, true.C_nb)).max() < 2e-5
    assert np.abs(v_n - true.v_n).max() < 2e-3


def test_an_epoch_at_the_end_of_a_row_is_as_it_was():
    record = simulate(SHIP, rate=25.0, duration=10.0).record
    one, other = (batch(record, start_at(2.0, within)) for within in (True, False))
    assert math.isclose(one[0], other[0])
    np.testing.assert_allclose(one[1], other[1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(one[2], other[2], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("rows", [0.0, 0.6, 1.0, 1.4])
def test_a_start_in_the_last_rows_has_nothing_to_go_on_with(rows):
    """It ended in a message about a record of one sample."""
    record = simulate(SHIP, rate=50.0, duration=20.0, imu=SPEC).record
    with pytest.raises(tn.DataError, match="goes on from it"):
        tn.navigate(record, start_at(float(record.time[-1]) - rows * record.interval), imu=SPEC)


@functools.cache
def _log(kind, duration):
    return simulate(SHIP, rate=25.0, duration=duration, imu=SPEC, seed=2, kind=kind).record


def _lost_after(start, lost, kind, slack=1e-6, duration=8.0):
    """The ship's log without the rows of a while after the start's epoch."""
    record = _log(kind, duration)
    keep = (record.time < start + slack) | (record.time > start + lost + slack)
    return tn.ImuRecord(record.time[keep], record.gyro[keep], record.accel[keep], kind)


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("lost", [0.04, 0.2, 0.8])
def test_rows_that_are_lost_right_after_the_epoch_are_bridged_and_counted(lost, kind):
    """The first row was taken for the next one: velocity was 7 to 538 sigmas off live, in silence, and of a whole log as well."""
    record, start = _lost_after(2.0, lost, kind), start_at(2.0, within=False)
    whole = tn.navigate(record, start, imu=SPEC, altitude="free")
    run = Navigator(start, SPEC, kind=kind, altitude="free")
    run.push(record.time, record.gyro, record.accel)
    for time, C_nb, v_n, sigma in (
        (whole.time[-1], whole.C_nb[-1], whole.v_n[-1], whole.track.sigma[-1]),
        (
            run.answer.time,
            run.answer.C_nb,
            run.answer.motion.v_n,
            np.append(run.answer.sigma, run.answer.motion.v_sigma),
        ),
    ):
        true = SHIP.states(time)
        assert np.abs(misalignment(C_nb, true.C_nb)).max() < 4.0 * sigma[:3].max()
        assert np.abs((v_n - true.v_n) / sigma[3:6]).max() < 4.0
    assert len(whole.gaps) == len(run._loop.gaps) == (lost > 0.04)  # of one row the made one takes the place
    at_once = tn.navigate(_lost_after(2.0, 0.0, kind), start, imu=SPEC, altitude="free").track
    assert lost < 0.5 or whole.track.sigma[-1, 3] > 2.0 * at_once.sigma[-1, 3]
    if lost > 0.04:
        assert run.finish().gaps == pytest.approx(np.array(whole.gaps))


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("rows", [0, 1, 2, 3, 20])
def test_rows_lost_after_an_epoch_within_a_row_count_once(rows, kind):
    """Of increments the row made for them counted up to half a row twice: velocity was 9 sigmas off, attitude 4."""
    for off in np.arange(1, 10) / 10.0:
        start = start_at(12.0 + 0.04 * off)
        record = _lost_after(start.time, 0.04 * (rows - off) if rows else 0.0, kind, duration=16.0)
        whole = tn.navigate(record, start, imu=SPEC, altitude="free", interval=FINE, output=1.0)
        run = Navigator(start, SPEC, kind=kind, altitude="free")
        run.push(record.time, record.gyro, record.accel)
        for track in (whole.track, run.past.track):
            true = SHIP.states(track.time)
            assert np.abs((track.v_n - true.v_n) / track.sigma[:, 3:6]).max() < 3.0, off
            turned = misalignment(track.C_nb[-1], SHIP.states(track.time[-1]).C_nb)
            assert np.abs(turned / track.sigma[-1, :3]).max() < 3.0, off
        apart = np.abs(run.answer.motion.v_n - whole.v_n[-1]) / whole.track.sigma[-1, 3:6]
        assert run.answer.time == whole.time[-1]
        assert apart.max() < 0.2, off  # of rates, where none is lost
        ended = run.finish()  # it has the last 10 s of the 12 before the start
        assert ended.gaps == whole.gaps
        for name in ("time", "v_n", "C_nb", "P"):
            np.testing.assert_array_equal(getattr(ended.track, name), getattr(whole.track, name))


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("lost", [0.06, 0.4])
def test_a_look_back_takes_the_row_that_was_made_anew(kind, lost, tmp_path):
    """In a run that was saved and goes on, too."""
    record, start = _lost_after(2.02, lost, kind), start_at(2.012)
    one, run = (Navigator(start, SPEC, kind=kind, altitude="free") for _ in range(2))
    one.push(record.time, record.gyro, record.accel)
    half = record.time < 5.0
    run.push(record.time[half], record.gyro[half], record.accel[half])
    run = Navigator.load(run.save(tmp_path / "run.npz"))
    loop = run._loop
    loop._take_anew(loop._taken(run.log), loop.shown, run.feeds, run.log)
    run.push(record.time[~half], record.gyro[~half], record.accel[~half])
    assert len(loop._first) == 1
    assert loop.gaps == one._loop.gaps
    np.testing.assert_allclose(run.answer.C_nb, one.answer.C_nb, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(run.answer.motion.v_n, one.answer.motion.v_n, rtol=0.0, atol=1e-12)
    off = run.answer.motion.v_n - SHIP.states(run.answer.time).v_n
    assert np.abs(off / run.answer.motion.v_sigma).max() < 3.0


@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("ends", [0.5, 1.5])  # s behind the gap; in the first one late rows may still fill it
def test_a_log_that_ends_soon_after_a_gap_at_the_epoch_is_finished_as_a_whole_one(kind, ends):
    """It was refused: "runs from .. s, but the alignment holds at .. s"."""
    lost, start = _lost_after(2.0, 0.2, kind), start_at(2.0)
    record = lost.between(None, 2.2 + ends)
    run = Navigator(start, SPEC, kind=kind, altitude="free")
    run.push(1.99, [0.0, 0.0, 1e9], [0.0, 0.0, 9.8])  # no sensor measures this: left out
    run.push(record.time, record.gyro, record.accel)
    assert (run.answer is None) == (ends < 1.0)
    whole = tn.navigate(record, start, imu=SPEC, altitude="free", interval=FINE, output=1.0)
    np.testing.assert_array_equal(run.finish().track.v_n, whole.track.v_n)


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_a_gap_right_after_the_epoch_that_is_too_long_is_refused(kind):
    record, start = _lost_after(2.0, 1.2, kind), start_at(2.0, within=False)
    with pytest.raises(tn.DataError, match=r"expected gaps of 1 s at most"):
        tn.navigate(record, start, imu=SPEC, altitude="free")
    run = Navigator(start, SPEC, kind=kind, altitude="free")
    run.push(record.time, record.gyro, record.accel)
    assert run.answer is None
    assert "expected 1 s at most" in run.failure


def test_rows_that_come_late_fill_a_gap_right_after_the_epoch():
    """Rows out of order by less than a second: the loop waits for them, and is the one of rows in order, to the bit."""
    record, start = _lost_after(2.0, 0.0, "increments"), start_at(2.0, within=False)
    late = (record.time > 2.02) & (record.time < 2.51)
    now = (record.time > 2.51) & (record.time < 3.01)
    one, other = (Navigator(start, SPEC, kind="increments", altitude="free") for _ in range(2))
    for rows in (record.time < 2.02, now, late, record.time > 3.01):
        one.push(record.time[rows], record.gyro[rows], record.accel[rows])
    other.push(record.time, record.gyro, record.accel)
    assert one._loop.gaps == []
    np.testing.assert_array_equal(one.answer.C_nb, other.answer.C_nb)
    np.testing.assert_array_equal(one.answer.motion.v_n, other.answer.motion.v_n)
