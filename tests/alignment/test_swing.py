"""A ship that swings on her lines: how the swing is found, when it is believed, and that it hides no fault."""

import math
from types import SimpleNamespace
from zlib import crc32

import numpy as np
import pytest

from benchmarks.honesty import foreign, vehicles
from benchmarks.honesty.foreign import log, sensed
from benchmarks.honesty.foreign_rows import CASES
from tests.alignment.test_motion_fit import MOTIONS, WALKS, drawn
from truenorth.alignment import align, swing
from truenorth.alignment.motion_fit import _score
from truenorth.alignment.motion_likelihood import Series
from truenorth.alignment.swing_fit import MOST, fit_swing, is_swing, long_enough
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.campaign.faults import FAULTS
from truenorth.core.position import Position
from truenorth.errors.staying import QUIETEST_BASE
from truenorth.errors.sway import AxisMotion, Oscillator
from truenorth.filters import LinearSystem
from truenorth.records.specs import imu_spec
from truenorth.state.evidence import Evidence

SEA = AxisMotion(1e-4, (Oscillator(2, 0.03, 1.0, 0.1),))


def test_what_a_line_gains_is_what_it_takes_off_the_exact_likelihood():
    """Restricted likelihoods with and without the line differ by its gain, and by what its columns make of the determinant."""
    motion, K, w = MOTIONS["swell"], 200, 0.12
    t = np.arange(K)
    y = drawn(motion, K, 5) + 0.02 * np.cos(w * t + 1.0)
    gain, sigma = Series(y, 1.0, WALKS).lines(motion, np.array([w, 0.4]))
    assert sigma[0] == pytest.approx(0.02 / math.sqrt(2.0), rel=0.1)
    assert gain[0] > 100.0 * gain[1]
    left = [Series(part, 1.0, WALKS, np.stack([np.cos(w * t), np.sin(w * t)], axis=1)) for part in (y, 0.0 * y)]
    bare = [Series(part, 1.0, WALKS) for part in (y, 0.0 * y)]

    def square(series):
        """Of a series alone: without what the determinants make of it."""
        return np.diff([item.exact(*_of(motion))[0] for item in series])[0]

    assert square(left) - square(bare) == pytest.approx(gain[0], rel=1e-6)


def _of(motion):
    orders, values = motion.table
    return orders, np.log(np.concatenate([[motion.white], values.ravel()]))[None]


def _still(z):
    """A log of which nothing is to be estimated but the motion."""
    K = len(z)
    one = np.eye(1)
    return LinearSystem(
        one[None],
        np.zeros((1, 1, 1)),
        np.zeros((K, 3, 1)),
        QUIETEST_BASE**2 * np.eye(3)[None],
        z,
        np.zeros(1),
        1e-9 * one,
    )


def test_a_swing_is_found_besides_the_sea():
    """Of .3 m in 130 s, three times round in the log, and .2 m in 70 s: the usual fit does not look at the slower one."""
    K = 400
    t = np.arange(K) + 0.5
    z = np.stack([drawn(SEA, K, seed) for seed in (1, 2, 3)], axis=1)
    for axis, (size, period) in enumerate(((0.3, 130.0), (0.2, 70.0))):
        z[:, axis] += 2.0 * math.pi / period * size * np.cos(2.0 * math.pi / period * t + axis)
    found = fit_swing(_still(z), 1.0, WALKS, (SEA, SEA, SEA), np.zeros((K, 3, 2)))
    for axis, (size, period) in enumerate(((0.3, 130.0), (0.2, 70.0))):
        (line,) = (item for item in found[axis].oscillators if is_swing(item))
        assert 2.0 * math.pi / line.frequency == pytest.approx(period, rel=0.01)
        assert swing.amplitude(line) == pytest.approx(size, rel=0.03)
    assert found[2] == SEA


def test_a_log_must_show_that_the_swing_comes_back():
    assert not long_enough(60.0)
    assert long_enough(61.0)


@pytest.mark.parametrize("K", [61, 64, 70])
def test_a_log_that_is_just_long_enough_has_one_frequency_to_try(K):
    """A grid from two periods in the log to the slowest sea: of a log of a minute it has one cell, and a swing there is found."""
    period = 0.5 * (30.0 + 0.5 * K)
    z = np.stack([drawn(SEA, K, seed) for seed in (1, 2, 3)], axis=1)
    z[:, 0] += 2.0 * math.pi / period * 1.2 * np.cos(2.0 * math.pi / period * (np.arange(K) + 0.5))
    found = fit_swing(_still(z), 1.0, WALKS, (SEA, SEA, SEA), np.zeros((K, 3, 2)))
    (line,) = (item for item in found[0].oscillators if is_swing(item))
    assert 2.0 * math.pi / line.frequency == pytest.approx(period, rel=0.1)


def _fine(likelihood):
    return SimpleNamespace(
        estimates=SimpleNamespace(log_likelihood=likelihood),
        settled=True,
        integrals=SimpleNamespace(intervals=np.ones(400)),
    )


