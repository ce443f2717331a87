"""What INS and log differ by, without waves: means that waves do not get through, and a filter that they do not mislead."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.voyage import SIGMA, passage
from truenorth.core.attitude import dcm_from_euler
from truenorth.damping.filters import Filter, run_filters
from truenorth.damping.waves import SPAN, over_waves
from truenorth.errors.log import LOGS, SCALE
from truenorth.errors.marine import MarineModel

T = 1.0  # s


def at_sea(hours=1.0, swing=0.5, period=8.0):
    """A ship in waves along its way, every second: the course with its waves, and without them."""
    truth = passage(np.random.default_rng(4), hours, turns=False)[1]
    time = np.arange(0.0, truth.time[-1], T)
    calm = replace(
        truth,
        time=time,
        C_nb=np.broadcast_to(truth.C_nb[0], (len(time), 3, 3)).copy(),
        v_n=np.broadcast_to(truth.v_n[0] * [1.0, 1.0, 0.0], (len(time), 3)).copy(),
        position=np.stack([np.interp(time, truth.time, x) for x in truth.position.T], axis=1),
        P=np.empty((0, 0, 0)),
        sensors=np.empty((0, 0)),
        residuals=(),
    )
    forward = calm.C_nb[0][:, 1]
    wave = swing * np.sin(2.0 * np.pi * time / period)[:, None] * forward
    return calm, replace(calm, v_n=calm.v_n + wave)


def test_waves_do_not_get_through():
    """Of waves of half a metre a second that the log does not show at all, less than a millimetre is left of 8 s, of 12 s too."""
    for period in (6.0, 8.0, 12.0):
        calm, course = at_sea(period=period)
        found = over_waves(course, calm.v_n[:, :2].copy(), 0.02, 0)
        rows = np.flatnonzero(np.isfinite(found.velocity[:, 0]))
        assert np.all(np.diff(rows) % round(SPAN / T) == 0)
        assert np.abs((course.v_n[:, :2] - found.velocity)[rows]).max() < 5e-3
        assert np.abs((found.course.v_n - calm.v_n)[rows]).max() < 5e-3


def test_noise_of_a_mean():
    """Of white noise the means scatter as is said, but for what their overlap adds on purpose."""
    calm, _ = at_sea(8.0)
    noise = 0.1 * np.random.default_rng(1).standard_normal((len(calm), 2))
    found = over_waves(calm, calm.v_n[:, :2] + noise, 0.1, 0)
    off = (calm.v_n[:, :2] - found.velocity)[np.isfinite(found.velocity[:, 0])]
    assert found.noise == pytest.approx(np.sqrt(4.0 / 3.0) * off.std(), rel=0.1)
    mean = off.mean(axis=0) * np.sqrt(len(off)) / found.noise  # of what is slow they know as much as is said
    assert np.abs(mean).max() < 3.3


def test_silences_and_few_rows():
    """Where less than half of a window is there is no mean; of a log with a row every 10 s each mean has its rows."""
    calm, _ = at_sea()
    velocity = calm.v_n[:, :2].copy()
    velocity[600:900] = np.nan
    found = over_waves(calm, velocity, 0.02, 0)
    assert np.isnan(found.velocity[610:890]).all()
    few = np.full_like(velocity, np.nan)
    few[::10] = calm.v_n[::10, :2] + [0.1, 0.0]
    found = over_waves(calm, few, 0.02, 0)
    there = np.isfinite(found.velocity[:, 0])
    assert there.sum() > 150
    np.testing.assert_allclose((found.velocity - calm.v_n[:, :2])[there], [[0.1, 0.0]] * there.sum(), atol=1e-9)


def test_a_log_that_does_not_follow_waves_has_no_scale():
    """A perfect INS in waves, a log that shows none: given every row the filter has a scale of -.2 at many sigmas; now none."""
    calm, course = at_sea(2.0)
    shown = calm.v_n[:, :2] + 0.005 * np.random.default_rng(3).standard_normal((len(calm), 2))
    model = MarineModel(1e-7, 1e-5, groups=LOGS["doppler-bottom"].groups())
    kind = Filter(model, model.prior(np.diag(SIGMA**2)), 0.02)
    at = model.slice_of(SCALE).start

    def scale(reference, sigma, seen=None):
        found = run_filters(course, reference, start=0, kinds={"one": replace(kind, sigma=sigma)}, seen=seen)["one"]
        return found.x[-1, at] / found.sigma[-1, at]

    calmed = over_waves(course, shown, 0.02, 0)
    assert abs(scale(shown, 0.02)) > 10.0
    assert abs(scale(calmed.velocity, calmed.noise, calmed.course)) < 2.0


def test_changes_of_speed_are_left_out():
    """A log two seconds late, while speed changes by .05 m/s^2 for two minutes: no mean of then, all of before and after."""
    calm, _ = at_sea(swing=0.0)
    time, forward = calm.time, calm.C_nb[0][:, 1]
    faster = np.clip(0.05 * (time - 1000.0), 0.0, 6.0)
    course = replace(calm, v_n=calm.v_n + faster[:, None] * forward)
    late = calm.v_n[:, :2] + np.interp(time - 2.0, time, faster)[:, None] * forward[:2]
    noise = 0.02 * np.random.default_rng(2).standard_normal(late.shape)
    rows = np.flatnonzero(np.isfinite(over_waves(course, late + noise, 0.02, 0).velocity[:, 0]))
    changing = (time[rows] > 1000.0 - SPAN / 2) & (time[rows] < 1120.0 + SPAN / 2)
    assert not changing.any()
    assert len(rows) > 0.9 * len(time) * T / SPAN - 8


def test_turns_are_left_out():
    """A log two metres from where it is taken to be, while the ship turns by half a degree a second for two minutes."""
    calm, _ = at_sea(swing=0.0)
    time = calm.time
    heading = np.radians(np.clip(0.5 * (time - 1000.0), 0.0, 60.0))
    C_nb = dcm_from_euler(heading, np.zeros_like(time), np.zeros_like(time)) @ calm.C_nb[0]
    course = replace(calm, C_nb=C_nb, v_n=C_nb @ np.array([0.0, 6.0, 0.0]))
    moved = np.gradient(C_nb @ np.array([0.0, 2.0, 0.0]), T, axis=0)[:, :2]
    noise = 0.02 * np.random.default_rng(2).standard_normal(moved.shape)
    rows = np.flatnonzero(np.isfinite(over_waves(course, course.v_n[:, :2] + moved + noise, 0.02, 0).velocity[:, 0]))
    turning = (time[rows] > 1000.0 - SPAN / 2) & (time[rows] < 1120.0 + SPAN / 2)
    assert not turning.any()
    assert len(rows) > 0.9 * len(time) * T / SPAN - 8
