"""A receiver that is led away, where the filter follows it in swings: seen by the filter's own response, and not by chance."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.runs import few_and_all
from truenorth.estimate.led_by import led_by_evidence
from truenorth.quality.led_away import doubtful_onsets, led_away_evidence
from truenorth.records import GnssRecord
from truenorth.state.limits import limit
from truenorth.state.track import Residuals

ROWS, SIGMA = 300, 0.1
TIME = np.arange(1.0, ROWS + 1.0)
AGES = np.arange(60)
SWINGS = np.exp(-AGES / 12.0) * np.cos(AGES / 2.0)  # of the innovations after a step: no exponential


def receiver(velocity):
    """At one place, with these level velocities (ROWS, 2)."""
    v_n = np.column_stack([velocity, np.zeros(ROWS)])
    return GnssRecord(TIME, np.full(ROWS, 0.7), np.full(ROWS, 1.9), np.zeros(ROWS), v_n=v_n)


def run(log):
    """A linear filter: what is left of each change of velocity swings."""
    change = np.diff(log.v_n, axis=0, prepend=0.0)
    # Predicted less measured.
    innovation = -np.stack([np.convolve(change[:, i], SWINGS)[:ROWS] for i in range(3)], axis=1)
    sigma = np.full((ROWS, 3), SIGMA)
    nis = np.sum((innovation / SIGMA) ** 2, axis=1)
    all_used = np.ones(ROWS, dtype=bool)
    return SimpleNamespace(
        residuals=[Residuals("GNSS velocity", TIME, innovation, sigma, nis, all_used, 0, TIME, ~all_used)]
    )


def noisy(log, rng):
    """The filter with noise of its innovations, the same in each pass; its first track."""
    noise = SIGMA * rng.standard_normal((ROWS, 3))

    def again(other):
        (source,) = run(other).residuals
        innovation = source.innovation + noise
        nis = np.sum((innovation / SIGMA) ** 2, axis=1)
        parts = (source.time, innovation, source.sigma, nis, source.used, 0, source.stamp, source.jumped)
        return SimpleNamespace(residuals=[Residuals(source.name, *parts)])

    return again, again(log)


@pytest.mark.slow
def test_steps_that_the_filter_follows_in_swings_are_seen_by_its_own_response_where_there_is_doubt():
    step = np.array([0.22, -0.33])
    log, doubted = receiver(np.outer(TIME > 120.0, step)), 0
    for seed in range(20):
        again, first = noisy(log, np.random.default_rng(seed))
        (source,) = first.residuals
        if led_away_evidence(source) or not doubtful_onsets(source):
            continue
        doubted += 1
        (found,) = led_by_evidence(again, first, log)
        assert found.figures["onset"] == pytest.approx(121.0, abs=2.0)
        assert found.figures["size"] == pytest.approx(np.linalg.norm(step), rel=0.5)
        assert found.effect.position == pytest.approx(found.figures["size"] * (ROWS - found.figures["onset"]))
    assert doubted >= 10  # a simpler signature sees but some of them


@few_and_all(2000, few=60)
def test_chance_shows_a_step_no_more_often_than_its_limit(runs):
    log, alarms, looks = receiver(np.zeros((ROWS, 2))), 0, 0
    for seed in range(runs):
        again, first = noisy(log, np.random.default_rng(seed))
        looks += bool(doubtful_onsets(first.residuals[0]))
        alarms += bool(led_by_evidence(again, first, log))
    expected = limit("step") * runs
    assert alarms <= expected + 4.0 * np.sqrt(expected)
    assert 0 < looks < 0.3 * runs  # each look costs passes


def test_a_receiver_that_is_off_in_every_turn_is_not_led_away():
    """A cart's, whose clock is late: each turn looks like a step, and the largest does not stand out."""
    rng = np.random.default_rng(6)
    turns = np.cumsum(np.where(np.arange(ROWS) % 15 == 7, rng.choice([-1, 1], ROWS), 0))
    log = receiver(np.outer(turns, [0.3, 0.45]))
    again, first = noisy(log, rng)
    assert doubtful_onsets(first.residuals[0])
    assert led_by_evidence(again, first, log) == []


def test_a_receiver_without_velocities_is_not_asked():
    log = GnssRecord(TIME, np.full(ROWS, 0.7), np.full(ROWS, 1.9), np.zeros(ROWS))
    assert led_by_evidence(lambda other: pytest.fail("a pass"), run(receiver(np.zeros((ROWS, 2)))), log) == []
