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
from typing import NamedTuple

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


class Sums(NamedTuple):
    """What has come up to an epoch: of each of `_rates` what it was there, and its integral."""

    time: float
    rates: Array
    sums: Array


def with_curve(track: Track, aiding: Sequence[Aiding], before: Track | None = None, since: Sums | None = None) -> Track:
    """The track with what the curve of its velocity adds to the covariance of velocity and place, where it is seen in the body.

    Parameters
    ----------
    track : Track
        From its start on, or from what came before it.
    aiding : sequence of Aiding
        Its measurements; where one of them shows velocity or place over the ground, or none velocity, the track is what it was.
    before : Track, optional
        The same epochs as filtered, of a track that is smoothed: place was corrected by what heading was off before.
    since : Sums, optional
        Of the epochs before.
    """
    if not seen_in_body(aiding) or not len(track.P):
        return track
    sums = _summed(track if before is None else before, since)
    n = track.P.shape[:2]
    along, across = np.zeros(n), np.zeros(n)
    along[:, DV], along[:, DP], across[:, DP] = _rates(track)[:, :3], sums[:, :3], sums[:, 3:6]
    P = track.P + sum(x[:, :, None] * x[:, None, :] for x in (along, across))
    for j in range(DP.start, DP.start + 2):
        P[:, j, j] += sums[:, 6] ** 2
    return replace(track, P=P)


def sums_after(track: Track, since: Sums | None) -> Sums | None:
    """What has come up to the last epoch of a track; `since`: up to its first one."""
    if not len(track):
        return since
    return Sums(float(track.time[-1]), _rates(track[-1:])[0], _summed(track, since)[-1])


def _rates(track: Track) -> Array:
    """(K, 7) m/s: what the covariance does not say of a velocity along and across the way, and by what place is lost."""
    sigma = np.maximum(track.sigma[:, 2], 1e-12)
    k = np.minimum(MOST, TURN / sigma)
    level = track.v_n * [1.0, 1.0, 0.0]
    along, across = (1.0 - np.cos(k * sigma)) / k, sigma - np.sin(MOST * sigma) / MOST
    aside = np.cross([0.0, 0.0, 1.0], level)
    lost = 0.5 * np.linalg.norm(level, axis=1) * (MOST * sigma > TURN)
    return np.column_stack([level * along[:, None], aside * across[:, None], lost])


def _summed(track: Track, since: Sums | None) -> Array:
    """(K, 7) integrals of the rates from the first epoch on, or since an earlier one."""
    rates, time = _rates(track), track.time
    first = Sums(float(time[0]), rates[0], np.zeros(rates.shape[1])) if since is None else since
    rates, time = np.vstack([first.rates, rates]), np.append(first.time, time)
    steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(time)[:, None]
    return np.asarray(first.sums + np.cumsum(steps, axis=0))
