"""Does another heading explain a log whose IMU was turned as well? By the level rate that its sensors may make all along.

A base that stays turns with the earth, by ``w_ie cos L`` about north, and a log shows that as a level rate. Where an axis turns the
IMU on and on one way along a level direction of the base, a scale factor of its gyro makes a rate along that direction: 8 deg/h of
150 ppm and 15 deg/s, where the earth's is 10. Then what is along the axis tells nothing, what is across it has the same size for
the headings to either side of it, and both explain the log: headings of 49 deg from each other, each known to 1.5 deg by a filter
that is linear about its own.

With J the mean level rate that each scale factor and misalignment makes, P their covariance before the log and e what was found of
them, the rate that a heading off by d asks of them is ``J e + w - R(d) w``, and its likelihood before the log is that of a normal
distribution with ``J P J' `` and what the log does not know. The mean is weighted by Hann's window, and counts as far as the turn
goes on all along: what goes round with the IMU makes a tilt that goes round, a turn of seconds makes one that stays, and neither a
rate. Biases are left out: where they may be as large as the earth's rate fits begin at headings all round
(:mod:`~truenorth.alignment.rotary`).
"""

from __future__ import annotations

import math

import numpy as np

from truenorth.alignment.fine import FineAlignment
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import EARTH_RATE
from truenorth.errors.matrices import MATRICES
from truenorth.errors.staying import PHI, STATES
from truenorth.state.evidence import Effect, Evidence

TRIED = np.radians(np.arange(0.5, 360.0, 0.5))  # by which a heading is off
LIKELY = 16.0  # twice the logarithm of a likelihood ratio: four sigmas of what makes up for it
NEAR, SIGMAS = (
    math.radians(20.0),
    10.0,
)  # what is nearer, with nothing less likely between, is the same heading, and in sigma
PARTS = 4  # of a log, in each of which a steady turn goes on


def rival_evidence(fine: FineAlignment, lat: float) -> list[Evidence]:
    """The heading farthest away that explains the log as well; sigma takes it in.

    Parameters
    ----------
    fine : FineAlignment
        Of an IMU that was turned, so that scale factors and misalignments are states; of another there is none.
    lat : float, rad
    """
    off = rival_heading(fine, lat) if len(fine.taken) >= STATES + MATRICES else 0.0
    return [Evidence("heading.rivals", {"off": off}, "hint", Effect(heading=off))] if off else []


def rival_heading(fine: FineAlignment, lat: float) -> float:
    """How far the farthest heading is that is about as likely as the one that was found, rad; zero where there is none."""
    matrices = slice(STATES, STATES + MATRICES)
    times = fine.integrals.intervals
    middle = (fine.integrals.time[1:] - 0.5 * times) / fine.integrals.time[-1]
    window = np.sin(math.pi * middle) ** 2
    J = -np.einsum("k,kij->ij", window, fine.system.Phi[:, PHI, matrices])[:2] / float(window @ times)
    J *= _steadiness(fine)
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


def _steadiness(fine: FineAlignment) -> float:
    """How much of the mean level turn goes on in every part of a log, 0 to 1: a turn of seconds makes a tilt, and no rate."""
    C_ib = fine.integrals.C_ib
    turns = rotation_vector_from_dcm(C_ib[1:] @ np.swapaxes(C_ib[:-1], 1, 2)) @ fine.C_n0_i.T
    parts = np.array([part.sum(axis=0)[:2] for part in np.array_split(turns, PARTS)]) / len(turns) * PARTS
    mean = parts.mean(axis=0)
    return float(np.clip((parts @ mean).min() / max(float(mean @ mean), 1e-300), 0.0, 1.0))
