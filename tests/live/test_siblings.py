"""A running answer whose heading no acceleration shows: as unsure as its start and its gyro leave it; any chunks, saved or not."""

import numpy as np
import pytest

from benchmarks.honesty.circling import drawn_start, received
from tests.runs import some
from truenorth.core.attitude import misalignment
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.live import GnssFeed, Navigator, navigator, siblings
from truenorth.navigation import navigate
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, simulate

DOCK = Position.from_degrees(40.0, 118.0)
STILL = Sway(DOCK, heading=1.0)
CALM = Sway(DOCK, heading=1.0, roll_tones=(Tone(0.01, 6.0, 0.2),), heading_tones=(Tone(0.03, 17.0, 0.2),))
SWELL = Sway(DOCK, heading=1.0, roll_tones=(Tone(0.05, 6.0, 0.2),), north_tones=(Tone(0.3, 8.0, 0.2),))


class Anchored:
    """A log at one place with fixes, and a run on it."""

    def __init__(self, motion, grade, duration, seed):
        rng, self.spec = np.random.default_rng(seed), imu_spec(grade)
        self.motion = motion
        self.log = simulate(motion, rate=25.0, duration=duration, imu=self.spec, seed=seed).record
        self.start = drawn_start(motion, self.spec, rng)
        self.aid = received(motion, duration, 1.0, rng)

    def run(self, **options):
        mounted = {"gnss": self.aid.mounting}
        return Navigator(self.start, self.spec, feeds=[GnssFeed()], mountings=mounted, kind=self.log.kind, **options)

    def feed(self, run, chunk, *, since=-1.0, until=np.inf, every=None):
        """Rows after `since`, fixes a tenth of a second late; answers at every so many seconds."""
        fixes, answers = self.aid.record, []
        g = int(np.searchsorted(fixes.time, since - 0.1, side="right"))
        rows = self.log.between(since + 1e-6, until)
        for first in range(0, len(rows), chunk):
            part = slice(first, first + chunk)
            now = rows.time[part][-1]
            while g < len(fixes) and fixes.time[g] + 0.1 <= now:
                run.feeds["gnss"].push(
                    fixes.time[g], fixes.lat[g], fixes.lon[g], fixes.alt[g], v_n=fixes.v_n[g],
                    position_sigma=fixes.position_sigma[g], velocity_sigma=fixes.velocity_sigma[g],
                )  # fmt: skip
                g += 1
            run.push(rows.time[part], rows.gyro[part], rows.accel[part])
            if every is not None and now % every < chunk * rows.interval and run.answer is not None:
                answers.append(run.answer)
        return answers

    def off(self, answers):
        """Heading's error over its sigma."""
        true = self.motion.states(np.array([a.time for a in answers]))
        phi = misalignment(np.stack([a.C_nb for a in answers]), true.C_nb)
        return phi[:, 2] / np.array([a.sigma[0] for a in answers])


@pytest.mark.parametrize(
    ("motion", "grade", "duration", "seed"),
    some(
        [(CALM, "consumer", 120.0, 3)],
        [
            (motion, grade, duration, seed)
            for motion in (STILL, CALM)
            for grade, duration in (("consumer", 200.0), ("consumer", 600.0), ("industrial", 600.0))
            for seed in (1, 2, 3)
        ],
    ),
)
def test_heading_without_a_push_is_as_unsure_as_its_gyro(motion, grade, duration, seed):
    """It was 18 sigmas off, `navigated`."""
    case = Anchored(motion, grade, duration, seed)
    answers = case.feed(case.run(), 125, every=5.0)
    assert {a.status for a in answers} == {"navigated"}
    assert np.abs(case.off(answers)).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_a_swell_shows_heading_and_sigma_stays(seed):
    case = Anchored(SWELL, "consumer", 200.0, seed)
    run = case.run()
    answers = case.feed(run, 125, every=5.0)
    assert np.degrees(answers[-1].sigma[0]) < 3.0
    assert np.abs(case.off(answers)).max() < 4.0
    assert not any("no acceleration" in reason for reason in answers[-1].reasons)


