"""Live on the move: the answer of the whole log, whatever the chunks; from alignment to navigation without a gap."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

import truenorth as tn
from tests.quality.test_clock_apart import SPEC, drive, shifted
from tests.runs import some
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.core.errors import AlignmentError
from truenorth.core.position import Position
from truenorth.estimate.own_clock import moved_by
from truenorth.live import Aligner, GnssFeed, Navigator, OdometerFeed
from truenorth.live.feed import shift_as
from truenorth.navigation.given import mountings_found
from truenorth.navigation.start import start_of
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import DP, DV
from truenorth.state.state import Start
from truenorth.state.track import Track

DURATION = 120.0


@pytest.fixture(scope="module")
def van():
    """A van in town that begins to drive after some seconds: IMU at 50 Hz, GNSS at 5 Hz, odometer, and the truth."""
    content = read_scenario("van").to_mapping()
    content |= {"duration": f"{DURATION:g} s", "imu": "tactical", "rate": "50 Hz"}
    content["gnss"] = {"rate": "5 Hz", "position_noise": "0.5 m", "velocity_noise": "0.05 m/s"}
    scenario = read_scenario(content)
    sim = scenario.simulate(seed=2)
    aiding = scenario.simulate_aiding(seed=2)
    return sim, aiding["gnss"].record, aiding["odometer"].record


def fed(run, record, gnss, odometer, chunk, *, until=math.inf, since=-math.inf, late=0.4, ahead=0.0):
    """Push rows in the order in which they come: aiding rows some tenths of a second late, the receiver's clock so far ahead."""
    g, o = int(np.searchsorted(gnss.time + late, since, side="right")), 0
    for first in range(0, len(record), chunk):
        part = slice(first, first + chunk)
        now = min(record.time[part][-1], until)
        while g < len(gnss) and gnss.time[g] + late <= now:
            run.feeds["gnss"].push(
                gnss.time[g] + ahead, gnss.lat[g], gnss.lon[g], gnss.alt[g], v_n=gnss.v_n[g],
                position_sigma=None if gnss.position_sigma is None else gnss.position_sigma[g],
                velocity_sigma=None if gnss.velocity_sigma is None else gnss.velocity_sigma[g],
            )  # fmt: skip
            g += 1
        while odometer is not None and o < len(odometer) and odometer.time[o] + late <= now:
            run.feeds["odometer"].push(odometer.time[o], odometer.values[o])
            o += 1
        rows = (record.time[part] > since) & (record.time[part] <= until)
        if rows.any():
            run.push(record.time[part][rows], record.gyro[part][rows], record.accel[part][rows])


def kept(record, end):
    """The rows that have come."""
    return record[: int(np.searchsorted(record.time, end, side="right"))]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chunk", "with_odometer"),
    some([(7, False)], [(7, True), *((n, aided) for n in (1, 1000) for aided in (False, True))]),
)
def test_on_the_move_the_last_answer_is_that_of_the_whole_log_to_the_bit(van, chunk, with_odometer):
    """By GNSS, and by GNSS and odometer, where corrections turn velocity with attitude (invariant errors)."""
    sim, gnss, odometer = van
    record, end = sim.record, sim.record.time[-1] - 0.4
    feeds, aids = [GnssFeed()], [Gnss(kept(gnss, end))]
    if with_odometer:
        feeds.append(OdometerFeed(odometer.kind, odometer.pulse_size))
        aids.append(Odometer(kept(odometer, end)))
    with Aligner(imu="tactical", aid=feeds, kind=record.kind, background=False) as aligner:
        fed(aligner, record, gnss, odometer if with_odometer else None, chunk)
        found = aligner.finish()
        answer = aligner.answer
    whole = tn.align(record, imu="tactical", aid=aids)
    assert found.moving is not None
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert np.array_equal(found.phi_covariance, whole.phi_covariance)
    assert found.status == whole.status == "aligned"
    assert answer.time == record.time[-1]
    truth = sim.motion.states(np.array([answer.time]))
    assert np.all(np.abs(answer.motion.v_n - truth.v_n[0]) < 4.0 * answer.motion.v_sigma + 0.02)


@pytest.mark.slow
def test_between_two_solutions_the_loop_goes_on(van):
    """Its answer is at the newest row, with a velocity within four sigmas of the truth."""
    sim, gnss, _ = van
    record = sim.record
    answers = []
    with Aligner(imu="tactical", aid=[GnssFeed()], kind=record.kind, background=False) as aligner:
        for until in np.arange(60.0, DURATION, 7.0):
            fed(aligner, record, gnss, None, 25, until=until, since=answers[-1].time if answers else -math.inf)
            answers.append(aligner.answer)
    assert any(a.solution.time < a.time - 3.0 for a in answers)
    for a in answers:
        if a.motion is None:
            continue
        truth = sim.motion.states(np.array([a.time]))
        assert np.all(np.abs(a.motion.v_n - truth.v_n[0]) < 4.0 * a.motion.v_sigma)
        off = (a.euler[0] - math.atan2(truth.C_nb[0, 0, 1], truth.C_nb[0, 1, 1]) + math.pi) % (2 * math.pi) - math.pi
        assert abs(off) < 4.0 * a.sigma[0]


