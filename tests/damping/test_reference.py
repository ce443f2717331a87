"""What a log does wrong is found, sized and named; a healthy one is left as it is."""

import numpy as np
import pytest

from benchmarks.honesty.voyage import passage, voyage
from tests.damping.marine_case import ideal_and_truth, paper_errors
from truenorth.aiding.aids import VelocityLog
from truenorth.core.attitude import misalignment
from truenorth.core.errors import DataError
from truenorth.damping.course import linearised, motion_at, place_at, without_errors
from truenorth.damping.options import Damper
from truenorth.damping.reference import cleaned, reference_of
from truenorth.errors.log import LogErrors
from truenorth.errors.marine import MarineModel
from truenorth.records import VelocityRecord
from truenorth.state.wording import sentences

NOISE = 0.05


@pytest.fixture(scope="module")
def course():
    """A free INS with errors of 3 m/s, at 2 s over 12 h: the worst slopes that a healthy log can show."""
    _, truth = ideal_and_truth(interval=2.0, hours=12.0)
    x = paper_errors()
    _, Phi = linearised(truth, MarineModel(0.0, 0.0))
    states = [x]
    for step in Phi:
        states.append(step @ states[-1])
    return truth, without_errors(truth, -np.array(states)[:, :7])


def log(truth, seed):
    rng = np.random.default_rng(seed)
    return truth.v_n[:, :2] - 0.3 + NOISE * rng.standard_normal((len(truth.time), 2)), rng


@pytest.mark.slow
def test_a_healthy_log_is_left_as_it_is(course):
    """Over 43 000 numbers: limits of 6 and 8 sigma with room for curvature make a false alarm rarer than one in 1e5 logs."""
    truth, free = course
    velocity, _ = log(truth, 1)
    found = cleaned(free, velocity)
    np.testing.assert_array_equal(found.velocity, velocity)
    assert found.noise == pytest.approx(NOISE, rel=0.05)
    assert (found.outliers, found.jumps, found.gaps, found.evidence()) == (0, (), (), [])


def test_outliers_jumps_and_gaps(course):
    truth, free = course
    healthy, rng = log(truth, 2)
    velocity = healthy.copy()
    velocity[6000:] += [0.6, -1.0]
    hit = rng.random(len(velocity)) < 0.01
    hit[5990:6010] = False
    velocity[hit] += 3.0 * np.sign(rng.standard_normal((hit.sum(), 2)))
    velocity[12000:13800] = np.nan
    found = cleaned(free, velocity)
    gone = np.isnan(found.velocity[:, 0]) & np.isfinite(velocity[:, 0])
    assert found.outliers == gone.sum()
    assert gone[hit & np.isfinite(velocity[:, 0])].all()
    assert gone.sum() - (hit & np.isfinite(velocity[:, 0])).sum() <= 2
    ((time, east, north),) = found.jumps
    assert time == pytest.approx(truth.time[6000], abs=4.0)
    assert (east, north) == (pytest.approx(0.6, abs=0.12), pytest.approx(-1.0, abs=0.12))  # lines of 31: 4 sigma
    ((since, length),) = found.gaps
    assert since == pytest.approx(truth.time[11999], abs=6.0)
    assert length == pytest.approx(3602.0, abs=12.0)
    late = found.velocity[14000:] - healthy[14000:]
    assert np.abs(np.nanmean(late, axis=0)).max() < 0.12
    text = " ".join(sentences(found.evidence()))
    assert "left out as outliers" in text
    assert "jumps by +0." in text
    assert "silent for 36" in text


def test_a_log_in_body_axes_is_turned(course):
    """Forward and right at 10 Hz, a heading of 51.34 deg: the mean of an epoch, east and north."""
    truth, _ = course
    part = truth[:200]
    time = np.arange(0.0, 398.0, 0.1)
    body = VelocityRecord(time, np.tile([0.0, 12.0, np.nan], (len(time), 1)), "body")
    found = reference_of(part, body, LogErrors())
    heading = np.radians(51.3401917)
    np.testing.assert_allclose(
        np.nanmean(found.velocity, axis=0), 12.0 * np.array([np.sin(heading), np.cos(heading)]), rtol=1e-3
    )


