"""Accelerometers that warm up together are seen by the filter's own response, and by chance no more often than is said."""

import math

import numpy as np
import pytest

from tests.estimate import linear_filter
from tests.runs import few_and_all
from truenorth.campaign.fault_benches import BENCHES
from truenorth.campaign.faults import _Draw
from truenorth.estimate.warming import TIMES, warming_rivals, without_warming
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.state.limits import limit

ROWS, SIGMA = 200, 1e-4  # m/s^2, of what this filter measures of forces in a second
SPEC = imu_spec("industrial")
BIAS = math.sqrt(SPEC.bias_variance[3])
STILL = ImuRecord(
    np.arange(1.0, ROWS + 1.0), np.zeros((ROWS, 3)), np.tile([0.0, 0.0, 9.8], (ROWS, 1)), "rates", "still"
)


def filter_of(rng):
    """Its innovations are forces, its heading that of the last one."""
    return linear_filter.filter_of(rng, ROWS, SIGMA, lambda record: record.accel, lambda force: force[-1, 0])


@pytest.mark.slow
@few_and_all(2000, few=200)
def test_of_sound_logs_no_more_than_is_said_have_a_rival_that_warms_up(runs):
    """Markov's bound: exp(-limit / 2) of them; the band is that of a Poisson count, once in a thousand."""
    rng = np.random.default_rng(31)
    found = 0
    for _ in range(runs):
        run = filter_of(rng)
        found += bool(warming_rivals(run, run(STILL), STILL, SPEC))
    most = runs * math.exp(-0.5 * limit("rival"))
    assert found <= most + 3.1 * math.sqrt(most) + 1.0


@pytest.mark.parametrize("time", [15.0, 30.0, 80.0])
def test_three_sizes_of_accelerometers_that_warm_up_are_found_with_what_they_do(time):
    """With any time between those that are asked for, from the size on that stands out of the noise by six sigmas."""
    run = filter_of(np.random.default_rng(5))
    course = -np.expm1(-STILL.time / time)
    shape = np.array([1.0, -0.6, 0.3])
    size = 6.5 * SIGMA / np.linalg.norm(np.outer(course - course.mean(), shape)) * shape
    log = without_warming(STILL, -size, time)
    (rival,) = warming_rivals(run, run(log), log, SPEC)
    assert rival.ratio > limit("rival")
    assert TIMES[0] * ROWS <= 1.01 * rival.figures["time"]
    assert rival.effect.heading > 0.0
    assert not warming_rivals(run, run(STILL), STILL, SPEC)


@pytest.mark.slow
def test_accelerometers_that_warm_up_on_a_drive_are_in_sigma():
    """Seed 12, run 9: of 209 ug heading was 5.8 sigmas off, without a word."""
    draw = _Draw(BENCHES["odometer"], 12, 9)
    assert draw.trial("accel warming up").outcome == "harmless"
