"""A barometer whose heights are another level's is named, by the receiver's heights or by the start's; a sound one never is."""

import numpy as np
import pytest

from truenorth.aiding.aids import Barometer, Gnss
from truenorth.quality.heights import either_level, level_evidence
from truenorth.records import GnssRecord, HeightRecord
from truenorth.state.mounting import Mounting
from truenorth.state.track import Residuals, Track
from truenorth.state.wording import sentences

TIME = np.arange(200.0)
KNOWN = Mounting()  # of which nothing is to be found
RISE = 30.0 * np.sin(TIME / 40.0)


def track(*residuals):
    """Of which the residuals alone are looked at."""
    found = object.__new__(Track)
    object.__setattr__(found, "residuals", residuals)
    return found


def known_to(sigma):
    """A track whose states are all known to this sigma."""
    found = track()
    for name, value in (("time", TIME), ("P", np.tile(sigma**2 * np.eye(15), (len(TIME), 1, 1)))):
        object.__setattr__(found, name, value)
    return found


def receiver(heights, sigma=1.0, mounting=KNOWN):
    place = np.zeros(len(TIME))
    return Gnss(GnssRecord(TIME, place, place, heights, position_sigma=np.full((len(TIME), 3), sigma)), mounting)


def first_rows(off, sigma=22.0):
    """Residuals of a barometer whose heights are `off` by what the start and the IMU say, of this sigma of both."""
    innovation, size = np.full((2, len(TIME), 3), np.nan)
    innovation[:, 0], size[:, 0] = -off, sigma
    return Residuals(
        "barometer", TIME, innovation, size, (off / sigma) ** 2, np.abs(off) < 3.9 * sigma, 0, TIME, TIME < 0.0, "m"
    )


def keys(*arguments):
    return [(e.key, e.remedies, e.kind) for e in level_evidence(*arguments)]


@pytest.mark.parametrize("off", [-150.0, 60.0])
def test_an_offset_beyond_both_sigmas_is_named_with_its_size(off):
    baro = Barometer(HeightRecord(TIME + 0.4, 400.0 + RISE + off))
    (found,) = level_evidence(baro, receiver(400.0 + RISE), track())
    assert (found.key, found.remedies, found.kind) == ("height.apart", ("level.apart",), "unknown")
    assert found.figures["apart"] == pytest.approx(off, abs=1.0)
    assert found.figures["sigma"] == pytest.approx(
        10.2, abs=0.1
    )  # the weather's 10 m, the receiver's noise and its slow error


def test_an_offset_that_its_sigma_holds_is_none():
    for off, mounting in ((30.0, None), (150.0, Mounting(bias_sigma=50.0, bias_time=3600.0)), (1.5, Mounting())):
        baro = Barometer(HeightRecord(TIME, 400.0 + RISE + off), mounting)
        assert not level_evidence(baro, receiver(400.0 + RISE), track())
    assert level_evidence(
        baro := Barometer(HeightRecord(TIME, 408.0 + RISE), Mounting()), receiver(400.0 + RISE), track()
    )
    assert not level_evidence(baro, receiver(400.0 + RISE, sigma=3.0), track())
    assert not level_evidence(
        baro, receiver(400.0 + RISE, mounting=Mounting(lever_arm=np.array([0.0, 3.0, 2.0]))), track()
    )


def test_what_is_there_for_a_part_of_the_log_alone_is_another_check_s():
    step = Barometer(HeightRecord(TIME, 400.0 + RISE + 150.0 * (TIME > 40.0)))
    assert not level_evidence(step, receiver(400.0 + RISE), track())
    gone = 400.0 + RISE
    gone[10:] = np.nan
    away = Barometer(HeightRecord(TIME + 60.0, 550.0 + RISE))
    assert not level_evidence(away, receiver(gone), track())


def test_heights_in_feet_are_named_by_their_ratio():
    feet = Barometer(HeightRecord(TIME, (60.0 + RISE) / 0.3048))
    assert keys(feet, receiver(60.0 + RISE), track()) == [("height.apart", ("height_in_feet",), "unknown")]
    off = (60.0 + RISE) / 0.3048 - (60.0 + RISE)
    assert keys(feet, None, track(first_rows(off, 11.0))) == [("height.first", ("height_in_feet",), "unknown")]


def test_first_rows_are_held_against_the_start():
    baro = Barometer(HeightRecord(TIME, 550.0 + RISE))
    assert keys(baro, None, track(first_rows(np.where(TIME < 40.0, 150.0, 0.0)))) == [
        ("height.first", ("level.first",), "unknown")
    ]
    assert not level_evidence(baro, None, track(first_rows(np.full(len(TIME), 60.0))))
    # Some rows that are wrong are outliers; so is a row later on.
    assert not level_evidence(baro, None, track(first_rows(np.where(TIME < 3.0, 150.0, 0.0))))
    assert not level_evidence(baro, None, track(first_rows(np.where(TIME > 40.0, 150.0, 0.0))))
    assert not level_evidence(baro, None, track())


@pytest.mark.parametrize("undulation", [-106.0, -45.0, 30.0, 85.0])
def test_a_height_kept_by_gnss_may_be_off_by_what_a_barometer_differs_by(undulation):
    """Heights above the ellipsoid and above the sea: nobody knows which of the two the reader means, and sigma holds both."""
    baro = Barometer(HeightRecord(TIME, 400.0 + RISE))
    (found,), growth = either_level(baro, receiver(400.0 + RISE + undulation), known_to(0.7))
    assert (found.key, found.remedies, found.kind, found.urgent) == ("height.either", ("level.either",), "note", True)
    assert "geoid" in sentences([found])[0]
    assert 0.7 * growth[:, 8] == pytest.approx(np.hypot(0.7, undulation))
    assert (growth[:, :8] == 1.0).all()


@pytest.mark.parametrize(
    ("heights", "remedy"),
    [(RISE, "level.either"), (700.0 + RISE, "level.either"), ((400.0 + RISE) / 0.3048, "height_in_feet")],
)
def test_what_no_geoid_explains_is_the_barometers(heights, remedy):
    """Heights above the start, or in feet: sigma of a receiver's height was 100 times as large."""
    (found,), growth = either_level(Barometer(HeightRecord(TIME, heights)), receiver(400.0 + RISE), known_to(0.7))
    assert (found.key, found.remedies, found.kind) == ("height.apart", (remedy,), "note")
    assert (growth == 1.0).all()


def test_a_barometer_that_chance_explains_widens_no_height():
    baro = Barometer(HeightRecord(TIME, 424.0 + RISE))  # the weather: 2.4 sigmas
    found, growth = either_level(baro, receiver(400.0 + RISE), known_to(0.7))
    assert not found
    assert (growth == 1.0).all()


@pytest.mark.parametrize("seed", range(40))
def test_sound_barometers_are_never_refused(seed):
    """Weather and noise as their sigmas say: beyond four of both in nine rows of ten is one log in 16,000 at the most."""
    rng = np.random.default_rng(seed)
    sigma = rng.uniform(0.05, 3.0)
    fixes = receiver(400.0 + RISE + sigma * (rng.standard_normal(200) + rng.standard_normal()), sigma)
    baro = Barometer(HeightRecord(TIME, 400.0 + RISE + 10.0 * rng.standard_normal() + rng.standard_normal(200)))
    assert not level_evidence(baro, fixes, track())
