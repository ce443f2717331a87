"""From an alignment on the move to navigation: what it knows of the IMU's axes goes on, with what ties it to the level."""

from dataclasses import replace

import numpy as np
import pytest

import truenorth
import truenorth.navigation.passes
from tests.alignment.test_in_motion_level import logs
from truenorth.core.attitude import misalignment
from truenorth.state.layout import ACCEL_AXES, ANTENNA_ARM, GYRO_AXES, PHI, STATES

ASKEW = 0.02  # rad, 2.3 sigmas of a consumer IMU: forward force on the upward accelerometer


@pytest.fixture(scope="module")
def askew():
    """A vehicle that turns and speeds up, its accelerometers askew; the alignment of the first part."""
    motion, record, gnss = logs("turning", 1)
    record = replace(record, accel=record.accel + ASKEW * np.outer(record.accel[:, 1], [0.0, 0.0, 1.0]))
    return (
        motion,
        record,
        gnss,
        truenorth.align(record.between(None, 30.0), None, "consumer", aid=[truenorth.Gnss(gnss)]),
    )


def test_the_start_is_the_alignments_end(askew, tmp_path, monkeypatch):
    """Attitude, scale factors and misalignments: the same covariance, from the answer and from its folder."""
    # What the rest of the log shows of the arm is in all of the track's places.
    monkeypatch.setattr(truenorth.navigation.passes, "with_open_arm", lambda track, quick: track)
    _, record, gnss, answer = askew
    assert set(answer.moving.known) == {GYRO_AXES, ACCEL_AXES, ANTENNA_ARM}
    answer.save(tmp_path)
    own = truenorth.navigate(record, answer, aid=[truenorth.Gnss(gnss)], check_clocks=False).track
    read = truenorth.navigate(record, tmp_path, aid=[truenorth.Gnss(gnss)], check_clocks=False).track
    before = answer.moving.track
    for name in (GYRO_AXES, ACCEL_AXES, ANTENNA_ARM):
        there, here = before.layout.slice_of(name), own.layout.slice_of(name)
        then, now = (
            P[np.ix_([*range(9), *range(at.start, at.stop)], [*range(9), *range(at.start, at.stop)])]
            for P, at in ((before.P[-1], there), (own.P[0], here))
        )
        then[:3, :3] = answer.moving.P[:3, :3]  # the bank of headings or the verdict may have added to it
        np.testing.assert_allclose(now, then, rtol=1e-6, atol=1e-9 * np.abs(then).max())
        np.testing.assert_allclose(own.sensors[0, here], before.sensors[-1, there], rtol=1e-9, atol=1e-15)
    assert np.all(np.abs(read.P - own.P) <= 1e-8 * own.sigma[:, :, None] * own.sigma[:, None, :])


def test_what_is_forgotten_makes_the_level_too_sure(askew):
    """Of a start without them the level would seem better known by the same pushes, seen twice."""
    motion, record, gnss, answer = askew
    moving = answer.moving
    bare = replace(answer, moving=replace(moving, P=moving.P[:STATES, :STATES], known={}))
    kept, lost = (
        truenorth.navigate(record, start, aid=[truenorth.Gnss(gnss)], check_clocks=False).track
        for start in (answer, bare)
    )
    size = [float(np.sqrt(np.trace(t.P[-1][PHI, PHI][:2, :2]))) for t in (kept, lost)]
    assert size[1] < 0.98 * size[0]
    off = misalignment(kept.C_nb[-1], motion.states(kept.time[-1:]).C_nb[0])
    assert np.abs(off[:2] / kept.sigma[-1, :2]).max() < 3.5
