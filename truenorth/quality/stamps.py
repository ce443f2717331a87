"""Stamps that scatter: measurements of a moment that is a little off the one they are stamped with, by another time in each row.

A stamp that is off by ``tau`` makes a velocity wrong by ``a tau``, a position by ``v tau`` and an attitude by ``w tau``, and
nothing at a steady velocity or at rest. So the noise of such a sensor is larger in manoeuvres alone, where the filter learns
attitude, and looks like an IMU whose errors grow with turns. The latter last from row to row, the former do not: of the
*difference* of innovations that follow each other, along acceleration, velocity or rate, the variance is
``q (S_1 + S_2) + sigma^2 (a_1^2 + a_2^2)``. Whether there is a sigma beyond the factor q says the ratio of the largest likelihoods
with and without it. Differences share their rows: half of it counts.

The rule is ours; differences of innovations as in :mod:`truenorth.alignment.in_motion_learnt`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.earth import radii
from truenorth.quality.slow_aids import FIXES, SPEEDS
from truenorth.state.evidence import Evidence, note
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

FEWEST = 20  # differences; the likelihood says whether they are enough
LONGEST = 0.5  # s, one sigma: more is no scatter of stamps
TRIES = np.concatenate([[0.0], np.geomspace(2e-3, LONGEST, 60)])  # s, one sigma
SLOW = 1e-9  # m/s, m/s^2 or rad/s: rates that have no direction, and are looked at along ..
ANYWHERE = np.array([1.0, 0.0, 0.0])
SHORTEST = 1e-3  # s, of a step
STEP = 0.5  # s, over which the motion of a vehicle is steady
LATELY = 2.0 * STEP  # s: a velocity so old is that of another leg
MOST = 25.0  # square of a normalised difference, that is an outlier beyond


def stamp_scatter(track: Track, aiding: Iterable[Aiding], had: float, looks: int = 1) -> float:
    """One sigma of the stamps of a receiver or a master, s, as its innovations show it; 0 where chance explains them.

    Parameters
    ----------
    track : Track
        Of a pass with these sources.
    aiding : iterable of Aiding
    had : float, s
        The scatter that is in their sigmas already.
    looks : int
        How many times a running log has been asked: so many chances there were.
    """
    names = {source.name for source in aiding}
    sources = [r for r in track.residuals if r.name in SOURCES and r.name in names]
    seen = [pair for pair in (pairs(r, SOURCES[r.name](track, r.time), had) for r in sources) if len(pair[0]) >= FEWEST]
    if not seen:
        return 0.0
    likelihood = np.sum([likelihoods(*pair, TRIES) for pair in seen], axis=0)
    best = int(np.argmax(likelihood))
    return float(TRIES[best]) if likelihood[best] - likelihood[0] > limit("rival") + 4.0 * math.log(looks) else 0.0


def stamp_notes(scatter: float) -> list[Evidence]:
    """That a receiver's stamps scatter by so much, s, one sigma; nothing of none."""
    return [note("noise.stamps", name="GNSS", size=scatter)] if scatter > 0.0 else []


def scattered(aiding: Sequence[Aiding], track: Track, sigma: float) -> dict[str, Array]:
    """What stamps that scatter by so much (s) add to the sigmas of a receiver, (M, 3) by name."""
    if sigma == 0.0:
        return {}
    return {s.name: sigma * np.abs(SOURCES[s.name](track, s.time)) for s in aiding if s.name in SOURCES}


def scattered_by_rows(aiding: Sequence[Aiding], sigma: float) -> dict[str, Array]:
    """The same without a track: by the motion that a receiver's rows show themselves, each by those up to it alone."""
    if sigma == 0.0:
        return {}
    moves = next((s for s in aiding if s.name == SPEEDS), None)
    found = {}
    for source in aiding:
        if source.name == SPEEDS:
            rate = _since(source.time, source.measured)
        elif source.name == FIXES:
            rate = _since(source.time, _metres(source.measured))
            if moves is not None:
                held, fresh = _held(source.time, moves)
                rate = np.where(fresh[:, None], held, rate)
        else:
            continue
        found[source.name] = sigma * np.abs(np.nan_to_num(rate))
    return found


def with_scatter(aiding: Sequence[Aiding], added: Mapping[str, Array]) -> list[Aiding]:
    """The same sources with these sigmas added to theirs."""
    return [replace(s, sigma=np.hypot(s.sigma, added[s.name])) if s.name in added else s for s in aiding]


