"""A running answer whose fixes are far later than was said: its looks find the delay, as the whole log shows it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.navigation.test_scattered_stamps import FLOWN, flown, running
from truenorth.live import GnssFeed, Navigator
from truenorth.state.mounting import Clock, Mounting


def flown_late(seed, late, said=0.03):
    """45 s of a flight whose fixes are stamped so much later than they hold, s; `said`: one sigma of their delay."""
    log, start, aid = flown(seed, 0.0)
    mounting = replace(aid.mounting, latency_sigma=said)
    return log.between(None, 45.0), start, type(aid)(replace(aid.record, time=aid.record.time + late), mounting)


def off_velocity(answer):
    true = FLOWN.states(np.array([answer.time])).v_n[0]
    return np.abs((answer.motion.v_n - true) / answer.motion.v_sigma).max()


@pytest.mark.parametrize("late", [0.3, -0.2])
def test_a_delay_of_many_sigmas_is_found_by_a_look(late):
    """Two aircraft of another simulator, .3 s late, were `inconsistent` to their end; now as long as they have not looked."""
    run = running(*flown_late(4, late), 25)
    assert run._loop.shown.mountings["gnss"].latency == pytest.approx(late, abs=0.05)
    assert run.answer.status == "navigated"
    assert off_velocity(run.answer) < 4.0


def test_a_delay_that_is_given_is_kept():
    log, start, aid = flown_late(4, 0.0, said=0.0)
    assert running(log, start, aid, 25)._loop.shown.mountings == {}


def test_it_is_found_whatever_the_chunks_saved_or_not(tmp_path):
    case = flown_late(5, 0.3)
    one, other = running(*case, 10), running(*case, 60, until=33.0, path=tmp_path / "run.npz")
    assert one._loop.shown.mountings["gnss"].latency == pytest.approx(0.3, abs=0.05)
    for name in ("v_n", "position", "v_sigma", "position_sigma"):
        np.testing.assert_array_equal(getattr(one.answer.motion, name), getattr(other.answer.motion, name))


def test_a_feed_that_says_how_it_sits_is_as_late_as_found_all_the_same():
    log, start, aid = flown_late(6, 0.3)
    own = running(log, start, aid, 25, mounting=aid.mounting)
    assert isinstance(own, Navigator)
    assert isinstance(own.feeds["gnss"].mounting, Mounting)
    assert own._loop.shown.mountings["gnss"].latency == pytest.approx(0.3, abs=0.05)
    assert own.answer.status == "navigated"


def test_each_place_and_velocity_is_given_away_when_it_comes_however_late_either_is():
    """Places that waited for velocities of another moment came too late, by the chunks in which the rows did."""
    feed, sent, given = GnssFeed(), {}, []
    found = Mounting(latency=0.5, latency_sigma=0.1, velocities=Clock(0.0, 0.1))
    for k in range(40):
        feed.push(0.1 * k, 0.8 + 3e-8 * k, 0.2, 100.0, v_n=np.array([0.0, 1.9 + 1e-3 * k, 0.0]))
        rows = feed.measurements("gnss", None, sent, -np.inf, found=found)
        given.append({source.name: len(source.time) for source in rows})
    assert given[2:] == [{"GNSS position": 1, "GNSS velocity": 1}] * 38
