"""A bias that steps on a swaying ship is found; scale factors and misalignments are none, though two sways make them beat."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth import align
from truenorth.core.position import Position
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(45.0, 10.0)


def ship(run):
    """Sways of 18, 6 and 8 deg, roll and heading of nearly one period, the IMU 18 m from the centre."""
    rng = np.random.default_rng([91, run])

    def tone(amplitude, period):
        phase = rng.uniform(0.0, 360.0)
        return [{"amplitude": f"{amplitude} deg", "period": f"{period} s", "phase": f"{phase:.2f} deg"}]

    tones = {"roll": tone(18.0, 11.05), "pitch": tone(6.0, 7.28), "heading": tone(8.0, rng.uniform(10.7, 10.9))}
    scenario = {
        "name": "ship",
        "duration": "240 s",
        "rate": "50 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": "navigation",
        "motion": {"kind": "sway", "heading": f"{rng.uniform(0.0, 360.0):.2f} deg", "tones": tones},
        "lever_arm": ["-6 m", "10 m", "14 m"],
    }
    built = read_scenario(scenario)
    return built.simulate(seed=5, run=run).record, built.imu_spec


@pytest.mark.slow
def test_sound_ships_show_no_step():
    """20 of them. Before: 8, by likelihood ratios of up to 24. What is left adds to sigma, and refuses none."""
    found = 0
    for run in range(20):
        answer = align(ship(run)[0], PLACE, ship(run)[1])
        assert answer.status == "aligned"
        found += any(item.key.startswith("bias.") for item in answer.evidence)
    assert found <= 4


@pytest.mark.parametrize("run", some([0], [1]))
def test_a_step_is_found(run):
    record, spec = ship(run)
    assert not any(item.key.startswith("bias.") for item in align(record, PLACE, spec).evidence)
    gyro = record.gyro.copy()
    gyro[record.time > 90.0, 0] += np.radians(0.3) / 3600.0
    answer = align(replace(record, gyro=gyro), PLACE, spec)
    assert answer.status == "inconsistent"
    assert any(item.key.startswith("bias.") for item in answer.evidence)
