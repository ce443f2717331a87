"""An error that all fixes share is in the position found: sigma has it where nobody says that there is none."""

from dataclasses import replace
from math import erfc
from types import SimpleNamespace

import numpy as np
import pytest

from tests.navigation.test_navigate import SPEC, drive, fixes
from tests.runs import some
from truenorth.aiding.aids import Gnss
from truenorth.aiding.sensors import from_gnss
from truenorth.navigation import Mounting, navigate
from truenorth.quality.absolute import accuracy_of, known_as_fixes, known_as_followed, shared_part
from truenorth.quality.aid_noise import LEAST_SQUARE, white_part
from truenorth.quality.slow_aids import FIXES
from truenorth.records import GnssRecord
from truenorth.simulation.processes import gauss_markov
from truenorth.state.layout import ANTENNA_ARM, DP, Layout
from truenorth.state.state import Start, State
from truenorth.state.track import Residuals, Track

__all__ = ["drive"]  # the fixture of a car that turns twice


@pytest.mark.slow
def test_fixes_that_err_together(drive):
    """By 2.4 m east, 1.2 m north, 5 m up, of a receiver that says 1.5 and 3 m: no innovation shows it, sigma has it."""
    motion, record, start = drive
    time = np.arange(1.0, 179.0)
    sound = fixes(motion, time, 0.3)
    off = np.array([2.4, 1.2, 5.0])
    shifted = replace(
        sound,
        lat=sound.lat + off[1] / 6.37e6,
        lon=sound.lon + off[0] / (6.38e6 * np.cos(sound.lat)),
        alt=sound.alt + off[2],
        position_sigma=np.tile([1.5, 1.5, 3.0], (len(time), 1)),
    )
    for mounting in (None, Mounting(lever_arm=np.zeros(3))):
        result = navigate(record, start, aid=Gnss(shifted, mounting), imu=SPEC)
        assert result.status == "navigated"
        # All that the receiver says but the noise that is seen, a twenty-fifth of the variance: the rest may be shared.
        assert np.all(result.position_sigma[-1] ** 2 >= 0.99 * (np.square([1.5, 1.5, 3.0]) - 0.3**2))
        lat, _, alt = result.position[-1]
        s = motion.states(np.array(result.time[-1]))
        miss = np.array([(lat - float(s.lat)) * 6.37e6, alt - float(s.alt)])
        assert np.abs(miss).max() > 1.0
        assert np.all(np.abs(miss) < 2.0 * result.position_sigma[-1][1:])
    # Who says that there is none is believed: the sigma of white noise.
    white = navigate(record, start, aid=Gnss(shifted, Mounting(bias_sigma=0.0)), imu=SPEC)
    assert (white.position_sigma[-1] < 1.0).all()


@pytest.mark.parametrize(("quality", "level"), [(None, 2.0), (1, 2.0), (2, 1.0), (4, 0.05), (5, 0.5)])
def test_a_receiver_that_says_nothing_is_known_by_the_kind_of_its_fixes(drive, quality, level):
    motion, _, _ = drive
    record = replace(fixes(motion, np.arange(1.0, 20.0), 0.3), position_sigma=None)
    if quality is not None:
        record = replace(record, quality=np.full(len(record), float(quality)))
    assert accuracy_of(record)[:2] == pytest.approx(level)
    assert accuracy_of(record)[2] > level