@pytest.mark.parametrize("frame", ["navigation", "body"])
def test_rows_between_epochs_are_compared_at_their_own_times(frame):
    """A true log every 4 s, epochs every 8 s, turns of 1 deg/s: exact by the finer epochs, to a decimetre by cubics alone.

    Rows taken for the nearest epoch's would be .7 m/s off in a turn at 10 m/s, and any filter would believe them.
    """
    _, truth = passage(np.random.default_rng(4), 2.0)
    v = truth.v_n if frame == "navigation" else np.einsum("kij,ki->kj", truth.C_nb, truth.v_n)
    log, coarse = VelocityRecord(truth.time, v, frame), truth[::2]
    exact, near = (reference_of(coarse, log, LogErrors(), fine) for fine in (truth, None))
    np.testing.assert_allclose(exact.velocity, coarse.v_n[:, :2], atol=1e-9)
    assert np.nanmax(np.abs(near.velocity - coarse.v_n[:, :2])) < 0.1  # at the ends of turns outliers are left out


def test_a_swing_is_not_late():
    """INS and log differ by a swing of 6 m/s; rows every 4 s, epochs every 8 s: two rows' mean is 2 s old, .015 m/s."""
    _, truth = passage(np.random.default_rng(4), 2.0, turns=False)
    swing = 6.0 * np.sin(truth.time / 806.0)[:, None] * [1.0, -1.0]
    v = truth.v_n.copy()
    v[:, :2] -= swing
    found = reference_of(truth[::2], VelocityRecord(truth.time, v, "navigation"), LogErrors(), truth)
    assert np.abs(found.velocity - v[::2, :2])[2:-2].max() < 1.5e-3


def test_a_fix_in_a_turn_holds_at_its_own_time():
    """Of the true course, with epochs every 8 s and a turn of 1 deg/s: place and heading between epochs, to .5 m and .1 deg."""
    _, truth = passage(np.random.default_rng(4), 2.0)
    turning = 1 + 2 * np.flatnonzero(np.abs(np.diff(truth.v_n[:, 0])[1::2]) > 0.05)[5]  # a row between two epochs
    coarse = truth[::2]
    C_nb, _ = motion_at(coarse, truth.time[[turning]])
    assert np.degrees(np.abs(misalignment(C_nb, truth.C_nb[[turning]]))).max() < 0.1
    lat, lon, _ = place_at(coarse, truth.time[turning])
    off = np.array([lat, lon]) - truth.position[turning, :2]
    assert np.abs(off * 6.37e6).max() < 0.5


@pytest.mark.slow
def test_hard_turns_and_a_coarse_track():
    """Filter 1 and the double filter on a track of 8 s, a log of 4 s: within their bands, through `navigate`."""
    ship = voyage(3, 1, hours=8.0)
    aid = VelocityLog(ship.log(LogErrors(drift=0.3)), errors=LogErrors(drift=0.3))
    for method in ("kalman", "double"):
        result = ship.navigated(aid, damping=Damper(method), output=8.0)
        ratios = ship.outcome(result, (2.0, 4.0, 6.0, 8.0)).ratios
        assert result.status == "navigated"
        assert max(np.abs(r).max() for r in ratios.values()) < 4.0


def test_what_is_refused(course):
    _, free = course
    far = np.arange(1e6, 1e6 + 100.0)
    with pytest.raises(DataError, match="no overlap"):
        reference_of(free, VelocityRecord(far, np.ones((100, 3)), "navigation"), LogErrors())
    near = np.arange(100.0)
    with pytest.raises(DataError, match="VE or VN is missing"):
        reference_of(free, VelocityRecord(near, np.tile([1.0, np.nan, 0.0], (100, 1)), "navigation"), LogErrors())
    with pytest.raises(DataError, match="v_forward is missing"):
        reference_of(free, VelocityRecord(near, np.tile([1.0, np.nan, 0.0], (100, 1)), "body"), LogErrors())
