"""A receiver whose velocities are means over its interval: of another moment than its places, and without the antenna's swing."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment.in_motion import align_in_motion
from truenorth.campaign.fault_benches import DRIVE
from truenorth.navigation import Mounting
from truenorth.quality.swing import swing
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import Layout
from truenorth.state.track import Track

ARM = np.array([0.3, -0.2, 2.0])
NOISE = 0.03  # m/s


def driven(grade, seed, late, mean):
    """Delays that are found of a receiver, s: its fixes are so late, its velocities a mean over so many seconds before."""
    tones = {
        name: [{"amplitude": "0.4 deg", "period": f"{period} s"}] for name, period in (("roll", 0.45), ("pitch", 0.37))
    }
    mapping = {
        "name": "mast",
        "duration": "160 s",
        "rate": "100 Hz",
        "position": {"lat": "45 deg", "lon": "10 deg"},
        "imu": grade,
        "motion": {"kind": "legs", "heading": f"{70 * seed} deg", "legs": DRIVE},
        "disturbances": [{"kind": "sway", "tones": tones}],
        "gnss": {
            "rate": "1 Hz",
            "position_noise": "0.5 m",
            "velocity_noise": f"{NOISE} m/s",
            "lever_arm": [f"{x} m" for x in ARM],
        },
    }
    scenario = read_scenario(mapping)
    log = scenario.simulate(seed=seed)
    gnss = scenario.simulate_aiding(seed=seed)["gnss"].record
    if mean > 0.0:
        times = np.maximum(gnss.time[:, None] - np.linspace(0.0, mean, 20), log.record.time[0])
        at = log.motion.states(times.ravel())
        v = at.v_n + np.einsum("kij,kj->ki", at.C_nb, np.cross(at.w_ib_b, ARM))
        noise = NOISE * np.random.default_rng(seed).standard_normal(gnss.v_n.shape)
        gnss = replace(gnss, v_n=v.reshape(*times.shape, 3).mean(axis=1) + noise)
    gnss = replace(gnss, time=gnss.time + late)
    antenna = Mounting(lever_arm=ARM, latency_sigma=0.2)
    answer = align_in_motion(log.record, grade, gnss=gnss, antenna=antenna)
    return answer.moving.delays


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["industrial", "consumer"])
@pytest.mark.parametrize("seed", some([1, 2], [3, 4]))
def test_means_are_older_than_places_by_half_of_their_time(grade, seed):
    """One delay for both was up to 48 of its sigmas off in drives of this kind."""
    delays = driven(grade, seed, 0.3 * seed, 1.0)
    for name, late in (("GNSS", 0.3 * seed), ("GNSS velocity", 0.3 * seed + 0.5)):
        found, sigma = delays[name]
        assert abs(found - late) < 3.3 * sigma < 0.2


@pytest.mark.slow
def test_velocities_of_the_moment_of_places_have_one_delay():
    """Of four sound receivers none has two: chance gives that in one of 148."""
    for seed in range(4):
        assert set(driven("industrial", seed, 0.6, 0.0)) == {"GNSS"}


def test_swing_is_what_an_interval_averages():
    """About x by a tone of .25 s: RMS along y by the arm upward; a steady turn has none."""
    time = 0.01 * np.arange(1, 2001)
    rate = 0.1 * np.sin(2.0 * np.pi * time / 0.25)
    gyro = np.stack([rate, np.zeros_like(time), np.full_like(time, 0.2)], axis=1)
    record = ImuRecord(time, gyro, np.zeros_like(gyro), "rates", "mast")
    at = np.arange(2.0, 18.0)
    zero = np.zeros((len(at), 3))
    level, P = np.tile(np.eye(3), (len(at), 1, 1)), np.tile(np.eye(15), (len(at), 1, 1))
    track = Track(at, level, zero, zero, np.zeros((len(at), 15)), P, Layout(), ())
    found = swing(track, record, np.array([0.0, 1.0, 2.0]), at)
    assert np.allclose(found[:, 1], 2.0 * 0.1 / np.sqrt(2.0), rtol=0.02)
    assert np.allclose(found[:, 0], 0.0, atol=1e-6)  # the steady turn on the arm forward
    assert np.array_equal(swing(track, record, np.zeros(3), at), zero)