def navigated(start, record, gnss, odometer, chunk, antenna):
    feeds = [GnssFeed(), OdometerFeed(odometer.kind, odometer.pulse_size)]
    with Navigator(start, feeds=feeds, mountings={"gnss": antenna}, kind=record.kind) as run:
        fed(run, record, gnss, odometer, chunk)
        answer, past = run.answer, run.past.track
        return answer, past, run.finish()


@pytest.mark.slow
@pytest.mark.parametrize("chunks", some([(7, 1000)], [((1, 7, 1000),)]))
def test_navigation_in_chunks_is_one_and_the_same_to_the_bit(van, chunks):
    sim, gnss, odometer = van
    record = sim.record
    start = tn.align(record.between(None, 60.06), imu="tactical", aid=[Gnss(gnss.between(None, 60.0))])
    assert start.status == "aligned"
    # Said: of an arm that is not, live navigation knows no part whose swing velocities do not show (docs/limits.md).
    antenna = dataclasses.replace(mountings_found(start_of(start, None)[0])["gnss"], lever_arm_sigma=0.0)
    runs = [navigated(start, record, gnss, odometer, chunk, antenna) for chunk in chunks]
    end = record.time[-1] - 0.4
    aids = [Gnss(kept(gnss, end), antenna), Odometer(kept(odometer, end))]
    whole, without_rivals = (
        tn.navigate(record, start, aid=aids, interval=0.2, output=1.0, check_clocks=looks) for looks in (True, False)
    )
    for answer, past, result in runs:
        assert np.array_equal(result.track.P, whole.track.P)
        assert np.array_equal(result.position, whole.position)
        assert result.status == whole.status  # the wheel's arm of .9 m, which is not given, is near what is refused
        assert np.array_equal(past.P, runs[0][1].P)
        assert np.array_equal(past.position, runs[0][1].position)
        # The loop knows the interval of sampling from its first rows, the batch from all: equal within rounding.
        np.testing.assert_allclose(past.position, whole.position[: len(past.time)], rtol=1e-12)
        np.testing.assert_allclose(past.C_nb, whole.C_nb[: len(past.time)], rtol=0, atol=1e-11)
        assert answer.time == record.time[-1]
        np.testing.assert_allclose(answer.motion.v_n, whole.v_n[-1], atol=0.02)
        # Nobody spoke of slow errors of the fixes, which say .5 m: neither knows the place better than what so many of them leave
        # open of what they share. A running answer compares no rivals: that the wheel sits .9 m from where it is said to be is
        # found by the whole log's second look.
        np.testing.assert_allclose(answer.motion.position_sigma, without_rivals.track.sigma[-1, DP], rtol=0.05)
        part = np.sqrt(1.5 / np.sum(gnss.has_position))  # one sigma of the white part of their variance
        assert np.all(answer.motion.position_sigma[:2] ** 2 > 0.2 * part * 0.5**2)


@pytest.mark.slow
def test_slow_errors_of_fixes_that_innovations_show_are_in_the_sigma_of_a_running_answer():
    """Fixes that wander by 4 m and say nothing of it: position is known to that, and neither to 2 m nor to ten."""
    content = read_scenario("van").to_mapping() | {"duration": "180 s", "imu": "tactical", "rate": "50 Hz"}
    content["gnss"] = {"rate": "2 Hz", "position_noise": "0.5 m", "velocity_noise": "0.05 m/s", "position_drift": "4 m"}
    scenario = read_scenario(content)
    sim = scenario.simulate(seed=35)
    gnss = dataclasses.replace(scenario.simulate_aiding(seed=35)["gnss"].record, position_sigma=None)
    start = tn.align(sim.record.between(None, 60.06), imu="tactical", aid=[Gnss(gnss.between(None, 60.0))])
    with Navigator(start, feeds=[GnssFeed()], kind=sim.record.kind) as run:
        fed(run, sim.record, gnss, None, 50)
        answer = run.answer
    truth = Track.along(sim.motion.states(np.array([answer.time])))
    now = answer.motion
    found = Track.of_motion(truth.time, answer.C_nb[None], now.v_n[None], now.position[None])
    off = found.errors_against(truth)[0, DP]
    assert answer.status == "navigated"
    assert any("wander" in reason for reason in answer.reasons)
    assert np.all(np.abs(off) < 3.0 * now.position_sigma)
    assert np.all((now.position_sigma > 2.5) & (now.position_sigma < 8.0))


