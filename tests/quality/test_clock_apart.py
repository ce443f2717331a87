"""A receiver on another clock: the lag against brute force, drives at any distance, and what shows none."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.aiding.aids import Gnss
from truenorth.core.position import Position
from truenorth.estimate import own_clock
from truenorth.estimate.own_clock import on_its_clock
from truenorth.quality.clock_apart import clock_apart, course_rate, unexplained, yaw_rate
from truenorth.records import GnssRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import simulate
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, straight, turn
from truenorth.state.evidence import Evidence, note
from truenorth.state.wording import sentences

PLACE = Position.from_degrees(48.0, 11.0, 500.0)
SPEC = imu_spec("industrial")


def drive(
    seed, duration=240.0, speed=12.0, turning=(6.0, 15.0), even=False, velocities=True, straights=(5, 25), imu=SPEC
):
    """A car's log and its receiver's, on one clock; `even`: the same turn again and again."""
    rng = np.random.default_rng(seed)
    legs = [*straight(10.0), *accelerate(speed, 1.5, 0.0)]
    for _ in range(60):
        by, rate, gone = rng.uniform(30, 120) * rng.choice([-1, 1]), rng.uniform(*turning), rng.uniform(*straights)
        by, rate, gone = (90.0, 10.0, 15.0) if even else (by, rate, gone)
        legs += [*straight(gone), *turn(np.radians(by), np.radians(rate))]
    motion = course(PLACE, [*legs, *straight(1000.0)], heading=rng.uniform(-3.0, 3.0))
    record = simulate(motion, rate=50.0, duration=duration, imu=imu, seed=seed).record
    t = np.arange(0.55, duration - 10.0, 0.2)
    s = motion.states(t)
    off = rng.standard_normal((len(t), 3))
    lat, lon, alt = s.lat + off[:, 1] / 6.37e6, s.lon + off[:, 0] / (6.39e6 * np.cos(s.lat)), s.alt + off[:, 2]
    v = s.v_n + 0.05 * rng.standard_normal((len(t), 3)) if velocities else None
    return motion, record, GnssRecord(t, lat, lon, alt, v_n=v, position_sigma=np.ones((len(t), 3)))


def shifted(gnss, late):
    return replace(gnss, time=gnss.time + late)


def test_what_is_left_of_the_turns_is_that_of_each_lag():
    """By FFT as by summing over each overlap, absent values left out."""
    rng = np.random.default_rng(7)
    w = rng.standard_normal(150)
    c = np.concatenate([rng.standard_normal(20), -w[:90] + 0.1 * rng.standard_normal(90)])
    c[rng.integers(0, len(c), 15)] = np.nan
    w[rng.integers(0, len(w), 15)] = np.nan
    lags, left = unexplained(c, w)
    assert lags[0] == -149 and lags[-1] == 109  # noqa: PT018
    for lag in (-30, 0, 20, 45):
        k = np.arange(len(w))
        k = k[(k + lag >= 0) & (k + lag < len(c))]
        a, b = c[k + lag], w[k]
        both = np.isfinite(a) & np.isfinite(b)
        a, b = a[both], b[both]
        found = left[np.flatnonzero(lags == lag)[0]]
        expected = np.var(a + b) / max(np.var(a), np.var(b))
        assert np.isinf(found) or abs(found - expected) < 1e-9
    assert lags[np.argmin(left)] == 20
    assert left.min() < 0.05


def test_rates_are_those_of_the_motion():
    """Course over ground and gyros about the vertical both turn as the vehicle does."""
    motion, record, gnss = drive(3)
    for (begin, rate), sign in ((course_rate(gnss, 1.0), 1.0), (yaw_rate(record, 1.0), -1.0)):
        t = begin + 0.5 * np.arange(len(rate))
        heading = [
            np.unwrap(np.arctan2(s.v_n[:, 0], s.v_n[:, 1])) for s in (motion.states(t - 0.5), motion.states(t + 0.5))
        ]
        there = np.isfinite(rate) & (t > 30.0)
        true = np.angle(np.exp(1j * (heading[1] - heading[0])))
        assert np.std((sign * rate - true)[there]) < 0.1 * np.std(true[there])


@pytest.mark.parametrize("velocities", [True, False])
@pytest.mark.parametrize("seed", some([1, 2], [3, 4, 5, 6]))
def test_a_clock_that_is_apart_is_found_at_any_distance(seed, velocities):
    _, record, gnss = drive(seed, velocities=velocities)
    for late in (18.0, -18.0, 37.2, 43211.4, -1.7e9):
        found = clock_apart(record, shifted(gnss, late))
        assert found is not None
        assert abs(found - late) <= 1.0
    assert [clock_apart(record, shifted(gnss, late)) for late in (0.0, 0.5, -1.0, 1.5)] == [None] * 4


def test_turns_at_even_distances_show_no_lag():
    """A track of which each round is as the one before fits at several lags."""
    _, record, gnss = drive(1, even=True)
    assert [clock_apart(record, shifted(gnss, late)) for late in (0.0, 18.0, -60.0)] == [None] * 3


def test_another_drive_shows_no_lag():
    """The receiver of one drive and the IMU of another have nothing in common."""
    drives = [drive(seed) for seed in range(1, 7)]
    found = [clock_apart(one[1], other[2]) for one in drives for other in drives if one is not other]
    assert found == [None] * 30


def test_one_who_does_not_move_shows_no_lag():
    _, record, gnss = drive(1)
    still = replace(gnss, v_n=0.05 * np.random.default_rng(1).standard_normal((len(gnss), 3)))
    assert clock_apart(record, shifted(still, 18.0)) is None


def test_one_stamp_far_away_is_no_grid_of_billions():
    _, record, gnss = drive(1)
    wrong = replace(gnss, time=np.append(-1.7e9, gnss.time[1:]))
    assert clock_apart(record, wrong) is None


@dataclass(frozen=True)
class Answer:
    """As much of an answer as is looked at."""

    status: str
    evidence: tuple[Evidence, ...] = ()


@pytest.mark.parametrize(
    ("late", "as_stamped", "shifted_by", "back", "taken"),
    [
        (3.0, "aligned", "aligned", 0.0, False),  # a nose that follows the course later, or a filter that finds 3 s
        (3.0, "inconsistent", "aligned", 0.0, True),
        (18.0, "inconsistent", "aligned", 0.4, True),
        (18.0, "inconsistent", "inconsistent", 0.0, False),  # another drive: no clock is blamed
        (18.0, "aligned", "aligned", 3.0, False),  # shifted in vain: the delay that is left says so
    ],
)
def test_rows_are_shifted_where_the_answer_bears_it_out(monkeypatch, late, as_stamped, shifted_by, back, taken):
    _, record, gnss = drive(1, 60.0)
    monkeypatch.setattr(own_clock, "clock_apart", lambda *_: late)

    def solved(rows):
        if rows is gnss:
            return Answer(as_stamped)
        assert rows.time[0] == gnss.time[0] - late
        return Answer(shifted_by, (note("delay.early", name="GNSS", size=back),) if back else ())

    answer = on_its_clock(solved, record, gnss)
    assert ("clock.ahead" in [item.key for item in answer.evidence]) == taken
    assert answer.status == (shifted_by if taken else as_stamped)


@pytest.mark.slow
@pytest.mark.parametrize("late", [18.0, -18.0, 43211.4])
def test_an_alignment_takes_the_receiver_by_its_own_clock(late):
    """GPS time against UTC, and seconds of the day: heading as without, and it is said by how much the rows were moved."""
    motion, record, gnss = drive(8, 300.0)
    answer = tn.align(record, None, SPEC, aid=[Gnss(shifted(gnss, late))])
    assert answer.status == "aligned"
    C = motion.states(np.array([record.time[-1]])).C_nb[0]
    true = np.arctan2(C[0, 1], C[1, 1])
    assert abs(np.angle(np.exp(1j * (answer.heading - true)))) < 4.0 * answer.euler_sigma[0]
    keys = [item.key for item in answer.evidence]
    assert ("clock.ahead" if late > 0.0 else "clock.behind") in keys
    assert ("clock.gps_or_utc" in keys) == (abs(late) == 18.0)
    text = " ".join(sentences(answer.evidence, {"offset": "--offset {sensor}={offset:.3f}"}))
    assert f"--offset gnss={-round(late):.3f}" in text


@pytest.mark.slow
def test_navigation_takes_the_receiver_by_its_own_clock():
    motion, record, gnss = drive(9, 300.0)
    begin = tn.align(record.between(None, 150.0), None, SPEC, aid=[Gnss(gnss.between(None, 150.0))])
    answer = tn.navigate(record.to_frame(), begin, aid=Gnss(shifted(gnss, 18.0)), imu=SPEC)  # a table, too
    assert answer.status == "navigated"
    off = (answer.track.v_n[-1] - motion.states(answer.track.time[-1:]).v_n[0]) / np.sqrt(
        np.diag(answer.track.P[-1])[3:6]
    )
    assert np.all(np.abs(off) < 4.0)
    assert "clock.ahead" in [item.key for item in answer.evidence]
