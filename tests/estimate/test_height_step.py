"""Heights of a receiver that step while its vertical velocity does not: found with size and time, and in sigma."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.estimate.height_step import likely_step
from truenorth.records import GnssRecord


def climbing(step: float, seed: int = 2) -> GnssRecord:
    """400 s of a vehicle on hills: white and slow errors of height, a velocity with noise, and a step at 250 s."""
    rng, time = np.random.default_rng(seed), np.arange(400.0)
    climb = 1.5 * np.sin(time / 40.0)
    slow = np.convolve(rng.normal(0.0, 1.0, 460), np.exp(-np.arange(60) / 20.0), "valid")[:400] * 0.3
    height = 300.0 - 60.0 * np.cos(time / 40.0) + slow + rng.normal(0.0, 2.0, 400) + step * (time >= 250.0)
    v_n = np.column_stack([np.zeros((400, 2)), climb + rng.normal(0.0, 0.07, 400)])
    return GnssRecord(time, np.full(400, 0.8), np.full(400, 0.2), height, v_n)


@pytest.mark.parametrize("step", [-12.0, 20.0])
def test_the_moment_of_a_step(step):
    found = likely_step(climbing(step))
    assert found is not None
    assert found[0] == pytest.approx(250.0, abs=4.0)
    assert found[1] == pytest.approx(step, abs=3.0)


def test_no_moment_stands_out_of_a_sound_log():
    assert [likely_step(climbing(0.0, seed)) for seed in range(20)] == [None] * 20


@pytest.mark.slow
@pytest.mark.parametrize("step", [-10.0, 15.0])
def test_a_step_is_in_sigma(step):
    inputs, truth = BENCHES["navigate"].draw(61, 1)
    log = inputs["gnss"]
    half = 0.5 * (log.time[0] + log.time[-1])
    stepped = replace(log, alt=log.alt + step * (log.time >= half))
    answer = BENCHES["navigate"].align(inputs | {"gnss": stepped})
    (found,) = [item for item in answer.evidence if item.key == "gnss.height_steps"]
    assert found.figures["size"] == pytest.approx(step, abs=2.0)
    assert found.figures["time"] == pytest.approx(half, abs=5.0)
    off = misses(answer, truth)
    assert np.abs(off["position"]).max() < 3.5
    assert np.abs(off["velocity"]).max() < 3.5