@pytest.mark.slow
def test_from_alignment_to_navigation_without_a_gap(van):
    """The navigator takes the rows after the alignment's epoch, and goes on with those that come."""
    sim, gnss, _ = van
    record = sim.record
    aligner = Aligner(imu="tactical", aid=[GnssFeed()], kind=record.kind, background=False)
    fed(aligner, record, gnss, None, 50, until=60.0)
    navigator = aligner.navigator()
    fed(navigator, record, gnss[int(np.searchsorted(gnss.time, 59.6, side="right")) :], None, 50, since=60.0)
    result = navigator.finish()
    assert result.status == "navigated"
    assert result.time[-1] == pytest.approx(record.time[-1], abs=1e-9)
    assert result.time[0] == pytest.approx(60.0, abs=0.02)
    truth = sim.motion.states(result.time[-1:])
    place = Position(truth.lat[0], truth.lon[0], truth.alt[0])
    off = (result.position[-1, :2] - [place.lat, place.lon]) * 6.37e6
    assert np.all(np.abs(off) < 4.0 * result.position_sigma[-1, 1::-1] + 0.1)


@pytest.mark.slow
def test_a_gap_that_is_too_long_is_named_and_the_answer_lost(van):
    sim, gnss, _ = van
    record = sim.record
    start = tn.align(record.between(None, 60.06), imu="tactical", aid=[Gnss(gnss.between(None, 60.0))])
    with Navigator(start, feeds=[GnssFeed()], kind=record.kind) as run:
        fed(run, record, gnss, None, 20, until=80.0)
        before = run.answer
        fed(run, record, gnss, None, 20, since=83.0)
        after = run.answer
    assert before.status == "navigated"
    assert after.status == "lost"
    assert not after.heading_known
    assert any("a gap of 3.0" in reason for reason in after.reasons)


@pytest.mark.slow
def test_a_run_that_is_saved_goes_on_to_the_same_bits(van, tmp_path):
    sim, gnss, _ = van
    record = sim.record
    with Aligner(imu="tactical", aid=[GnssFeed()], kind=record.kind, background=False) as aligner:
        fed(aligner, record, gnss, None, 25, until=50.0)
        aligner.save(tmp_path / "aligner.npz")
        fed(
            aligner,
            record,
            gnss[int(np.searchsorted(gnss.time, 49.6, side="right")) :],
            None,
            25,
            since=50.0,
            until=60.0,
        )
        start = aligner.finish()
    with Aligner.load(tmp_path / "aligner.npz", background=False) as again:
        fed(
            again, record, gnss[int(np.searchsorted(gnss.time, 49.6, side="right")) :], None, 25, since=50.0, until=60.0
        )
        found = again.finish()
    assert np.array_equal(found.phi_covariance, start.phi_covariance)
    assert np.array_equal(found.C_nb, start.C_nb)
    navigator = Navigator(start, feeds=[GnssFeed()], kind=record.kind)
    fed(navigator, record, gnss, None, 25, until=80.0)
    navigator.save(tmp_path / "navigator.npz")
    with pytest.raises(tn.DataError, match="holds no Aligner"):
        Aligner.load(tmp_path / "navigator.npz")
    later = gnss[int(np.searchsorted(gnss.time, 79.6, side="right")) :]
    runs = [navigator, Navigator.load(tmp_path / "navigator.npz")]
    for run in runs:
        fed(run, record, later, None, 25, since=80.0)
    one, other = (run.past.track for run in runs)
    assert np.array_equal(one.P, other.P)
    assert np.array_equal(one.position, other.position)
    assert runs[0].answer.summary() == runs[1].answer.summary()
    assert np.array_equal(runs[0].finish().position, runs[1].finish().position)


@pytest.mark.slow
def test_without_a_place_the_first_solution_waits_for_a_fix(van):
    """A receiver that starts cold gives none for a minute: the run says so, and goes on."""
    sim, gnss, _ = van
    record = sim.record
    first = 60.0
    with Aligner(imu="tactical", aid=[GnssFeed()], kind=record.kind, background=False) as aligner:
        fed(aligner, record, gnss.between(first, None), None, 50, until=first)
        assert aligner.answer is None
        assert "no fix has come" in aligner.failure
        with pytest.raises(AlignmentError, match="no fix has come"):
            Aligner(imu="tactical", aid=[GnssFeed()], background=False).finish()
        fed(aligner, record, gnss.between(first, None), None, 50, since=first)
        assert aligner.answer is not None
        assert aligner.failure == ""
        found = aligner.finish()
    whole = tn.align(record, imu="tactical", aid=[Gnss(kept(gnss, record.time[-1] - 0.4).between(first, None))])
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert found.status == whole.status


