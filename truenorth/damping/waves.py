"""What INS and log differ by, averaged over waves, for a filter that estimates the log's errors.

A log does not follow waves as an INS does: it is filtered, it samples them, its water moves with them. A filter that is given
every row takes what is left of a wave for a scale or a mounting: of waves of half a metre a second it sees them far better than
of the speed, and a Doppler log whose own filter lasts two seconds had a scale of -6 %, place was 12 sigmas off. So the difference
goes in as means by Hann's window, twice `SPAN` long, one for each `SPAN`, and what the log's errors show of it by the means of
attitude and velocity over the same rows. While the ship changes its speed a filtered log shows it late, by ``a tau``: means in
which that would be seen are left out; the scale shows before and after. Neighbouring means of white noise correlate by 1/6: of
what is slow they know no more than means with 4/3 of their variance that do not.

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
    window = np.cos(0.5 * np.pi * np.arange(1 - n, n) / n) ** 2
    there: NDArray[np.bool_] = np.asarray(np.isfinite(velocity).all(axis=1))

    def summed(rows: Array) -> Array:
        flat = np.where(there[:, None], rows.reshape(len(rows), -1), 0.0)
        return np.stack([np.convolve(column, window, "same") for column in flat.T], axis=1).reshape(rows.shape)

    total = np.convolve(there.astype(float), window, "same")
    usual = float(np.median(total[there])) if there.any() else 1.0
    known = np.zeros(len(course), dtype=np.bool_)
    known[start + n : len(course) - n + 1 : n] = True
    known[total <= 0.5 * usual] = False
    divisor = np.where(total > 0.0, total, 1.0)
    off = summed(course.v_n[:, :2] - velocity) / divisor[:, None]
    seen = replace(
        course,
        C_nb=np.where((total > 0.0)[:, None, None], summed(course.C_nb) / divisor[:, None, None], course.C_nb),
        v_n=np.where((total > 0.0)[:, None], summed(course.v_n) / divisor[:, None], course.v_n),
    )
    # Changes of speed, along the hull: in a turn it has none.
    along = np.gradient(np.einsum("kji,kj->ki", course.C_nb, course.v_n)[:, :2], course.interval, axis=0)
    push = np.linalg.norm(summed(along) / divisor[:, None], axis=1)
    size = noise * float(np.sqrt(np.sum(window**2) / (np.sum(window) * usual)))
    rough = np.diff(off[known], 2, axis=0)
    if len(rough) >= FEWEST:
        size = max(float(1.4826 * np.median(np.abs(rough)) / np.sqrt(ROUGH)), LEAST_NOISE)
    least = float(np.median(push[known])) if known.any() else 0.0  # a ship that always does has no others
    known &= LATE * push <= max(size, LATE * least)
    return Calm(np.where(known[:, None], course.v_n[:, :2] - off, np.nan), seen, float(np.sqrt(OVERLAP)) * size)
