"""What the rows up to now show of the aids: errors that last, how late they are, and how much stamps scatter.

:func:`truenorth.navigate` finds them by passes over the whole log (:mod:`truenorth.navigation.passes`). A running answer makes the
same passes at a few times: they are then states of its loop. Of a receiver whose rows are too few to show them, they are taken as
is usual of receivers. Taken for white, errors of a fix that last for a minute, and of a velocity that last for seconds, pull at the
velocity of an answer: it was up to 5 sigmas off. A delay of many of its sigmas is found in the same passes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from truenorth.aiding.aids import Aid, Gnss
from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError, UsageError
from truenorth.errors.axes import axis_sigma
from truenorth.errors.model import InsModel
from truenorth.estimate.gaps import bridge_gaps
from truenorth.estimate.latency import delay_notes, delays_found
from truenorth.estimate.moments import explained_by_two
from truenorth.estimate.slow_fit import usual
from truenorth.navigation.passes import delayed, with_scattered_stamps, with_slow_errors
from truenorth.navigation.plan import Plan
from truenorth.navigation.procedure import FINE
from truenorth.navigation.result import Altitude
from truenorth.navigation.second_look import SENSORS
from truenorth.quality.converging import Convergence, convergence
from truenorth.quality.slow_aids import FIXES, LEAST_ROWS, Slow, with_slow
from truenorth.quality.stamps import scattered_by_rows, stamp_notes, with_scatter
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start
from truenorth.state.track import Track

# s after the first rows of an aid: half a minute shows how stamps scatter, a minute is the least that shows how errors last
LOOKS = (5.0, 30.0, 75.0, 150.0)
GLANCE = 15.0  # s, between two glances at innovations alone, at ..
NEWEST = 600  # of them
AHEAD = 2.0  # s, of a measurement before its time: a delay makes it due earlier, and rows come up to a second late


class Shown(NamedTuple):
    """What a look shows of the aids."""

    slow: Slow  # errors that last
    stamps: float = 0.0  # s, one sigma of the receiver's stamps
    said: Sequence[Evidence] = ()
    since: float = -math.inf  # s: stamps are known to scatter in rows after this time
    mountings: Mapping[str, Mounting] = {}  # of aids that are as late as found, by their keys
    converging: Convergence | None = None  # how the fixes of a receiver that starts up do

    def with_states(self, aiding: Sequence[Aiding]) -> list[Aiding]:
        """These measurements with states for errors that last, and for those of fixes that converge."""
        converges = self.converging
        known = [source if converges is None or source.name != FIXES else converges.of(source) for source in aiding]
        return with_slow(known, self.slow)

    def on(self, aiding: Sequence[Aiding]) -> list[Aiding]:
        """These measurements of one aid with such errors; each by the rows up to it alone."""
        added = scattered_by_rows(aiding, self.stamps)
        known = {s.name: added[s.name] * (s.time > self.since)[:, None] for s in aiding if s.name in added}
        return with_scatter(self.with_states(aiding), known)


def next_look(last: float, begun: Sequence[float]) -> float:
    """The time of the look that follows one, s, of aids whose rows begin at these times; infinity: there is none."""
    return min((first + after for first in begun for after in LOOKS if first + after > last), default=math.inf)


def next_glance(last: float, begin: float, row: float) -> float:
    """The time of the first glance after one, s, of a run from `begin` that has a row of this time; infinity: it has none."""
    if row == math.inf:
        return row
    return begin + GLANCE * max(math.ceil((row - begin) / GLANCE), round((last - begin) / GLANCE) + 1)


def lasting_errors(
    record: ImuRecord,
    start: Start,
    model: InsModel,
    altitude: Altitude,
    spec: ImuSpec,
    aids: Mapping[str, Aid | None],
) -> Shown:
    """Errors of aids that last, how fixes converge, how late the aids are, and how much stamps scatter.

    Parameters
    ----------
    record : ImuRecord
        The rows from the start on.
    start : Start
    model : InsModel
        Of the loop, without states of aids.
    altitude : {"fixed", "free", "baro", "gnss"}
        How height is kept.
    spec : ImuSpec
    aids : mapping of str to Aid or None
        Up to the record's end, by their keys; None: too few rows.
    """
    given: dict[str, Any] = {key: aid for key, aid in aids.items() if aid is not None}
    sources = [source for aid in given.values() for source in aid.sources(altitude)]
    converging = next((convergence(source) for source in sources if source.name == FIXES), None)
    unseen = usual(source for source in sources if 0 < _seconds(source) < LEAST_ROWS)
    receiver = given.get(Gnss.key)
    if isinstance(receiver, Gnss) and receiver.mounting is not None and receiver.mounting.bias_sigma is not None:
        unseen.pop(FIXES, None)
    try:
        record, _, disturbances = bridge_gaps(record)
        every = max(1, round(1.0 / FINE))
        askew = axis_sigma(spec)[0].max()
        plan = Plan(record, start, model, altitude, disturbances, FINE, every, askew, slow=unseen)
        track = plan.run(plan.sources(given))
        given, track, late = _as_late_as_shown(plan, given, track)
        plan, track = with_scattered_stamps(plan, given, track)
        said: Sequence[Evidence] = ()
        if any(_seconds(source) >= LEAST_ROWS for source in sources):
            plan, track, said = with_slow_errors(plan, given, track)
    except (DataError, UsageError):  # the loop itself says what is wrong
        return Shown(unseen, converging=converging)
    delays = delay_notes(delays_found(track, {SENSORS[key][0]: mounting for key, mounting in late.items()}))
    said = [*delays, *stamp_notes(plan.stamps), *said]
    return Shown(plan.slow, plan.stamps, said, mountings=late, converging=converging)


def _as_late_as_shown(
    plan: Plan, given: dict[str, Any], track: Track
) -> tuple[dict[str, Any], Track, dict[str, Mounting]]:
    """The aids as late as a track shows them where that explains the rows better, their track, and how those sit that are."""
    later = delayed(plan, given, track)
    if later is given:
        return given, track, {}
    other = plan.run(plan.sources(later))
    if not explained_by_two(other, track, delays=True):
        return given, track, {}
    return later, other, {key: later[key].mounting for key in SENSORS if later.get(key) is not given.get(key)}


def _seconds(source: Aiding) -> int:
    """How many seconds of the log have rows of a source: so many means show how its errors last."""
    return len(np.unique(np.floor(source.time)))
