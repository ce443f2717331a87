"""How likely is each heading of a log whose IMU was turned? On the circle on which the earth's level rate goes round with heading.

Of heading a base that stays knows the earth's level rate, ``w = w_ie cos L`` towards north. A heading that is off by d sees
``w sin d`` of it across what it takes for north, and ``w (cos d - 1)`` more along. A filter that is linear in heading has the first
alone, as ``w d``: it is right where a log tells as much of what is across north as of anything.

Where an axis turns the IMU on and on one way about a level direction, a scale factor k of the gyros along it makes a rate ``k s``
along that axis, s its rate: 0.2 deg/h of navigation grade at 15 deg/s, one sigma. Heading is known by what is across the axis,
``w sin a`` with a the azimuth of the axis. Near east and west that is stationary, ``d(w sin a)/da = w cos a -> 0``: a noise n of it
leaves headings about ``sqrt(2 n / w)`` to either side of east, and between the two sides decides what is known of k, to
``sigma_k s / w``, a degree here. A filter about a heading that noise has turned off east takes the slope that it has there for
knowledge: 0.4 deg of a heading that was 2.2 deg off.

A log is linear in the rate, where it is not in heading. So the rate along north is one more state without any prior, and all others
are as free as before: biases, scale factors, misalignments, motion. It asks for no other pass. A rate of one shows in the
innovations v as y, and turns what the filter found at the end by X (Friedland's bias, apart from the other states)::

    r = p y' W^-1 v,   p = 1 / (y' W^-1 y),   phi = phi_0 - X r,   P = P_0 + X p X',   cov(phi, r) = -X p

What of this normal distribution lies on the circle ``(sin d, cos d - 1)`` is the likelihood of a heading. Filters about headings
that were held at -1.5 to 4 deg of navigation grade, and at -15 to 15 deg of tactical, all else fitted anew, had twice its logarithm
to 3 %, up to 25.

Sigma is the second moment about the answer, all headings alike before the log, and no heading nearby is farther than four sigmas
that is not as unlikely. By the second moment alone, one of 400 simulated answers near east was beyond four sigmas, up to 12: where
a slight peak is far from the other, its part of the moment is small, and who is there is many sigmas off. Of a heading on the
other side of the circle the moment has what its chance is worth: a quarter of the way to it would refuse logs for one chance in
3000.

Source: B. Friedland, "Treatment of bias in recursive filtering", IEEE Trans. Automatic Control 14 (1969): the bias apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import whitened
from truenorth.core.earth import gravity_of_place
from truenorth.core.position import Position
from truenorth.errors.staying import PHI, local_axes
from truenorth.estimate.batch import Filtered
from truenorth.filters.gains import Gains, factors, through
from truenorth.state.evidence import Effect, Evidence
from truenorth.state.limits import limit
from truenorth.strapdown.inertial import gravity_position

Array = NDArray[np.float64]

HEADING = PHI.stop - 1
NEAR = math.radians(20.0)
FOUR = 4.0  # sigmas: who is farther off, is off by a defect
AWAY = np.geomspace(1e-7, math.pi, 600)  # rad, from a peak: one of any width has some thirty points a side
STEP = 1e-3  # of the level rate: a difference quotient is right to its square
HARMONICS = 2  # of what is quadratic on a circle


class HeadingCourse(NamedTuple):
    """What a log shows of the earth's level rate, as parts of it; linear, whatever heading.

    Attributes
    ----------
    mean : (2,) array
        What is left across north, as a heading error is, and along it.
    P : (2, 2) array
        Covariance.
    found : float, rad
        The heading error that is taken off in the answer.
    """

    mean: Array
    P: Array
    found: float

    def misfit(self, off: Array) -> Array:
        """Minus twice the logarithm of the likelihood of heading errors (N,), rad."""
        left = np.stack([np.sin(off), np.cos(off) - 1.0]) - self.mean[:, None]
        return np.asarray(np.sum(left * np.linalg.solve(self.P, left), axis=0))

    def likeliest(self) -> float:
        """The heading error that is the likeliest of all, rad."""
        turns = self.turns()
        return float(turns[np.argmin(self.misfit(turns))])

    def turns(self) -> Array:
        """(4,) heading errors, rad, among which are all that are likelier, or less likely, than those to either side.

        The misfit is a trigonometric polynomial of second degree, and its slope a polynomial of ``exp(i d)`` of the fourth.
        """
        count = 2 * HARMONICS + 1
        c = np.fft.fft(self.misfit(2.0 * math.pi * np.arange(count) / count))
        slope = [k * c[k] for k in range(HARMONICS, -HARMONICS - 1, -1)]  # c[-k]: of the harmonic -k
        return np.asarray(np.angle(np.roots(slope)))

    def spread(self) -> tuple[float, float]:
        """Sigma of the heading about the answer, and how far the farthest is that is not less likely than by four sigmas, rad."""
        at = self.turns()[:, None]
        off = np.concatenate([at - AWAY, at, at + AWAY], axis=1).ravel() - self.found
        off = np.sort((off + math.pi) % (2.0 * math.pi) - math.pi)
        misfit = self.misfit(self.found + off)
        misfit -= misfit.min()
        weight = np.exp(-0.5 * misfit)
        moment = float(np.trapezoid(weight * off**2, off) / np.trapezoid(weight, off))
        likely = np.abs(off[misfit < FOUR**2])
        near = float(likely[likely < NEAR].max(initial=0.0))
        return max(math.sqrt(moment), near / FOUR), float(likely.max())


def course_evidence(fine: FineAlignment, position: Position) -> list[Evidence]:
    """That headings are likely which are farther off than a filter says that is linear about its own; sigma takes them in.

    Parameters
    ----------
    fine : FineAlignment
        Whose measurements are mean velocities; of one whose heading is a convention there is no evidence.
    position : Position
    """
    own = float(fine.P[HEADING, HEADING])
    if fine.form != "velocity" or fine.system.P0[HEADING, HEADING] == 0.0 or own > NEAR**2:
        return []  # no heading is claimed
    sigma, farthest = heading_course(fine, position).spread()
    more = math.sqrt(max(sigma**2 - own, 0.0))
    if more <= limit("negligible") * math.sqrt(own):
        return []
    return [Evidence("heading.curved", {"off": farthest}, "hint", Effect(heading=more))]


def heading_course(fine: FineAlignment, position: Position) -> HeadingCourse:
    """The level rate that the log of a fine alignment shows, everything else free."""
    return course_of(fine, fine.gains, along_north(fine.integrals.time, position))[0]


def course_of(found: Filtered, gains: Gains, north: Array) -> tuple[HeadingCourse, Array]:
    """The same of a filter's run.

    Parameters
    ----------
    found : Filtered
    gains : Gains
        Of that run.
    north : (K, 3) array, m/s
        Of :func:`along_north`.

    Returns
    -------
    course : HeadingCourse
    left : (n,) array
        What the last state has of a rate of one.
    """
    made, turned = through(gains, np.ascontiguousarray(north[:, :, None]))
    seen = np.concatenate([made, found.estimates.innovation[..., None]], axis=2)
    y, v = whitened(factors(found.estimates.innovation_covariance), seen).reshape(-1, 2).T
    p = 1.0 / max(float(y @ y), 1e-300)
    r, left, heading = p * float(y @ v), turned[:, 0], float(found.end[HEADING])
    X = float(left[HEADING])
    P = np.array([[found.P[HEADING, HEADING] + X * p * X, -X * p], [-X * p, p]])
    return HeadingCourse(np.array([heading - X * r, r]), P, heading), left


def along_north(time: Array, position: Position) -> Array:
    """(K, 3) what once the earth's level rate more, along north, adds to the mean velocities between times, m/s.

    What is across north is taken up by whatever hides heading. So a log whose heading is off by d looks as if its base turned by
    ``w cos d`` about north, and by nothing about east: not as if its gravity did, turned by d, and its IMU as much the other way,
    each to first order. Between the two are ``g w^2 sin^2(d) t^3 / 6`` of height: 1 mm/s of 2 deg in ten minutes, known to .1 mm/s.
    Without them the course of tactical IMUs near east had two peaks 6 deg to either side of any heading that it was asked about.
    """
    more, less = (_apparent_gravity(time, position, x) for x in (STEP, -STEP))
    v = -np.diff(more - less, axis=0) / (2.0 * STEP * np.diff(time)[:, None])
    return np.asarray(local_axes(time, position.lat) @ v[:, :, None])[:, :, 0]


def _apparent_gravity(time: Array, position: Position, more: float) -> Array:
    """Second integral of gravity (..., 3), m, of a base that turns by so many times more about north, and as it does about up."""
    north, up = (1.0 + more) * math.cos(position.lat), math.sin(position.lat)
    rate, lat = math.hypot(north, up), math.atan2(up, north)
    g = gravity_of_place(position.lat, position.alt) / gravity_of_place(lat, position.alt)
    return np.asarray(g * gravity_position(rate * time, lat, position.alt) / rate**2)
