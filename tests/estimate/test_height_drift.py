"""Heights of a receiver that drift away from its velocities: found with their size, and in sigma."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.campaign.fault_benches import BENCHES, misses


def drifted(run, rise):
    inputs, truth = BENCHES["navigate"].draw(61, run)
    log = inputs["gnss"]
    rising = replace(log, alt=log.alt + rise * (log.time - log.time[0]) / log.duration)
    answer = BENCHES["navigate"].align(inputs | {"gnss": rising})
    found = [item for item in answer.evidence if item.key == "gnss.height_drifts"]
    return found, float(np.abs(misses(answer, truth)["position"]).max())


@pytest.mark.slow
@pytest.mark.parametrize(("run", "rise"), [(1, -6.0), (1, 6.0), (5, -6.0), (5, 6.0), (6, 6.0), (6, -8.0), (6, -6.0)])
def test_a_drift_of_metres_is_found_and_in_sigma(run, rise):
    """It was up to 4.5 sigmas off without a word."""
    (found,), worst = drifted(run, rise)
    assert found.kind == "hint"
    assert found.figures["size"] == pytest.approx(abs(rise), abs=3.0)
    assert found.figures["rate"] * rise > 0.0
    assert worst < 3.0


def test_heights_of_a_sound_receiver_are_left_alone():
    assert drifted(1, 0.0)[0] == []
