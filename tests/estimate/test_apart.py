"""A loop that feeds nothing back: what rows are off by is not linear, and the track is where they say."""

from dataclasses import replace

import numpy as np

from tests.navigation.test_navigate import SPEC, drive, fixes
from truenorth.aiding.sensors import from_gnss
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.errors.model import InsModel
from truenorth.estimate.run import navigate_track, with_states
from truenorth.navigation import Mounting
from truenorth.records.specs import imu_spec
from truenorth.state.layout import PHI

__all__ = ["drive"]  # the fixture of a car that turns twice

TILT = np.array([0.08, -0.05, 0.02])  # rad, of the motion that the loop is linear about


def open_loop(drive, **options):
    """Track of a loop about a motion that is tilted, its errors known at the start no better than that."""
    motion, record, start = drive
    P = start.P.copy()
    P[PHI, PHI] = np.diag([0.1**2] * 3)
    tilted = replace(start, C_nb=dcm_from_rotation_vector(TILT) @ start.C_nb, P=P)
    time = np.arange(1.0, 179.0)
    shown = motion.states(time).v_n + 0.03 * np.random.default_rng(3).standard_normal((len(time), 3))
    log = replace(fixes(motion, time, sigma=1.0), v_n=shown, velocity_sigma=np.full((len(time), 3), 0.03))
    used = from_gnss(log, Mounting(bias_sigma=0.0))
    model = with_states(InsModel.from_spec(imu_spec(SPEC)), used)
    values, off = np.zeros(model.states), np.zeros(model.states)
    return navigate_track(
        record, tilted, model, used, prior=(model.prior(P), values), open_until=1e9, off=off, **options
    )


def far_off(drive, track):
    """Largest error of places and velocities in the last minute, m and m/s."""
    at = track.time > track.time[-1] - 60.0
    true = drive[0].states(track.time[at])
    v = np.abs(track.v_n[at] - true.v_n).max()
    north, east = (
        (track.position[at, 0] - true.lat) * 6.37e6,
        (track.position[at, 1] - true.lon) * 6.38e6 * np.cos(true.lat),
    )
    return max(np.abs(north).max(), np.abs(east).max()), v


def test_what_a_loop_far_off_is_corrected_by_is_not_linear(drive):
    """A tilt of 5 deg is 100 m/s and 10 km after 3 min: of a linear row tenths of a metre a second are left."""
    linear, exact = (far_off(drive, open_loop(drive, exact=of)) for of in (False, True))
    assert exact[0] < 1.5 < 4.0 < linear[0]  # m
    assert exact[1] < 0.1 < 0.15 < linear[1]  # m/s
