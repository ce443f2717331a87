"""Vehicles with a wheel: the last passes, which feed nothing back, come to rest astray, or know what nothing shows."""

import numpy as np
import pytest

from tests.runs import some
from truenorth import Gnss, Odometer, align
from truenorth.alignment import in_motion
from truenorth.alignment.in_motion_open import open_track
from truenorth.core.attitude import misalignment
from truenorth.simulation.scenario import read_scenario


def tracked(seed):
    """A vehicle on tracks, an industrial IMU half a metre behind its wheel: errors of attitude over their sigmas, status."""
    rng = np.random.default_rng(seed)
    legs = []
    for _ in range(60):
        turn = {"kind": "turn", "angle": f"{100.0 * rng.normal():.1f} deg", "rate": f"{rng.uniform(20, 60):.1f} deg/s"}
        legs += [turn, {"kind": "straight", "duration": f"{rng.uniform(1, 6):.1f} s"}]
    gnss = {
        "rate": "1 Hz",
        "position_noise": "1.5 m",
        "velocity_noise": "0.05 m/s",
        "lever_arm": ["0.3 m", "0.5 m", "0.5 m"],
    }
    scenario = read_scenario(
        {
            "name": "tracked",
            "duration": "300 s",
            "rate": "100 Hz",
            "position": {"lat": "45 deg", "lon": "10 deg"},
            "imu": "industrial",
            "motion": {"kind": "legs", "heading": "70 deg", "speed": "2.5 m/s", "legs": legs},
            "gnss": gnss,
            "odometer": {"rate": "10 Hz", "noise": "0.02 m/s", "lever_arm": ["0 m", "0.5 m", "0 m"]},
        }
    )
    log, aiding = scenario.simulate(seed=seed), scenario.simulate_aiding(seed=seed)
    found = align(log.record, imu="industrial", aid=[Gnss(aiding["gnss"].record), Odometer(aiding["odometer"].record)])
    row = int(np.searchsorted(log.truth.time, found.time - 1e-6))
    return misalignment(found.C_nb, log.truth.C_nb[row]) / np.sqrt(np.diag(found.phi_covariance)), found.status


@pytest.mark.slow
def test_a_vehicle_on_tracks_knows_heading_as_it_says():
    """Headings were 4.2, 1.9 and 2.8 of sigmas off that were half as large as the closed loop's."""
    off, statuses = zip(*(tracked(seed) for seed in (1, 6, 8)), strict=True)
    assert set(statuses) == {"aligned"}
    assert np.abs(off).max() < 4.0
    assert np.sqrt(np.mean(np.square(off)[:, 2])) < 1.5


def about_town(seed):
    """A van with a consumer IMU, no stop at first, a wheel that counts 1 % too little: the logs, and what is asked of `align`."""
    mapping = read_scenario("van").to_mapping() | {"duration": "240 s", "imu": "consumer"}
    mapping["motion"]["wait"] = "0 s"
    mapping["odometer"] = {"rate": "10 Hz", "noise": "0.05 m/s", "scale": "-1 %"}
    scenario = read_scenario(mapping)
    log, aiding = scenario.simulate(seed=seed), scenario.simulate_aiding(seed=seed)
    return log, lambda: align(
        log.record, imu="consumer", aid=[Gnss(aiding["gnss"].record), Odometer(aiding["odometer"].record)]
    )


@pytest.mark.parametrize("seed", some([4], [1, 5]))
def test_a_wheel_is_known_no_better_than_the_way_shows(seed, monkeypatch):
    """An open loop's velocity is off by tens of m/s in the end, and a scale seemed to be shown by those: twice as well as it was.

    Level was 7.9 sigmas off, or the scale 2.5, with other seeds of another simulator 57.
    """
    log, aligned = about_town(seed)
    closed_loops = []
    monkeypatch.setattr(
        in_motion, "open_track", lambda task, first, track: closed_loops.append(track) or open_track(task, first, track)
    )
    found = aligned()
    scale = found.moving.track.layout.slice_of("odometer scale").start
    off = misalignment(found.C_nb, log.motion.states(np.array([found.time])).C_nb[0])
    assert found.status == "aligned", found.reasons
    assert np.abs(off / np.sqrt(np.diag(found.phi_covariance))).max() < 4.0
    value, sigma = (of[-1, scale] for of in (found.moving.track.sensors, found.moving.track.sigma))
    assert abs(value + 0.01) < 4.0 * sigma
    (closed,) = closed_loops
    assert sigma > 0.9 * closed.sigma[-1, scale]
