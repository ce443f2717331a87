"""Biases that change on a base that sways, without a specification: the most plausible change explains what it can first."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.runs import some
from truenorth import align
from truenorth.alignment import signatures
from truenorth.alignment.bias_step import bias_signatures, seen_of
from truenorth.alignment.coloured import made
from truenorth.alignment.matched import innovations_of
from truenorth.alignment.steps_in_turn import _course, changes
from truenorth.core.position import Position
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(45.0, 10.0)


def mast(run, vertical=0.0, level=0.0):
    """A quiet mast that gusts rock, 200 s; accelerometers that change evenly from the middle on, m/s^2: the vertical one, and x."""
    rng = np.random.default_rng([92, run])

    def tone(size, shortest, longest):
        period, phase = rng.uniform(shortest, longest), rng.uniform(0.0, 360.0)
        return [{"amplitude": f"{size} deg", "period": f"{period:.4f} s", "phase": f"{phase:.2f} deg"}]

    scenario = {
        "name": "mast",
        "duration": "200 s",
        "rate": "50 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": "navigation",
        "motion": {
            "kind": "sway",
            "heading": f"{rng.uniform(0.0, 360.0):.2f} deg",
            "tones": {"roll": tone(0.05, 0.6, 0.8), "pitch": tone(0.03, 0.8, 1.1), "heading": tone(0.01, 1.0, 2.0)},
        },
        "lever_arm": ["0 m", "0 m", "2 m"],
    }
    record = read_scenario(scenario).simulate(seed=5, run=run).record
    later = np.clip(record.time / record.time[-1] - 0.5, 0.0, None) * 2.0
    change = later[:, None] * np.array([level, 0.0, vertical])
    return replace(record, accel=record.accel + change * record.interval)


def remembered(monkeypatch):
    """What `steps_in_turn` is asked, of each alignment."""
    calls, ask = [], signatures.steps_in_turn
    monkeypatch.setattr(signatures, "steps_in_turn", lambda *given: calls.append(given) or ask(*given))
    return calls


@cache
def risen(run):
    """The answer of a log whose vertical accelerometer changes by 60 ug, and what `steps_in_turn` is asked of it."""
    with pytest.MonkeyPatch.context() as patch:
        calls = remembered(patch)
        answer = align(mast(run, vertical=60.0 * 9.8e-6), PLACE)
    return answer, calls[-1]


@pytest.mark.parametrize("run", some([0], [1, 2, 3]))
def test_a_vertical_accelerometer_that_changes_is_the_only_one(run):
    """Heading is as good as before, and no level accelerometer is said to change by more than it."""
    answer, asked = risen(run)
    assert answer.status == "aligned"
    found = changes(*asked)
    assert found
    assert found[0].at % 6 == 5
    assert found[0].size == pytest.approx(60.0 * 9.8e-6, rel=0.3)
    assert all(change.ratio < 20.0 for change in found[1:])


@pytest.mark.parametrize("run", some([0], [1, 2, 3]))
def test_a_level_one_that_changes_is_seen_behind_the_vertical_one(run, monkeypatch):
    """Both change, and both are found: what the vertical one explains is not all."""
    asked = remembered(monkeypatch)
    answer = align(mast(run, vertical=60.0 * 9.8e-6, level=5e-3), PLACE)
    assert answer.status != "aligned"
    kinds = {change.at % 6 for change in changes(*asked[-1])}
    assert 5 in kinds
    assert kinds - {5}


def test_what_a_change_explains_is_what_was_matched():
    """A step or a ramp from an onset on: the innovations that it makes are those of its signature."""
    fine = risen(0)[1][0]
    for at in (5, 15, 40, 66):
        seen = innovations_of(fine, seen_of(fine, _course(at, len(fine.estimates.innovation))))
        wanted = made(seen, bias_signatures(fine), np.array([at]))[0]
        np.testing.assert_allclose(seen.white[:, :, 1], wanted, rtol=0, atol=1e-6 * np.abs(wanted).max())
