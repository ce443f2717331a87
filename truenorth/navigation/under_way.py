"""Slow errors of a receiver by what it shows under way, of a log that rests and drives.

Fitted to both, the rest decides, which is as long and by far the better fitted (:func:`~truenorth.quality.slow_aids.under_way`):
of a car that stood for nine minutes before it drove through a city the white noise was a tenth of what it is there, and the gates
kept half of its fixes out, until the track was lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from truenorth.aiding.aids import Gnss
from truenorth.estimate.slow_fit import bounded_misfit, fitted
from truenorth.navigation.plan import Plan
from truenorth.quality.absolute import says_size
from truenorth.quality.slow_aids import FIXES, MOVES, Lasting, Slow, under_way
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Track

COARSE = 1.0  # s, between predictions of a filter that looks for the receiver's errors
PART = 900.0  # s of a log, that show them: some ten times as long as they last
LONGEST = 12.0 * PART  # of a log with rests, until so much of it is under way
QUIET = 0.5  # of the mean square of innovations, at rest, by errors as large as under way


def fitted_under_way(plan: Plan, given: Mapping[str, Any], receiver: Gnss, track: Track) -> tuple[Plan, list[Evidence]]:
    """The plan with slow errors of the receiver that the log's first part makes likeliest, and what is new to be said.

    By what it shows under way, where that speaks against what rest and drive together make likeliest by more than chance does, and
    where the rest is quiet beyond it.

    Parameters
    ----------
    plan : Plan
        With slow errors that innovations have shown.
    given : mapping
        Aids by their keys.
    receiver : Gnss
    track : Track
        So far: it says when the vehicle moves.
    """
    end = plan.record.time[0] + PART
    if under_way(track) is not track:  # it rests and drives
        moves = np.linalg.norm(track.v_n[:, :2], axis=1) > MOVES
        spent = np.cumsum(moves * np.diff(track.time, prepend=plan.start.time))
        last = min(int(np.searchsorted(spent, PART)), len(spent) - 1)
        end = min(max(float(track.time[last]), end), plan.record.time[0] + LONGEST)
    part = plan.record.between(None, end)
    short = replace(plan, record=part, interval=max(plan.interval, COARSE), every=len(part))

    def run(slow: Slow) -> Track:
        other = replace(short, slow=slow)
        return other.run(other.sources(given))

    def driven(slow: Slow) -> Track:
        return under_way(run(slow), track)

    aiding, says = replace(plan, slow={}).sources(given), says_size(receiver.record)
    slow, said = fitted(run, plan.slow, aiding, said=says)
    if under_way(track) is track:
        return replace(plan, slow=slow), said
    other, words = fitted(driven, plan.slow, aiding, said=says)
    found = run(other)
    by_all, by_drive = (bounded_misfit(seen.residuals) for seen in (driven(slow), under_way(found, track)))
    if by_all - by_drive > limit("rival") and _is_quiet(under_way(found, track, rest=True)):
        slow, said = _no_smaller(other, slow), words
    return replace(plan, slow=slow), said


def _no_smaller(slow: Slow, other: Slow) -> Slow:
    """These slow errors, no smaller than the others: what lasts at rest may be larger than what lasts under way."""

    def larger(name: str, own: Lasting) -> Lasting:
        sigma = own.group.sigma if name not in other else np.maximum(own.group.sigma, other[name].group.sigma)
        return replace(own, group=replace(own.group, sigma=sigma))

    return {name: larger(name, own) for name, own in slow.items()}


def _is_quiet(track: Track) -> bool:
    """Whether innovations of fixes are far smaller than they are said to be; not of a receiver without any."""
    used = [
        residuals.nis[residuals.used] / residuals.rows[residuals.used]
        for residuals in track.residuals
        if residuals.name == FIXES
    ]
    return bool(used and used[0].size and np.mean(used[0]) < QUIET)
