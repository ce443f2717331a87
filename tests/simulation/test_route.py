"""Routes along way-points: where they pass, how fast, and what is refused; way-point files."""

import math

import numpy as np
import pytest

from truenorth.core.errors import DataError, UsageError
from truenorth.simulation.route import Driving, WayPoint, route
from truenorth.simulation.waypoints import read_waypoints, thinned

deg = math.radians

TOWN = [
    WayPoint(deg(45.0), deg(10.0), 100.0),
    WayPoint(deg(45.004), deg(10.001), 110.0),
    WayPoint(deg(45.006), deg(10.008), 115.0, stop=10.0),
    WayPoint(deg(45.002), deg(10.009), 112.0, speed=25.0),
    WayPoint(deg(44.99), deg(10.02), 90.0),
    WayPoint(deg(44.99), deg(10.0), 80.0),
    WayPoint(deg(45.0), deg(10.0), 100.0),
]


def passed(points, motion):
    """Distance (m), difference of height (m) and speed (m/s) where a motion passes nearest to each point."""
    stop = float(motion.speed.breaks[-1])
    at = motion.states(np.arange(0.0, stop, 0.02))
    speed = np.linalg.norm(at.v_n, axis=1)
    rows = []
    for point in points:
        away = np.hypot(at.lat - point.lat, (at.lon - point.lon) * math.cos(point.lat)) * 6.37e6
        k = int(np.argmin(away))
        rows.append((away[k], at.alt[k] - point.alt, speed[k]))
    return np.array(rows), at, speed


def test_a_route_goes_where_it_should_and_no_faster():
    driving = Driving(speed=15.0, acceleration=1.5, lateral_acceleration=2.0, radius=12.0)
    motion = route(TOWN, driving, wait=20.0)
    rows, at, speed = passed(TOWN, motion)
    # A corner of radius r and turn a is cut by less than a quintic fade's widening of r (1/cos(a/2) - 1) allows.
    assert np.all(rows[:, 0] < 18.0)
    np.testing.assert_allclose(rows[:, 1], 0.0, atol=0.1)
    assert speed.max() == pytest.approx(25.0, abs=1e-6)
    assert np.sum(speed < 1e-9) * 0.02 == pytest.approx(31.0, abs=0.05)  # the wait, the stop, a second at the end
    end = motion.states(float(motion.speed.breaks[-1]))
    assert abs(float(end.lat) - TOWN[-1].lat) * 6.37e6 < 0.05
    assert abs(float(end.lon) - TOWN[-1].lon) * 6.37e6 < 0.05
    assert float(end.alt) == pytest.approx(100.0, abs=0.05)
    assert np.max(np.abs(at.f_b[:, 0])) < 2.05  # the lateral limit, and 3 deg of slope turned a little
    grade = np.gradient(speed, 0.02)
    assert np.max(np.abs(grade)) < 1.5 + 1e-3


def test_a_rhumb_line_ends_at_its_point():
    """400 km across latitudes, one leg: within a millimetre."""
    points = [WayPoint(deg(60.0), deg(5.0), 0.0), WayPoint(deg(63.0), deg(10.0), 2000.0)]
    motion = route(points, Driving(speed=200.0))
    end = motion.states(float(motion.speed.breaks[-1]))
    assert abs(float(end.lat) - points[1].lat) * 6.37e6 < 1e-2
    assert abs(float(end.lon) - points[1].lon) * 6.37e6 < 1e-2
    assert float(end.alt) == pytest.approx(2000.0, abs=1e-2)


def test_along_a_parallel():
    points = [WayPoint(deg(45.0), deg(10.0)), WayPoint(deg(45.0), deg(10.5))]
    motion = route(points)
    end = motion.states(float(motion.speed.breaks[-1]))
    assert abs(float(end.lat) - deg(45.0)) * 6.37e6 < 1e-6
    assert abs(float(end.lon) - deg(10.5)) * 6.37e6 < 1e-3


def test_a_short_way_is_driven_slower():
    """30 m from stop to stop at 1.5 m/s^2: the top speed is what the way leaves time for."""
    points = [WayPoint(deg(45.0), deg(10.0)), WayPoint(deg(45.0) + 30.0 / 6.367e6, deg(10.0))]
    motion = route(points, Driving(speed=30.0, acceleration=1.5, onset=1.0))
    top = float(np.max(motion.speed(np.linspace(0, 60, 6001))[0]))
    assert top * (top / 1.5 + 1.0) == pytest.approx(30.0, rel=1e-3)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (TOWN[:1], "two at least"),
        ([TOWN[0], TOWN[0]], "way-points 1 and 2 are 0.000 m apart"),
        ([TOWN[0], WayPoint(deg(45.0001), deg(10.0), 500.0)], "slope"),
        (
            [TOWN[0], WayPoint(deg(45.0001), deg(10.0), 100.0), WayPoint(deg(45.00001), deg(10.0), 100.0)],
            "way-point 2: a turn",
        ),
    ],
)
def test_an_impossible_route_is_refused(points, words):
    with pytest.raises(UsageError, match=words):
        route(points)


CSV = "lat,lon,alt,speed,stop\n45.0,10.0,100,,\n45.004,10.001,110,12,\n45.006,10.008,115,,10\n"
GPX = """<?xml version="1.0"?>
<gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="45.0" lon="10.0"><ele>100</ele></trkpt>
<trkpt lat="45.00001" lon="10.0"><ele>100</ele></trkpt>
<trkpt lat="45.004" lon="10.001"><ele>110</ele></trkpt>
</trkseg></trk></gpx>
"""


def test_way_points_are_read(tmp_path):
    (tmp_path / "r.csv").write_text(CSV)
    (tmp_path / "r.gpx").write_text(GPX)
    points = read_waypoints(tmp_path / "r.csv")
    assert points == [
        WayPoint(deg(45.0), deg(10.0), 100.0),
        WayPoint(deg(45.004), deg(10.001), 110.0, speed=12.0),
        WayPoint(deg(45.006), deg(10.008), 115.0, stop=10.0),
    ]
    assert len(read_waypoints(tmp_path / "r.gpx")) == 2  # a receiver's track: points a metre apart are one
    assert len(read_waypoints(tmp_path / "r.gpx", spacing=0.0)) == 3
    assert len(thinned(points, 1e6)) == 1


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "", "empty"),
        ("a.csv", "lat,long\n1,2\n", "row 1, column 2.*'long'.*did you mean"),
        ("a.csv", "lat,alt\n1,2\n", "0 columns for lon"),
        ("a.csv", "lat,lon\n45,10\n45.1,ten\n", "row 3, column lon: 'ten'; expected a number"),
        ("a.csv", "lat,lon\n45,10\n95.1,10\n", "row 3, column lat: 95.1; expected -89.5 to 89.5"),
        ("a.csv", "lat,lon\n45,10\n45.1\n", "row 3: 1 cells"),
        ("a.csv", "lat,lon\n45,10\n45.1,nan\n", "row 3, column lon"),
        ("a.csv", "lat,lon\n45,10\n", "two or more"),
        ("a.gpx", "<gpx><trk>", "not a GPX file: line 1"),
        ("a.gpx", "<gpx/>", "no points"),
        ("a.gpx", '<gpx><rtept lat="1"/></gpx>', "rtept 1, column lon"),
    ],
)
def test_bad_way_points_name_the_place(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match=words):
        read_waypoints(tmp_path / name)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(UsageError, match="cannot be read"):
        read_waypoints(tmp_path / "no.csv")
    with pytest.raises(UsageError, match="suffix"):
        read_waypoints(tmp_path / "no.kml")
