"""A vehicle that rests with aids: its gyros see the earth's rate, and noisy aids do not hide that they know no heading."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.aiding.aids import Gnss
from truenorth.alignment import align
from truenorth.campaign.fault_benches import RECEIVER
from truenorth.simulation.scenario import read_scenario

WAITING = {
    "name": "waiting",
    "duration": "90 s",
    "rate": "50 Hz",
    "position": {"lat": "34 deg", "lon": "109 deg", "alt": "400 m"},
    "imu": "navigation",
    "motion": {
        "kind": "sway",
        "heading": "92 deg",
        "tones": {"roll": [{"amplitude": "0.02 deg", "period": "1.7 s", "phase": "30 deg"}]},
    },
    "gnss": RECEIVER,
}


@pytest.fixture(scope="module")
def waiting():
    built = read_scenario(WAITING)
    return built.simulate(seed=3).record, built.simulate_aiding(seed=3)["gnss"].record, built.imu_spec


def _off(answer) -> float:
    return float(abs((np.degrees(answer.heading) - 92.0 + 180.0) % 360.0 - 180.0))


def test_a_sound_log_passes(waiting) -> None:
    record, gnss, spec = waiting
    answer = align(record, imu=spec, aid=Gnss(gnss))
    assert not any(item.key.startswith("rate.") for item in answer.evidence)
    assert _off(answer) < 3.0 * np.degrees(answer.euler_sigma[0])


def test_gyros_whose_axes_are_exchanged_miss_the_earths_rate(waiting) -> None:
    record, gnss, spec = waiting
    answer = align(replace(record, gyro=record.gyro[:, [0, 2, 1]]), imu=spec, aid=Gnss(gnss))
    assert answer.status == "inconsistent"
    assert any(item.key == "rate.misses" for item in answer.evidence)


def test_velocities_a_hundred_times_as_noisy_give_no_heading_that_is_not_there(waiting) -> None:
    """In cm/s by mistake: of the vehicle at rest only the noise grows; a real one was 65 deg off, 22 of its sigmas."""
    record, gnss, spec = waiting
    short = record.between(None, 68.0)
    answer = align(short, imu=spec, aid=Gnss(replace(gnss, v_n=100.0 * gnss.v_n)))
    sigma = np.degrees(answer.euler_sigma[0])
    assert answer.status not in ("aligned",) or _off(answer) < 3.0 * sigma
