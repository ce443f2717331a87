"""A slave of which nothing is said: of the usual grade, or of a poorer one where the log speaks against that."""

import numpy as np
import pytest

import truenorth
from truenorth.aiding.aids import Master
from truenorth.campaign.fault_benches import BENCHES, misses


def slave(run, imu):
    """A flight of the faults' bench with a slave of a preset."""
    bench = BENCHES["transfer"]
    drawn = bench.__class__(bench.name, lambda rng: {**bench.scenario(rng), "imu": imu}, bench.align, bench.sits)
    return drawn.draw(61, run)


@pytest.mark.slow
@pytest.mark.parametrize("imu", ["consumer", "industrial"])
def test_the_log_says_of_which_grade(imu):
    """Before, a consumer slave was `inconsistent`: 18 of 18."""
    inputs, truth = slave(0, imu)
    answer = truenorth.align(inputs["record"], aid=[Master(inputs["master"], inputs["mounting"], matching="velocity")])
    assert answer.status == "aligned", answer.reasons
    assert answer.imu.name == imu
    assert max(float(np.abs(off).max()) for off in misses(answer, truth).values()) < 4.0


@pytest.mark.slow
def test_a_grade_that_is_given_is_not_changed():
    """What somebody said is judged, and not replaced."""
    inputs, _ = slave(0, "consumer")
    aid = [Master(inputs["master"], inputs["mounting"], matching="velocity")]
    assert truenorth.align(inputs["record"], imu="industrial", aid=aid).imu.name == "industrial"
