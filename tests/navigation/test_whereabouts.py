"""Aiding logs of another place, in other units or axes: refused with row, column, what it looks like and what to do."""

from dataclasses import replace

import numpy as np
import pytest

from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.navigation.whereabouts import check_fixes, check_heights
from truenorth.records import GnssRecord, HeightRecord
from truenorth.records.gnss_frames import check_frames

N = 60
T = 100.0 + np.arange(N)
PLACE = Position.from_degrees(48.0, 11.0, 500.0)
R = 6.38e6


def journey(noise=0.3, v=(9.0, 5.0, 0.6), seed=0):
    """Fixes and velocities on a road that goes up and down, from 40 m away from the place."""
    rng = np.random.default_rng(seed)
    v_n = np.array(v) * [1.0, 1.0, 0.0] + np.outer(np.cos(T / 5.0), [0.0, 2.0, v[2]])
    way = np.vstack([np.full(3, 40.0), 40.0 + np.cumsum(0.5 * (v_n[1:] + v_n[:-1]), axis=0)])
    way += noise * rng.standard_normal(way.shape)
    lat, lon = PLACE.lat + way[:, 1] / R, PLACE.lon + way[:, 0] / (R * np.cos(PLACE.lat))
    return GnssRecord(
        T, lat, lon, PLACE.alt + way[:, 2], v_n + 0.03 * rng.standard_normal(v_n.shape), source="gnss.csv"
    )


def refused(check, *arguments):
    with pytest.raises(DataError) as caught:
        check(*arguments)
    return str(caught.value)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: {"lat": r.lon, "lon": r.lat}, ["exchanged they fit", "lat is lon"]),
        (lambda r: {"lat": np.radians(r.lat), "lon": np.radians(r.lon)}, ["read as radians", "units position=rad"]),
        (lambda r: {"lon": -r.lon}, ["longitude's other sign", "east is positive"]),
        (lambda r: {"lat": -r.lat}, ["latitude's other sign", "north is positive"]),
        (lambda r: {"lat": r.lat + 0.01}, ["align with `lat` 48.57", "`lon` 11.00", "64 km"]),
        (lambda r: {"alt": r.alt - PLACE.alt}, ["column alt: 4", "from 500.0 m", "`alt` 4"]),
        (lambda r: {"alt": -r.alt}, ["counted downwards", "depth"]),
        (lambda r: {"alt": r.alt / 0.3048}, ["times 0.3048 they fit", "3.28", "metres"]),
    ],
)
def test_a_track_from_elsewhere_says_what_it_looks_like(change, words):
    right = journey()
    check_fixes(right, PLACE, T[0])
    wrong = replace(right, **change(right))
    found = refused(check_fixes, wrong, PLACE, T[0])
    for word in ("gnss.csv: row ", "expected the track to begin there", *words):
        assert word in found, found


def test_without_longitude_or_height_the_alignment_is_named():
    found = refused(check_fixes, journey(), Position(PLACE.lat, 0.0, PLACE.alt), T[0])
    assert "was `lon` left out? align with `lat` 48.000" in found
    assert "`lon` 11.00" in found
    assert "column alt" in refused(check_fixes, journey(), replace(PLACE, alt=0.0), T[0])
    check_fixes(journey(), replace(PLACE, alt=0.0), T[0], heights=False)
    check_fixes(journey(), replace(PLACE, alt=0.0, vertical_sigma=100.0), T[0])


def test_first_fixes_that_are_poor_lie_as_far_off_as_they_say():
    r = journey()
    far = replace(r, lat=r.lat + 1200.0 / R, alt=r.alt + 300.0)
    check_fixes(replace(far, position_sigma=np.tile([50.0, 50.0, 85.0], (N, 1))), PLACE, T[0])
    assert "columns lat and lon" in refused(check_fixes, replace(far, position_sigma=np.full((N, 3), 5.0)), PLACE, T[0])
    high = replace(far, lat=r.lat, position_sigma=np.full((N, 3), 5.0))
    assert "column alt" in refused(check_fixes, high, PLACE, T[0])


def test_what_may_have_been_driven_or_is_one_outlier_passes():
    r = journey()
    far = replace(r, lat=r.lat + 5000.0 / R)
    assert "deg, 50" in refused(check_fixes, far, PLACE, T[0])
    check_fixes(far, PLACE, T[0] - 15.0)  # 5 km in 15 s are within what aircraft fly
    check_fixes(replace(r, lat=np.where(T[2] > T, far.lat, r.lat)), PLACE, T[0])
    check_fixes(replace(r, lat=np.full(N, np.nan)), PLACE, T[0])


def test_a_barometer_of_another_zero():
    baro = HeightRecord(T, np.full(N, 812.0), source="baro.csv")
    found = refused(check_heights, baro, PLACE, T[0])
    assert "baro.csv: row 3, column alt: 812.0 m, 312 m from 500.0 m" in found
    assert "`alt` 812" in found
    check_heights(baro, replace(PLACE, vertical_sigma=50.0), T[0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: {"v_n": r.v_n[:, [1, 0, 2]] * [1, 1, -1]}, ["north, east, down", "exchange the columns VE and VN"]),
        (lambda r: {"lat": r.lon, "lon": r.lat}, ["latitude and longitude exchanged"]),
        (lambda r: {"lat": np.radians(r.lat), "lon": np.radians(r.lon)}, ["radians that were read as degrees"]),
        (lambda r: {"v_n": r.v_n * [1, 1, -1]}, ["heights contradict", "counted downwards", "VD"]),
        (lambda r: {"alt": -r.alt}, ["heights contradict", "depth"]),
    ],
)
def test_velocities_that_are_not_the_change_of_position(change, words):
    right = journey()
    check_frames(right)
    found = refused(check_frames, replace(right, **change(right)))
    for word in ("gnss.csv: ", *words):
        assert word in found, found


def test_noise_alone_is_no_contradiction():
    """A parked receiver, and one whose fixes are noisier than the way between them: never refused in 200 draws."""
    for seed in range(100):
        check_frames(journey(3.0, (0.0, 0.0, 0.0), seed))
        check_frames(journey(8.0, seed=seed))
