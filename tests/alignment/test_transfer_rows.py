"""Rows of a master whose velocities hold before the attitudes of the same stamp."""

import numpy as np
import pytest

from benchmarks.honesty.transfer import aircraft, filtered
from truenorth.alignment.transfer import align_transfer
from truenorth.alignment.transfer_rows import ATTITUDE, TRANSLATION, by_rows, stamped_as_the_master
from truenorth.alignment.transfer_verdict import _unsettled
from truenorth.estimate.memory import ABSENT, USED
from truenorth.records.specs import imu_spec
from truenorth.simulation import MasterSpec, simulate, simulate_sensor
from truenorth.state.track import Residuals, Track

LATE, STAMPS = 0.15, np.array([0.0, 0.1, 0.2, 0.3, 0.4])


def said(name, time, stamp, row):
    """Residuals whose innovations are the numbers of their rows."""
    values, used = np.repeat(np.asarray(row, dtype=float)[:, None], 3, axis=1), np.ones(len(row), dtype=bool)
    return Residuals(name, time, values, values + 1.0, values[:, 0], used, 0, stamp, ~used)


def test_a_row_is_its_attitude_and_the_velocity_that_held_before():
    """The attitude of the last row lies beyond the log, the velocity of the first one before it."""
    attitude, velocity = np.array([0, 1, 2, 3]), np.array([2, 3, 4])
    before = STAMPS[velocity] - LATE
    residuals = (
        said("master velocity", before, before, velocity),
        said("master attitude", STAMPS[attitude], STAMPS[attitude], attitude),
    )
    nothing = np.zeros(4)
    track = Track(nothing, nothing, nothing, nothing, nothing, nothing, None, residuals)
    rows = by_rows(stamped_as_the_master(track, STAMPS, LATE))
    np.testing.assert_array_equal(rows.stamp, STAMPS[attitude])
    np.testing.assert_array_equal(rows.innovation[:, 0], [np.nan, np.nan, 2.0, 3.0])
    np.testing.assert_array_equal(rows.innovation[:, 3], attitude)
    assert rows.verdict[1, [TRANSLATION, ATTITUDE]].tolist() == [ABSENT, USED]
    assert rows.verdict[3, [TRANSLATION, ATTITUDE]].tolist() == [USED, USED]
    assert stamped_as_the_master(track, STAMPS, 0.0) is track


@pytest.mark.parametrize(("left", "named"), [(0.2, False), (0.9, False), (1.3, True)])
def test_passes_that_do_not_settle_are_named(left, named):
    """What a pass moves by more than its sigma is no answer yet: an arm was 8 sigmas off, `aligned`."""
    found = _unsettled(left)
    assert [item.key for item in found] == (["transfer.unsettled"] if named else [])
    assert all(item.effect.heading == np.inf for item in found)


@pytest.mark.slow
@pytest.mark.parametrize("run", [0, 1])
def test_a_master_without_errors_whose_velocity_a_filter_made_late(run):
    """Good to 5 mm/s, of a consumer slave: an arm forward was up to 12 sigmas off (8 flights of seed 90778, RMS 6.3)."""
    rng = np.random.default_rng([90778, run])
    arm, tau = rng.standard_normal(3), 0.05 * rng.standard_normal()
    mounting = tuple(np.radians(3.0) * rng.standard_normal(3))
    spec = MasterSpec(
        clock_offset=tau, lever_arm=tuple(arm), mounting=mounting, velocity_noise=0.005, attitude_noise=3e-4
    )
    way = aircraft()
    slave = simulate(way, rate=100.0, duration=200.0, imu=imu_spec("consumer"), seed=90778, run=run).record
    master = simulate_sensor(way, spec, duration=200.0, seed=90778, run=run).record
    answer = align_transfer(slave, filtered(master, master.time - tau, way, arm, 0.1), "consumer", matching="both")
    t = answer.transfer
    assert answer.status == "aligned"
    assert np.all(np.abs(t.lever_arm - arm) < 4.0 * t.lever_arm_sigma)
    assert abs(t.delay - tau) < 4.0 * t.delay_sigma
