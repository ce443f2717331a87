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
from truenorth.estimate.slow_fit import fitted
from truenorth.navigation.plan import Plan
from truenorth.quality.absolute import says_size
from truenorth.quality.slow_aids import MOVES, Slow, under_way
from truenorth.state.evidence import Evidence
from truenorth.state.track import Track

COARSE = 1.0  # s, between predictions of a filter that looks for the receiver's errors
PART = 900.0  # s of a log, that show them: some ten times as long as they last
LONGEST = 4.0 * PART  # of a log with rests, until so much of it is under way


def fitted_under_way(plan: Plan, given: Mapping[str, Any], receiver: Gnss, track: Track) -> tuple[Plan, list[Evidence]]:
    """The plan with slow errors of the receiver that the log's first part makes likeliest, and what is new to be said.

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
        driven = np.cumsum(moves * np.diff(track.time, prepend=plan.start.time))
        last = min(int(np.searchsorted(driven, PART)), len(driven) - 1)
        end = min(max(float(track.time[last]), end), plan.record.time[0] + LONGEST)
    part = plan.record.between(None, end)
    short = replace(plan, record=part, interval=max(plan.interval, COARSE), every=len(part))

    def run(slow: Slow) -> Track:
        other = replace(short, slow=slow)
        return under_way(other.run(other.sources(given)), track)

    slow, said = fitted(run, plan.slow, replace(plan, slow={}).sources(given), said=says_size(receiver.record))
    return replace(plan, slow=slow), said
