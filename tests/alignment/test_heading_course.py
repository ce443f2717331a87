"""Heading by the earth's level rate on its circle: sigma near the headings at which a log hardly shows it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.alignment.test_rivals import answered
from tests.runs import some
from truenorth.alignment import rivals
from truenorth.alignment.heading_course import HEADING, HeadingCourse, along_north, course_evidence, heading_course
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE, gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import local_axes
from truenorth.estimate.staying import StayingLog

HERE = Position(math.radians(45.3), 0.2, 0.0)
EAST = 0.3  # deg, by which the outer axis is off east


def fallen(time, rate):
    """(K, 3) second integral, m, of gravity on a base that turns by a rate (3,) rad/s; by parts so short that they are straight."""
    fine = np.linspace(0.0, time[-1], 20 * (len(time) - 1) + 1)
    step = fine[1]
    middle = fine[:-1] + 0.5 * step
    g = gravity_of_place(HERE.lat, HERE.alt)
    force = -g * np.array([dcm_from_rotation_vector(rate * t)[:, 2] for t in middle])
    before = np.cumsum(force, axis=0) * step - force * step
    return np.concatenate([np.zeros((1, 3)), np.cumsum(before * step + 0.5 * force * step**2, axis=0)])[::20]


@pytest.mark.parametrize("off", [0.05, -0.2])
def test_a_heading_that_is_hidden_turns_the_base_by_its_cosine_about_north(off):
    """Along north and in height: a state of the level rate that is linear about rest has no height."""
    time = np.linspace(0.0, 600.0, 61)
    north, up = EARTH_RATE * math.cos(HERE.lat), EARTH_RATE * math.sin(HERE.lat)
    apart = fallen(time, np.array([0.0, north, up])) - fallen(time, np.array([0.0, north * math.cos(off), up]))
    seen = np.einsum("kij,kj->ki", local_axes(time, HERE.lat), np.diff(apart, axis=0) / np.diff(time)[:, None])
    made = (math.cos(off) - 1.0) * along_north(time, HERE)
    size = np.abs(seen).max(axis=0)
    assert size[2] > 1e-3 * size[0]
    for axis in (0, 2):
        assert np.abs(seen - made)[:, axis].max() < (1e-3 + off**2) * size[axis]


@pytest.mark.parametrize("sigma", [1e-6, 1e-4, 3e-3])
def test_where_the_circle_is_straight_sigma_is_that_of_the_filter(sigma):
    course = HeadingCourse(np.array([0.2 * sigma, 0.1]), np.diag([sigma**2, 0.01]), 0.2 * sigma)
    own, farthest = course.spread()
    assert own == pytest.approx(sigma, rel=1e-2)
    assert farthest == pytest.approx(4.0 * sigma, rel=3e-2)


def test_two_headings_that_are_alike_are_a_sigma_apart_whatever_the_filter_knows():
    """What is along north is known to 1e-6, and nothing across: headings of 1 deg to either side of 0, the answer one of them."""
    one = math.radians(1.0)
    course = HeadingCourse(np.array([0.0, math.cos(one) - 1.0]), np.diag([1.0, 1e-12]), one)
    assert course.spread()[0] == pytest.approx(2.0 * one / math.sqrt(2.0), rel=1e-2)


def drawn(rng, across, along):
    """The course about the likeliest heading and its error: an axis within 1 deg of east, whose own rate is known to `across`."""
    true = math.radians(rng.uniform(-1.0, 1.0))
    seen = np.array([math.sin(true) + across * rng.standard_normal(), math.cos(true) + along * rng.standard_normal()])
    P = np.diag([across**2, along**2])
    whole = HeadingCourse(seen - [0.0, 1.0], P, 0.0)
    turns = whole.turns()
    at = float(turns[np.argmin(whole.misfit(turns))])
    c, s = math.cos(at), math.sin(at)
    turned = np.array([[c, -s], [s, c]])
    found = HeadingCourse(turned @ seen - [0.0, 1.0], turned @ P @ turned.T, 0.0)
    linear = 1.0 / math.sqrt(np.linalg.inv(found.P)[0, 0])
    return true - at, linear, found.spread()[0]


@pytest.mark.parametrize("along", some([5e-5], [5e-4]))
def test_errors_near_east_are_as_large_as_sigma(along):
    rng = np.random.default_rng(0)
    error, linear, sigma = np.array([drawn(rng, math.radians(1.0), along) for _ in range(300)]).T
    assert np.abs(error / linear).max() > 5.0  # as a filter believes that is linear about its answer
    assert np.abs(error / sigma).max() < 4.0
    assert 0.8 < math.sqrt(np.mean((error / sigma) ** 2)) < 1.2


def spied(monkeypatch, heading, seed):
    """The fine alignment of a navigation grade IMU that spins about an axis at this heading, its answer and that over sigma."""
    seen = []

    def spy(fine, position):
        seen.append((fine, position))
        return course_evidence(fine, position)

    monkeypatch.setattr(rivals, "course_evidence", spy)
    answer, off = answered("navigation", heading, encoder=True, seed=seed)
    return *seen[-1], answer, off


def is_curved(answer):
    return any(item.key == "heading.curved" for item in answer.evidence)


def held_at(log, estimator, off):
    """Minus twice the logarithm of the likelihood of a log whose heading is held so far off, everything else fitted about it."""
    P = log.prior.P.copy()
    P[HEADING, HEADING] = 1e-12
    C_n0_i = dcm_from_rotation_vector([0.0, 0.0, off]) @ log.C_n0_i
    about = StayingLog(
        log.record,
        C_n0_i,
        log.position,
        log.noise,
        replace(log.prior, P=P),
        log.interval,
        log.rows,
        sways=log.sways,
        C_sb=log.C_sb,
        taken=log.taken,
    )
    for _ in range(3):
        estimator.base = about.linearise()
        found = estimator.filtered()
        about.correct(found.end)
    return -2.0 * float(found.estimates.log_likelihood)


@pytest.mark.slow
def test_the_course_is_that_of_filters_about_each_heading(monkeypatch):
    """Of a motion that is alike along east and north: another would turn with the frame."""
    fine, position, _, _ = spied(monkeypatch, EAST, 1)
    log, estimator = fine.about, fine.estimator
    east, _, up = estimator.motion
    estimator.motion = (east, east, up)
    estimator.base = log.linearise()
    found = estimator.filtered()
    course = heading_course(fine.filtered_by(found.system, found.estimates), position)
    off = np.radians([0.0, -1.0, 1.0, 2.0])
    made, expected = np.array([held_at(log, estimator, x) for x in off]), course.misfit(off)
    np.testing.assert_allclose(made[1:] - made[0], expected[1:] - expected[0], rtol=0.1)
    linear = (off[1:] - course.found) ** 2 / found.P[HEADING, HEADING]
    assert (linear > 1.5 * (expected[1:] - expected[0]))[-1]


@pytest.mark.slow
def test_near_east_sigma_has_both_sides(monkeypatch):
    """Where the circle is bent within what a log leaves of heading, it is larger than that of the filter."""
    curved = []
    for seed in (1, 2, 3):
        fine, _, answer, off = spied(monkeypatch, EAST, seed)
        assert answer.status == "aligned", answer.reasons
        assert np.abs(off).max() < 4.0
        curved.append(is_curved(answer))
        if curved[-1]:
            assert answer.phi_covariance[HEADING, HEADING] > 1.09 * fine.P[HEADING, HEADING]
    assert any(curved)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_passes_about_a_heading_that_hardly_shows_come_to_rest(seed):
    """Of a tactical IMU: half of them went to and fro by 10 deg, and were refused as of a base that does not stay."""
    answer, off = answered("tactical", EAST, encoder=True, seed=seed)
    assert answer.status in ("not_converged", "level_only"), answer.reasons
    assert np.abs(off).max() < 4.0


@pytest.mark.slow
def test_away_from_east_nothing_is_added(monkeypatch):
    _, _, answer, off = spied(monkeypatch, 40.0, 1)
    assert not is_curved(answer)
    assert np.abs(off).max() < 4.0
