"""Gyros of an indexer that turn too far, by the tilt and by the angles; and a sea that pushes its base."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from benchmarks.honesty.foreign import sensed
from benchmarks.honesty.foreign_rows import moored, spun
from truenorth.alignment import rotary
from truenorth.alignment.encoder_angles import angles_at
from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.indexing import C_bs_from_angles
from truenorth.quality.tilt import check_tilt
from truenorth.records.specs import imu_spec

AXES = ("z", "x")


def base_in_imu(encoder, time):
    return np.swapaxes(C_bs_from_angles(AXES, angles_at(encoder, time, AXES)), -1, -2)


def scales(record, encoder):
    tilt = check_tilt(record, partial(base_in_imu, encoder), accel_bias=0.01)
    return {item.figures["axis"]: item.figures["scale"] for item in tilt.evidence() if item.key == "tilt.scale"}


@pytest.mark.slow
def test_waves_that_push_the_base_of_an_indexer_are_no_scale_factor():
    """Gyros that turn 11 % less would leave less of the force, and have the ship turn by 1 deg/s."""
    rng = np.random.default_rng([305, 25, 11])
    true, encoder = spun(rng, moored(rng, 200.0))
    assert scales(sensed(rng, true, imu_spec("tactical")), encoder) == {}


@pytest.mark.parametrize("scale", [-0.05, 0.05])
def test_a_gyro_that_turns_too_far_is_found(scale):
    inputs, _ = BENCHES["rotary"].draw(61010, 0)
    record = inputs["record"]
    gyro = record.gyro.copy()
    gyro[:, 0] *= 1.0 + scale
    found = scales(replace(record, gyro=gyro), inputs["encoder"])
    assert found["x"] == pytest.approx(scale, rel=0.2)


@pytest.mark.slow
def test_an_inferred_specification_is_not_held_against_its_log(monkeypatch):
    """It was taken for one that somebody gave: a sound tactical IMU was refused as in the other hemisphere (ratio 58)."""
    inputs, _ = BENCHES["rotary"].draw(61010, 1)
    given = []
    begins = rotary.what_begins
    monkeypatch.setattr(
        rotary, "what_begins", lambda *of, **asked: given.append(asked["given"]) or begins(*of, **asked)
    )
    for imu in (None, inputs["imu"]):
        BENCHES["rotary"].align(inputs | {"imu": imu})
    assert given == [False, True]
