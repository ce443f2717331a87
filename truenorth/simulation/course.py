"""Courses over the ellipsoid: speed, track, slope and bank of a vehicle, ship or aircraft.

Velocity and acceleration are closed forms of the profiles. Position is the integral of velocity over the curved earth,
by collocation on Gauss-Legendre nodes and Picard iteration over the whole course at once: exact to rounding at the
knots, to a micrometre in between, and no drift over days.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import normal_gravity, radii
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.simulation.motion import Kinematics, Motion
from truenorth.simulation.profile import Profile, Ramp, lead_in, profile

Array = NDArray[np.float64]
KNOT = 2.0  # s between knots of the position
TABLE = 1024.0  # s: the shortest table of positions; the others are 2, 4, 8 ... times as long


@dataclass(frozen=True, eq=False)
class Course(Motion):
    """Motion along a track; it begins at time 0.

    Attributes
    ----------
    position : Position
        At time 0.
    speed : Profile
        Along the track, m/s, of time.
    track : Profile
        Direction of travel, rad clockwise from north.
    slope : Profile
        Of the path above the horizon, rad; the body's pitch.
    bank : Profile
        Roll, rad, of time.
    along : {"time", "distance"}
        What track and slope are functions of: seconds (flight) or metres travelled (road).
    heading_offset : float, rad
        Heading minus track.
    lever_arm : (3,) floats, m
        To the IMU, body axes.
    """

    position: Position
    speed: Profile
    track: Profile
    slope: Profile
    bank: Profile
    along: Literal["time", "distance"] = "time"
    heading_offset: float = 0.0
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _tables: dict[int, Any] = field(default_factory=dict, init=False, repr=False)
    _distance: Profile = field(init=False, repr=False)

    def __post_init__(self) -> None:
        whole = self.speed.integral()
        offset = float(whole(0.0)[0])
        coefficients = whole.coefficients.copy()
        coefficients[-1] -= offset  # zero at time 0
        object.__setattr__(self, "_distance", Profile(whole.breaks, coefficients))

    @property
    def breaks(self) -> Array:
        """Times where a profile goes from one polynomial to the next."""
        corners = [self.speed.breaks, self.bank.breaks]
        turns = [self.track.breaks, self.slope.breaks]
        corners += turns if self.along == "time" else [self._times_at(x) for x in turns]
        return np.unique(np.concatenate(corners))

    def distance(self, t: Array) -> Array:
        """Metres travelled since time 0."""
        return self._distance(t)[0]

    def kinematics(self, t: Array) -> Kinematics:
        """Angles, velocity and its derivative in closed form; place from the table of the integral."""
        heading, slope, V, dV = self._path(t)
        velocity, acceleration = _velocity(heading, slope, V, dV)
        lat, lon, alt = self._place(t)
        values, rates, accelerations = (np.stack(x) for x in zip(heading, slope, self.bank(t), strict=True))
        values[0] += self.heading_offset
        return Kinematics(values, rates, accelerations, lat, lon, alt, velocity, acceleration)

    def _path(self, t: Array) -> tuple[Any, Any, Array, Array]:
        V, dV, _ = self.speed(t)
        if self.along == "time":
            return self.track(t), self.slope(t), V, dV
        s = self.distance(t)
        return _by_time(self.track(s), V, dV), _by_time(self.slope(s), V, dV), V, dV

    def _place(self, t: Array) -> tuple[Array, Array, Array]:
        if np.size(t) and np.min(t) < 0:
            raise UsageError(f"time {np.min(t):g} s is before the course begins; expected 0 s or more")
        # Which table is a matter of the times asked for alone, or their order would change the bits; twice as long each time, or a
        # long log, taken block by block, would integrate from the start for every block.
        size = 1 << (max(1, math.ceil((np.max(t) if np.size(t) else 0.0) / TABLE)) - 1).bit_length()
        if size not in self._tables:
            self._tables[size] = self._integrated(size * TABLE)
        lat, lon, alt = self._tables[size]
        return lat(t), lon(t), alt(t)

    def _integrated(self, stop: float) -> tuple[Any, Any, Any]:
        """Latitude, longitude and height as piecewise polynomials of time."""
        from scipy.interpolate import PPoly

        corners = self.breaks[(self.breaks > 0) & (self.breaks < stop)]
        knots = np.union1d(np.arange(0.0, stop + KNOT, KNOT), corners)
        length = np.diff(knots)[:, None]
        heading, slope, V, dV = self._path(knots[:-1, None] + length * UNIT_NODES)
        v, _ = _velocity(heading, slope, V, dV)

        def integral(start: float, rate: Array) -> tuple[Array, Any]:
            """At the nodes, and as polynomials of the time since each knot."""
            steps = (length * rate) @ UNIT_WEIGHTS
            at_knots = start + np.concatenate([[0.0], np.cumsum(steps)])[:-1, None]
            powers = rate @ POWERS.T / length ** np.arange(len(POWERS))
            coefficients = np.concatenate([at_knots, powers], axis=1)[:, ::-1]
            return at_knots + length * (rate @ TO_NODES.T), PPoly(np.ascontiguousarray(coefficients.T), knots)

        alt, height = integral(self.position.alt, v[2])
        lat, before = np.full_like(alt, self.position.lat), np.inf
        for _ in range(50):
            new, latitude = integral(self.position.lat, v[1] / (radii(lat)[0] + alt))
            change = float(np.max(np.abs(new - lat)))
            lat = new
            if change < 1e-16 or change >= before:
                break
            before = change
        if np.max(np.abs(lat)) > math.radians(89.5):
            raise UsageError("the course comes within half a degree of a pole, where east has no meaning; turn before")
        _, longitude = integral(self.position.lon, v[0] / ((radii(lat)[1] + alt) * np.cos(lat)))
        return latitude, longitude, height

    def _times_at(self, marks: Array) -> Array:
        """Times when the distances `marks` are reached, by bisection; the unreached are left out."""
        stop = float(self.speed.breaks[-1])
        final = float(self.speed(stop)[0])
        if final > 0:
            stop += max(0.0, float(marks[-1] - self.distance(np.asarray(stop)))) / final + 1.0
        marks = marks[(marks > 0) & (marks < self.distance(np.asarray(stop)))]
        low, high = np.zeros_like(marks), np.full_like(marks, stop)
        for _ in range(60):
            middle = 0.5 * (low + high)
            beyond = self.distance(middle) >= marks
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        return high


@dataclass(frozen=True)
class Leg:
    """A part of a course in time."""

    duration: float  # s
    speed: float | None = None  # m/s; at its end; None: unchanged
    turn: float = 0.0  # rad; change of track, clockwise
    slope: float | None = None  # rad; at its end; None: unchanged
    # float or {"flat", "coordinated"}; held through the leg, rad; coordinated: ``atan(V psi'/g)``
    bank: float | Literal["flat", "coordinated"] = "flat"
    onset: float = 2.0  # s; in which a turn, an acceleration or a bank comes and goes


def course(
    position: Position,
    legs: Sequence[Leg],
    *,
    heading: float = 0.0,
    speed: float = 0.0,
    slope: float = 0.0,
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Course:
    """A course from legs in time: flight, a ship's manoeuvre, a drive.

    Parameters
    ----------
    position : Position
    legs : sequence of Leg
        After the last the vehicle goes straight on.
    heading, speed, slope : float, rad, m/s, rad
        To begin with.
    lever_arm : (3,) floats, m

    Raises
    ------
    UsageError
        A leg that has no length, goes backwards or is a wall; it is named by its number.
    """
    g = float(normal_gravity(position.lat, position.alt))
    tracks, speeds, slopes, banks = [], [], [], []
    at, V, gamma = 0.0, speed, slope
    for number, leg in enumerate(legs, 1):
        try:
            check_leg(leg, V)
        except UsageError as error:
            raise UsageError(f"leg {number}: {error}") from None
        onset = min(leg.onset, 0.5 * leg.duration)
        after = V if leg.speed is None else leg.speed
        if leg.turn:
            tracks.append(Ramp(at, leg.duration, leg.turn, onset))
        if after != V:
            speeds.append(Ramp(at, leg.duration, after - V, onset))
        if leg.slope is not None and leg.slope != gamma:
            slopes.append(Ramp(at, leg.duration, leg.slope - gamma, onset))
            gamma = leg.slope
        if leg.bank == "coordinated":
            bank = math.atan(0.5 * (V + after) * leg.turn / (leg.duration - onset) / g)
        else:
            bank = 0.0 if leg.bank == "flat" else float(leg.bank)
        if bank:
            banks += [Ramp(at, onset, bank, 0.5 * onset), Ramp(at + leg.duration - onset, onset, -bank, 0.5 * onset)]
        at, V = at + leg.duration, after
    parts = profile(speed, speeds), profile(heading, tracks), profile(slope, slopes), profile(0.0, banks)
    return Course(position, *parts, lever_arm=lever_arm)


def ring(
    position: Position,
    *,
    radius: float,
    speed: float,
    heading: float = 0.0,
    clockwise: bool = True,
    wait: float = 0.0,
    acceleration: float = 1.0,
    lever_arm: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Course:
    """A land vehicle that waits, accelerates straight on, and then goes round a ring for ever.

    Parameters
    ----------
    position : Position
        Where it waits.
    radius : float, m
    speed : float, m/s
    heading : float, rad
    clockwise : bool
    wait : float, s
    acceleration : float, m/s^2
    lever_arm : (3,) floats, m

    Raises
    ------
    UsageError
        A radius, speed or acceleration that is not positive, or a wait that is negative.
    """
    if not (radius > 0 and speed > 0 and acceleration > 0 and wait >= 0):
        raise UsageError(
            f"ring of radius {radius:g} m at {speed:g} m/s, acceleration {acceleration:g} m/s^2, after {wait:g} s; "
            "expected positive values"
        )
    onset = 1.0
    duration = speed / acceleration + onset
    V = profile(0.0, [Ramp(wait, duration, speed, onset)])
    straight = 0.5 * speed * duration  # the distance of the acceleration
    track = lead_in(heading, straight, 2.0 * speed, (1.0 if clockwise else -1.0) / radius)
    return Course(position, V, track, profile(0.0, []), profile(0.0, []), "distance", lever_arm=lever_arm)


def check_leg(leg: Leg, speed: float) -> None:
    """Refuse a leg, begun at a speed (m/s), that cannot be.

    Raises
    ------
    UsageError
    """
    if not (leg.duration > 0 and leg.onset > 0):
        raise UsageError(f"duration {leg.duration:g} s, onset {leg.onset:g} s; expected both positive")
    if speed < 0 or (leg.speed is not None and leg.speed < 0):
        raise UsageError("a speed below zero; expected zero or more")
    if leg.bank not in ("flat", "coordinated") and not isinstance(leg.bank, int | float):
        raise UsageError(f"bank {leg.bank!r}; expected 'flat', 'coordinated' or an angle")
    if leg.slope is not None and abs(leg.slope) >= 0.5 * math.pi:
        raise UsageError(f"slope {math.degrees(leg.slope):g} deg; expected less than 90 deg")


def _velocity(heading: Any, slope: Any, V: Array, dV: Array) -> tuple[Array, Array]:
    """Velocity in n and its derivative, (3, ...), of track and slope (each with its derivatives) and speed."""
    (h, dh, _), (g, dg, _) = heading, slope
    sh, ch, sg, cg = np.sin(h), np.cos(h), np.sin(g), np.cos(g)
    east, north = cg * sh, cg * ch
    v = V * np.stack([east, north, sg])
    turning = np.stack([dh * north - dg * (sg * sh), -dh * east - dg * (sg * ch), dg * cg])
    return v, dV * np.stack([east, north, sg]) + V * turning


def _by_time(signal: tuple[Array, Array, Array], V: Array, dV: Array) -> tuple[Array, Array, Array]:
    """Derivatives by time of a signal given by distance."""
    value, first, second = signal
    return value, first * V, second * V**2 + first * dV


def _collocation(count: int) -> tuple[Array, Array, Array, Array]:
    """Gauss-Legendre nodes and weights on (0, 1); integrals from 0 of the polynomial through values at the nodes.

    The first matrix gives those integrals at the nodes, the second as coefficients of tau, tau^2, ... of the interval.
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    nodes, weights = 0.5 * (1 + nodes), 0.5 * weights
    powers = np.linalg.inv(np.vander(nodes, increasing=True)) / np.arange(1, count + 1)[:, None]
    return nodes, weights, np.vander(nodes, count + 1, increasing=True)[:, 1:] @ powers, powers


UNIT_NODES, UNIT_WEIGHTS, TO_NODES, POWERS = _collocation(8)
