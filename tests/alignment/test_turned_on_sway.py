"""Gyros that are turned against their accelerometers, on a base that sways and on an indexer; and a sea that pushes in step."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from tests.quality.test_tilt import _moored
from tests.quality.test_tilt_on_indexer import base_in_imu
from tests.runs import some
from truenorth.alignment import align
from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.position import Position
from truenorth.quality.tilt import _cells
from truenorth.quality.tilt_bench import TiltBench

SEED = 46


def turned(record, degrees):
    return replace(record, gyro=record.gyro @ dcm_from_rotation_vector(np.radians(degrees)).T)


def turn_found(answer):
    return next((item.figures for item in answer.evidence if item.key == "tilt.turned"), None)


@pytest.mark.parametrize(
    ("run", "degrees"),
    some([(2, [0.1, 0.1, -0.35])], [(1, [0.0, 0.0, 2.0]), (3, [-0.7, 0.25, -0.3]), (4, [1.5, -0.5, -1.5])]),
)
def test_a_turn_on_a_sway_is_found_and_refused(run, degrees):
    inputs, _ = BENCHES["swaying"].draw(SEED, run)
    answer = BENCHES["swaying"].align(inputs | {"record": turned(inputs["record"], degrees)})
    assert np.degrees(turn_found(answer)["turn"]) == pytest.approx(np.linalg.norm(degrees), abs=0.06)
    assert answer.status == "inconsistent"


@pytest.mark.parametrize("run", some([1], [5, 6]))
def test_gyros_as_good_as_their_specification_are_not_turned(run):
    """Of run 1 pieces of the log show a turn of .4 +- .3 deg; of run 5 a motion fitted anew is likelier by 1000, not the turn."""
    inputs, _ = BENCHES["swaying"].draw(SEED, run)
    answer = BENCHES["swaying"].align(inputs)
    assert turn_found(answer) is None
    assert answer.status == "aligned"


@pytest.mark.parametrize("seed", some([16], [3, 8, 15, 22]))
def test_waves_that_carry_a_ship_as_they_roll_her_turn_no_gyros(seed):
    ship = _moored(seed)
    answer = align(ship.simulate(seed=seed).record, Position.from_degrees(50.0, 1.0), imu=ship.imu_spec)
    assert turn_found(answer) is None
    assert answer.status == "aligned"


def bench_of(record, encoder):
    theta, force, interval, middle = _cells(record)
    base = partial(base_in_imu, encoder)(middle.ravel()).reshape(*middle.shape, 3, 3)
    return TiltBench(force, interval, base), theta


@pytest.mark.parametrize("degrees", [[0.0, 0.0, 0.0], [0.3, -0.2, 0.1], [-1.0, 2.0, 1.5]])
def test_an_indexer_shows_the_turn_about_each_axis(degrees):
    inputs, _ = BENCHES["rotary"].draw(SEED, 1)
    bench, theta = bench_of(turned(inputs["record"], degrees), inputs["encoder"])
    found, sigma = bench.turned(theta)
    assert np.degrees(found) == pytest.approx(degrees, abs=0.05)
    assert np.all(np.abs(found - np.radians(degrees)) < 4.0 * sigma)


@pytest.mark.parametrize("degrees", [[0.0, 0.0, 0.0], [0.1, -0.26, -0.22]])
def test_a_turn_on_an_indexer_is_refused(degrees):
    """193 sigmas of heading, `aligned`."""
    inputs, _ = BENCHES["rotary"].draw(SEED, 0)
    answer = BENCHES["rotary"].align(inputs | {"record": turned(inputs["record"], degrees)})
    assert (turn_found(answer) is not None) == any(degrees)
    assert (answer.status == "inconsistent") == any(degrees)
