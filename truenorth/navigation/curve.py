"""What lies beyond the tangent: velocity and place of a vehicle that sees its velocity in its own axes, heading known roughly.

A heading that is off by ``psi`` turns the velocity over the ground. Across the way that is ``v psi``, which the covariance holds.
Along the way it is ``v (1 - cos psi)``, which no tangent shows: of 6 m/s and 15 deg 0.2 m/s, where the log itself is good to
0.05 m/s. A sigma of velocity is then such that k of it hold what k of the heading's make of velocity, up to four,

    along = max over k <= 4 of (1 - cos(k sigma))/k          dv = v along

Place is off by the sum of it, as if the heading were off to one side all the way; a way back takes that off again. Once the
heading is found, place is corrected by ``v psi`` across the way, where it was off by ``v sin psi``:

    across = max over k <= 4 of (k sigma - sin(k sigma))/k   dp = int v along dt, and int u x v across dt

Of a heading that may be any within four sigmas (beyond 33 deg) the way may have led anywhere, as may the one that was found: they
end up to twice their length apart, and half of that length is a sigma, in any direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.row import BODY_FRAME
from truenorth.aiding.source import Aiding
from truenorth.state.layout import DP, DV
from truenorth.state.track import Track

Array = NDArray[np.float64]

MOST = 4.0  # sigmas
TURN = 2.3311  # rad, where (1 - cos x)/x is largest: tan(x/2) = x


def seen_in_body(aiding: Sequence[Aiding]) -> bool:
    """Whether velocity is seen in the body, and neither it nor place over the ground."""
    in_body = any(source.row.axes == BODY_FRAME and source.row.unit == "m/s" for source in aiding)
    return in_body and not any(source.over_ground for source in aiding)


def with_curve(track: Track, aiding: Sequence[Aiding], before: Track | None = None) -> Track:
    """The track with what the curve of its velocity adds to the covariance of velocity and place, where it is seen in the body.

    Parameters
    ----------
    track : Track
        From its start on.
    aiding : sequence of Aiding
        Its measurements; where one of them shows velocity or place over the ground, or none velocity, the track is what it was.
    before : Track, optional
        The same epochs as filtered, of a track that is smoothed: place was corrected by what heading was off before.
    """
    if not seen_in_body(aiding) or not len(track.P):
        return track
    off, _ = _off(track)
    filtered = track if before is None else before
    way, aside = (_summed(x, track.time) for x in _off(filtered))
    lost = _summed(np.linalg.norm(filtered.v_n[:, :2], axis=1) * (MOST * filtered.sigma[:, 2] > TURN), track.time) / 2.0
    n = track.P.shape[:2]
    along, across = np.zeros(n), np.zeros(n)
    along[:, DV], along[:, DP], across[:, DP] = off, way, aside
    P = track.P + sum(x[:, :, None] * x[:, None, :] for x in (along, across))
    for j in range(DP.start, DP.start + 2):
        P[:, j, j] += lost**2
    return replace(track, P=P)


def _off(track: Track) -> tuple[Array, Array]:
    """(K, 3) m/s, by which a velocity is off along and across the way beyond what its covariance says."""
    sigma = np.maximum(track.sigma[:, 2], 1e-12)
    k = np.minimum(MOST, TURN / sigma)
    level = track.v_n * [1.0, 1.0, 0.0]
    along, across = (1.0 - np.cos(k * sigma)) / k, sigma - np.sin(MOST * sigma) / MOST
    return level * along[:, None], np.cross([0.0, 0.0, 1.0], level) * across[:, None]


def _summed(rate: Array, time: Array) -> Array:
    """Its integral from the first epoch on, along the first axis (K, ..)."""
    steps = 0.5 * ((rate[1:] + rate[:-1]).T * np.diff(time)).T
    return np.concatenate([np.zeros_like(rate[:1]), np.cumsum(steps, axis=0)])
