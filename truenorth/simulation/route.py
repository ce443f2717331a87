"""A land vehicle on a route of way-points: corners rounded, slopes blended, speed within the limits of driver and tyres.

Between way-points the track is a rhumb line of the ellipsoid. At each the vehicle turns in a transition of length ``L``,
in which the track's rate fades in and out by the quintic step; the tangents it needs are found by quadrature. The plan is
made in distance; speed follows in time from limits by backward and forward passes over the corners and stops.

Source of the rhumb line: J. P. Snyder, *Map Projections: A Working Manual*, USGS Prof. Paper 1395, 1987, eq. 3-21 (meridian
distance, here by quadrature) and 7-7 (isometric latitude).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.core.errors import UsageError, expect_positive
from truenorth.core.position import Position
from truenorth.simulation.course import Course
from truenorth.simulation.profile import Profile, Ramp, profile

Array = NDArray[np.float64]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class WayPoint:
    """A point of a route."""

    lat: float  # rad
    lon: float  # rad
    alt: float = 0.0  # m
    speed: float | None = None  # m/s; from here on; None: as before
    stop: float = 0.0  # s; for which the vehicle stands here


@dataclass(frozen=True)
class Driving:
    """How a vehicle is driven.

    Attributes
    ----------
    speed : float, m/s
        Where no way-point says another.
    acceleration : float, m/s^2
        Along the track, also of braking.
    lateral_acceleration : float, m/s^2
        In corners.
    radius : float, m
        Of a corner, where the legs are long enough; tighter ones are driven slower.
    smallest_radius : float, m
        That the vehicle can turn in.
    onset : float, s
        In which an acceleration comes and goes.
    """

    speed: float = 15.0
    acceleration: float = 1.5
    lateral_acceleration: float = 2.0
    radius: float = 15.0
    smallest_radius: float = 4.0
    onset: float = 1.0

    def __post_init__(self) -> None:
        expect_positive("driving", vars(self))


def route(
    points: Sequence[WayPoint],
    driving: Driving | None = None,
    *,
    wait: float = 0.0,
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Course:
    """The course of a vehicle along way-points; it begins and ends standing.

    Parameters
    ----------
    points : sequence of WayPoint
    driving : Driving
    wait : float, s
        Before it sets off.
    lever_arm : (3,) floats, m
        To the IMU, body axes.

    Raises
    ------
    UsageError
        Fewer than two points, two in one place, a corner tighter than the vehicle can turn, a slope beyond 45 deg: the
        message names the way-points by number, 1 the first.
    """
    driving = driving or Driving()
    if len(points) < 2:
        raise UsageError(f"route of {len(points)} way-point(s); expected two at least")
    heading, plan, rise = _legs(points)
    turns = (np.diff(heading) + math.pi) % (2 * math.pi) - math.pi
    lengths, tangents = _corners(turns, plan, driving)
    # From the middle of one corner to that of the next; a corner's arc is shorter than its two tangents.
    before, after = np.concatenate([[0.0], tangents]), np.concatenate([tangents, [0.0]])
    arcs = 0.5 * (np.concatenate([[0.0], lengths]) + np.concatenate([lengths, [0.0]]))
    slope = np.arctan2(rise, plan - before - after + arcs)
    way = (plan - before - after + arcs) / np.cos(slope)
    centres, end = np.cumsum(way)[:-1], float(np.sum(way))
    track = [
        Ramp(centre - 0.5 * L, L, turn, 0.5 * L)
        for centre, L, turn in zip(centres, lengths, turns, strict=True)
        if turn != 0.0
    ]
    grade = _grades(slope, centres, end)
    speed = _speeds(points, centres, lengths, turns, end, driving, wait)
    first = points[0]
    return Course(
        Position(first.lat, first.lon, first.alt),
        speed,
        profile(float(heading[0]), track),
        profile(float(slope[0]), grade),
        profile(0.0, []),
        "distance",
        lever_arm=lever_arm,
    )


def _legs(points: Sequence[WayPoint]) -> tuple[Array, Array, Array]:
    """Heading, length in plan (m) and rise (m) of each leg."""
    lat, lon, alt = (np.array([getattr(p, name) for p in points]) for name in ("lat", "lon", "alt"))
    dlon = (np.diff(lon) + math.pi) % (2 * math.pi) - math.pi
    half, middle = 0.5 * np.diff(lat), 0.5 * (lat[1:] + lat[:-1])
    nodes = middle[:, None] + half[:, None] * NODES
    R_M, R_N = radii(nodes)
    height = 0.5 * (alt[1:] + alt[:-1])[:, None]
    north = half * ((R_M + height) @ WEIGHTS)
    # Rhumb line: tan(track) = dlon/dq, q the isometric latitude, dq = (R_M + h)/((R_N + h) cos lat) dlat.
    isometric = half * (((R_M + height) / ((R_N + height) * np.cos(nodes))) @ WEIGHTS)
    heading = np.arctan2(dlon, isometric)
    along = np.abs(np.cos(heading)) > 1e-6
    parallel = np.abs(dlon) * np.cos(middle) * (radii(middle)[1] + height[:, 0])
    plan = np.where(along, np.abs(north) / np.where(along, np.abs(np.cos(heading)), 1.0), parallel)
    for leg in np.flatnonzero(plan < 0.1):
        raise UsageError(
            f"way-points {leg + 1} and {leg + 2} are {plan[leg]:.3f} m apart; expected .1 m at least: give a stop to one "
            "point instead of the point twice"
        )
    rise = np.diff(alt)
    for leg in np.flatnonzero(np.abs(rise) > plan):
        raise UsageError(
            f"way-points {leg + 1} and {leg + 2}: {rise[leg]:.1f} m of height in {plan[leg]:.1f} m of way; expected a slope "
            "below 45 deg"
        )
    return heading, plan, rise


def _corners(turns: Array, plan: Array, driving: Driving) -> tuple[Array, Array]:
    """Length of each corner's transition and of its tangent, m: the radius asked for, or what the legs leave room for."""
    # A quintic fade in and out over half the length each has its largest curvature, 2 turn/L, in the middle.
    shape = _tangent_ratio(turns)
    wanted = 2 * np.abs(turns) * driving.radius
    room = 0.5 * np.minimum(plan[:-1], plan[1:])  # half of a leg for each of its corners
    lengths = np.minimum(wanted, 0.98 * room / shape)
    radius = np.divide(lengths, 2 * np.abs(turns), out=np.full_like(lengths, np.inf), where=turns != 0)
    for corner in np.flatnonzero(radius < driving.smallest_radius):
        raise UsageError(
            f"way-point {corner + 2}: a turn of {math.degrees(turns[corner]):.0f} deg between legs of {plan[corner]:.1f} m and "
            f"{plan[corner + 1]:.1f} m needs a radius of {radius[corner]:.2f} m; the vehicle can turn in "
            f"{driving.smallest_radius:g} m: move the points apart, or give a smaller smallest_radius"
        )
    return lengths, lengths * shape