@pytest.mark.parametrize(
    ("change", "believed"),
    [
        ({}, True),
        ({"size": 1.01 * MOST}, False),  # a base that leaves goes farther
        ({"slow": (Oscillator(2, 0.01, 2.0 * math.pi / 60.0, 0.5),)}, False),  # something else is slow, too
        ({"rival": 150.0}, False),  # the usual motion and what begins explain as much
        ({"left": 26.0}, False),  # something is left that chance does not give
        ({"gained": 60.0}, False),  # chance and its own freedom give as much: 25 + 6 log 400
    ],
)
def test_a_swing_is_believed_where_nothing_else_explains_as_much(change, believed, monkeypatch):
    given = {"size": 0.9 * MOST, "slow": (), "rival": 12.0, "left": 5.0, "gained": 200.0} | change
    w = 2.0 * math.pi / 100.0
    line = Oscillator(1, given["size"] * w / math.sqrt(2.0), w, 1e-10)
    moved = AxisMotion(1e-4, (*SEA.oscillators, *given["slow"], line))
    plain, fine = _fine(0.0), _fine(0.5 * given["gained"])
    monkeypatch.setattr(swing, "_likeliest", lambda item, position: given["left"] if item is fine else 5.0)
    begun = [Evidence("drift.step", {"ratio": given["rival"]}, "bounded")]
    assert swing.swings(fine, (moved, moved, SEA), plain, lambda: begun, Position(0.7, 0.0, 0.0)) is believed


def test_two_parameters_that_do_the_same_make_no_singular_matrix():
    """Size and damping of a peak whose wings alone are seen: as first run, on accelerations in another unit, a `LinAlgError`."""
    series = Series(drawn(MOTIONS["white"], 64, 1), 1.0, WALKS)

    def expected(orders, logs):
        return np.exp(0.2 * (logs[:, 1] + logs[:, 3]))[:, None] * np.ones(len(series.periodogram))

    series.expected = expected
    _score(series, AxisMotion(1e-3, (Oscillator(1, 1e3, 1.0, 0.5),)))


def test_a_guess_that_is_no_model_warns_of_nothing(recwarn):
    from truenorth.alignment.motion_fit import climb

    series = Series(np.full(64, np.inf), 1.0, WALKS)
    assert climb(series, AxisMotion(1e-3), 3) == AxisMotion(1e-3)
    assert not recwarn.list


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "run"), [(31, 3), (31, 6), (77, 0)])
def test_a_ship_on_her_lines_is_aligned(seed, run):
    """Ships of another world, which swing and turn by decimetres in one to three minutes: these were refused as leaving."""
    rng = np.random.default_rng([seed, run, 9])
    true = vehicles.ship(rng, 400.0, moored=True)
    record = sensed(rng, true, imu_spec("navigation"))
    answer = align(record, Position(*true.place.mean(axis=0).tolist()), "navigation")
    assert answer.status == "aligned", answer.reasons
    C = true.at(answer.time)[2]
    off = -log(answer.C_nb @ C.T)
    off[:2] = answer.C_nb[:2] @ np.cross(answer.C_nb[2], C[2])
    assert np.all(np.abs(off) < 4.0 * np.sqrt(np.diag(answer.phi_covariance)))
    assert any(item.key == "sway.swing" for item in answer.evidence)
    # The slow arm stays behind: which part of a heading is slow shows itself afterwards.
    assert answer.ongoing.P.shape == (39, 39)


@pytest.mark.slow
@pytest.mark.parametrize(("leaves", "refused"), [(0.0, False), (3.0, True)])
def test_a_drift_that_is_small_against_sigma_refuses_no_ship(leaves, refused, monkeypatch):
    """A slow heel looked like a drift by a ratio of 27, small against the sigma of a tactical IMU; one to 3 m/s is one."""

    def world(rng, start, v, *rest):
        gone = np.clip(np.linspace(-1.0, 1.0, len(v)), 0.0, 1.0)[:, None] * np.array([leaves, 0.0, 0.0])
        return foreign.world(rng, start, v + gone, *rest)

    monkeypatch.setattr(vehicles, "world", world)
    case = next(case for case in CASES if case.name == "swaying, tactical, ship moored")
    assert bool(case.run(4242, 10).refused) == refused


@pytest.mark.slow
@pytest.mark.parametrize(("bench", "fault"), [("swaying", "coarse quantum"), ("rotary", "wrong hemisphere")])
def test_no_swing_takes_up_a_fault(bench, fault):
    """By 8.8 and 8.6 sigmas: a motion of three free oscillators let both pass."""
    inputs, truth = BENCHES[bench].draw(9961, 0)
    spoil = next(item.apply for item in FAULTS if item.name == fault)
    spoilt, _ = spoil(inputs, np.random.default_rng([9961, 0, crc32(f"{bench} {fault}".encode())]))
    answer = BENCHES[bench].align(spoilt)
    worst = max(float(np.abs(x).max()) for x in misses(answer, truth).values())
    assert answer.status == "inconsistent" or worst < 3.0, answer
