"""What lies beyond the tangent: velocity and place of a vehicle that sees its velocity in its own axes, heading known roughly.

A heading that is off by ``psi`` turns the velocity over the ground. Across the way that is ``v psi``, which the covariance holds.
Along the way it is ``v (1 - cos psi)``, which no tangent shows: of 6 m/s and 15 deg 0.2 m/s, where the log itself is good to
0.05 m/s. A sigma of velocity is then such that k of it hold what k of the heading's make of velocity, up to four,

    along = max over k <= 4 of (1 - cos(k sigma))/k          dv = v along

With a way L from the place about which it turns, place is off by ``L along`` in the same manner. Of a log alone ``v`` and ``L`` are
those of the motion; what shows the ground makes them shorter, a fix starts the way anew, and velocities of GNSS leave none of v.
So they are what the covariance says that turns with azimuth: ``u x v = -cov(dv, psi)/var(psi)``, and L as much of dp.

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
SMALL = 1e-12  # rad


def shows_body_velocity(aiding: Sequence[Aiding]) -> bool:
    """Whether velocity is seen along axes of the body."""
    return any(source.row.axes == BODY_FRAME and source.row.unit == "m/s" for source in aiding)


def seen_in_body(aiding: Sequence[Aiding]) -> bool:
    """Whether velocity is seen in the body, and neither it nor place over the ground."""
    return shows_body_velocity(aiding) and not any(source.over_ground for source in aiding)


def shows_stops_alone(aiding: Sequence[Aiding]) -> bool:
    """Whether a velocity of zero is all that is seen of how the vehicle moves."""
    shown = [source for source in aiding if source.does == "measurement"]
    return any(source.row.name == "velocity" for source in shown) and not any(source.over_ground for source in shown)


def with_curve(track: Track, aiding: Sequence[Aiding]) -> Track:
    """The track with what the curve of its velocity adds to the covariance of velocity and place, seen not over ground.

    Parameters
    ----------
    track : Track
    aiding : sequence of Aiding
        Its measurements; where none of them shows velocity in the body, or stops alone, the track is what it was.
    """
    if not (shows_body_velocity(aiding) or shows_stops_alone(aiding)) or not len(track.P):
        return track
    P = track.P.copy()
    psi = P[:, 2, 2]
    sigma = np.sqrt(np.maximum(psi, SMALL**2))
    k = np.minimum(MOST, TURN / sigma)
    short = (1.0 - np.cos(k * sigma)) / k
    for first in (DV.start, DP.start):
        side = slice(first, first + 2)
        turns = track.P[:, side, 2] / (sigma**2)[:, None]  # what turns with azimuth, a quarter of a turn on
        along = short[:, None] * turns[:, ::-1] * [1.0, -1.0]
        P[:, side, side] += along[:, :, None] * along[:, None, :]
    lost = 0.5 * np.linalg.norm(turns, axis=1) * (MOST * sigma > TURN)
    for j in range(DP.start, DP.start + 2):
        P[:, j, j] += lost**2
    return replace(track, P=P)
