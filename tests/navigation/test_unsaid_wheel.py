"""An odometer of which nothing is said, after an alignment at rest: what it counts and how it sits is estimated."""

import numpy as np

from tests.helpers import start_before
from truenorth.aiding.aids import WHEEL, Odometer
from truenorth.core.attitude import misalignment
from truenorth.navigation import navigate
from truenorth.records.specs import imu_spec
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import DV
from truenorth.state.mounting import Mounting


def van(scale):
    """A van of two minutes whose wheel counts wrong by `scale` and sits askew by two degrees: log, wheel and truth."""
    wheel = {"rate": "10 Hz", "output": "speed", "noise": "0.02 m/s", "scale": scale, "mounting": ["2 deg", "-1 deg"]}
    shipped = read_scenario("van").to_mapping()
    scenario = read_scenario({**shipped, "duration": "120 s", "imu": "tactical", "odometer": wheel})
    simulation = scenario.simulate(seed=5)
    return simulation, scenario.simulate_aiding(seed=5)["odometer"].record


def test_its_scale_and_its_seat_are_estimated():
    simulation, wheel = van("2 %")
    record, truth, spec = simulation.record, simulation.truth, imu_spec("tactical")
    sigma = np.repeat([1e-3, 0.01, 0.3, spec.gyro_bias, spec.accel_bias], 3)
    place = (truth.lat[0], truth.lon[0], truth.alt[0])
    biases = (simulation.errors.gyro_bias, simulation.errors.accel_bias)
    start = start_before(record, truth.C_nb[0], truth.v_n[0], place, biases, sigma)
    unsaid = navigate(record, start, aid=Odometer(wheel), imu=spec)
    assert unsaid.status == "navigated", unsaid.reasons
    assert abs(unsaid.estimated()["odometer scale"]["value"][0] - 0.02) < 0.005
    end = np.searchsorted(truth.time, unsaid.track.time[-1] - 1e-6)
    at_end = unsaid.track.sigma[-1]
    assert np.abs(misalignment(unsaid.track.C_nb[-1], truth.C_nb[end]) / at_end[:3]).max() < 4.0
    assert np.abs((unsaid.track.v_n[-1] - truth.v_n[end]) / at_end[DV]).max() < 4.0
    same = navigate(record, start, aid=Odometer(wheel, WHEEL), imu=spec)
    np.testing.assert_array_equal(same.track.v_n, unsaid.track.v_n)
    exact = navigate(record, start, aid=Odometer(wheel, Mounting()), imu=spec)  # said to be known, and is not
    assert exact.status == "inconsistent"
