"""Fixes that are stamped when they arrive: an aircraft's are off by metres along its way, and its turns show by how much."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.circling import compared, drawn_start, received
from tests.runs import some
from truenorth.core.position import Position
from truenorth.live import GnssFeed, Navigator, lasting
from truenorth.navigation import navigate
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import straight, turn

DEG = math.pi / 180.0
SPEC = imu_spec("industrial")
FLOWN = course(
    Position.from_degrees(48.0, 11.0, 1500.0),
    [leg for angle in (90.0, -120.0, 150.0, -180.0) for leg in (*straight(10.0), *turn(angle * DEG, 6.0 * DEG))],
    heading=0.3,
    speed=50.0,
)
LENGTH = 140.0  # s


def flown(seed, scatter):
    """Log, start and fixes of a flight, whose stamps scatter by so much, s."""
    rng = np.random.default_rng([seed, 8])
    log = simulate(FLOWN, rate=25.0, duration=LENGTH, imu=SPEC, seed=seed).record
    start, aid = drawn_start(FLOWN, SPEC, rng), received(FLOWN, LENGTH - 1.0, 1.0, rng)
    late = scatter * np.clip(rng.standard_normal(len(aid.record)), -3.0, 3.0)
    return log, start, type(aid)(replace(aid.record, time=aid.record.time + late), aid.mounting)


def said_scatter(result):
    return [item.figures["size"] for item in result.evidence if item.key == "noise.stamps"]


def test_a_scatter_is_found_and_no_sound_flight_is_refused():
    """Of 8 flights of another simulator 5 were refused with .15 s: fixes "contradict the track"."""
    log, start, aid = flown(1, 0.15)
    result = navigate(log, start, aid=aid, imu=SPEC)
    assert result.status == "navigated"
    assert said_scatter(result) == [pytest.approx(0.15, rel=0.3)]
    off = compared(result, FLOWN, (70.0, 100.0, LENGTH))
    assert max(np.abs(ratio).max() for ratio in off.ratios.values()) < 4.0


def test_stamps_that_do_not_scatter_are_left_alone():
    log, start, aid = flown(2, 0.0)
    assert said_scatter(navigate(log, start, aid=aid, imu=SPEC)) == []


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.05, 0.15])
def test_sigma_is_true_whatever_the_scatter(scatter):
    """Sixteen flights; RMS of 48 figures of each kind, three a flight, that are not independent."""
    found = []
    for seed in range(16):
        log, start, aid = flown(seed + 10, scatter)
        result = navigate(log, start, aid=aid, imu=SPEC)
        assert result.status == "navigated"
        found.append(compared(result, FLOWN, (70.0, 100.0, LENGTH)).ratios)
    for name in found[0]:
        ratios = np.concatenate([np.ravel(one[name]) for one in found])
        assert 0.7 < np.sqrt(np.mean(ratios**2)) < 1.3
        assert np.abs(ratios).max() < 4.0


def running(log, start, aid, chunk, until=np.inf, path=None, mounting=None):
    """A running answer on a flight, saved and loaded at a time."""
    feed = GnssFeed(mounting)
    run = Navigator(start, SPEC, feeds=[feed], mountings={"gnss": aid.mounting}, kind=log.kind)
    rows, sent = feed.rows_of(aid.record), 0
    for first in range(0, len(log), chunk):
        part = slice(first, first + chunk)
        last = int(np.searchsorted(rows[:, 0] + 0.1, log.time[part][-1], side="right"))
        if last > sent:
            run.feeds["gnss"].add(rows[sent:last])
            sent = last
        run.push(log.time[part], log.gyro[part], log.accel[part])
        if log.time[part][-1] > until:
            run, until = Navigator.load(run.save(path)), np.inf
    return run


@pytest.mark.parametrize("most", some([0], [4, 3]))
def test_a_running_answer_finds_it_too_whatever_the_chunks_saved_or_not(monkeypatch, tmp_path, most):
    """By glances at its innovations alone, without a look; and by so many looks."""
    monkeypatch.setattr(lasting, "LOOKS", lasting.LOOKS[:most])
    log, *case = flown(3, 0.15)
    case = log.between(None, 100.0), *case
    one, other = running(*case, 10), running(*case, 60, until=70.0, path=tmp_path / "run.npz")
    assert one._loop.shown.stamps == pytest.approx(0.15, rel=0.4)
    assert any("stamps scatter" in reason for reason in one.answer.reasons)
    for name in ("v_n", "position", "v_sigma", "position_sigma"):
        np.testing.assert_array_equal(getattr(one.answer.motion, name), getattr(other.answer.motion, name))
