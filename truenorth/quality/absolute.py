"""How well fixes can be known to lie: an error that all of them share is in the position found, and nowhere to be seen.

Of fixes with a constant error b the innovations are ``z = dp - b``, and b is in no velocity: the filter ends at ``dp = b``, and an
hour of fixes is as far off as one of them. Orbits, clocks, atmosphere and a reference station's own place err so for minutes to
hours. So where nobody says how large slow errors are (``Mounting.bias_sigma`` None), position is known no better than by a fix.

What a receiver says of a fix is the size of all its errors, ``s^2 = s_w^2 + s_c^2``: white noise and what fixes share. The white
part is in the differences of innovations, a share ``q`` of ``s^2`` to within its own sigma ``u``
(:func:`truenorth.quality.aid_noise.white_part`). What is left is shared, ``c = 1 - q``. But receivers are not exact about their
size: half as much again is what they differ by (``limit("fix untrue")``), and that is two sigmas here. So a sigma ``s`` is true to
a quarter, and ``s^2`` to ``m``, a half. With all shares alike likely beforehand, c is normal about ``1 - q`` with the sigma
``hypot(u, m)``, cut off at 0 and at the most that passes for true, and its mean times ``s^2`` is in the variance of position.

Of white fixes ``c`` is ``.8 m`` in the mean, however many there are: position is never known better than to .6 of a fix. Ten fixes
a second of 2 cm, of which nothing is shared by what is said, would average to 5 mm within seconds, and 1 cm that lasts for minutes
is in no innovation: a filter has followed it before it is as large as the noise. Of such receivers sigma was five times too small.

The rule is ours; the estimate of noise is R. Mehra's, see there.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Gnss
from truenorth.aiding.sensors import place_axes, place_sigma
from truenorth.aiding.source import Aiding
from truenorth.quality.aid_noise import NEWEST, white_part
from truenorth.quality.slow_aids import FIXES, Lasting, Slow, as_lasting, says_size, slow_errors, usual_bias, with_slow
from truenorth.quality.swing import unseen_arm
from truenorth.records import GnssRecord
from truenorth.state.evidence import Evidence
from truenorth.state.layout import ANTENNA_ARM, DP
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

# m, along the level, of a receiver that says nothing but the kind of its fixes (NMEA 0183): differential, fixed and floating phase
BY_QUALITY = {2: 1.0, 4: 0.05, 5: 0.5}
LEVEL, UP = slice(0, 2), slice(2, 3)
PARTS = 1001  # of a variance that may be shared
CHANCE = 2.0  # sigmas, beyond which a receiver has more noise than it says


def accuracy_of(record: GnssRecord) -> Array:
    """(3,) m: one sigma east, north, up of a fix, by what its receiver says of it, else by its kind, else the usual one."""
    level = usual_bias(record)
    if record.position_sigma is None and record.dop is None and record.quality is not None:
        kinds, counts = np.unique(record.quality[record.has_position], return_counts=True)
        level = BY_QUALITY.get(int(kinds[np.argmax(counts)]), level)
    return level * place_axes(record)


def known_as_fixes(
    track: Track,
    record: GnssRecord | None,
    bias: float | None,
    shown: Lasting | None = None,
    fixes: Aiding | None = None,
) -> Track:
    """The track with position known no better than by a fix of this receiver; `bias`: what was said of its slow error.

    Of heights, too, where the receiver has them. What the receiver says of a fix is noise, what wanders and what stays, together,
    and of the last ones where those are worse. Innovations have shown the noise and what wanders (`shown`), or that nothing does
    and how large the noise of `fixes` is; both are in the track's covariance: only the rest can stay. A receiver that says far less
    than innovations show, or nothing, says nothing of the rest: there position is known no better than its slow error, which may
    last longer than the log.
    """
    if bias is not None or record is None or not record.has_position.any() or not len(track.P):
        return track
    last = record.between(float(record.time[-NEWEST:][0]), None)
    sigma = np.maximum(accuracy_of(record), accuracy_of(last) if last.has_position.any() else 0.0)
    if not np.isfinite(record.alt[record.has_position]).any():
        sigma[2] = 0.0
    P, at = track.P.copy(), np.arange(DP.start, DP.stop)
    known = P[:, at, at] > 0.0  # a height that is held has no sigma
    rest = _left(track, record, shown, fixes)
    if rest is not None:
        wide = P[:, at, at] + rest * sigma**2
    else:
        least = sigma if shown is None else np.maximum(sigma, shown.group.sigma)
        wide = np.maximum(P[:, at, at], least**2)
    P[:, at, at] = np.where(known, wide, P[:, at, at])
    return replace(track, P=P)


def _left(track: Track, record: GnssRecord, shown: Lasting | None, fixes: Aiding | None) -> Array | None:
    """(3,) which part of the variance that a receiver says is neither noise nor wanders; None: nothing is known of it."""
    if shown is not None:
        seen = math.hypot(shown.white, shown.group.sigma[0] / place_sigma(record))
        return np.full(3, max(1.0 - seen**2, 0.0)) if says_size(record) and seen < limit("fix untrue") else None
    if (
        fixes is None or record.position_sigma is None
    ):  # a dilution of precision says nothing of how large a range's error is
        return None
    level, up = (white_part(track, fixes, axes) for axes in (LEVEL, UP))
    if level is None or not level[0] < limit("fix untrue") ** 2:
        return None
    left = shared_part(*level)
    return np.array([left, left, 1.0 if up is None else shared_part(*up)])


def shared_part(white: float, sigma: float) -> float:
    """Mean of the part of a variance that is not white, where the white part is known to a sigma, and what is said to a half.

    A receiver that has more noise than it says, beyond chance, says too little: by as much again at a time. No more than all of
    what it says is shared: beyond that what it says is not true.
    """
    untrue = limit("fix untrue") - 1.0  # one sigma of a square: what still passes for true is two of a size
    parts = np.linspace(0.0, limit("fix untrue") ** 2, PARTS)
    misfit = np.square((parts - (1.0 - white)) / math.hypot(sigma, untrue))
    weight = np.exp(-0.5 * (misfit - misfit.min()))
    return min(1.0, float(parts @ weight / weight.sum()) + max(0.0, white - 1.0 - CHANCE * sigma))


def known_as_followed(
    track: Track, receiver: Gnss, altitude: str, start: Start | None = None, modelled: Slow | None = None
) -> tuple[Track, list[Evidence]]:
    """The track of a loop with its place as unsure as fixes leave it, and what is to be said of slow errors that it does not have.

    A loop without states for a slow error follows it. So position is known no better than by a fix (:func:`known_as_fixes`), nor
    than the slow error that the innovations up to now show. What their colour says of position is in sigma then. And what fixes
    that wander seem to say of the antenna's arm is as little knowledge: of the place, the arm hides as much as it did at the start.

    Parameters
    ----------
    track : Track
        With the innovations of the receiver.
    receiver : Gnss
        Its newest rows.
    altitude : str
        How height is kept.
    start : Start, optional
        Of the loop.
    modelled : mapping of str to Lasting, optional
        Slow errors that are states of the loop.
    """
    slow = modelled or {}
    fixes = [source for source in with_slow(receiver.sources(altitude), slow) if source.name == FIXES]
    bias = None if receiver.mounting is None else receiver.mounting.bias_sigma
    known = known_as_fixes(track, receiver.record, bias, slow.get(FIXES), next(iter(fixes), None))
    if FIXES in slow:
        return known, []
    slow, said = slow_errors(track, fixes)
    found = as_lasting(known, with_slow(fixes, slow))
    return (_with_arm_of(found, start) if said and start is not None else found), said


def _with_arm_of(track: Track, start: Start) -> Track:
    """The track with the place as uncertain as if the antenna's arm were known no better than at the start."""
    own = track.layout.slice_of(ANTENNA_ARM)
    if own is None or not len(track.P):
        return track
    begun = np.square(track.layout.priors[track.layout.names.index(ANTENNA_ARM)])
    if ANTENNA_ARM in start.known:
        begun = np.diag(start.P)[start.states_of(ANTENNA_ARM)]
    now = np.diagonal(track.P, axis1=1, axis2=2)[:, own]
    return _wider(track, np.maximum(begun - now, 0.0))


def with_open_arm(track: Track, quick: Array) -> Track:
    """The track with the place as uncertain as is the part of an estimated arm whose swing the receiver does not show.

    What is learnt of the arm upward is made of how the receiver filters then, which is another thing for each tone of a swing.
    The square of that part as found, less its variance: of a receiver that shows all there is nothing left. Of a swell hardly a
    part is made of how it filters, `quick` (:func:`truenorth.quality.swing.quick_part`).
    """
    if track.layout.slice_of(ANTENNA_ARM) is None or not len(track.P):
        return track
    d, sigma = unseen_arm(track)
    return _wider(track, np.tile(quick**2 * np.maximum(d**2 - sigma**2, 0.0), (len(track), 1)))


def _wider(track: Track, variance: Array) -> Track:
    """The track with these variances (K, 3), m^2, of a body axis each, in those of the place, but of a height that is held."""
    P, C = track.P.copy(), track.C_nb * (np.diagonal(track.P, axis1=1, axis2=2)[:, DP] > 0.0)[:, :, None]
    P[:, DP, DP] += (C * variance[:, None, :]) @ np.swapaxes(C, 1, 2)
    return replace(track, P=P)
