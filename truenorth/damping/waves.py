"""What INS and log differ by, averaged over waves, for a filter that estimates the log's errors.

A log does not follow waves as an INS does: it is filtered, it samples them, its water moves with them. A filter that is given every
row takes what is left of a wave for a scale or a mounting: of waves of half a metre a second it sees them far better than of the
speed, and a Doppler log whose own filter lasts two seconds had a scale of -6 %, place was 12 sigmas off. So the difference goes in
as means by Hann's window, twice `SPAN` long, one for each `SPAN`, and what the log's errors show of it by the means of attitude and
velocity over the same rows. While the ship changes its speed a filtered log shows it late, by ``a tau``: means in which that would
be seen are left out; the scale shows before and after. So are those of turns, in which a log sits a metre from where it is taken to
be: an arm that nobody has said is found by turns, and a log's filter leaves it short by a tenth. Neighbouring means of white noise
correlate by 1/6: of what is slow they know no more than means with 4/3 of their variance that do not.

Source: F. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc. IEEE 66 (1978), for
the window; the rest is ours.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.reference import LEAST_NOISE
from truenorth.state.track import Track

Array = NDArray[np.float64]

SPAN = 20.0  # s, from one mean to the next: longer than waves, shorter than turns
ROUGH = 4.667  # variance of second differences of such means of white noise, theirs being 1
LATE = 1.0  # s, by which a log may follow changes of speed later than is known
ASTRAY = 1.0  # m, from where a log is taken to be
FEWEST = 30  # of these differences, by which noise is known to a tenth
OVERLAP = 4.0 / 3.0  # 1 + 2/6: density at zero frequency of such means


class Calm(NamedTuple):
    """A reference velocity without waves."""

    velocity: Array  # (K+1, 2) m/s: the course less the mean of what it differs by from the log; NaN between the means
    course: Track  # means of attitude (no rotations) and velocity over the rows of each mean
    noise: float  # m/s, one-sigma, of a mean


def over_waves(course: Track, velocity: Array, noise: float, start: int) -> Calm:
    """Means of a reference velocity over waves.

    Parameters
    ----------
    course : Track
    velocity : (K+1, 2) array, m/s
        NaN where absent.
    noise : float, m/s
        One-sigma white noise of an epoch, waves among it; what second differences of the means show counts instead, if there are
        enough.
    start : int
        Epoch from which on they are wanted.
    """
    n = max(1, round(SPAN / course.interval))
    if n == 1:
        return Calm(velocity, course, noise)
    there = np.flatnonzero(np.isfinite(velocity).all(axis=1))
    if not len(there):
        return Calm(velocity, course, noise)
    along = np.gradient(np.einsum("kji,kj->ki", course.C_nb, course.v_n)[:, :2], course.interval, axis=0)
    turning = np.gradient(np.unwrap(np.arctan2(course.C_nb[:, 1, 0], course.C_nb[:, 0, 0])), course.interval)[:, None]
    parts = (course.v_n[:, :2] - velocity, course.C_nb.reshape(-1, 9), course.v_n, along, turning)
    rows = np.concatenate([part[there] for part in parts], axis=1)
    found, weights = hann_means(course.time[there], rows, float(course.time[start]), n * course.interval)
    at = start + n * np.arange(len(found))
    inside = (at > start) & (at + n <= len(course))  # with a whole window
    at, found = at[inside], found[inside]
    size = noise * float(np.sqrt(np.nanmedian(weights[inside]))) if inside.any() else noise
    rough = np.diff(found[:, :2], 2, axis=0)
    rough = rough[np.isfinite(rough)]
    if len(rough) >= 2 * FEWEST:
        size = max(float(1.4826 * np.median(np.abs(rough)) / np.sqrt(ROUGH)), LEAST_NOISE)
    late = LATE * np.linalg.norm(found[:, 14:16], axis=1)  # along the hull: in a turn it has none
    astray = ASTRAY * np.abs(found[:, 16])
    with np.errstate(invalid="ignore"):
        taken = np.all([seen <= max(size, _usual(seen)) for seen in (late, astray)], axis=0)
    at, found = at[taken], found[taken]
    calm, C_nb, v_n = np.full_like(velocity, np.nan), course.C_nb.copy(), course.v_n.copy()
    calm[at] = course.v_n[at, :2] - found[:, :2]
    C_nb[at], v_n[at] = found[:, 2:11].reshape(-1, 3, 3), found[:, 11:14]
    return Calm(calm, replace(course, C_nb=C_nb, v_n=v_n), float(np.sqrt(OVERLAP)) * size)


def _usual(seen: Array) -> float:
    """What half of the means have: a ship that always does so has no others."""
    return float(np.nanmedian(seen)) if np.isfinite(seen).any() else 0.0


def hann_means(time: Array, rows: Array, first: float, span: float) -> tuple[Array, Array]:
    """Means of rows (M, n) by Hann's windows, twice `span` long, about ``first + k span``.

    Returns
    -------
    means : (K, n) array
        NaN where half of the usual number of rows is missing.
    variance : (K,) array
        Of a mean of white noise of unit variance.
    """
    place = np.maximum((time - first) / span, 0.0)
    before = place.astype(int)
    weight = np.cos(0.5 * np.pi * (place - before)) ** 2
    count = int(before[-1]) + 2
    sums, total, square = np.zeros((count, rows.shape[1])), np.zeros(count), np.zeros(count)
    for at, part in ((before, weight), (before + 1, 1.0 - weight)):
        part = np.where(time >= first, part, 0.0)
        np.add.at(sums, at, part[:, None] * rows)
        total += np.bincount(at, part, minlength=count)
        square += np.bincount(at, part**2, minlength=count)
    full = total > 0.5 * float(np.median(total))
    divisor = np.where(full, total, np.nan)
    return sums / divisor[:, None], square / divisor**2