def test_it_is_what_navigate_says_of_the_rows_until_now():
    """A consumer IMU after two minutes at anchor, whose sigma the rule has enlarged several times."""
    case = Anchored(CALM, "consumer", 120.0, 3)
    run = case.run()
    answer = case.feed(run, 50, every=120.0)[-1]
    now = case.log.between(None, answer.time)
    aid = type(case.aid)(case.aid.record.between(None, answer.time - 0.1), case.aid.mounting)
    whole = navigate(now, case.start, aid=aid, imu=case.spec, interval=0.2, output=1.0)
    np.testing.assert_allclose(answer.sigma[0], whole.euler_sigma[-1, 0], rtol=0.05)
    np.testing.assert_allclose(answer.motion.position_sigma, whole.position_sigma[-1], rtol=0.2)
    found = run.finish()
    assert found.status == "navigated"


@pytest.mark.slow
def test_chunks_and_questions_change_no_bit_nor_does_a_run_that_was_saved(tmp_path):
    """One that is asked often and one that is never asked before its end, one row at a time, and half of it from a file."""
    case = Anchored(CALM, "consumer", 120.0, 3)
    asked, silent, saved = case.run(), case.run(), case.run()
    case.feed(asked, 25, every=4.0)
    case.feed(silent, 1)
    case.feed(saved, 25, until=43.0)
    saved.save(tmp_path / "run.npz")
    again = Navigator.load(tmp_path / "run.npz")
    for run in (saved, again):
        case.feed(run, 25, since=43.0)
    first = asked.answer.summary()
    assert any("no acceleration shows it" in reason for reason in first["reasons"])
    assert silent.answer.summary() == first
    assert saved.answer.summary() == again.answer.summary() == first


def test_a_run_that_was_saved_without_them_is_of_another_version(tmp_path, monkeypatch):
    """It would go on without the comparison, in silence."""
    case = Anchored(STILL, "consumer", 10.0, 1)
    monkeypatch.setattr(navigator, "KEPT", tuple(name for name in navigator.KEPT if name != "_loop"))
    case.run().save(tmp_path / "run.npz")
    monkeypatch.undo()
    with pytest.raises(DataError, match="not a result of this version"):
        Navigator.load(tmp_path / "run.npz")


def test_the_track_of_a_run_too_long_to_be_kept_is_as_unsure_along_the_way():
    case = Anchored(CALM, "consumer", 120.0, 3)
    run = case.run(most_rows=1000)
    answer = case.feed(run, 25, every=120.0)[-1]
    found = run.finish()
    assert run.log.merged > 1
    np.testing.assert_allclose(found.euler_sigma[-1, 0], answer.sigma[0], rtol=1e-6)
    true = case.motion.states(found.time).C_nb
    off = misalignment(found.C_nb, true)[:, 2] / found.track.sigma[:, 2]
    assert np.abs(off).max() < 4.0


def test_siblings_that_break_down_leave_the_answer_as_it_is(monkeypatch):
    """As in :func:`truenorth.navigate`: there is nothing to compare, and the loop's own sigma stands."""
    case = Anchored(CALM, "consumer", 60.0, 3)
    run, alone = case.run(), case.run()
    case.feed(run, 25)
    usual = run.answer
    monkeypatch.setattr(siblings, "go_on", broken)
    case.feed(alone, 25)
    answer = alone.answer
    assert answer.status == usual.status == "navigated"
    assert answer.sigma[0] < usual.sigma[0]
    assert not any("no acceleration" in reason for reason in answer.reasons)


def broken(*_, **__):
    raise DataError("the covariance is lost in rounding")


def test_without_another_sensor_there_is_nothing_that_shows_heading_and_nothing_to_compare():
    case = Anchored(STILL, "consumer", 10.0, 1)
    run = Navigator(case.start, case.spec, altitude="fixed", kind=case.log.kind)
    run.push(case.log.time, case.log.gyro, case.log.accel)
    assert run.answer.status == "navigated"
    assert run._loop.siblings._states == []
