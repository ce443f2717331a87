"""Rows of the IMU that are lost under way: a running answer bridges them as the whole log does. Aids that come too late."""

import numpy as np
import pytest

from tests.live.test_siblings import SWELL, Anchored
from tests.runs import some
from truenorth.live import GnssFeed, Navigator, lasting
from truenorth.live.bridges import bridged, unbroken
from truenorth.live.log import Log
from truenorth.navigation import navigate
from truenorth.records import ImuRecord
from truenorth.simulation import simulate
from truenorth.state.layout import DV

LOST = ((20.0, 0.7), (40.0, 0.08), (40.2, 0.3), (44.0, 0.04))  # s: after which row, and how long


class Gappy(Anchored):
    """A vessel in a swell whose log of increments has gaps; without them where `lost` is empty."""

    def __init__(self, kind="increments", lost=LOST, duration=50.0):
        super().__init__(SWELL, "industrial", duration, 3)
        if kind != self.log.kind:
            self.log = simulate(SWELL, rate=25.0, duration=duration, imu=self.spec, seed=3, kind=kind).record
        keep = np.ones(len(self.log), dtype=bool)
        for after, length in lost:
            keep &= ~((self.log.time > after + 1e-6) & (self.log.time < after + length + 1e-6))
        self.log = ImuRecord(self.log.time[keep], self.log.gyro[keep], self.log.accel[keep], kind)

    def off_velocity(self, answers):
        true = self.motion.states(np.array([a.time for a in answers]))
        off = np.stack([a.motion.v_n for a in answers]) - true.v_n
        return off / np.stack([a.motion.v_sigma for a in answers])


@pytest.mark.parametrize("kind", some(["increments"], ["rates"]))
def test_gaps_are_bridged_as_in_the_whole_log(kind):
    """Gravity's 7 m/s of a lost 0.7 s were missing of a log of increments: 50 sigmas, and fixes were rejected for good."""
    case = Gappy(kind)
    run = case.run()
    answers = case.feed(run, 5, every=1.0)
    assert {a.status for a in answers} == {"navigated"}
    assert sum(r.rejected for r in run.residuals) == 0
    assert np.abs(case.off_velocity(answers)).max() < 4.0
    assert np.abs(case.off(answers)).max() < 4.0
    until = answers[-1].time
    aid = type(case.aid)(case.aid.record.between(None, until - 0.1), case.aid.mounting)
    whole = navigate(case.log.between(None, until), case.start, aid=aid, imu=case.spec, interval=0.2, output=1.0)
    apart = (answers[-1].motion.v_n - whole.v_n[-1]) / whole.track.sigma[-1, DV]
    assert np.abs(apart).max() < 0.5


def test_an_answer_that_has_a_gap_among_rows_still_to_be_taken_knows_of_it():
    """These rows wait for late measurements for a second; the answer is carried over them."""
    case = Gappy()
    run = case.run()
    case.feed(run, 1, until=20.0)
    before = run.answer
    case.feed(run, 1, since=20.0, until=20.84)
    after = run.answer
    assert after.time == pytest.approx(20.84)
    assert np.abs(case.off_velocity([after])).max() < 4.0
    assert (after.motion.v_sigma > 2.0 * before.motion.v_sigma).all()  # of what may have happened in 0.7 s


def test_gaps_in_any_chunks_saved_or_not_are_the_same_bits(tmp_path):
    case = Gappy(duration=45.0)
    one, other = case.run(), case.run()
    case.feed(one, 1)
    case.feed(other, 12, until=20.3)
    other = Navigator.load(other.save(tmp_path / "run.npz"))
    case.feed(other, 12, since=20.3)
    for name in ("v_n", "position", "v_sigma"):
        np.testing.assert_array_equal(getattr(one.answer.motion, name), getattr(other.answer.motion, name))


@pytest.mark.parametrize("kind", ["increments", "rates"])
def test_a_vehicle_that_stood_may_drive_off_in_a_gap(kind):
    """Its push before and behind it differs by 3 m/s^2: what it gained in 0.5 s is known to a step that came at any time."""
    time = 0.02 * np.arange(1.0, 4001.0)
    rows = np.zeros((len(time), 7))
    rows[:, 0] = time
    rows[:, 1:] = 0.001 * np.random.default_rng(1).standard_normal((len(time), 6))
    rows[-1, 5] += 3.0
    rows[-1, 0] += 0.5
    if kind == "increments":
        rows[:, 1:] *= 0.02
    log = Log(kind)
    log.add(rows)
    _, (possible,), gaps = bridged(rows[-50:], rows[-51], np.empty(0), 0.02, log, begins=False)
    assert len(gaps) == 1
    assert float(np.sqrt(possible.measured).max()) == pytest.approx(0.5 * 3.0 / np.sqrt(12.0), rel=0.01)


