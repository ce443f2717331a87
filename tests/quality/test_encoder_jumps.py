"""An encoder that slips is found by its jump, whatever its resolution and however the base sways; sound ones are left alone."""

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.quality.encoder_jumps import jump_evidence

ARCSEC = np.radians(1.0) / 3600.0


def sway(rng, time):
    """A turn of the base about two axes, as an encoder counts it more than the gyros."""
    tones = [(rng.uniform(0.02, 0.14), rng.uniform(5.0, 12.0), rng.uniform(0.0, 6.28)) for _ in range(4)]
    first, second = (
        sum(a * np.sin(2.0 * np.pi * time / T + phase) for a, T, phase in part) for part in (tones[:2], tones[2:])
    )
    return np.stack([first, second], axis=-1)


def counted(x, rate, time, step):
    """`x` less a steady turn, in counts of an encoder that turns by it."""
    turn = rate * time[:, None]
    return step * np.round((x + turn) / step) - turn


@pytest.mark.parametrize("rows", [10.0, 50.0, 100.0])
@few_and_all(20, few=5)
def test_a_jump_is_found_where_it_is(rows, runs):
    for run in range(runs):
        rng = np.random.default_rng([run, 7])
        time = np.arange(0.0, 240.0, 1.0 / rows)
        x = counted(sway(rng, time), rng.uniform(0.05, 0.3, 2), time, ARCSEC)
        axis, row, size = rng.integers(2), int(rng.uniform(0.1, 0.9) * len(time)), np.radians(rng.uniform(0.03, 5.0))
        x[row:, axis] += size
        (found,) = jump_evidence(time, np.zeros_like(x), x)
        assert found.figures["axis"] == str(axis + 1)
        assert found.figures["size"] == pytest.approx(size, rel=0.1)
        assert abs(found.figures["time"] - time[row]) < 3.0 / rows
        assert found.effect.heading == abs(found.figures["size"])


@pytest.mark.parametrize("step", [1.0, 60.0, 600.0, 5400.0])
@few_and_all(20, few=5)
def test_the_steps_of_a_resolution_are_no_jumps(step, runs):
    for run in range(runs):
        rng = np.random.default_rng([run, 8])
        time = np.arange(0.0, 240.0, 0.02)
        x = counted(sway(rng, time), rng.uniform(0.03, 0.3, 2), time, step * ARCSEC)
        assert jump_evidence(time, np.zeros_like(x), x) == []


def test_a_row_that_was_misread_comes_back():
    time = np.arange(0.0, 240.0, 0.02)
    x = counted(sway(np.random.default_rng(3), time), np.array([0.2, 0.1]), time, ARCSEC)
    x[4000, 1] += 0.3
    x[7000:7003, 0] -= 0.1
    assert jump_evidence(time, np.zeros_like(x), x) == []


@pytest.mark.parametrize("late", [0.001, 0.02])
def test_an_encoder_that_is_late_jumps_where_its_axis_starts_and_stops(late):
    """From rest to 10 deg/s within a row, and back: it is no slip. One at rest is, and one as the axis turns."""
    time = np.arange(0.0, 240.0, 0.02)
    goes = (time % 40.0 > 30.0).astype(float)
    own = np.radians(10.0) * 0.02 * np.cumsum(goes)[:, None] * np.array([1.0, 0.0])
    seen = np.interp(time - late, time, own[:, 0])
    x = counted(sway(np.random.default_rng(5), time), np.zeros(2), time, ARCSEC)
    x[:, 0] += seen - own[:, 0]
    assert jump_evidence(time, own, x) == []
    for row in (5000, 5750):  # at rest, and as it turns
        slipped = x.copy()
        slipped[row:, 0] += np.radians(0.3)
        (found,) = jump_evidence(time, own, slipped)
        assert found.figures["size"] == pytest.approx(np.radians(0.3), rel=0.1)


def test_rows_that_are_lost_are_no_jump():
    time = np.arange(0.0, 240.0, 0.02)
    x = counted(sway(np.random.default_rng(6), time), np.array([0.2, 0.1]), time, ARCSEC)
    there = np.ones(len(time), dtype=bool)
    there[3000:3040] = there[8000:8003] = there[9000] = False
    there &= np.random.default_rng(7).random(len(time)) > 0.03
    assert jump_evidence(time[there], np.zeros_like(x[there]), x[there]) == []
    for row in (5000, 9000):  # one of them lost
        slipped = x.copy()
        slipped[row:, 1] += np.radians(0.1)
        (found,) = jump_evidence(time[there], np.zeros_like(x[there]), slipped[there])
        assert found.figures["size"] == pytest.approx(np.radians(0.1), rel=0.1)


@pytest.mark.parametrize("step", [2.6, 158.0, 1260.0])  # arcsec: of 19, 13 and 10 bits
def test_an_axis_that_seldom_turns_counts_and_does_not_slip(step):
    """A turn of 90 deg in 600 s is less than two rows in a hundred: each count of it was a jump, and the turn one of 87 deg."""
    time = np.arange(0.0, 1800.0, 0.02)
    rate = np.radians(10.0) * np.clip(5.5 - np.abs(time % 600.0 - 300.0), 0.0, 1.0)
    own = np.cumsum(rate)[:, None] * 0.02
    x = step * ARCSEC * np.round((sway(np.random.default_rng(9), time)[:, :1] * 0.01 + own) / (step * ARCSEC)) - own
    rests = rate == 0.0
    x[rests, 0] = np.round(own[rests, 0] / (step * ARCSEC)) * step * ARCSEC - own[rests, 0]  # the base at rest, too
    assert jump_evidence(time, own, x) == []


def test_a_short_log_shows_nothing():
    assert jump_evidence(np.arange(10.0), np.zeros((10, 2)), np.zeros((10, 2))) == []
    assert jump_evidence(np.arange(100.0), np.zeros((100, 2)), np.zeros((100, 2))) == []


@pytest.mark.slow
@pytest.mark.parametrize("runs", [6])
def test_an_indexer_that_slips_is_no_longer_silent(runs):
    """Seed 9100, run 5: .31 deg of the inner axis were 143 sigmas of level, `aligned`."""
    for run in range(5, 5 - runs, -1):
        inputs, truth = BENCHES["rotary"].draw(9100, run)
        encoder, rng = inputs["encoder"], np.random.default_rng(run)
        angles = encoder.angles.copy()
        row = int(rng.uniform(0.2, 0.9) * len(angles))
        angles[row:, 1] += np.radians(rng.uniform(0.06, 1.0))
        slipped = type(encoder)(encoder.time, angles)
        answer = BENCHES["rotary"].align(inputs | {"encoder": slipped})
        assert answer.status == "inconsistent"
        assert any(item.key in ("encoder.jumps", "encoder.zero") for item in answer.evidence)
        assert max(np.abs(x).max() for x in misses(BENCHES["rotary"].align(inputs), truth).values()) < 4.0
