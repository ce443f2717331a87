"""Two counters in turn are known by their steps, however coarse; one counter is one, whatever it counts."""

import math

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.quality.alternation import alternation_evidence
from truenorth.quality.other_counts import counts_in_turn
from truenorth.records import ImuRecord
from truenorth.state.wording import sentence

ROWS, STEP = 15_000, 0.00122  # m/s a row of 10 ms: gravity is 80 of them


def counted(rng, *, carried):
    """An IMU at rest whose accelerometers count gravity and a noise of a step."""
    force = (
        np.array([0.3, -0.2, 80.3])
        + rng.uniform(-0.5, 0.5, 3)
        + rng.uniform(0.3, 1.0) * rng.standard_normal((ROWS + 1, 3))
    )
    return STEP * (np.diff(np.round(np.cumsum(force, axis=0)), axis=0) if carried else np.round(force[1:]))


def record(accel):
    return ImuRecord(
        0.01 * np.arange(1.0, ROWS + 1.0),
        1e-8 * np.random.default_rng(3).standard_normal((ROWS, 3)),
        accel,
        "increments",
    )


@pytest.mark.parametrize("carried", [True, False])
@pytest.mark.parametrize("angle", [0.04, 0.12])
def test_every_second_row_of_another_sensor_is_found_and_its_turn_too(angle, carried):
    for seed in range(10):
        rng = np.random.default_rng([1, seed])
        accel, axis = counted(rng, carried=carried), [*rng.standard_normal(2), 0.0]
        C = dcm_from_rotation_vector(math.radians(angle) * np.array(axis) / np.linalg.norm(axis))
        accel[1::2] = accel[1::2] @ C.T
        log = record(accel)
        assert counts_in_turn(log, 2)
        (found,) = alternation_evidence(log)
        assert found.key in ("record.alternates", "record.other_counts")
        # The mean is half of it off; coarse counts know that to some arc seconds.
        assert math.degrees(found.effect.level) == pytest.approx(0.5 * angle, abs=0.02)


@pytest.mark.parametrize("carried", [True, False])
@few_and_all(20, few=5)
def test_one_counter_is_one(carried, runs):
    for seed in range(runs):
        log = record(counted(np.random.default_rng([2, seed]), carried=carried))
        assert not any(counts_in_turn(log, period) for period in (2, 3, 5))
        assert alternation_evidence(log) == []


def test_nor_is_one_of_half_a_step_in_each_row_or_without_counts():
    rng = np.random.default_rng(4)
    accel = counted(rng, carried=True)
    accel[:, 0] = STEP * (np.arange(ROWS) % 2 + rng.integers(-1, 2, ROWS) * (rng.random(ROWS) < 0.1))
    assert not counts_in_turn(record(accel), 2)
    assert not counts_in_turn(record(accel + 1e-6 * rng.standard_normal(accel.shape)), 2)


def test_rows_that_somebody_has_put_between_are_named_as_well_and_do_next_to_nothing():
    rng = np.random.default_rng(5)
    accel = counted(rng, carried=False)
    own = accel[::2]
    accel[3:-4:2] = (9.0 * (own[1:-2] + own[2:-1]) - own[:-3] - own[3:]) / 16.0
    (found,) = alternation_evidence(record(accel))
    assert found.key == "record.other_counts"
    assert found.effect.level < math.radians(0.01)
    assert "put between" in sentence(found)
