"""A receiver whose errors last, on a running answer: they are states of its loop, as in the whole log; any chunks, saved or not."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.live.test_siblings import SWELL, Anchored
from tests.runs import some
from truenorth.core.earth import radii
from truenorth.core.errors import DataError
from truenorth.live import GnssFeed, HeightFeed, Navigator, kept, lasting, loop
from truenorth.live.lasting import lasting_errors
from truenorth.navigation import navigate
from truenorth.state.layout import DV
from truenorth.state.mounting import Mounting


def coloured(rng, count, sigma, time):
    """(count, 3) first-order Gauss-Markov errors, one row a second."""
    a = np.exp(-1.0 / time)
    white = sigma * rng.standard_normal((count, 3))
    white[1:] *= np.sqrt(1.0 - a * a)
    return np.asarray(lfilter([1.0], [1.0, -a], white, axis=0))


class Wandering(Anchored):
    """A vessel in a swell whose receiver says how large its errors are, and not that they last."""

    def __init__(self, seed, duration=150.0, slow=2.0, quick=0.05):
        super().__init__(SWELL, "industrial", duration, seed)
        rng, fixes = np.random.default_rng([seed, 5]), self.aid.record
        place, v = coloured(rng, len(fixes), slow, 60.0), coloured(rng, len(fixes), quick, 6.0)
        R_M, R_N = radii(fixes.lat[0])
        record = replace(
            fixes,
            lat=fixes.lat + place[:, 1] / R_M,
            lon=fixes.lon + place[:, 0] / (R_N * np.cos(fixes.lat)),
            alt=fixes.alt + place[:, 2],
            v_n=fixes.v_n + v,
            position_sigma=np.hypot(fixes.position_sigma, slow),
            velocity_sigma=np.hypot(fixes.velocity_sigma, quick),
        )
        self.aid = type(self.aid)(record, Mounting(lever_arm=self.aid.mounting.lever_arm))

    def off_velocity(self, answers):
        true = self.motion.states(np.array([a.time for a in answers]))
        off = np.stack([a.motion.v_n for a in answers]) - true.v_n
        return off / np.stack([a.motion.v_sigma for a in answers])


def rms_of_velocity(seeds):
    """RMS of velocity over sigma of runs, at every 5 s of each; a figure of (E, N, U)."""
    off = [case.off_velocity(case.feed(case.run(), 25, every=5.0)) for case in map(Wandering, seeds)]
    return np.sqrt(np.mean(np.square(np.concatenate(off)), axis=0))


@pytest.mark.slow
def test_velocity_is_as_unsure_as_errors_that_last_leave_it(monkeypatch):
    """Four runs of 30 answers that are not independent: RMS scatters by some 0.2."""
    seeds = (1, 2, 3, 4)
    assert (rms_of_velocity(seeds) < 1.45).all()
    monkeypatch.setattr(lasting, "LOOKS", ())
    assert rms_of_velocity(seeds).max() > 1.6


def test_after_a_look_sigma_is_that_of_the_whole_log():
    case = Wandering(1, duration=100.0)
    run = case.run()
    case.feed(run, 25)
    answer = run.answer
    assert set(run._loop.shown.slow) == {"GNSS position", "GNSS velocity"}
    aid = type(case.aid)(case.aid.record.between(None, answer.time - 0.1), case.aid.mounting)
    whole = navigate(case.log.between(None, answer.time), case.start, aid=aid, imu=case.spec, output=1.0)
    np.testing.assert_allclose(answer.motion.v_sigma, whole.track.sigma[-1, DV], rtol=0.2)


def test_before_a_minute_of_fixes_errors_last_as_is_usual_and_white_ones_then_do_not():
    case = Wandering(1, duration=90.0, slow=0.0, quick=0.0)
    run = case.run()
    case.feed(run, 25, until=40.0)
    assert set(run._loop.shown.slow) == {"GNSS position", "GNSS velocity"}
    assert all(lasting.white == 1.0 for lasting in run._loop.shown.slow.values())
    unsure = run.answer.motion.v_sigma
    case.feed(run, 25, since=40.0)
    assert run._loop.shown.slow == {}
    assert (run.answer.motion.v_sigma < unsure).all()
    assert sum(r.rejected for r in run.residuals) == 0


def test_a_slow_error_that_is_said_is_not_taken_as_usual():
    case = Anchored(SWELL, "industrial", 20.0, 1)  # fixes with no slow error, by what is said
    run = case.run()
    case.feed(run, 25)
    assert set(run._loop.shown.slow) == {"GNSS velocity"}


@pytest.mark.parametrize(("duration", "saved"), some([(38.0, 31.0)], [(85.0, 76.0)]))
def test_looks_change_no_bit_whatever_the_chunks_saved_or_not(tmp_path, duration, saved):
    """Saved where a look is due: the second, which takes errors as is usual, or the third, which measures how they last."""
    case = Wandering(2, duration=duration)
    one, other = case.run(), case.run()
    case.feed(one, 3)
    case.feed(other, 60, until=saved)
    other = Navigator.load(other.save(tmp_path / "run.npz"))
    case.feed(other, 60, since=saved)
    assert one._loop.shown.slow
    for name in ("v_n", "position", "v_sigma", "position_sigma"):
        np.testing.assert_array_equal(getattr(one.answer.motion, name), getattr(other.answer.motion, name))


def test_a_run_that_another_version_saved_is_refused_by_name(monkeypatch, tmp_path):
    case = Wandering(2, duration=5.0)
    run = case.run()
    case.feed(run, 25)
    path = run.save(tmp_path / "run.npz")
    monkeypatch.setattr(kept, "FORMAT", kept.FORMAT + 1)
    with pytest.raises(DataError, match="not a result of this version"):
        Navigator.load(path)


def test_a_loop_that_breaks_down_with_such_errors_goes_on_without(monkeypatch):
    case = Wandering(1, duration=30.0)
    run = case.run()
    case.feed(run, 25, until=5.5)

    def broken(*_, **__):
        monkeypatch.undo()
        raise DataError("the covariance is lost in rounding")

    def looked(*args):
        monkeypatch.setattr(loop, "go_on", broken)
        return lasting_errors(*args)

    monkeypatch.setattr(loop, "lasting_errors", looked)
    case.feed(run, 25, since=5.5)
    assert loop.go_on is not broken
    assert run._loop.shown.slow == {}
    assert run.failure == ""
    assert run.answer.status == "navigated"


@pytest.mark.slow
def test_a_run_whose_rows_are_added_up_looks_back_no_more():
    case = Wandering(1, duration=150.0)
    run = case.run(most_rows=1000)
    answers = case.feed(run, 25, every=5.0)
    assert run.log.merged > 1
    assert np.abs(case.off_velocity(answers)).max() < 5.0


def test_looks_follow_the_first_rows_of_each_aid():
    times = [-np.inf]
    while np.isfinite(times[-1]) or len(times) == 1:
        times.append(lasting.next_look(times[-1], [10.0, 40.0]))
    assert times[1:] == [15.0, 40.0, 45.0, 70.0, 85.0, 115.0, 160.0, 190.0, np.inf]
    assert lasting.next_look(0.0, []) == np.inf


@pytest.mark.parametrize("before", [0.3, 700.0])
def test_a_run_whose_rows_begin_after_its_start_is_lost(before):
    """What the vehicle did until then nobody knows: the whole log is refused, too. Velocity was up to 538 sigmas off in silence."""
    case = Wandering(3, duration=10.0)
    case.start = replace(case.start, time=case.start.time - before)
    run = case.run()
    case.feed(run, 25)
    assert run.answer is None
    assert "push the rows before it as well" in run.failure
    with pytest.raises(DataError, match="push the rows before it"):
        run.finish()


@pytest.mark.parametrize("since", [1.0, 10.0])
def test_headings_may_come_later_than_the_first_fix(since):
    """A second antenna that finds its heading after ten seconds: it was no source of the loop, and a push raised.

    After one second the loop has taken no row, or too few to begin anew.
    """
    case = Wandering(3, duration=30.0)
    runs = case.run(), case.run()
    fixes = case.aid.record
    C = case.motion.states(fixes.time).C_nb
    heading = np.arctan2(C[:, 0, 1], C[:, 1, 1])
    for chunk, run in zip((1, 50), runs, strict=True):
        g = 0
        for first in range(0, len(case.log), chunk):
            part = slice(first, first + chunk)
            while g < len(fixes) and fixes.time[g] + 0.1 <= case.log.time[part][-1]:
                seen = {"heading": heading[g], "heading_sigma": 0.01} if fixes.time[g] > since else {}
                run.feeds["gnss"].push(
                    fixes.time[g], fixes.lat[g], fixes.lon[g], fixes.alt[g], v_n=fixes.v_n[g], **seen
                )
                g += 1
            run.push(case.log.time[part], case.log.gyro[part], case.log.accel[part])
        assert "GNSS heading" in {residuals.name for residuals in run.residuals}
    np.testing.assert_array_equal(runs[0].answer.motion.v_n, runs[1].answer.motion.v_n)


def test_a_logger_faster_than_its_receiver_in_any_chunks():
    """Ten rows of each fix: each is judged by the rows before it alone."""
    case = Wandering(4, duration=30.0)
    fixes = case.aid.record
    often = np.repeat(np.arange(len(fixes)), 5)
    groups = {name: getattr(fixes, name)[often] for name in fixes.groups() if getattr(fixes, name) is not None}
    time = (fixes.time[:, None] + 0.2 * np.arange(5)).ravel()
    case.aid = type(case.aid)(replace(fixes, **{**groups, "time": time}), case.aid.mounting)
    runs = case.run(), case.run()
    for chunk, run in zip((3, 60), runs, strict=True):
        case.feed(run, chunk)
    assert sum(len(r.time) for r in runs[0].residuals if r.name == "GNSS position") <= len(fixes)
    np.testing.assert_array_equal(runs[0].answer.motion.v_n, runs[1].answer.motion.v_n)


def test_two_threads_may_ask_at_once():
    """Rows of a feed that waited were lost to one that asked while another read them."""
    case = Wandering(5, duration=20.0)
    run, alone = case.run(), case.run()
    ended = threading.Event()

    def ask():
        while not ended.is_set():
            _ = run.answer

    asking = threading.Thread(target=ask)
    asking.start()
    case.feed(run, 5)
    ended.set()
    asking.join()
    case.feed(alone, 5)
    assert len(run.feeds["gnss"].rows) == len(alone.feeds["gnss"].rows)


def test_a_feed_without_rows_is_left_out_of_a_look():
    case = Wandering(3, duration=10.0)
    run = Navigator(case.start, case.spec, feeds=[GnssFeed(), HeightFeed()], altitude="gnss", kind=case.log.kind)
    case.feed(run, 25)
    assert run._loop.shown.slow.keys() == {"GNSS position", "GNSS velocity"}
    assert run.answer.status == "navigated"
