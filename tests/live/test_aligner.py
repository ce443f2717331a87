"""Live alignment: the answer of the whole log, whatever the chunks; hostile rows counted; memory bounded."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment import align
from truenorth.core.attitude import euler_from_dcm
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.live import Aligner
from truenorth.live.intake import CONFIRMED, Intake
from truenorth.live.log import Log
from truenorth.records.specs import imu_spec
from truenorth.simulation import Sway, Tone, rest, simulate
from truenorth.strapdown.increments import increments

PLACE = Position.from_degrees(45.0, 10.0)


@pytest.fixture(scope="module")
def record():
    return simulate(rest(PLACE, 0.7, 0.02, -0.03), rate=50.0, duration=130.0, imu=imu_spec("navigation"), seed=3).record


def rows_of(record):
    return np.column_stack([record.time, record.gyro, record.accel])


def pushed(aligner, record, chunk):
    for first in range(0, len(record), chunk):
        part = slice(first, first + chunk)
        aligner.push(record.time[part], record.gyro[part], record.accel[part])


@pytest.mark.parametrize("chunk", some([1000], [1, 13]))
def test_the_last_answer_is_that_of_the_whole_log_to_the_bit(record, chunk):
    with Aligner(PLACE, "navigation", kind=record.kind, background=False) as aligner:
        pushed(aligner, record, chunk)
        found = aligner.finish()
    whole = align(record, PLACE, "navigation")
    assert np.array_equal(found.C_nb, whole.C_nb)
    assert np.array_equal(found.phi_covariance, whole.phi_covariance)
    assert found.status == whole.status == "aligned"


@pytest.mark.slow
def test_known_lags_are_taken_off_the_stamps(record):
    """As in the batch: the answer holds when the sensors felt what the last row says."""
    late = replace(imu_spec("navigation"), gyro_latency=0.004, accel_latency=0.004)
    with Aligner(PLACE, late, kind=record.kind, background=False) as aligner:
        pushed(aligner, record, 13)
        found = aligner.finish()
    whole = align(record, PLACE, late)
    assert found.time == whole.time == record.time[-1] - 0.004
    assert np.array_equal(found.C_nb, whole.C_nb)


@pytest.mark.slow
def test_between_solutions_the_filter_goes_on_as_the_batch_does(record):
    with Aligner(PLACE, "navigation", kind=record.kind, background=False) as aligner:
        pushed(aligner, record, 50)
        answer, whole = aligner.answer, aligner.finish()
    assert answer.time == record.time[-1]
    assert answer.solution.time < answer.time
    assert aligner.solutions > 10
    off = answer.euler - whole.euler
    assert np.all(np.abs(off) < 3.0 * answer.sigma)
    assert np.abs(off[1:]).max() < np.radians(0.01)
    assert answer.sigma[0] == pytest.approx(whole.euler_sigma[0], rel=0.1)


@pytest.mark.slow
def test_a_ship_that_sheers_at_anchor_is_answered_between_solutions():
    """She turns so far that scale factors and misalignments of her gyros are states: the filter goes on with them."""
    tones = {"pitch_tones": (Tone(0.01, 6.0),), "roll_tones": (Tone(0.03, 9.0),), "heading_tones": (Tone(0.3, 100.0),)}
    motion = Sway(PLACE, heading=0.7, lever_arm=(1.0, 5.0, 2.0), **tones)
    record = simulate(motion, rate=25.0, duration=200.0, imu=imu_spec("tactical"), seed=3).record
    answers = []
    with Aligner(PLACE, "tactical", kind=record.kind, background=False) as aligner:
        for first in range(0, len(record), 50):
            pushed(aligner, record[first : first + 50], 50)
            answers += [] if aligner.answer is None else [aligner.answer]
    going = [a for a in answers if a.solution.method == "swaying"]
    assert all(a.solution.ongoing.matrices is not None for a in going)
    assert max(a.time - a.solution.time for a in going) > 13.0  # a block of the filter
    true = motion.states(np.array([a.time for a in going])).C_nb
    off = np.array([a.euler for a in going]) - np.stack(euler_from_dcm(true), axis=1)
    off[:, 0] = (off[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(off / [a.sigma for a in going]).max() < 4.0
    for answer in going:
        assert answer.sigma == pytest.approx(answer.solution.euler_sigma, rel=0.2)


def test_after_a_gap_that_nobody_fills_the_answer_is_gone_until_the_next_solution(record):
    rows = rows_of(record)
    with Aligner(PLACE, "navigation", kind=record.kind, background=False) as aligner:
        aligner.push(rows[:3000, 0], rows[:3000, 1:4], rows[:3000, 4:])
        assert aligner.answer is not None
        aligner.push(rows[3250:3290, 0], rows[3250:3290, 1:4], rows[3250:3290, 4:])
        assert aligner.answer is not None  # late rows may still fill it
        aligner.push(rows[3290:3400, 0], rows[3290:3400, 1:4], rows[3290:3400, 4:])
        assert aligner.answer is None
        aligner.push(rows[3400:4500, 0], rows[3400:4500, 1:4], rows[3400:4500, 4:])
        answer = aligner.answer
    assert answer.solution.duration < 26.0
    assert answer.time == rows[4499, 0]


def test_a_thread_solves_while_rows_come(record):
    with Aligner(PLACE, "navigation", kind=record.kind, share=1.0) as aligner:
        pushed(aligner, record, 10)
        found = aligner.finish()
    assert np.array_equal(found.C_nb, align(record, PLACE, "navigation").C_nb)
    assert aligner.answer is not None


@pytest.mark.slow
def test_hostile_rows_are_counted_and_the_answer_is_unharmed(record):
    rows, random = rows_of(record), np.random.default_rng(5)
    hostile = []
    for number, row in enumerate(rows):
        hostile.append(row)
        if number % 97 == 50:
            bad = row.copy()
            bad[random.integers(0, 7)] = np.nan
            hostile.append(bad)
        if number % 101 == 50:
            bad = row.copy()
            bad[random.integers(1, 7)] = 1e200
            hostile.append(bad)
        if number % 89 == 50:
            hostile.append(row)  # repeated
        if number % 113 == 50:
            bad = row.copy()
            bad[0] += 1.7e9  # another clock
            hostile.append(bad)
        if number % 127 == 60:
            hostile.append(rows[number - 55])  # repeated, and too late or not
    hostile[300], hostile[303] = hostile[303], hostile[300]
    with Aligner(PLACE, "navigation", kind=record.kind, background=False) as aligner:
        for row in hostile:
            aligner.push(row[0], row[1:4], row[4:])
        found = aligner.finish()
    counts = aligner.intake.counts
    assert np.array_equal(found.C_nb, align(record, PLACE, "navigation").C_nb)
    assert counts.taken == len(record)
    assert min(counts.not_finite, counts.too_large, counts.repeated, counts.other_clock, counts.reordered) > 0
    assert counts.taken + counts.left_out == len(hostile)


def test_a_jump_of_the_clock_that_goes_on_is_a_gap_and_loses_no_row():
    intake = Intake()
    rows = np.zeros((100, 7))
    rows[:, 0] = np.arange(100) * 0.01
    rows[50:, 0] += 100.0
    taken = sum(len(block) for row in rows for block in intake.sift(row[None]))
    assert taken == 100
    assert intake.counts.left_out == 0
    few = np.zeros((CONFIRMED - 1, 7))
    few[:, 0] = 1000.0 + np.arange(CONFIRMED - 1) * 0.01
    assert not intake.sift(few)  # waits
    rows[:, 0] += 101.0
    assert len(intake.sift(rows[:10])) == 10
    assert intake.counts.other_clock == CONFIRMED - 1


def test_after_a_long_gap_alignment_begins_anew_and_says_when(record):
    rows = rows_of(record)
    kept = np.concatenate([rows[:2000], rows[2100:]])
    with Aligner(PLACE, "navigation", kind=record.kind, background=False) as aligner:
        aligner.push(kept[:, 0], kept[:, 1:4], kept[:, 4:])
        found = aligner.finish()
    assert found.duration == pytest.approx(record.time[-1] - rows[2100, 0], abs=0.05)
    assert found.status == "aligned"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["rates", "increments"])
@pytest.mark.parametrize("chunk", [1, 7, 333])
def test_merged_rows_keep_the_sums_whatever_the_chunks(kind, chunk):
    random = np.random.default_rng(1)
    count = 9000
    rows = np.column_stack([np.arange(1, count + 1) * 0.001, random.normal(size=(count, 6))])
    log = Log(kind, most=1000)
    for first in range(0, count, chunk):
        assert log.add(rows[first : first + chunk])
    assert log.merged == 16
    assert len(log) <= 1000
    record = log.record()
    assert record.kind == "increments"
    reference = Log(kind, most=10**6)
    reference.add(rows)
    dtheta, dvel = increments(reference.record())
    upto = int(np.searchsorted(rows[:, 0], record.time[-1], side="right"))
    np.testing.assert_allclose(record.gyro.sum(axis=0), dtheta[:upto].sum(axis=0), atol=1e-9)
    np.testing.assert_allclose(record.accel.sum(axis=0), dvel[:upto].sum(axis=0), atol=1e-9)
    np.testing.assert_allclose(np.diff(record.time), 0.016, atol=1e-9)


def test_rows_of_a_tenth_of_a_second_are_merged_no_further_and_the_oldest_go():
    log = Log("increments", most=1000)
    rows = np.column_stack([np.arange(1, 20_001) * 0.02, np.ones((20_000, 6))])
    for first in range(0, len(rows), 500):
        log.add(rows[first : first + 500])
    assert log.merged == 4
    assert 500 < len(log) <= 1000
    record = log.record()
    assert record.time[-1] == rows[-1, 0]
    np.testing.assert_array_equal(record.gyro, 4.0)
    assert log.dropped + len(log) == 5000


@pytest.mark.slow
def test_a_base_that_drives_off_is_noticed_and_the_heading_until_then_kept(record):
    rows = rows_of(record)
    drive = rows[:, 0] > 90.0
    scale = 0.02 if record.kind == "increments" else 1.0
    rows[drive, 5] += 0.5 * scale  # forward
    with Aligner(PLACE, "navigation", kind=record.kind, background=False) as aligner:
        for first in range(0, len(rows), 25):
            part = rows[first : first + 25]
            aligner.push(part[:, 0], part[:, 1:4], part[:, 4:])
        answer, found = aligner.answer, aligner.finish()
    assert 87.0 < aligner.left <= 90.0
    assert found.status == "aligned"
    assert abs(found.heading - 0.7) < 4.0 * found.euler_sigma[0]
    assert any("left its place" in reason for reason in answer.reasons)


def test_shapes_that_do_not_fit_are_refused():
    with Aligner(PLACE, background=False) as aligner:
        with pytest.raises(UsageError, match="expected"):
            aligner.push([0.0, 1.0], np.zeros((3, 3)), np.zeros((2, 3)))
        assert aligner.answer is None
