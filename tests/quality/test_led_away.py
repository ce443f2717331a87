"""Steps of a receiver's velocity: seen where the INS contradicts them, and chance no more often than it may."""

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.quality.led_away import led_away_evidence
from truenorth.state.limits import limit
from truenorth.state.track import Residuals

ROWS, SIGMA = 300, 0.1


def seen(z, name="GNSS velocity", outliers=()):
    """Evidence of normalised innovations (ROWS, 3), a row a second."""
    time, sigma = np.arange(1.0, len(z) + 1.0), np.full((len(z), 3), SIGMA)
    used = np.ones(len(z), dtype=bool)
    used[list(outliers)] = False
    return led_away_evidence(Residuals(name, time, SIGMA * z, sigma, np.sum(z**2, axis=1), used, 0, time, ~used))


def followed(step, onset, memory):
    """What a filter of this memory leaves of a step in the innovations, in sigmas."""
    since = np.arange(ROWS) - onset
    return np.outer(np.where(since >= 0, np.exp(-np.maximum(since, 0) / memory), 0.0), step)


@pytest.mark.slow
@few_and_all(3000, few=500)
def test_chance_shows_a_step_no_more_often_than_its_limit(runs):
    rng, logs = np.random.default_rng(0), runs
    alarms = sum(bool(seen(rng.standard_normal((ROWS, 3)))) for _ in range(logs))
    expected = limit("step") * logs
    assert alarms <= expected + 4.0 * np.sqrt(expected)


@pytest.mark.parametrize("memory", [3.0, 8.0, 15.0])
def test_a_step_is_seen_where_it_begins(memory):
    rng = np.random.default_rng(1)
    step = np.array([6.0, -4.0, 0.0]) / np.sqrt(min(memory, 10.0) / 3.0)
    (found,) = seen(rng.standard_normal((ROWS, 3)) + followed(step, 120, memory))
    assert abs(found.figures["onset"] - 121.0) <= 3.0
    assert found.figures["size"] == pytest.approx(SIGMA * np.linalg.norm(step), rel=0.5)
    assert found.effect.position == pytest.approx(found.effect.velocity * (ROWS - found.figures["onset"]))


def test_a_step_whose_first_rows_were_taken_for_outliers_is_seen():
    rng = np.random.default_rng(2)
    assert seen(rng.standard_normal((ROWS, 3)) + followed([9.0, 0.0, 0.0], 200, 4.0), outliers=[200, 201])


def test_an_outlier_is_no_step_and_a_wheel_may_slip():
    rng = np.random.default_rng(3)
    z = rng.standard_normal((ROWS, 3))
    lonely = z.copy()
    lonely[77, :2] = 30.0
    assert not seen(lonely, outliers=[77])
    assert not seen(z + followed([9.0, 0.0, 0.0], 200, 4.0), name="odometer")