def test_rows_that_are_stamped_late_are_no_gaps():
    """Nothing is lost, and the clock comes back: gravity of a gap would be 17 sigmas of velocity."""
    case = Gappy(lost=(), duration=45.0)
    late = np.random.default_rng(2).random(len(case.log)) < 0.01
    late[:20] = late[-8:] = False
    case.log = ImuRecord(case.log.time + 0.03 * late, case.log.gyro, case.log.accel, "increments")
    run = case.run()
    answers = case.feed(run, 3, every=1.0)
    assert late.sum() > 5
    assert run._loop.gaps == []
    assert sum(r.rejected for r in run.residuals) == 0
    assert np.abs(case.off_velocity(answers)).max() < 4.0
    whole = navigate(case.log, case.start, aid=case.aid, imu=case.spec, interval=0.2, output=1.0)
    assert (whole.status, whole.gaps) == ("navigated", ())
    off = whole.v_n - case.motion.states(whole.time).v_n
    assert np.abs(off / whole.track.sigma[:, DV]).max() < 4.0


def test_stamps_of_milliseconds_make_no_gaps():
    """400 rows a second: steps of 2 and 3 ms, of which the longer ones are 1.5 times the shorter."""
    time = np.round(0.0025 * np.arange(1.0, 4001.0) + 0.0004, 3)
    rows = np.hstack([time[:, None], np.zeros((4000, 6))])
    log = Log("increments")
    log.add(rows)
    assert bridged(rows[1:], rows[0], np.empty(0), 0.002, log, begins=False)[1:] == ([], [])


def test_a_gap_that_an_answer_goes_across_is_one_that_the_loop_bridges():
    """Both go by the same interval: of stamps of milliseconds the rows' own pace is another one."""
    time = np.round(0.0025 * np.arange(1.0, 4001.0) + 0.0004, 3)
    time[3990:] += 1.0029 - (time[3990] - time[3989])
    rows = np.hstack([time[:, None], np.zeros((4000, 6))])
    log = Log("increments")
    log.add(rows)
    assert len(unbroken(rows[1:], rows[0], 0.003, begins=False)) == 3999
    _, _, gaps = bridged(rows[1:], rows[0], np.empty(0), 0.003, log, begins=False)
    assert len(gaps) == 1


@pytest.mark.parametrize("after", [3000, 3001, 3002, 3003])
@pytest.mark.parametrize("kind", ["increments", "rates"])
def test_what_may_have_happened_in_a_gap_is_the_same_of_rows_that_are_added_up(kind, after):
    """A row of several, and of rates one that holds the gap with gravity, says nothing of a step in it."""
    time = 0.01 * np.arange(1.0, 5001.0)
    time[after:] += 0.9
    rows = np.zeros((len(time), 7))
    rows[:, 0] = time
    rows[:, 1:] = 0.001 * np.random.default_rng(1).standard_normal((len(time), 6))
    rows[:, 6] += 9.8
    if kind == "increments":
        rows[:, 1:] *= 0.01
    log = Log(kind, most=1000)
    log.add(rows)
    assert log.merged > 1
    _, (possible,), gaps = bridged(rows[after - 5 :], rows[after - 6], np.empty(0), 0.01, log, begins=False)
    assert len(gaps) == 1
    assert float(np.sqrt(possible.measured).max()) < 0.9 * 0.01


def test_aids_that_come_too_late_are_called_so():
    """They were said to lie before the start or after the end of the log."""
    case = Gappy(lost=())
    run, fixes = case.run(), case.aid.record
    for first in range(0, len(case.log), 100):  # four seconds of rows, then the fixes of that time
        rows = slice(first, first + 100)
        run.push(case.log.time[rows], case.log.gyro[rows], case.log.accel[rows])
        of = (fixes.time > case.log.time[first]) & (fixes.time <= case.log.time[rows][-1])
        run.feeds["gnss"].push(
            fixes.time[of], fixes.lat[of], fixes.lon[of], fixes.alt[of], v_n=fixes.v_n[of],
            position_sigma=fixes.position_sigma[of], velocity_sigma=fixes.velocity_sigma[of],
        )  # fmt: skip
    said = " ".join(run.answer.reasons)
    assert "GNSS position" in said
    assert "came more than a second after the IMU's rows of their time" in said
    assert "before the start or after the end" not in said


def test_a_sensor_of_which_every_row_comes_too_late_is_named(monkeypatch):
    """A look back takes them, as long as one is to come."""
    case = Gappy(lost=(), duration=40.0)
    run = Navigator(case.start, case.spec, feeds=[GnssFeed()], mountings={"gnss": case.aid.mounting}, kind="increments")
    run.push(case.log.time, case.log.gyro, case.log.accel)
    fixes = case.aid.record.between(None, 30.0)
    run.feeds["gnss"].push(fixes.time, fixes.lat, fixes.lon, fixes.alt, v_n=fixes.v_n)
    monkeypatch.setattr(lasting, "LOOKS", ())
    run.push(case.log.time[-1] + [0.04, 0.08], case.log.gyro[-2:], case.log.accel[-2:])
    run.push(case.log.time[-1] + [1.04, 1.08], case.log.gyro[-2:], case.log.accel[-2:])
    assert any("came more than a second after" in reason for reason in run.answer.reasons)