@pytest.mark.parametrize("lasts", [False, True])
def test_a_loop_that_follows_a_slow_error_knows_place_no_better_than_that(drive, lasts):
    """Innovations of 4 m that last for 20 rows, of a receiver that says nothing; of white ones as large nothing is said."""
    time = np.arange(1.0, 400.0)
    noise = np.random.default_rng(7).standard_normal((len(time) + 40, 3))
    kernel = np.exp(-np.arange(40) / 20.0) if lasts else np.eye(1, 40)[0]
    error = 4.0 * np.column_stack([np.convolve(axis, kernel / np.linalg.norm(kernel), "valid") for axis in noise.T])
    error = error[: len(time)]
    said_of_it, nis, used = np.full((len(time), 3), 4.0), np.full(len(time), 3.0), np.ones(len(time), dtype=bool)
    seen = Residuals("GNSS position", time, error, said_of_it, nis, used, 0, time, ~used, "m")
    track = Track.along(drive[0].states(time[-1:]))
    track = replace(track, P=0.01 * np.eye(track.sensors.shape[1])[None], residuals=(seen,))
    record = replace(fixes(drive[0], np.arange(1.0, 179.0), 0.3), position_sigma=None)
    found, said = known_as_followed(track, Gnss(record), "gnss")
    assert [item.key for item in said] == (["innovations.wander"] if lasts else [])
    sigma = found.sigma[-1, DP]
    armed = replace(
        track, layout=Layout((ANTENNA_ARM,), ((5.0,) * 3,)), P=0.01 * np.eye(18)[None], sensors=np.zeros((1, 18))
    )
    start = Start.of(State.at(np.eye(3), 0.8), np.eye(15))
    more = known_as_followed(armed, Gnss(record), "gnss", start)[0].sigma[-1, DP]
    np.testing.assert_allclose(more**2 - sigma**2, 25.0 - 0.01 if lasts else 0.0, rtol=1e-6, atol=1e-9)
    learnt = replace(start, P=np.diag([*np.ones(15), 4.0, 4.0, 9.0]), known={ANTENNA_ARM: np.zeros(3)})
    assert learnt.without(ANTENNA_ARM).P.shape == (15, 15)
    more = known_as_followed(armed, Gnss(record), "gnss", learnt)[0].sigma[-1, DP]
    np.testing.assert_allclose(np.sum(more**2 - sigma**2), 17.0 - 0.03 if lasts else 0.0, rtol=1e-6, atol=1e-9)
    assert sigma[0] == pytest.approx(2.0) if not lasts else np.all((sigma > 4.0) & (sigma < 16.0))


UNTRUE = 0.5  # of the variance that a receiver says, one sigma, by which it may be wrong
SAID, WHITE = 2.0, 0.01  # m: what the receiver says; what an INS that is good against its fixes is off by


def seen_by(rng, shared, time, rows=600, said=SAID):
    """A track of an INS that is nearly exact, and its fixes: a share of what the receiver says lasts (s), the rest is white."""
    at = np.arange(1.0, rows + 1.0)
    lasts = gauss_markov(SAID, time, 1.0, rows, rng) if np.isfinite(time) else SAID * rng.standard_normal((1, 3))
    e = np.sqrt(1.0 - shared) * SAID * rng.standard_normal((rows, 3)) + np.sqrt(shared) * lasts
    e = e - e.mean(axis=0)  # the filter ends at the mean of them
    used = np.ones(rows, dtype=bool)
    residuals = Residuals(FIXES, at, e, np.full((rows, 3), said), np.full(rows, 3.0), used, 0, at, ~used, "m")
    three = np.zeros((1, 3))
    track = Track(at[-1:], np.eye(3)[None], three, three, np.zeros((1, 15)), WHITE**2 * np.eye(15)[None], Layout(), ())
    record = GnssRecord(at, 0.7 + 0.0 * at, 0.1 + 0.0 * at, 5.0 + 0.0 * at, position_sigma=np.full((rows, 3), said))
    return replace(track, residuals=(residuals,)), record, from_gnss(record, Mounting())[0]


