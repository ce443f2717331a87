"""Accelerometers that warm up on a base that sways: what the vertical one shows says what the level ones may do."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth import align
from truenorth.alignment.warming_up import _fitted
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.earth import GRAVITY_EQUATOR

UG = 1e-6 * GRAVITY_EQUATOR
SWAYING = BENCHES["swaying"]


def warmed(record, sizes, time):
    """The record of accelerometers that warm up by so many ug within this part of the log."""
    course = -np.expm1(-np.arange(1, len(record) + 1) / (time * len(record)))
    scale = record.steps[:, None] if record.kind == "increments" else 1.0
    return replace(record, accel=record.accel + scale * np.outer(course, np.multiply(sizes, UG)))


def _named(answer):
    return [item for item in answer.evidence if item.key == "rival.accels_warm_up"]


def test_three_accelerometers_that_warm_up_together_are_named():
    """The vertical one by 80 ug, the level ones by half of it: heading moves by two sigmas."""
    inputs, truth = SWAYING.draw(41130, 0)
    sound = SWAYING.align(inputs)
    assert not _named(sound)
    record = warmed(inputs["record"], [-13.0, -42.0, -81.0], 0.43)
    found = align(record, inputs["place"], inputs["imu"])
    (named,) = _named(found)
    assert named.kind == "bounded"
    assert named.figures["size"] == pytest.approx(81.0 * UG, rel=0.2)
    moved = abs(misses(replace(sound, C_nb=found.C_nb), truth)["heading"][0] - misses(sound, truth)["heading"][0])
    assert moved > 1.5
    assert 0.5 < named.effect.heading / (moved * sound.euler_sigma[0]) < 2.0
    assert found.status == "inconsistent" or np.abs(misses(found, truth)["heading"]) < 3.0


@pytest.mark.slow
def test_a_vertical_accelerometer_that_steps_alone_is_no_warming():
    inputs, _ = SWAYING.draw(41130, 1)
    record = inputs["record"]
    accel = record.accel.copy()
    late = record.time > record.time[0] + 0.6 * record.duration
    accel[late, 2] += 100.0 * UG * (record.steps[late] if record.kind == "increments" else 1.0)
    assert not _named(align(replace(record, accel=accel), inputs["place"], inputs["imu"]))


def test_what_the_log_leaves_open_counts_as_much_as_what_it_shows():
    """The third axis shows 5; the first, which nothing shows, leaves what such a size does: its effect is of that size."""
    rng = np.random.default_rng(3)
    s = rng.standard_normal((600, 3)) * [1e-5, 1.0, 1.0]
    nu = 5.0 * s[:, 2] + rng.standard_normal(600)
    found = _fitted(0.4, s, nu, np.diag([1.0, 1.0, 0.0]), (200, 3))
    assert found.ratio == pytest.approx(25.0 * np.sum(s[:, 2] ** 2), rel=0.1)
    assert found.size[2] == pytest.approx(5.0, abs=0.2)
    assert abs(found.size[0]) < 0.2
    assert 2.0 < np.sqrt(found.square[0]) < 6.0
    assert np.sqrt(found.square[1]) < 0.2


@pytest.mark.slow
def test_sound_logs_show_no_warming():
    """20 of them; chance gives one of 148 as much."""
    for run in range(20):
        inputs, _ = SWAYING.draw(90210, run)
        assert not _named(SWAYING.align(inputs))
