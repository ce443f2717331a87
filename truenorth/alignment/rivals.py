"""Does another heading explain a log whose IMU was turned as well? By the level rate that its sensors may make all along.

A base that stays turns with the earth, by ``w_ie cos L`` about north, and a log shows that as a level rate. Where an axis turns the
IMU on and on one way along a level direction of the base, a scale factor of its gyro makes a rate along that direction: 8 deg/h of
150 ppm and 15 deg/s, where the earth's is 10. Then what is along the axis tells nothing, what is across it has the same size for
the headings to either side of it, and both explain the log: headings of 49 deg from each other, each known to 1.5 deg by a filter
that is linear about its own.

With J the mean level rate that each scale factor and misalignment makes, P their covariance before the log and e what was found of
them, the rate that a heading off by d asks of them is ``J e + w - R(d) w``, and its likelihood before the log is that of a normal
distribution with ``J P J' `` and what the log does not know. Of J what goes on in every part of the log counts: what goes round
with the IMU makes a tilt that goes round, a turn of seconds makes one that stays, and neither a rate. Biases are left out: where
they may be as large as the earth's rate fits begin at headings all round (:mod:`~truenorth.alignment.rotary`). Headings that are
nearer than these are in a sigma that is not linear about one of them: :mod:`~truenorth.alignment.heading_course`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.heading_course import course_evidence
from truenorth.core.earth import EARTH_RATE
from truenorth.core.position import Position
from truenorth.errors.matrices import MATRICES
from truenorth.errors.staying import PHI, STATES
from truenorth.state.evidence import Effect, Evidence

Array = NDArray[np.float64]

TRIED = np.radians(np.arange(0.5, 360.0, 0.5))  # by which a heading is off
LIKELY = 16.0  # twice the logarithm of a likelihood ratio: four sigmas of what makes up for it
# What is nearer than one of these two, with nothing less likely between, is the same heading, and in sigma.
NEAR, SIGMAS = math.radians(20.0), 10.0
PARTS = 4  # of a log, in each of which a steady rate goes on


def rival_evidence(fine: FineAlignment, position: Position) -> list[Evidence]:
    """The heading farthest away that explains the log as well, or how likely the nearer ones are; sigma takes them in.

    Parameters
    ----------
    fine : FineAlignment
        Of an IMU that was turned, so that scale factors and misalignments are states; of another there is none.
    position : Position
    """
    if len(fine.taken) < STATES + MATRICES:
        return []
    off = rival_heading(fine, position.lat)
    if not off:
        return course_evidence(fine, position)
    return [Evidence("heading.rivals", {"off": off}, "hint", Effect(heading=off))]


def rival_heading(fine: FineAlignment, lat: float) -> float:
    """How far the farthest heading is that is about as likely as the one that was found, rad; zero where there is none."""
    matrices = slice(STATES, STATES + MATRICES)
    J = _steady(-fine.system.Phi[:, PHI, matrices][:, :2] / fine.integrals.intervals[:, None, None])
    rate = EARTH_RATE * math.cos(lat)
    unknown = rate**2 * fine.P[PHI, PHI][2, 2]
    S = J @ fine.system.P0[matrices, matrices] @ J.T + unknown * np.eye(2)
    found = J @ (fine.taken + fine.end[: len(fine.taken)])[matrices]
    # Positive about the vertical: north goes to (-sin, cos).
    asked = found + rate * np.stack([np.sin(TRIED), 1.0 - np.cos(TRIED)], axis=1)
    misfit = np.einsum("ki,ki->k", asked, np.linalg.solve(S, asked.T).T)
    off = np.minimum(TRIED, 2.0 * math.pi - TRIED)
    likely = misfit - min(found @ np.linalg.solve(S, found), misfit.min()) < LIKELY
    same = np.logical_and.accumulate(likely) | np.logical_and.accumulate(likely[::-1])[::-1]
    rivals = likely & ~(same & (off < max(NEAR, SIGMAS * math.sqrt(fine.P[PHI, PHI][2, 2]))))
    return float(off[rivals].max(initial=0.0))


def _steady(rates: Array) -> Array:
    """(2, n) of rates (K, 2, n) what goes on in every part of a log: of what goes round, or turns for seconds, next to nothing."""
    parts = np.array([part.mean(axis=0) for part in np.array_split(rates, PARTS)])
    mean = parts.mean(axis=0)
    share = (parts * np.sign(mean)).min(axis=0) / np.maximum(np.abs(mean), 1e-300)
    return np.asarray(mean * np.clip(share, 0.0, 1.0))
