"""A start whose heading is unsure: the log is linearised once more about the heading that it shows itself.

Errors are linear about a heading that is known to some degrees. With 15 deg at the start a filter corrects tilts and biases by
columns that turn as its heading does, and that passes for knowledge of both: of ships with consumer IMUs level was 1.4 sigmas off,
RMS, and heading 7 on the way. So the log is filtered and smoothed, its start is turned to where the smoother puts it, until that
stays: Gauss and Newton's way to the most likely heading. Then it begins with three times the sigma that the log leaves of it. The
log counts twice in that: sigma of heading is 5 % too small at the most, less than figures of sigma are worth. Where the log shows
less than that of a start, or is likelier as it began, the start stays as it was said to be. These passes have no gates, which a
wrong heading would shut: a fix that jumps pulls them. So the log with its gates has to be likelier from there, too.

Source: B. Bell, "The iterated Kalman smoother as a Gauss-Newton method", SIAM J. Optimization 4 (1994); the narrow start is ours,
as in passes on the move (:mod:`truenorth.alignment.in_motion_passes`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from truenorth.aiding.aids import Aid, Gnss
from truenorth.aiding.sensors import place_sigma
from truenorth.alignment.in_motion_passes import SETTLED, turn_between
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import DataError
from truenorth.estimate.slow_fit import bounded_misfit
from truenorth.navigation.by_start import LINEAR, UP
from truenorth.state.state import Start
from truenorth.state.track import Track

MOST = 3  # passes
WIDER = 3.0  # times what the log leaves of a heading


def linear_within(given: Mapping[str, Aid]) -> float:
    """Heading, rad, within which errors are linear: a turn of an arm that is not known moves an antenna by their product.

    Of .1 rad and 5 m that is half a metre, which fixes of centimetres take for knowledge of the heading: it was 55 sigmas off.
    """
    receiver = given.get(Gnss.key)
    if not isinstance(receiver, Gnss) or not receiver.record.has_position.any():
        return LINEAR
    arm = (receiver.mounting or receiver.usual).lever_arm_sigma
    return min(LINEAR, place_sigma(receiver.record) / arm) if arm > 0.0 else LINEAR


def recentred(run: Callable[[Start, bool], Track], start: Start, linear: float = LINEAR) -> Start:
    """The start with the heading that the log shows, where it was unsure and is shown; else the same one.

    Parameters
    ----------
    run : callable
        The log from a start, with gates or, to be smoothed once that is asked for, without.
    start : Start
    linear : float, rad
        Sigma of heading within which nothing is asked.
    """
    before = math.sqrt(float(start.P[UP, UP]))
    if before < linear:
        return start
    best, at, shown = math.inf, start, start
    for _ in range(MOST):
        try:
            track = run(at, False)
            cost = bounded_misfit(track.residuals)
            if not cost < best:
                break
            smoothed = track.whole()
        except DataError:  # the filter broke down
            break
        sigma = float(smoothed.sigma[0, UP])
        if WIDER * sigma > before:
            return start
        turn = turn_between(smoothed.C_nb[0], at.C_nb)
        best, shown = cost, _narrower(at, WIDER * sigma / before)
        if abs(turn) < SETTLED * sigma:
            break
        at = replace(at, C_nb=np.asarray(dcm_from_euler(-turn, 0.0, 0.0) @ at.C_nb))
    if shown.C_nb is start.C_nb:
        return start
    try:
        likelier = bounded_misfit(run(shown, True).residuals) < bounded_misfit(run(start, True).residuals)
    except DataError:
        return start
    return shown if likelier else start


def _narrower(start: Start, part: float) -> Start:
    """The start with so many times the sigma of heading."""
    P = start.P.copy()
    P[UP] *= part
    P[:, UP] *= part
    return replace(start, P=P)
