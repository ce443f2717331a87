"""A velocity log sits somewhere on the hull: where nobody says so, its arm is estimated."""

import numpy as np

from tests.navigation.test_navigate import SPEC, drive
from truenorth.aiding.aids import VelocityLog
from truenorth.navigation import navigate
from truenorth.records import VelocityRecord
from truenorth.state.layout import DV

__all__ = ["drive"]  # the fixture of a car that turns twice


def test_a_log_far_ahead(drive):
    motion, record, start = drive
    time, arm = np.arange(0.5, 179.0, 0.5), np.array([0.0, 18.0, 0.0])
    s, (before, after) = motion.states(time), (motion.states(time + step).C_nb for step in (-0.01, 0.01))
    v_n = s.v_n + (after - before) @ arm / 0.02
    v_b = np.einsum("kji,kj->ki", s.C_nb, v_n) + 0.02 * np.random.default_rng(3).standard_normal((len(time), 3))
    log = VelocityRecord(time, v_b, "body", source="log.csv")

    unsaid = navigate(record, start, aid=VelocityLog(log, errors="doppler-bottom"), imu=SPEC, check_clocks=False)
    assert unsaid.status == "navigated", unsaid.reasons
    found = unsaid.estimated()["velocity log lever arm"]
    value, sigma = np.asarray(found["value"]), np.asarray(found["sigma"])
    assert sigma[1] < 0.5
    assert np.all(np.abs(value - arm) < 4.0 * sigma)
    off = unsaid.v_n[-1] - motion.states(unsaid.time[-1]).v_n
    assert np.abs(off / unsaid.track.sigma[-1, DV]).max() < 4.0