def test_a_receiver_that_never_brought_a_fix_leaves_navigation_by_the_imu_alone(van):
    record = van[0].record[:200]
    begun = float(record.time[0])
    start = Start(begun, np.eye(3), np.zeros(3), 0.8, 0.2, 100.0, np.zeros(3), np.zeros(3), 1e-6 * np.eye(15))
    with Navigator(start, "tactical", feeds=[GnssFeed()], kind=record.kind) as run:
        run.push(record.time, record.gyro, record.accel)
        found = run.finish()
    assert (run.altitude, found.altitude) == ("gnss", "fixed")
    assert any("gnss: fewer than two rows came" in reason for reason in found.reasons)


def test_rounding_grows_the_sigma_of_a_live_run_as_that_of_the_whole_log(van):
    """Few digits under a vibration: the loop reads from its newest rows what `navigate` reads from all; the same in any chunks."""
    record = van[0].record.between(None, 90.0)
    steps = [2.0 * np.median(np.abs(np.diff(x, axis=0))) for x in (record.gyro, record.accel)]
    gyro, accel = (step * np.round(x / step) for step, x in zip(steps, (record.gyro, record.accel), strict=True))
    coarse = tn.ImuRecord(record.time, gyro, accel, record.kind)
    P = np.diag(np.repeat([1e-10, 1e-6, 1e-6, 1e-16, 1e-10], 3))
    start = Start(float(record.time[0]), np.eye(3), np.zeros(3), 0.8, 0.2, 100.0, np.zeros(3), np.zeros(3), P)
    sigma = {}
    for name, log, chunk in (("fine", record, 100), ("coarse", coarse, 100), ("in other chunks", coarse, 37)):
        with Navigator(start, "tactical", altitude="free", kind=log.kind) as run:
            for first in range(0, len(log), chunk):
                part = slice(first, first + chunk)
                run.push(log.time[part], log.gyro[part], log.accel[part])
            sigma[name] = run.answer.motion.v_sigma
    whole = tn.navigate(coarse, start, imu="tactical", altitude="free", check_clocks=False)
    assert np.array_equal(sigma["coarse"], sigma["in other chunks"])
    assert np.all(sigma["coarse"] > 2.0 * sigma["fine"])
    np.testing.assert_allclose(sigma["coarse"], whole.track.sigma[-1][DV], rtol=0.4)


@pytest.mark.slow
@pytest.mark.parametrize("ahead", [18.0, *some([], [-18.0])])
def test_a_receiver_on_another_clock_is_taken_by_it_from_the_solution_on_that_finds_it(ahead, tmp_path):
    """Before, alignments found it, the navigation between them did not, and the status changed to and fro."""
    _, record, gnss = drive(8, 160.0)
    seen = []
    with Aligner(imu=SPEC, aid=[GnssFeed()], kind=record.kind, background=False) as aligner:
        for until in np.arange(30.0, 160.0, 2.0):
            since = until - 2.0 if until > 30.0 else -math.inf
            fed(aligner, record, gnss, None, 50, until=until, since=since, ahead=ahead)
            seen.append(aligner.answer.status)
        assert aligner.feeds["gnss"].offset == -ahead
        first = seen.index("aligned")
        assert set(seen[first:]) == {"aligned"}
        found = aligner.finish()
        aligner.save(tmp_path / "run")
    again = Aligner.load(tmp_path / "run", background=False)
    assert again.feeds["gnss"].offset == -ahead
    whole = tn.align(record.between(None, until), imu=SPEC, aid=[Gnss(shifted(kept(gnss, until - 0.4), ahead))])
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert [item.key for item in found.evidence] == [item.key for item in whole.evidence]


def test_rows_are_moved_however_they_come_and_a_clock_taken_back_is_not_spoken_of():
    """Whole seconds, as another thread brings a row while the offset is found; then it is found to be none."""
    feed = GnssFeed()
    feed.push([1.0, 2.0], [0.7, 0.7], [0.1, 0.1], [0.0, 0.0])
    assert feed.rows[:, 0].tolist() == [1.0, 2.0]
    feed.push(3.0, 0.7, 0.1, 0.0)  # waits
    feed.shift(18.0)
    feed.push(4.0, 0.7, 0.1, 0.0)
    assert feed.rows[:, 0].tolist() == [19.0, 20.0, 21.0, 22.0]
    keys = [[item.key for item in moved_by(offset)] for offset in (feed.offset, -60.0, 0.0)]
    assert keys == [["clock.behind", "clock.gps_or_utc"], ["clock.ahead"], []]
    feed.shift(-18.0)
    assert (feed.offset, feed.rows[0, 0]) == (0.0, 1.0)
    for feeds in ({"gnss": feed}, {}):  # a run that goes on from a saved answer has rows as they were stamped
        shift_as(SimpleNamespace(evidence=moved_by(-60.0)), feeds)
    assert feed.offset == -60.0