def _tangent_ratio(turns: Array) -> Array:
    """Tangent over length of a transition: half its chord, over the cosine of half the turn."""
    x = 0.5 * (1 + NODES)[:, None]  # over the first half; the second is its mirror image
    angle = turns * (2.5 * x**4 - 3 * x**5 + x**6)  # integral of the quintic step, from 0 to half the turn
    half_chord = 0.5 * (0.5 * WEIGHTS @ np.cos(angle - 0.5 * turns))
    return half_chord / np.cos(0.5 * turns)


def _grades(slope: Array, centres: Array, end: float) -> list[Ramp]:
    """Changes of slope, each centred on its way-point, in half of the shorter way to a neighbour, 40 m at most."""
    edges = np.concatenate([[0.0], centres, [end]])
    room = np.minimum(np.diff(edges)[:-1], np.diff(edges)[1:])
    ramps = []
    for centre, change, way in zip(centres, np.diff(slope), room, strict=True):
        if change:
            L = min(40.0, 0.5 * float(way))
            ramps.append(Ramp(float(centre) - 0.5 * L, L, float(change), 0.5 * L))
    return ramps


def _speeds(
    points: Sequence[WayPoint], centres: Array, lengths: Array, turns: Array, end: float, driving: Driving, wait: float
) -> Profile:
    """Speed by time: as fast as legs, corners and stops allow."""
    cruise, now = [], driving.speed
    for point in points[:-1]:
        now = now if point.speed is None else point.speed
        cruise.append(now)
    # Marks along the way: distance, the speed at which it may be passed, and for how long to stand there.
    marks = [(0.0, 0.0, wait + points[0].stop)]
    limits = []
    for k, point in enumerate(points[1:-1]):
        if turns[k]:
            radius = lengths[k] / (2 * abs(turns[k]))
            corner = min(math.sqrt(driving.lateral_acceleration * radius), cruise[k], cruise[k + 1])
            marks.append((float(centres[k] - 0.5 * lengths[k]), corner, 0.0))
            limits.append(cruise[k])
        if point.stop > 0 or not turns[k]:
            marks.append((float(centres[k]), 0.0 if point.stop > 0 else min(cruise[k], cruise[k + 1]), point.stop))
            limits.append(corner if turns[k] else cruise[k])
        if turns[k]:
            marks.append((float(centres[k] + 0.5 * lengths[k]), corner, 0.0))
            limits.append(corner)
    marks.append((end, 0.0, 0.0))
    limits.append(cruise[-1])
    return _schedule(marks, limits, driving)


