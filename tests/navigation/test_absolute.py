"""An error that all fixes share is in the position found: sigma has it where nobody says that there is none."""

from dataclasses import replace

import numpy as np
import pytest

from tests.navigation.test_navigate import SPEC, drive, fixes
from truenorth.aiding.aids import Gnss
from truenorth.navigation import Mounting, navigate
from truenorth.quality.absolute import accuracy_of, known_as_followed
from truenorth.state.layout import ANTENNA_ARM, DP, Layout
from truenorth.state.state import Start, State
from truenorth.state.track import Residuals, Track

__all__ = ["drive"]  # the fixture of a car that turns twice


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
        assert np.all(result.position_sigma[-1] >= [1.5, 1.5, 3.0])
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
