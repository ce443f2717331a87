"""How late places are, by a motion that is known from both sides: what a causal filter makes of its own errors is no delay.

A fix shows ``p - tau v + n``, and the column of the delay is a velocity that is estimated, ``v + e``, by fixes and an IMU that are
wrong. Innovations hold the same e: what runs ahead by it is ahead of the next fix, and seems to be shown late. Of a motion p that
an IMU with errors reports as ``m = p + e``, and fixes z with noise of covariance R, let E be the covariance of e, and
``S = E + R``. What a row says of the delay is ``c' S^-1 r`` with ``r = z - m``. Of a column c of m itself it is, on the mean over
errors of logs of one motion,

    tr(S^-1 E[e e_dot']) = -1/2 tr(S^-1 dS/dtau) > 0

since errors of an IMU grow; that of a filter's latest velocity is in between (:mod:`truenorth.estimate.shown_late` carries what is
known over corrections of velocity, not over those of tilt, which change it from then on). It is a square of what velocity is known
to over that of the velocity, times the seconds over which fixes make it known: of cars nothing, of walkers, whose sway in step a
consumer IMU is not known to follow, 0.2 s, all of one sign, and 0.1 s was said to be the sigma. A smoothed velocity has errors of
its own, ``e_s = e + E S^-1 r``. But

    E[r e_s'] = -E + S S^-1 E = 0

what a smoother leaves has nothing in common with what it has used. So a pass takes the velocities of its delay's column from the
smoothed track of a pass before, and they stay as they are whatever it corrects.

Sources: W. Fuller, *Measurement Error Models* (1987), ch. 1: a regressor with errors that its residuals share. The rule is ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from truenorth.aiding.position import POSITION, POSITION_OF_KNOWN_MOTION
from truenorth.aiding.source import Aiding
from truenorth.estimate.events import late_fixes
from truenorth.estimate.latency import delay_of
from truenorth.state.layout import DV
from truenorth.state.track import Track

SURE = 1e-2  # variance of velocity over its square: less (cars have .002 to .005) moves a delay by a tenth of its sigma
MOST = 6000  # fixes and rows of the track: a smoother holds the links from each to the next


def is_led_by_errors(track: Track, aiding: Sequence[Aiding], every: float) -> bool:
    """Whether the delay of places is seen by velocities whose errors matter, in a log that can be smoothed each `every` seconds."""
    late = late_fixes(aiding)
    if late is None or late.row is not POSITION or len(late.time) + np.ptp(track.time) / every > MOST:
        return False
    return float(np.sum(track.sigma[:, DV] ** 2)) > SURE * float(np.sum(track.v_n**2))


def of_known_motion(aiding: Sequence[Aiding], smoothed: Track | None) -> list[Aiding]:
    """The same sources; late places have a column of these velocities. None: of those of the pass itself."""
    late = None if smoothed is None else late_fixes(aiding)
    if smoothed is None or late is None or late.row is not POSITION:
        return list(aiding)
    found = delay_of(smoothed, "GNSS")
    shown = late.time - (0.0 if found is None else found[0])
    v = np.stack([np.interp(shown, smoothed.time, along) for along in smoothed.v_n.T], axis=1)
    known = replace(late, kind=POSITION_OF_KNOWN_MOTION, measured=np.hstack([late.measured, v]))
    return [known if source is late else source for source in aiding]
