"""Stamps of a receiver that scatter: found in manoeuvres, and not where noise is larger all along."""

import numpy as np
import pytest

from tests.runs import some
from truenorth.aiding.source import Aiding
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import radii
from truenorth.quality.stamps import scattered, scattered_by_rows, stamp_scatter, with_scatter
from truenorth.state.layout import Layout
from truenorth.state.track import Residuals, Track

TIME = np.arange(0.0, 240.0, 1.0)
SIGMA = {"GNSS velocity": 0.05, "GNSS position": 2.0}


def way():
    """Velocity and acceleration east, north and up (240, 3) of a car: a turn of 90 deg within 8 s of each 40, 12 m/s."""
    course = np.cumsum(np.where(TIME % 40.0 < 8.0, np.pi / 16.0, 0.0))
    v = 12.0 * np.stack([np.sin(course), np.cos(course), 0.0 * course], axis=1)
    return v, np.gradient(v, TIME, axis=0)


def drive(rng, scatter=0.0, factor=1.0, slow=0.0):
    """A track, its sources, and innovations of stamps that scatter, of a larger noise, of an error that lasts in turns."""
    v, a = way()
    rates = {"GNSS velocity": a, "GNSS position": v}
    residuals, sources = [], []
    for name in SIGMA:
        sigma = np.full((len(TIME), 3), SIGMA[name])
        e = factor * sigma * rng.standard_normal(sigma.shape) + rates[name] * scatter * rng.standard_normal(
            (len(TIME), 1)
        )
        if name == "GNSS velocity":
            e += slow * a
        used = np.ones(len(TIME), dtype=bool)
        residuals.append(Residuals(name, TIME, e, sigma, np.sum((e / sigma) ** 2, axis=1), used, 0, TIME, ~used))
        sources.append(Aiding(name, name.split()[1], TIME, np.zeros((len(TIME), 3)), sigma))
    track = Track(
        TIME, np.eye(3), v, np.zeros((0, 3)), np.zeros((0, 0)), np.zeros((0, 0, 0)), Layout(), tuple(residuals)
    )
    return track, sources


def test_a_scatter_is_found_by_its_size():
    found = []
    for run in range(20):
        track, sources = drive(np.random.default_rng([3, run]), scatter=0.1)
        found.append(stamp_scatter(track, sources, 0.0))
    # Of 48 s of turns a sigma is known to a tenth or so, of a run; the mean of twenty to a fortieth of it.
    assert np.mean(found) == pytest.approx(0.1, rel=0.1)
    assert np.std(found) < 0.025


@pytest.mark.parametrize("world", some([{"factor": 3.0}, {"slow": 0.1}], [{}, {"factor": 0.5}]))
def test_noise_of_another_size_and_errors_that_last_are_no_scatter(world):
    """Beyond a ratio of 10 in less than one of 148 sound logs: of 40 none or one."""
    found = [stamp_scatter(*drive(np.random.default_rng([4, run]), **world), 0.0) for run in range(40)]
    assert np.count_nonzero(found) <= 1


def test_sigmas_grow_by_what_a_stamp_makes_of_speed_and_acceleration():
    track, sources = drive(np.random.default_rng(1), scatter=0.1)
    v, a = way()
    velocity, position = with_scatter(sources, scattered(sources, track, 0.1))
    straight, turn = 20, 44  # s
    assert velocity.sigma[straight] == pytest.approx(0.05, abs=1e-3)
    assert velocity.sigma[turn, :2] == pytest.approx(np.hypot(0.05, 0.1 * np.abs(a[turn, :2])), rel=0.05)
    assert position.sigma[turn, :2] == pytest.approx(np.hypot(2.0, 0.1 * np.abs(v[turn, :2])), rel=0.05)
    # With the scatter in the sigmas the next pass finds the same one, not none and not twice as much.
    wider = tuple(
        Residuals(r.name, r.time, r.innovation, s.sigma, r.nis, r.used, 0, r.stamp, r.jumped)
        for r, s in zip(track.residuals, (velocity, position), strict=True)
    )
    again = Track(track.time, track.C_nb, track.v_n, track.position, track.sensors, track.P, track.layout, wider)
    assert stamp_scatter(again, sources, 0.1) == pytest.approx(stamp_scatter(track, sources, 0.0), rel=0.1)


def test_attitudes_of_a_moment_that_is_off_show_it_by_the_rate():
    """A master's attitude in turns, 20 ms off: a common time of its rows, not their noise."""
    heading = -np.cumsum(np.where(TIME % 40.0 < 8.0, np.pi / 16.0, 0.0))
    C = dcm_from_rotation_vector(np.outer(heading, [0.0, 0.0, 1.0]))
    rate, rng, sigma = np.append(np.diff(heading), 0.0), np.random.default_rng(6), np.full((len(TIME), 3), 3e-4)
    for scatter in (0.0, 0.02):
        e = sigma * rng.standard_normal(sigma.shape)
        e[:, 2] += scatter * rate * rng.standard_normal(len(TIME))
        used, nothing = np.ones(len(TIME), dtype=bool), (np.zeros((0, 3)), np.zeros((0, 0)), np.zeros((0, 0, 0)))
        rows = Residuals("master attitude", TIME, e, sigma, np.sum((e / sigma) ** 2, axis=1), used, 0, TIME, ~used)
        track = Track(TIME, C, np.zeros((len(TIME), 3)), *nothing, Layout(), (rows,))
        source = Aiding("master attitude", "rotation", TIME, np.zeros((len(TIME), 3)), sigma)
        assert stamp_scatter(track, [source], 0.0) == pytest.approx(scatter, rel=0.3)


def test_nothing_scatters_nothing():
    track, sources = drive(np.random.default_rng(1))
    assert scattered(sources, track, 0.0) == {}
    assert with_scatter(sources, {})[0].sigma is sources[0].sigma


def test_by_its_own_rows_a_place_scatters_along_the_way_that_it_goes_now():
    """Velocities that fall silent before a turn say nothing of where the vehicle goes after it."""
    v, _ = way()
    R_M, R_N = radii(0.8)
    place = np.cumsum(v, axis=0)
    place = np.stack([0.8 + place[:, 1] / R_M, place[:, 0] / (R_N * np.cos(0.8)), place[:, 2]], axis=1)
    fixes = Aiding("GNSS position", "position", TIME, place, np.full((len(TIME), 3), 2.0))
    for last in (len(TIME), 40):  # s, of the velocities
        speeds = Aiding("GNSS velocity", "velocity", TIME[:last], v[:last], np.full((last, 3), 0.05))
        added = scattered_by_rows([fixes, speeds], 0.1)
        np.testing.assert_allclose(added["GNSS position"][50:], 0.1 * np.abs(v[50:]), atol=0.02)
        np.testing.assert_allclose(added["GNSS velocity"][1:last], 0.1 * np.abs(np.diff(v[:last], axis=0)), atol=1e-9)
    assert scattered_by_rows([fixes], 0.0) == {}
