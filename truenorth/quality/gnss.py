"""Velocities of a receiver or of a master against the changes of its positions: grid north, exchanged axes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import radii
from truenorth.records import GnssRecord, MasterRecord
from truenorth.state.evidence import Effect, Evidence, Figure, contradiction

Array = NDArray[np.float64]

PIECE = 20.0  # s, of a displacement
LEAST_WAY = 20.0  # m of a piece: shorter ones do not show a direction
FEWEST = 4
UNEXPLAINED = 0.3  # of the squares of displacements, that velocities turned as one may leave at most
CLEAR = 4.0  # sigmas: six pieces of a sound log come so far in one of a hundred, twelve in one of five hundred
LEAST = math.radians(0.15)  # rad: a smaller turn is the drift of a receiver's positions


def gnss_evidence(gnss: GnssRecord) -> list[Evidence]:
    """What the positions of a receiver say against its velocities."""
    if gnss.v_n is None:
        return []
    rows = np.flatnonzero(gnss.has_position & np.isfinite(gnss.v_n[:, :2]).all(axis=1))
    return turn_evidence("gnss", gnss.time[rows], gnss.lat[rows], gnss.lon[rows], gnss.v_n[rows])


def master_evidence(master: MasterRecord, velocity_error: float = 0.0) -> list[Evidence]:
    """What the positions of a master say against its velocities, whose slow error has this one-sigma (m/s)."""
    if master.v_n is None or master.lat is None or master.lon is None:
        return []
    rows = np.flatnonzero(
        np.isfinite(master.v_n[:, :2]).all(axis=1) & np.isfinite(master.lat) & np.isfinite(master.lon)
    )
    return turn_evidence(
        "master", master.time[rows], master.lat[rows], master.lon[rows], master.v_n[rows], velocity_error
    )


def turn_evidence(
    source: str, time: Array, lat: Array, lon: Array, v_n: Array, velocity_error: float = 0.0
) -> list[Evidence]:
    """By how much velocities are turned, where positions contradict them; heading would be as wrong.

    Displacements ``p`` and integrals ``s`` of velocity of pieces, as complex numbers (east + i north): the turn is the phase
    of ``sum p conj(s)``; its sigma from what the pieces leave. Velocities of exchanged or flipped axes fit no turn at all.

    Parameters
    ----------
    source : str
        ``gnss`` or ``master``: the evidence is named after it.
    time : (N,) array, s
    lat, lon : (N,) arrays, rad
    v_n : (N, 3) array, m/s
    velocity_error : float, m/s
        One-sigma of an error that stays: across the way it looks like a turn.
    """
    if len(time) < 2 * FEWEST:
        return []
    R_M, R_N = radii(lat)
    at = (lon - lon[0]) * R_N * np.cos(lat) + 1j * (lat - lat[0]) * R_M
    velocity = v_n[:, 0] + 1j * v_n[:, 1]
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
    if np.sum(np.abs(p - k * s) ** 2) > UNEXPLAINED * np.sum(np.abs(p) ** 2):
        return [contradiction(f"{source}.velocity", "sensor_axes")]
    angle = -float(np.angle(k))  # of the velocities against the positions, counter-clockwise
    left = np.imag((p - k * s) * np.conj(k * s)) / np.abs(k)
    sigma = math.sqrt(float(np.sum(left**2)) * len(p) / (len(p) - 1)) / energy
    across = velocity_error * abs(np.sum(s * np.diff(time[edges])[good])) / energy
    sigma = math.hypot(sigma, across)
    if abs(angle) < max(CLEAR * sigma, LEAST):
        return []
    figures: dict[str, Figure] = {"angle": angle, "sigma": sigma}
    return [Evidence(f"{source}.turned", figures, "bounded", Effect(heading=abs(angle)), ("grid_north",))]
