"""Antennas of whose arm nothing is said: metres away on a ship, and neither place nor level is off by more than sigma says."""

from types import SimpleNamespace

import numpy as np
import pytest

from truenorth import Gnss, align, navigate
from truenorth.aiding.aids import ANTENNA, VEHICLE_ARM
from truenorth.alignment.in_motion_task import moving_task
from truenorth.core.attitude import misalignment
from truenorth.core.earth import radii
from truenorth.core.position import Position
from truenorth.estimate.latency import mounting_found
from truenorth.simulation import rest, simulate, simulate_sensor
from truenorth.simulation.gnss import GnssSpec
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import DP, Layout
from truenorth.state.mounting import LONGEST_ARM, Mounting


def found(arm, lag):
    """A track that has found an arm (3,) m and a delay (s), good to a metre and to .01 s."""
    layout = Layout(("GNSS lever arm", "GNSS lag"), ((5.0,) * 3, (0.2,)))
    sensors, sigma = np.zeros((1, 19)), np.full((1, 19), 1.0)
    sensors[0, 15:], sigma[0, 18] = [*arm, lag], 0.01
    return SimpleNamespace(layout=layout, sensors=sensors, sigma=sigma)


def test_an_arm_beyond_its_prior_widens_it_before_a_delay_takes_its_place():
    near, far = found((0.5, 3.0, 0.0), -0.5), found((0.5, 20.0, 0.0), -0.5)
    assert mounting_found(ANTENNA, near, "GNSS").latency == -0.5
    longer = mounting_found(ANTENNA, far, "GNSS")
    assert (longer.latency, longer.lever_arm_sigma) == (0.0, 20.0)
    assert mounting_found(longer, far, "GNSS").latency == -0.5  # now wide enough
    assert mounting_found(ANTENNA, found((0.0, 1e4, 0.0), 0.0), "GNSS").lever_arm_sigma == LONGEST_ARM
    said = Mounting(lever_arm_sigma=0.5 * VEHICLE_ARM, latency_sigma=0.2)
    assert mounting_found(said, far, "GNSS").lever_arm_sigma == said.lever_arm_sigma


def test_a_place_by_a_fix_is_known_as_well_as_the_arm():
    """Of an antenna 60 m away the IMU is 60 m from its fix, whichever way; a place that is given is the IMU's own."""
    way = rest(Position.from_degrees(45.0, 10.0), 0.3)
    record = simulate(way, rate=20.0, duration=20.0, imu="tactical", seed=1).record
    gnss = simulate_sensor(way, GnssSpec(), duration=20.0, seed=1).record

    def task(antenna, place=None):
        return moving_task(record, "tactical", None, gnss, place, None, antenna, (), True, None, 0.0)

    for antenna in (Mounting(lever_arm_sigma=60.0), Mounting(lever_arm=np.array([0.0, 60.0, 0.0]))):
        begin = task(antenna).begin
        assert min(begin.horizontal_sigma, begin.vertical_sigma) > 60.0
        assert task(antenna, Position.from_degrees(45.0, 10.0, horizontal_sigma=2.0)).begin.horizontal_sigma == 2.0


@pytest.mark.slow
@pytest.mark.parametrize("arm", [1.0, 15.0, 30.0, 60.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_ship_whose_antenna_is_far_ahead(arm, seed):
    """Of 15 m the place was 4 to 6 sigmas off, with a receiver taken to be 2.5 s early; of 30 and 60 m logs were refused."""
    straight = {"kind": "straight", "duration": "60 s"}
    legs = [straight]
    for angle in (60, -90, 120, -60):
        legs += [{"kind": "turn", "angle": f"{angle} deg", "rate": "2 deg/s"}, straight]
    gnss = {
        "rate": "1 Hz",
        "position_noise": "1 m",
        "velocity_noise": "0.05 m/s",
        "lever_arm": ["1 m", f"{arm} m", "3 m"],
    }
    scenario = read_scenario(
        {
            "name": "ship",
            "duration": "600 s",
            "rate": "50 Hz",
            "position": {"lat": "45 deg", "lon": "10 deg"},
            "imu": "tactical",
            "motion": {"kind": "legs", "heading": f"{70 * seed} deg", "speed": "6 m/s", "legs": legs},
            "gnss": gnss,
        }
    )
    log, receiver = scenario.simulate(seed=seed), scenario.simulate_aiding(seed=seed)["gnss"].record
    half, truth = 0.5 * float(log.record.time[-1]), log.truth
    start = align(log.record.between(None, half), imu="tactical", aid=Gnss(receiver.between(None, half)))
    assert start.status == "aligned", start.reasons
    row = int(np.searchsorted(truth.time, start.time - 1e-6))
    assert np.all(np.abs(misalignment(start.C_nb, truth.C_nb[row])) < 4.0 * np.sqrt(np.diag(start.phi_covariance)))
    track = (answer := navigate(log.record, start, aid=Gnss(receiver))).track
    assert answer.status == "navigated", answer.reasons
    rows = np.searchsorted(truth.time, track.time - 1e-6).clip(0, len(truth.time) - 1)
    R_M, R_N = radii(truth.lat[rows])
    north, east = (track.position[:, 0] - truth.lat[rows]) * R_M, (track.position[:, 1] - truth.lon[rows]) * R_N
    off = np.stack([east * np.cos(truth.lat[rows]), north, track.position[:, 2] - truth.alt[rows]], axis=1)
    assert np.abs(off / track.sigma[:, DP]).max() < 4.0
