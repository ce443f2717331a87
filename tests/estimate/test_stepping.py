"""A gyro whose bias steps is seen by the filter's own response, named, and by chance no more often than is said."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.estimate import linear_filter
from tests.runs import few_and_all
from truenorth.campaign.fault_benches import BENCHES
from truenorth.campaign.faults import _Draw
from truenorth.estimate.stepping import _Look, stepping_rivals, without_step
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.state.limits import limit

ROWS, SIGMA = 200, 1e-5  # rad/s, of what this filter measures of rates in a second
SPEC = imu_spec("tactical")
STILL = ImuRecord(np.arange(1.0, ROWS + 1.0), np.zeros((ROWS, 3)), np.zeros((ROWS, 3)), "rates", "still")


def filter_of(rng):
    """Its innovations are rates, its heading that of the last one."""
    return linear_filter.filter_of(rng, ROWS, SIGMA, lambda record: record.gyro, lambda rate: 100.0 * rate[-1].sum())


@pytest.mark.slow
@few_and_all(1000, few=100)
def test_of_sound_logs_no_more_than_is_said_have_a_gyro_that_steps(runs):
    """Markov's bound: exp(-limit / 2) of them are rivals; the band is that of a Poisson count, once in a thousand."""
    rng = np.random.default_rng(17)
    ratios = []
    for _ in range(runs):
        run = filter_of(rng)
        ratios += [item.ratio for item in stepping_rivals([run], run(STILL), STILL, SPEC)]
    most = runs * math.exp(-0.5 * limit("rival"))
    assert sum(ratio > limit("rival") for ratio in ratios) <= most + 3.1 * math.sqrt(most) + 1.0


@pytest.mark.parametrize(("axis", "onset"), [(0, 0.32), (1, 0.55), (2, 0.78)])
def test_a_step_is_named_with_axis_time_and_size(axis, onset):
    """Between the moments that are asked for, from the size on that stands out of the noise by eight sigmas."""
    run = filter_of(np.random.default_rng(5))
    size = 8.0 * SIGMA / math.sqrt(ROWS * onset * (1.0 - onset))
    log = without_step(STILL, _Look(0.0, axis, onset, -size))
    (rival,) = stepping_rivals([run], run(log), log, SPEC)
    assert rival.ratio > limit("rival")
    assert rival.figures["axis"] == "xyz"[axis]
    assert abs(rival.figures["onset"] - onset * STILL.duration) <= 0.1 * STILL.duration
    assert abs(rival.figures["size"] / size - 1.0) < 0.5
    assert rival.effect.heading > 0.0
    assert not stepping_rivals([run], run(STILL), STILL, SPEC)


@pytest.mark.parametrize("taken", [0.5, 1.0])
def test_a_step_that_was_taken_for_a_slow_error_is_found_without_it(taken):
    """A filter that took up half of a step shows no response to it; of one that took up all of it the log needs no other."""
    other, size = filter_of(np.random.default_rng(5)), 12.0 * SIGMA / math.sqrt(ROWS * 0.25)
    log = without_step(STILL, _Look(0.0, 1, 0.55, -size))
    left = without_step(STILL, _Look(0.0, 1, 0.55, -(1.0 - taken) * size))

    def taking_up(_):
        return other(left)

    assert not stepping_rivals([taking_up], taking_up(log), log, SPEC)
    found = stepping_rivals([taking_up, other], taking_up(log), log, SPEC)
    assert [item.figures["axis"] for item in found] == (["y"] if taken < 1.0 else [])
    assert all(
        item.ratio < 0.75 * 144.0 for item in found
    )  # twelve sigmas, less what the log is against the other filter


def test_increments_lose_what_a_step_adds_to_each():
    log = replace(STILL, kind="increments", time=0.5 * STILL.time)
    less = without_step(log, _Look(0.0, 2, 0.5, 2e-3)).gyro
    np.testing.assert_allclose(less[-1], [0.0, 0.0, -1e-3])
    np.testing.assert_array_equal(less[:, :2], 0.0)
    np.testing.assert_array_equal(less[0], 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("run", range(10))
def test_a_step_on_a_drive_is_not_silent(run):
    """Run 0: of 1.9 deg/h heading was 6.3 sigmas off, `aligned`, without a word."""
    assert _Draw(BENCHES["odometer"], 31129, run).trial("gyro bias step").outcome != "silent"


@pytest.mark.slow
@pytest.mark.parametrize("run", range(8))
def test_sound_drives_have_no_step(run):
    """Nor has any of 100 drawn ones: the largest ratio of a look was 2."""
    draw = _Draw(BENCHES["odometer"], 90871, run)
    answer = draw.bench.align(draw.inputs)
    assert answer.status == "aligned"
    assert not any(item.key == "rival.gyro_steps" for item in answer.evidence)
