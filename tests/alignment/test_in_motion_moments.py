"""A receiver whose velocities are means over its interval: of another moment than its places, and without the antenna's swing."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.aiding.source import Aiding, state
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.in_motion_learnt import learnt_evidence
from truenorth.campaign.fault_benches import DRIVE
from truenorth.navigation import Mounting
from truenorth.quality.swing import swing, unseen_sigma, with_unseen_arm
from truenorth.records import ImuRecord
from truenorth.simulation.scenario import read_scenario
from truenorth.state.layout import ANTENNA_ARM, Layout
from truenorth.state.track import Track

ARM = np.array([0.3, -0.2, 2.0])
NOISE = 0.03  # m/s


def recorded(grade, seed, late, mean, arm=ARM, rate=1.0):
    """A drive on rough ground; a receiver whose fixes are so late, s, its velocities a mean over so many seconds before."""
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
            "rate": f"{rate} Hz",
            "position_noise": "0.5 m",
            "velocity_noise": f"{NOISE} m/s",
            "lever_arm": [f"{x} m" for x in arm],
        },
    }
    scenario = read_scenario(mapping)
    log = scenario.simulate(seed=seed)
    gnss = scenario.simulate_aiding(seed=seed)["gnss"].record
    if mean > 0.0:
        times = np.maximum(gnss.time[:, None] - np.linspace(0.0, mean, 20), log.record.time[0])
        at = log.motion.states(times.ravel())
        v = at.v_n + np.einsum("kij,kj->ki", at.C_nb, np.cross(at.w_ib_b, arm))
        noise = NOISE * np.random.default_rng(seed).standard_normal(gnss.v_n.shape)
        gnss = replace(gnss, v_n=v.reshape(*times.shape, 3).mean(axis=1) + noise)
    return log, replace(gnss, time=gnss.time + late)


def driven(grade, seed, late, mean, said=True):
    """Alignment on such a drive."""
    log, gnss = recorded(grade, seed, late, mean)
    antenna = Mounting(lever_arm=ARM, latency_sigma=0.2) if said else None
    return align_in_motion(log.record, grade, gnss=gnss, antenna=antenna)


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["industrial", "consumer"])
@pytest.mark.parametrize("seed", some([1, 2], [3, 4]))
def test_means_are_older_than_places_by_half_of_their_time(grade, seed):
    """One delay for both was up to 48 of its sigmas off in drives of this kind."""
    delays = driven(grade, seed, 0.3 * seed, 1.0).moving.delays
    for name, late in (("GNSS", 0.3 * seed), ("GNSS velocity", 0.3 * seed + 0.5)):
        found, sigma = delays[name]
        assert abs(found - late) < 3.3 * sigma < 0.2


@pytest.mark.slow
def test_velocities_of_the_moment_of_places_have_one_delay():
    """Of four sound receivers none has two: chance gives that in one of 148."""
    for seed in range(4):
        assert set(driven("industrial", seed, 0.6, 0.0).moving.delays) == {"GNSS"}


@pytest.mark.slow
@pytest.mark.parametrize("grade", ["industrial", "consumer"])
@pytest.mark.parametrize("mean", [0.0, 1.0])
def test_an_arm_that_is_not_said_is_no_shorter_by_a_swing_that_is_not_shown(grade, mean):
    """Up it was 37 to 57 of its sigmas off, as if there were no mast. Of twelve figures one is beyond 3.5 in 180 calls."""
    for seed in range(4):
        moving = driven(grade, seed, 0.3, mean, said=False).moving
        sigma = np.sqrt(np.diag(moving.P))[-3:]
        assert np.all(np.abs(moving.known[ANTENNA_ARM] - ARM) < 3.5 * sigma)
        assert sigma[2] > 1.0  # nothing but its swing shows it


def test_what_is_quick_of_a_rate():
    """A tone of .25 s is quick, a steady turn is not; only velocities of an estimated arm are asked, which is of any length."""
    time = 0.01 * np.arange(1, 4001)
    rate = 0.1 * np.sin(2.0 * np.pi * (time - 0.005) / 0.25)
    gyro = np.stack([rate, 0.1 * np.sin(2.0 * np.pi * time / 60.0), np.full_like(time, 0.2)], axis=1)
    record = ImuRecord(time, 0.01 * gyro, np.zeros_like(gyro), "increments", "mast")
    at = np.arange(5.03, 35.0, 1.0)
    zero = np.zeros((len(at), 3))
    source = Aiding(
        "GNSS velocity", "velocity", at, zero, zero + 0.1, ARM, states=state("GNSS", "lever arm", np.full(3, 0.5))
    )
    (found,) = with_unseen_arm([source], record, 1e-3)
    assert np.allclose(found.measured[:, 3], 0.1 * np.sin(2.0 * np.pi * at / 0.25), atol=0.003)
    assert np.allclose(found.measured[:, 4:6], 0.0, atol=0.003)
    assert not found.measured[:, 6:].any()
    assert found.states["filter"].sigma == pytest.approx(unseen_sigma(np.hypot(ARM, 0.5), 1e-3))
    known = replace(source, states={})
    assert with_unseen_arm([known], record, 1e-3)[0] is known


def test_a_swing_that_is_not_shown_is_said():
    (item,) = learnt_evidence({}, {}, 0.0, 0.14)
    assert (item.key, item.figures["size"]) == ("noise.swing", 0.14)
    assert learnt_evidence({}, {}, 0.0, 0.0) == []


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
