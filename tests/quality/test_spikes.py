"""Single rows to one side: errors that move a mean; knocks, pulses of a counter and noise, which do not."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.faults import run_faults
from truenorth.quality.spikes import one_sided, spikes_evidence
from truenorth.strapdown.increments import across_gaps

INTERVAL, ROWS = 0.02, 12_000
TIME = INTERVAL * np.arange(ROWS)
SEEDS = range(20)


def noise(rng):
    return rng.standard_normal(ROWS)


def sway(rng):
    return 3000.0 * np.sin(2.0 * np.pi * TIME / rng.uniform(5.0, 9.0) + rng.uniform(0.0, 6.0))


def places(rng, count=150):
    return rng.choice(np.arange(100, ROWS - 100), count, replace=False)


def relaxing(time=0.15):
    """What a base answers to a push of one row: its velocity comes back to nothing."""
    velocity = np.exp(-INTERVAL * np.arange(200) / time)
    return np.diff(velocity, prepend=0.0)


def springing(frequency, damping):
    """The same of a base on springs: its displacement comes back as well."""
    w, time = 2.0 * np.pi * frequency, INTERVAL * np.arange(400)
    own = w * np.sqrt(1.0 - damping**2)
    velocity = np.exp(-damping * w * time) * (np.cos(own * time) - damping * w / own * np.sin(own * time))
    return np.diff(velocity, prepend=0.0)


def knocks(at, sizes, answer):
    """Knocks at rows, and the same answer after each."""
    values = np.zeros(ROWS)
    np.add.at(values, at, sizes)
    return np.convolve(values, answer)[:ROWS]


def steady(rng, every, jitter=2):
    """Rows so many seconds apart, but for some."""
    at = np.arange(100, ROWS - 100, round(every / INTERVAL))
    return at + rng.integers(-jitter, jitter + 1, len(at))


@pytest.mark.parametrize("size", [9.0, 60.0])
@pytest.mark.parametrize("base", [lambda rng: 0.0, sway])
def test_errors_to_one_side_move_the_mean_by_what_is_said(base, size):
    for seed in SEEDS:
        rng = np.random.default_rng([1, seed])
        values = noise(rng) + base(rng)
        at = places(rng)
        values[at] += size
        found = one_sided(values, INTERVAL)
        assert found.rows == pytest.approx(len(at), rel=0.3)
        assert found.mean == pytest.approx(size * len(at) / ROWS, rel=0.3)


@pytest.mark.parametrize("size", [20.0, 60.0])
def test_errors_on_a_still_base_are_known_as_such(size):
    for seed in SEEDS:
        rng = np.random.default_rng([5, seed])
        values = noise(rng)
        values[places(rng)] += size
        assert one_sided(values, INTERVAL).kind == "known"


@pytest.mark.parametrize("every", [0.5, 1.0, 2.0])
def test_errors_that_come_steadily_are_found(every):
    for seed in SEEDS:
        rng = np.random.default_rng([6, seed])
        values = noise(rng)
        values[steady(rng, every)] += 60.0
        assert one_sided(values, INTERVAL) is not None


def test_knocks_after_which_the_base_is_at_rest_again_are_none():
    for seed in SEEDS:
        rng = np.random.default_rng([2, seed])
        assert one_sided(noise(rng) + knocks(places(rng, 40), 60.0, relaxing()), INTERVAL) is None


@pytest.mark.parametrize("every", [0.3, 0.5, 0.7, 1.0, 1.5, 3.0])
@pytest.mark.parametrize("answer", [relaxing(0.05), relaxing(), springing(1.0, 0.3), springing(2.0, 0.2)])
@few_and_all(8, few=2)
def test_nor_are_steady_ones_whose_answers_overlap(every, answer, runs):
    for seed in range(runs):
        rng = np.random.default_rng([7, seed])
        at = steady(rng, every)
        values = noise(rng) + knocks(at, 60.0 * rng.uniform(0.7, 1.3, len(at)), answer)
        assert one_sided(values, INTERVAL) is None


@pytest.mark.parametrize("size", [9.0, 60.0])
@pytest.mark.parametrize("every", [0.5, 0.7, 1.0, 1.5])
def test_knocks_like_a_clock_refuse_no_log(every, size):
    """What answers of one size have in common is the mean of the channel: nothing tells them from errors."""
    for seed in range(8):
        rng = np.random.default_rng([8, seed])
        found = one_sided(noise(rng) + knocks(steady(rng, every, 0), size, relaxing()), INTERVAL)
        assert found is None or found.kind == "hint"


def test_a_still_base_that_is_knocked_every_second_is_aligned():
    """Of runs 0, 1, 3 and 4 the log was refused, with knocks of .2 m/s^2."""
    for run in range(5):
        inputs, truth = BENCHES["still"].draw(12, run)
        record, rng = inputs["record"], np.random.default_rng(run)
        at = np.arange(100, len(record) - 100, round(1.0 / record.interval))
        at += rng.integers(-2, 3, len(at))
        size = 300.0 * float(np.median(np.abs(np.diff(record.accel[:, 0]))))
        pushed = np.zeros(len(record))
        pushed[at] = size * rng.uniform(0.7, 1.3, len(at))
        velocity = np.exp(-record.interval * np.arange(200) / 0.15)
        accel = record.accel.copy()
        accel[:, 0] += np.convolve(pushed, np.diff(velocity, prepend=0.0))[: len(record)]
        answer = BENCHES["still"].align({**inputs, "record": replace(record, accel=accel)})
        assert answer.status == "aligned"
        assert all(np.all(np.abs(miss) < 3.0) for miss in misses(answer, truth).values())


def test_pulses_of_a_counter_are_none():
    """Counts of a rate of a fiftieth of a step, with noise of a hundredth of one, turned a little by a calibration."""
    for seed in SEEDS:
        rng = np.random.default_rng([3, seed])
        whole = np.cumsum(rng.uniform(0.01, 0.05) + 0.05 * rng.standard_normal(ROWS))
        pulses = np.diff(np.round(whole), prepend=0.0)
        assert one_sided(pulses + 0.01 * rng.standard_normal(ROWS), INTERVAL) is None


def test_noise_and_spikes_to_both_sides_are_none():
    for seed in SEEDS:
        rng = np.random.default_rng([4, seed])
        values = noise(rng) + sway(rng) * rng.integers(2)
        assert one_sided(values, INTERVAL) is None
        at = places(rng)
        values[at] += 9.0 * np.where(np.arange(len(at)) % 2, 1.0, -1.0)
        assert one_sided(values, INTERVAL) is None
    assert one_sided(np.zeros(10), INTERVAL) is None


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["still", "swaying", "rotary"])
def test_none_passes_in_silence(procedure):
    assert [t for t in run_faults([procedure], ["spikes"], runs=12, seed=13) if t.outcome == "silent"] == []


@pytest.mark.parametrize("kind", ["rates", "increments"])
def test_a_row_that_is_as_long_as_those_lost_before_it_is_no_spike(kind):
    """Of a vehicle with a hundredth of its rows lost, gravity in two intervals was "116 single rows to one side"."""
    inputs, _ = BENCHES["still"].draw(12, 0)
    record = inputs["record"]
    factor = {"rates": 1.0, "increments": record.interval}[kind] / (
        record.interval if record.kind == "increments" else 1.0
    )
    same = replace(record, gyro=factor * record.gyro, accel=factor * record.accel, kind=kind)
    keep = np.random.default_rng(3).random(len(same)) > 0.01
    lost = replace(same, time=same.time[keep], gyro=same.gyro[keep], accel=same.accel[keep])
    assert lost.gaps.size
    assert spikes_evidence(across_gaps(lost), inputs["place"].lat) == []


def test_spikes_in_rows_before_gaps_count_in_full():
    """The bridges have a part of them, which made them seem smaller by a fifth."""
    inputs, _ = BENCHES["still"].draw(12, 0)
    record = inputs["record"]
    keep = np.ones(len(record), dtype=bool)
    keep[500::700] = False
    lost = replace(record, time=record.time[keep], gyro=record.gyro[keep], accel=record.accel[keep])
    accel, size = lost.accel.copy(), 200.0 * np.std(lost.accel[:, 0])
    accel[lost.gaps - 1, 0] += size
    (found,) = spikes_evidence(across_gaps(replace(lost, accel=accel)), inputs["place"].lat)
    assert found.figures["count"] >= len(lost.gaps) > 10
    mean = len(lost.gaps) * size / len(lost) / lost.interval
    assert found.effect.level == pytest.approx(mean / 9.8, rel=0.03)