@pytest.mark.parametrize(
    ("shared", "time"),
    some([(0.0, np.inf), (0.5, 300.0)], [(1.0, np.inf), (0.1, np.inf), (0.5, np.inf), (1.0, 3600.0)]),
)
def test_what_is_not_white_may_be_shared(shared, time):
    """The mean of what sigma allows for over 200 receivers is what is shared, to what so many fixes can show."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(200):
        track, record, fixes = seen_by(rng, shared, time)
        known = known_as_fixes(track, record, None, fixes=fixes)
        found.append((known.sigma[-1, DP] ** 2 - WHITE**2) / SAID**2)
    level, up = np.mean(found, axis=0)[[0, 2]]
    u = np.sqrt(3.0 / 600.0) * max(1.0 - shared, LEAST_SQUARE)  # of the part of one axis
    # A slow error of 300 s seems white by 1/300. Beyond what is shared: what the receiver may be wrong by about its size, a half.
    most = min(shared + UNTRUE * normal_beyond(-shared / UNTRUE), 1.0)
    assert shared - u < level < most + u + 0.005
    assert shared - 1.4 * u < up < most + 1.4 * u + 0.005
    assert level > most - 0.08


def normal_beyond(low):
    """Mean of a normal variable that is beyond a limit."""
    return np.exp(-0.5 * low**2) / np.sqrt(2.0 * np.pi) / (0.5 * erfc(low / np.sqrt(2.0)))


def test_a_part_is_cut_off_at_nothing_and_at_all():
    m = np.hypot(0.1, UNTRUE)  # what the receiver may be wrong by counts as what is seen of its noise
    assert shared_part(1.0, 0.1) == pytest.approx(m * np.sqrt(2.0 / np.pi), rel=0.01)  # half of a normal distribution
    assert shared_part(0.0, 0.1) == pytest.approx(1.0, abs=0.01)
    assert shared_part(0.0, 0.1) <= 1.0
    assert shared_part(0.5, 0.01) == pytest.approx(0.5 + UNTRUE * normal_beyond(-1.0), rel=0.01)
    assert shared_part(0.5, 10.0) == pytest.approx(1.0, abs=0.15)  # nothing is seen: as much as is said
    assert shared_part(1.3, 0.05) == pytest.approx(
        0.2 + UNTRUE * normal_beyond(0.6) - 0.3, abs=0.02
    )  # it says too little: by as much again, but for chance


def test_ten_white_fixes_a_second_do_not_average_to_nothing():
    """2000 of 2 cm: a slow error of 1 cm besides, of which nothing is said, is in no innovation, since the filter follows it."""
    rng = np.random.default_rng(6)
    track, record, fixes = seen_by(rng, 0.0, np.inf, 2000)
    sigma = known_as_fixes(track, record, None, fixes=fixes).sigma[-1, DP]
    assert np.all((sigma > 0.6 * SAID) & (sigma < 0.7 * SAID))
    silent = known_as_fixes(track, record, 0.0, fixes=fixes)  # who says that there is none is believed
    assert silent.sigma[-1, DP] == pytest.approx(WHITE)


def test_nothing_is_known_of_what_is_shared():
    """Of few fixes, of a receiver that says nothing, or far too little: position is known no better than a fix."""
    rng = np.random.default_rng(4)
    for rows, said, says in ((30, SAID, True), (600, SAID, False), (600, 0.5 * SAID, True)):
        track, record, fixes = seen_by(rng, 0.0, np.inf, rows, said)
        record = record if says else replace(record, position_sigma=None)
        known = known_as_fixes(track, record, None, fixes=fixes)
        assert known.sigma[-1, DP][:2] == pytest.approx(said)


@pytest.mark.parametrize("newest", [3000, 1000])
def test_what_good_fixes_share_is_not_what_poor_ones_after_them_share(newest):
    """200 s of fixed phases, then 100 s that say 2 m and all err by 1.5 m. A loop keeps the newest rows, and older innovations."""
    rng = np.random.default_rng(0)
    time = 0.1 * np.arange(3000)
    said = np.where(time < 200.0, 0.02, 2.0)[:, None] * np.ones(3)
    expected = np.hypot(said, 0.03)
    off = np.where(
        time[:, None] < 200.0, expected * rng.standard_normal((3000, 3)), 1.5 + 0.05 * rng.standard_normal((3000, 3))
    )
    shown = SimpleNamespace(name=FIXES, used=np.ones(3000, dtype=bool), innovation=off, sigma=expected, stamp=time)
    source = SimpleNamespace(name=FIXES, time=time[-newest:], sigma=said[-newest:])
    part = white_part(SimpleNamespace(residuals=(shown,)), source, slice(0, 2))
    assert shared_part(*part) > 0.9
