"""Axes of gyros on the move: constants as the specification says, unless the log speaks against them. They count once."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.honesty import moving
from benchmarks.honesty.harness import Log, simulated
from tests.alignment.test_in_motion_learnt import track_of
from truenorth.alignment import in_motion, in_motion_constants
from truenorth.alignment.in_motion_passes import fits_worse
from truenorth.errors.group import Group
from truenorth.quality.slow_aids import FIXES, LEAST, SPEEDS, Lasting

SEED = 61  # any


@pytest.fixture(scope="module")
def turning() -> Log:
    """A vehicle that turns all the time, its gyros of navigation grade."""
    case = next(case for case in moving.CASES if "S-turns" in case.name)
    return simulated(case.scenario(np.random.default_rng([SEED, 0])), SEED, 0)


def seen_by(monkeypatch, log):
    """The answer of a log, and the task of the last pass."""
    tasks = []
    own = in_motion.moving_answer

    def spy(task, *others):
        tasks.append(task)
        return own(task, *others)

    monkeypatch.setattr(in_motion, "moving_answer", spy)
    answer = in_motion.align_in_motion(
        log.record, "navigation", odometer=log.aiding["odometer"], position=log.start, zupt=False
    )
    return answer, tasks[-1]


@pytest.mark.slow
def test_axes_of_gyros_that_are_constants_count_once(monkeypatch, turning):
    """Misalignments of 2 arcsec as noise in turns besides their states made the sigma of heading two to three times as large."""
    answer, task = seen_by(monkeypatch, turning)
    assert answer.status == "aligned", answer.reasons
    assert task.steady
    assert task.model.turn_noise == (0.0, 0.0)
    true = np.arctan2(*turning.C_nb(answer.time)[:2, 1])
    off = (answer.heading - true + np.pi) % (2.0 * np.pi) - np.pi
    sigma = float(answer.euler_sigma[0])
    assert abs(off) < 4.0 * sigma
    again = replace(task, steady=False).with_spec(task.spec)
    as_noise = again.run(task.by_the_earth(), gated=True)
    assert sigma < 0.6 * float(as_noise.sigma[-1, 2])


@pytest.mark.slow
def test_axes_of_gyros_that_change_are_noise_in_turns(monkeypatch, turning):
    """Turned by 60 arcsec (30 sigmas) from one S-turn to the next: what no constant explains is noise in turns."""
    record = turning.record
    other = np.where(np.floor(record.time / 20.0) % 2 == 0.0, 1.0, -1.0) * np.radians(60.0 / 3600.0)
    gyro = record.gyro.copy()
    gyro[:, 0] += other * record.gyro[:, 2]
    gyro[:, 1] -= other * record.gyro[:, 2]
    _, task = seen_by(monkeypatch, replace(turning, record=replace(record, gyro=gyro)))
    assert not task.steady
    assert max(task.model.turn_noise) > 0.0


ALONG, ALL = (LEAST, 1.0, LEAST), (1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("name", "sizes", "steady"),
    [
        (FIXES, ALL, True),
        (SPEEDS, ALL, True),
        ("odometer", ALL, False),
        ("odometer", ALONG, True),
        ("velocity log", ALL, False),
    ],
)
def test_slow_errors_of_a_receiver_hide_no_axes_nor_does_what_a_wheel_slips_along_its_way(
    monkeypatch, name, sizes, steady
):
    """They do not turn with the vehicle; a slip sideways does, and looks as a wrong heading does. With fixes that wander, three
    quarters of heading's variance was noise in turns that its states count already."""
    one = np.ones((400, 3))
    found = SimpleNamespace(track=track_of(one, one), settled=True)
    constant = SimpleNamespace(steady=True)
    task = SimpleNamespace(
        steady=False, lasting={name: Lasting(Group("slow", np.array(sizes)))}, with_constant_axes=lambda: constant
    )
    monkeypatch.setattr(in_motion_constants, "once_more", lambda task, before, first: found)
    assert in_motion_constants.as_specified(task, found, None)[0].steady is steady


def test_the_log_decides():
    """By the likelihood, beyond what chance explains; and a model that rejects more of the log explains less of it."""
    rng = np.random.default_rng(SEED)
    innovation = rng.standard_normal((400, 3))
    right = track_of(innovation, np.ones((400, 3)))
    assert not fits_worse(right, track_of(1.002 * innovation, np.ones((400, 3))))
    assert fits_worse(right, track_of(1.1 * innovation, np.ones((400, 3))))
    (residuals,) = right.residuals
    used = residuals.used.copy()
    used[7] = False
    assert fits_worse(right, replace(right, residuals=(replace(residuals, used=used),)))
