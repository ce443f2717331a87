"""Fixes from outside in damped navigation: taken whole or not at all, counted, and never left out in silence."""

import math

import numpy as np
import pytest

from tests.damping.test_navigation import Ship
from truenorth.aiding.fixes import AzimuthFix, Fixes, PositionFix
from truenorth.core.earth import radii
from truenorth.core.errors import UsageError
from truenorth.damping.fix_rows import Weighed, fixes_on
from truenorth.damping.options import Damper
from truenorth.errors.marine import DP
from truenorth.filters import FilterState

AUGMENTED = Damper("augmented")
METHODS = ("augmented", "kalman", "double", "external", "internal")
DEG = math.radians(1.0)
FIRST, LAST = 3600.0, 9000.0  # s
STEP = 600.0  # s, between fixes that are many


@pytest.fixture(scope="module")
def ship():
    return Ship(hours=3.0)


@pytest.fixture(scope="module")
def log(ship):
    return ship.log()


@pytest.fixture(scope="module")
def without(ship, log):
    return {method: ship.navigate(Damper(method), log) for method in METHODS}


def places(ship, times, north=0.0, sigma=100.0):
    """Where the ship was, and so many metres north of it at the last of the times."""
    found = []
    for time in times:
        lat, lon, _ = ship.truth.position[round(time / ship.truth.interval)]
        off = north / radii(lat)[0] if time == times[-1] else 0.0
        found.append(PositionFix(time, float(lat + off), float(lon), sigma))
    return found


def azimuth(ship, time, wrong=0.0):
    C = ship.truth.C_nb[round(time / ship.truth.interval)]
    return AzimuthFix(time, math.atan2(C[0, 1], C[1, 1]) + wrong, 0.05 * DEG)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("what", ["place", "azimuth"])
def test_what_contradicts_the_track_is_no_quiet_result(ship, log, without, what, method):
    """A place 55 km to the north of where the ship is, an azimuth a degree off: they were left out, half of them or whole."""
    if what == "place":
        wrong, name = Fixes(places(ship, [FIRST], 55e3)), "position fix"
    else:
        wrong, name = Fixes((), [azimuth(ship, FIRST, 1.0 * DEG)]), "azimuth reset"
    result, alone = ship.navigate(Damper(method), log, fixes=wrong), without[method]
    assert result.status == "inconsistent"
    assert f"{name}: 1 of 1 measurements rejected: they contradict the track" in result.reasons[0]
    said = result.summary()["aiding"]
    assert said[name] == {"measurements": 1, "rejected": 1, "outside": 0, "nis_over_rows": None}
    assert set(result.innovations()["sensor"]) == {"levelled velocity log", name}
    np.testing.assert_allclose(result.position, alone.position, rtol=0.0, atol=1e-12)  # neither axis of it is taken
    np.testing.assert_allclose(result.track.sigma, alone.track.sigma, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_what_is_right_is_taken_and_counted(ship, log, without, method):
    """Two places and an azimuth, two of them at one time: sigma comes down to theirs, errors with it."""
    result = ship.navigate(
        Damper(method), log, fixes=Fixes(places(ship, [FIRST, LAST], sigma=10.0), [azimuth(ship, LAST)])
    )
    assert result.status == "navigated"
    said = result.summary()["aiding"]
    assert [(said[name]["measurements"], said[name]["rejected"]) for name in ("position fix", "azimuth reset")] == [
        (2, 0),
        (1, 0),
    ]
    k = int(np.searchsorted(result.time, LAST))
    assert np.all(result.position_sigma[k, :2] < 12.0)
    assert np.all(np.abs(ship.errors(result)[k, DP]) < 40.0)
    assert np.all(without[method].position_sigma[k, :2] > 50.0)


def test_two_places_at_one_time_are_two(ship, log):
    """The second one of an epoch took the place of the first."""
    one, two = (
        ship.navigate(AUGMENTED, log, fixes=Fixes(places(ship, [FIRST] * count, sigma=10.0))) for count in (1, 2)
    )
    assert two.summary()["aiding"]["position fix"]["measurements"] == 2
    k = int(np.searchsorted(one.time, FIRST))
    np.testing.assert_allclose(two.position_sigma[k, :2], one.position_sigma[k, :2] / math.sqrt(2.0), rtol=0.05)


@pytest.mark.parametrize("last", [False, True])
def test_one_of_many_is_an_outlier_where_later_ones_agree(ship, log, last):
    """A slip among six costs nothing and is said; as the last one it contradicts what the answer says of the end."""
    times = FIRST + STEP * np.arange(6.0)
    wrong = places(ship, times[: 6 if last else 3], 55e3)
    result = ship.navigate(AUGMENTED, log, fixes=Fixes([*wrong, *places(ship, times[len(wrong) :])]))
    assert result.summary()["aiding"]["position fix"]["rejected"] == 1
    assert result.status == ("inconsistent" if last else "navigated")
    said = "contradict the track" if last else "position fix: 1 of 6 measurements rejected as outliers"
    assert any(said in reason for reason in result.reasons)


def test_a_fix_is_weighed_by_the_wider_of_filter_and_bands(ship):
    """Six sigmas of the filter off, within three of the bands, which know more of the log: it is sound, and taken."""
    course = ship.truth
    fix = fixes_on(course, course, Fixes(places(ship, [FIRST], 6000.0)), 0)
    state = FilterState(np.zeros(13), np.diag(np.full(13, 1000.0**2)), np.zeros(()), np.zeros(2))
    own, wider = Weighed(fix), Weighed(fix.expected(np.full((len(course), 7), 2500.0)))
    assert own.take(0, state) is state
    assert not own.used[0]
    taken = wider.take(0, state)
    assert wider.used[0]
    assert wider.nis[0] == pytest.approx(5.76, rel=0.01)
    np.testing.assert_allclose(taken.x[DP], [0.0, -6000.0], atol=80.0)
    assert taken.memory is state.memory


def test_an_undamped_navigation_with_fixes_needs_no_damping(ship):
    with pytest.raises(UsageError, match="fixes with damping none"):
        ship.navigate(Damper("none"), fixes=Fixes(places(ship, [FIRST])))
