"""Fixes of a receiver that starts up: poor at first, off by the same for seconds, and honest about how poor they are."""

from dataclasses import replace

import numpy as np
import pytest

from tests.navigation.test_navigate import SPEC, drive, fixes
from truenorth.aiding.aids import Gnss
from truenorth.errors.model import InsModel
from truenorth.navigation import Mounting, navigate
from truenorth.navigation.plan import Plan
from truenorth.quality.converging import CONVERGING, with_convergence

__all__ = ["drive"]  # the fixture of a car that turns twice

TIME = np.arange(0.5, 90.0, 0.2)
FIRST, FALLS, WHITE = 20.0, 15.0, 0.3  # m, s, m
SAME, ESTIMATED, NEW = "the same", "an estimate", "new each time"


def converging(motion, kind, seed):
    """Fixes whose first errors are of `FIRST` and fall within `FALLS`; rows say how large they are."""
    rng = np.random.default_rng([seed, 7])  # not those of the white noise
    size = FIRST * np.exp(-(TIME - TIME[0]) / FALLS)
    x = rng.standard_normal((len(TIME), 3))
    if kind == SAME:
        x[:] = x[0]
    elif kind == ESTIMATED:  # of an estimate that gets better: E x_j x_k = s_k / s_j
        for k in range(1, len(x)):
            like = size[k] / size[k - 1]
            x[k] = like * x[k - 1] + np.sqrt(1.0 - like**2) * x[k]
    sound = fixes(motion, TIME, WHITE, seed)
    off = size[:, None] * x
    return replace(
        sound,
        lat=sound.lat + off[:, 1] / 6.37e6,
        lon=sound.lon + off[:, 0] / (6.39e6 * np.cos(sound.lat)),
        alt=sound.alt + off[:, 2],
        position_sigma=np.tile(np.hypot(WHITE, size)[:, None], (1, 3)),
    )


def velocity_in_sigmas(motion, track):
    """Of all epochs but the first second."""
    k = (track.time > 1.0) & (track.time < TIME[-1])
    v = motion.states(track.time[k]).v_n
    return (track.v_n[k] - v) / np.sqrt(np.diagonal(track.P[k], axis1=1, axis2=2)[:, 3:6])


@pytest.mark.parametrize("kind", [SAME, ESTIMATED, NEW])
def test_velocity_is_as_sure_as_it_is_said_to_be(drive, kind):
    """Twelve receivers of each kind, four as before. What lasts leads the velocity away where it is taken for white noise."""
    motion, record, start = drive
    plan = Plan(record.between(None, TIME[-1]), start, InsModel.from_spec(SPEC), "gnss", [], 0.2, 5, 0.0)
    now, before = [], []
    for seed in range(12):
        aid = Gnss(converging(motion, kind, seed), Mounting())
        now.append(velocity_in_sigmas(motion, plan.run(plan.sources({"gnss": aid}))))
        if kind != NEW and seed < 4:
            before.append(velocity_in_sigmas(motion, plan.run(aid.sources("gnss"))))
    assert np.abs(now).max() < 4.0
    assert np.sqrt(np.mean(np.square(now))) < 1.2
    if kind != NEW:
        assert np.abs(before).max() > 6.0


def test_a_receiver_that_is_as_good_all_the_time_has_no_such_state(drive):
    """Nor has one that says it of each row a little otherwise."""
    motion, _, _ = drive
    sound = fixes(motion, TIME, WHITE)
    (same,) = Gnss(sound, Mounting()).sources("gnss")
    assert with_convergence([same])[0] is same
    rough = 0.05 * np.random.default_rng(0).uniform(-1.0, 1.0, (len(TIME), 3))
    (about,) = Gnss(replace(sound, position_sigma=sound.position_sigma * (1.0 + rough)), Mounting()).sources("gnss")
    assert with_convergence([about])[0] is about


def test_the_state_is_as_large_as_the_rows_say_and_lasts_as_long_as_they_fall(drive):
    motion, _, _ = drive
    (source,) = with_convergence(Gnss(converging(motion, SAME, 0), Mounting()).sources("gnss"))
    group = source.states["own"]
    assert group.name == CONVERGING
    assert group.lasts[0] == pytest.approx(FALLS, rel=0.05)
    size = FIRST * np.exp(-(TIME - TIME[0]) / FALLS)
    poor = size > WHITE
    np.testing.assert_allclose(source.measured[poor, 3], size[poor], rtol=0.02)
    assert np.all(source.measured[np.hypot(WHITE, size) < 1.01 * WHITE, 3:] == 0.0)  # it has settled
    np.testing.assert_allclose(source.sigma[:, 0], np.hypot(WHITE, size))  # and may be white as well
    # A log that ends before: what falls to the end has not settled at what its last rows say.
    early = TIME < 25.0
    short = Gnss(converging(motion, SAME, 0)[: int(early.sum())], Mounting()).sources("gnss")
    (source,) = with_convergence(short)
    np.testing.assert_allclose(source.measured[:, 3], size[early], rtol=0.05)


@pytest.mark.slow
def test_navigation_from_fixes_that_converge(drive):
    """By all passes over the log; 150 m off in its first rows, as it says."""
    motion, record, start = drive
    for seed in range(4):
        found = navigate(record, start, aid=Gnss(converging(motion, SAME, seed), Mounting()), imu=SPEC)
        assert found.status == "navigated"
        assert np.abs(velocity_in_sigmas(motion, found.track)).max() < 4.0
