"""Gyros whose level axes are reversed: north half a turn off, which an odometer follows as well."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment.in_motion_axes import HALF_TURN
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.state.limits import limit


@pytest.mark.slow
@pytest.mark.parametrize("bench", ["odometer", pytest.param("gnss", marks=pytest.mark.slow)])
def test_gyros_half_a_turn_about_the_vertical_are_found_and_named(bench):
    """Seed 1: before, heading was 101 sigmas off with an odometer, `aligned`."""
    inputs, _ = BENCHES[bench].draw(1, 0)
    record = inputs["record"]
    answer = BENCHES[bench].align(inputs | {"record": replace(record, gyro=record.gyro * HALF_TURN)})
    assert answer.status == "inconsistent"
    found = {item.key: item for item in answer.evidence}["axes.half_turn"]
    assert found.figures["ratio"] > limit("half turn")
    assert any("half a turn about the vertical" in reason for reason in answer.reasons)


@pytest.mark.slow
@pytest.mark.parametrize("bench", ["odometer", "gnss"])
def test_sound_drives_have_their_gyros_where_they_are(bench):
    for run in range(20):
        inputs, truth = BENCHES[bench].draw(77, run)
        answer = BENCHES[bench].align(inputs)
        assert answer.status == "aligned"
        assert max(np.abs(x).max() for x in misses(answer, truth).values()) < 4.0
