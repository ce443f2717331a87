"""Sensors of which nothing is said: what a wheel counts and how it sits, and how late a receiver is, is estimated."""

import numpy as np
import pytest

from tests.helpers import start_before
from tests.navigation.test_navigate import SPEC, drive, fixes
from truenorth.aiding.aids import Gnss, Odometer
from truenorth.core.attitude import misalignment
from truenorth.navigation import navigate
from truenorth.records.specs import imu_spec
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import DV
from truenorth.state.mounting import Mounting

__all__ = ["drive"]  # the fixture of a car that turns twice


@pytest.mark.slow
def test_a_late_receiver(drive):
    motion, record, start = drive
    gnss = fixes(motion, np.arange(1.0, 178.0), sigma=0.3)
    for late in (0.0, 0.15):
        result = navigate(record, start, aid=Gnss(gnss.shifted(late)), imu=SPEC)
        assert result.status == "navigated", result.reasons
        assert not any(reason.startswith("warning") for reason in result.reasons)
        lag = result.estimated()["GNSS lag"]
        assert abs(lag["value"][0] - late) < min(4.0 * lag["sigma"][0], 0.05)
    on_time = navigate(record, start, aid=Gnss(gnss.shifted(0.15), Mounting()), imu=SPEC)  # said to be, and is not
    assert any("late" in reason for reason in on_time.reasons)


def van(scale):
    """A van whose wheel counts wrong by `scale` and sits askew by two degrees: log, wheel and truth."""
    wheel = {"rate": "10 Hz", "output": "speed", "noise": "0.02 m/s", "scale": scale, "mounting": ["2 deg", "-1 deg"]}
    shipped = read_scenario("van").to_mapping()
    scenario = read_scenario({**shipped, "duration": "80 s", "imu": "tactical", "odometer": wheel})
    simulation = scenario.simulate(seed=5)
    return simulation, scenario.simulate_aiding(seed=5)["odometer"].record


def test_its_scale_and_its_seat_are_estimated():
    simulation, wheel = van("2 %")
    record, truth, spec = simulation.record, simulation.truth, imu_spec("tactical")
    sigma = np.repeat([1e-3, 0.01, 0.3, spec.gyro_bias, spec.accel_bias], 3)
    place = (truth.lat[0], truth.lon[0], truth.alt[0])
    biases = (simulation.errors.gyro_bias, simulation.errors.accel_bias)
    start = start_before(record, truth.C_nb[0], truth.v_n[0], place, biases, sigma)
    unsaid = navigate(record, start, aid=Odometer(wheel), imu=spec, check_clocks=False)
    assert unsaid.status == "navigated", unsaid.reasons
    assert abs(unsaid.estimated()["odometer scale"]["value"][0] - 0.02) < 0.005
    end = np.searchsorted(truth.time, unsaid.track.time[-1] - 1e-6)
    at_end = unsaid.track.sigma[-1]
    assert np.abs(misalignment(unsaid.track.C_nb[-1], truth.C_nb[end]) / at_end[:3]).max() < 4.0
    assert np.abs((unsaid.track.v_n[-1] - truth.v_n[end]) / at_end[DV]).max() < 4.0
    exact = navigate(
        record, start, aid=Odometer(wheel, Mounting()), imu=spec, check_clocks=False
    )  # said so, and is not
    assert exact.status == "inconsistent"
