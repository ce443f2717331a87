"""What lies beyond the tangent: velocity and place of a vehicle that sees its velocity in its own axes, heading known roughly.

A heading that is off by ``psi`` turns the velocity over the ground. Across the way that is ``v psi``, which the covariance holds.
Along the way it is ``v (1 - cos psi)``, which no tangent shows: of 6 m/s and 15 deg 0.2 m/s, where the log itself is good to
0.05 m/s. A sigma of velocity is then such that k of it hold what k of the heading's make of velocity, up to four,

    e = max over k <= 4 of (1 - cos(k sigma))/k,        dv = v e,    dp = int v e dt

the place as if the heading were off to one side all the way; a way back takes that off again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from truenorth.aiding.row import BODY_FRAME
from truenorth.aiding.source import Aiding
from truenorth.state.layout import DP, DV, PHI
from truenorth.state.track import Track

MOST = 4.0  # sigmas
TURN = 2.3311  # rad, where (1 - cos x)/x is largest: tan(x/2) = x


def with_curve(track: Track, aiding: Sequence[Aiding]) -> Track:
    """The track with what the curve of its velocity adds to the covariance of velocity and place, where it is seen in the body.

    Parameters
    ----------
    track : Track
        From its start on.
    aiding : sequence of Aiding
        Its measurements; where one of them shows velocity or place over the ground, or none velocity, the track is what it was.
    """
    in_body = any(source.row.axes == BODY_FRAME and source.row.unit == "m/s" for source in aiding)
    if not in_body or any(source.over_ground for source in aiding) or not len(track.P):
        return track
    sigma = np.maximum(track.sigma[:, PHI][:, 2], 1e-12)
    k = np.minimum(MOST, TURN / sigma)
    off = track.v_n * ((1.0 - np.cos(k * sigma)) / k)[:, None]
    off[:, 2] = 0.0
    way = np.zeros_like(off)
    way[1:] = np.cumsum(0.5 * (off[1:] + off[:-1]) * np.diff(track.time)[:, None], axis=0)
    both = np.zeros(track.P.shape[:2])
    both[:, DV], both[:, DP] = off, way
    return replace(track, P=track.P + both[:, :, None] * both[:, None, :])