def _schedule(marks: list[tuple[float, float, float]], limits: list[float], driving: Driving) -> Profile:
    """Ramps of speed from mark to mark, never above the limit in between."""
    ways = np.diff([mark[0] for mark in marks])
    passing = [mark[1] for mark in marks]
    for k in range(len(passing) - 2, -1, -1):  # brake in time
        passing[k] = min(passing[k], _reachable(passing[k + 1], ways[k], driving))
    for k in range(1, len(passing)):  # and no faster than it can be reached
        passing[k] = min(passing[k], _reachable(passing[k - 1], ways[k - 1], driving))
    ramps, t = [], 0.0
    for k, way in enumerate(ways):
        t += marks[k][2]
        before, after = passing[k], passing[k + 1]
        top = _top(before, after, max(limits[k], before, after), way, driving)
        cruise = way - _way(before, top, driving) - _way(top, after, driving)
        for start, stop in ((before, top), (top, after)):
            if stop != start:
                duration = _duration(start, stop, driving)
                ramps.append(Ramp(t, duration, stop - start, min(driving.onset, 0.5 * duration)))
                t += duration
            if start == before and cruise > 0:
                t, cruise = t + cruise / top, 0.0
    return profile(0.0, ramps)


def _duration(start: float, stop: float, driving: Driving) -> float:
    return abs(stop - start) / driving.acceleration + driving.onset if stop != start else 0.0


def _way(start: float, stop: float, driving: Driving) -> float:
    """Distance of a change of speed: its ramp is symmetric about the mean."""
    return 0.5 * (start + stop) * _duration(start, stop, driving)


def _reachable(start: float, way: float, driving: Driving) -> float:
    """The highest speed that can be reached within a way; `start` itself where even the shortest change is too long."""
    low, high = start, start + math.sqrt(2 * driving.acceleration * way) + 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _way(start, middle, driving) <= way else (low, middle)
    return low


def _top(before: float, after: float, limit: float, way: float, driving: Driving) -> float:
    """The highest speed between two marks, up to the limit, that leaves room to reach it and to come down from it."""

    def needed(top: float) -> float:
        return _way(before, top, driving) + _way(top, after, driving)

    if needed(limit) <= way:
        return limit
    low, high = max(before, after), limit
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if needed(middle) <= way else (low, middle)
    return low
