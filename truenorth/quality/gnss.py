"""A receiver's velocities against the changes of its positions: counted from grid north, or from another one."""

from __future__ import annotations

import math

import numpy as np

from truenorth.core.earth import radii
from truenorth.records import GnssRecord
from truenorth.state.evidence import Effect, Evidence

PIECE = 20.0  # s, of a displacement
LEAST_WAY = 20.0  # m of a piece: shorter ones do not show a direction
FEWEST = 4
CLEAR = 5.0  # sigmas
LEAST = math.radians(0.15)  # rad: a smaller turn is the drift of a receiver's positions


def gnss_evidence(gnss: GnssRecord) -> list[Evidence]:
    """By how much the velocities are turned, where positions contradict them; heading would be as wrong.

    Displacements ``p`` and integrals ``s`` of velocity of pieces, as complex numbers (east + i north): the turn is the phase
    of ``sum p conj(s)``; its sigma from what the pieces leave.
    """
    if gnss.v_n is None:
        return []
    rows = np.flatnonzero(gnss.has_position & np.isfinite(gnss.v_n[:, :2]).all(axis=1))
    if len(rows) < 2 * FEWEST:
        return []
    time, lat, lon, v = gnss.time[rows], gnss.lat[rows], gnss.lon[rows], gnss.v_n[rows]
    R_M, R_N = radii(lat)
    at = (lon - lon[0]) * R_N * np.cos(lat) + 1j * (lat - lat[0]) * R_M
    velocity = v[:, 0] + 1j * v[:, 1]
    steps = np.diff(time)
    whole = np.append(0.0, np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * steps))
    edges = np.searchsorted(time, np.arange(time[0], time[-1], PIECE))
    gaps = np.append(0, np.cumsum(steps > 3.0 * np.median(steps)))
    good = (np.diff(gaps[edges]) == 0) & (np.abs(np.diff(whole[edges])) > LEAST_WAY)
    p, s = np.diff(at[edges])[good], np.diff(whole[edges])[good]
    if len(p) < FEWEST:
        return []
    energy = float(np.sum(np.abs(s) ** 2))
    k = np.sum(p * np.conj(s)) / energy
    angle = -float(np.angle(k))  # of the velocities against the positions, counter-clockwise
    left = np.imag((p - k * s) * np.conj(k * s)) / np.abs(k)
    sigma = math.sqrt(float(np.sum(left**2)) * len(p) / (len(p) - 1)) / energy
    if abs(angle) < max(CLEAR * sigma, LEAST):
        return []
    return [
        Evidence(
            "gnss.turned", {"angle": angle, "sigma": sigma}, "bounded", Effect(heading=abs(angle)), ("grid_north",)
        )
    ]