def _since(time: Array, values: Array) -> Array:
    """(M, 3) rate of change of values over the last second, or the rows since, where there are fewer."""
    before = np.maximum(time - LATELY, time[0])
    return (values - _at(before, time, values)) / np.maximum(time - before, SHORTEST)[:, None]


def _held(time: Array, rows: Aiding) -> tuple[Array, NDArray[np.bool_]]:
    """(M, 3) the last of the rows up to each time, and whether it is of that moment: a turn makes another of an old velocity."""
    last = np.maximum(np.searchsorted(rows.time, time, side="right") - 1, 0)
    return rows.measured[last], np.abs(time - rows.time[last]) <= LATELY


def _metres(place: Array) -> Array:
    """(M, 3) east, north and up of the first of these places (rad, rad, m)."""
    R_M, R_N = radii(place[0, 0])
    off = place - place[0]
    return np.stack([off[:, 1] * R_N * np.cos(place[0, 0]), off[:, 0] * R_M, off[:, 2]], axis=1)


def _velocity(track: Track, time: Array) -> Array:
    before, after = _around(track, time)
    return 0.5 * (after + before)


def _acceleration(track: Track, time: Array) -> Array:
    before, after = _around(track, time)
    return (after - before) / (2.0 * STEP)


def _around(track: Track, time: Array) -> list[Array]:
    """(M, 3) velocities a step before and after."""
    return [_at(time + dt, track.time, track.v_n) for dt in (-STEP, STEP)]


def _turn(track: Track, time: Array) -> Array:
    """(M, 3) rad/s, along n, from each row of the track to the next."""
    turned = rotation_vector_from_dcm(track.C_nb[1:] @ np.swapaxes(track.C_nb[:-1], 1, 2))
    steps = np.maximum(np.diff(track.time), SHORTEST)[:, None]  # rows may hold at one time
    return _at(time, 0.5 * (track.time[1:] + track.time[:-1]), turned / steps)


def _at(time: Array, of: Array, values: Array) -> Array:
    return np.stack([np.interp(time, of, v) for v in values.T], axis=1)


# What a stamp multiplies, (M, 3) at some times: velocity (m/s) of a position, acceleration (m/s^2) of a velocity, rate (rad/s).
SOURCES: dict[str, Callable[[Track, Array], Array]] = {
    SPEEDS: _acceleration,
    FIXES: _velocity,
    "master velocity": _acceleration,
    "master position": _velocity,
    "master attitude": _turn,
}


def pairs(r: Residuals, rate: Array, had: float) -> tuple[Array, Array, Array]:
    """Of innovations that follow each other, along a rate (M, 3): square of the difference, variance, square of rates.

    The variance is without what `had` times the rate has added to the sigmas already.
    """
    there, some = np.isfinite(r.innovation), r.rows > 0
    e, sigma, rate = (np.where(there, values, 0.0)[some] for values in (r.innovation, r.sigma, rate))
    pairs = rate[1:] + rate[:-1]  # of rows that follow each other alike, or the two say little
    size = np.linalg.norm(pairs, axis=1)[:, None]
    along = np.where(size > SLOW, pairs / np.maximum(size, SLOW), ANYWHERE)
    variance = np.maximum(sigma**2 - (had * rate) ** 2, 0.0)
    difference = np.einsum("ki,ki->k", np.diff(e, axis=0), along)
    squares = np.einsum("ki,ki->k", rate[1:], along) ** 2 + np.einsum("ki,ki->k", rate[:-1], along) ** 2
    S = np.einsum("ki,ki->k", variance[1:] + variance[:-1], along**2)
    return difference**2, S, squares


def likelihoods(squares: Array, variance: Array, rates: Array, tries: Array) -> Array:
    """(T,) twice the log-likelihood of differences with each scatter that is tried, the factor of the variance the best, halved."""
    found = np.full(len(tries), -math.inf)
    quiet = variance > 0.0
    squares, variance, rates = squares[quiet], variance[quiet], rates[quiet]
    for factor in np.geomspace(0.25, 16.0, 25):
        v = factor * variance + tries[:, None] ** 2 * rates
        found = np.maximum(found, -0.5 * np.sum(np.minimum(squares / v, MOST) + np.log(v), axis=1))
    return found
