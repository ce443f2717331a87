"""What there is to say of an alignment that runs: of the last solution, and of the rows since."""

from __future__ import annotations

from typing import Protocol

from truenorth.alignment import Alignment
from truenorth.live.answer import under_way
from truenorth.live.feed import Feed
from truenorth.live.intake import Intake
from truenorth.live.log import Log
from truenorth.live.onward import Onward


class _Run(Protocol):
    """What an aligner knows of its rows."""

    onward: Onward
    intake: Intake
    feeds: dict[str, Feed]
    log: Log
    failure: str

    @property
    def duration(self) -> float: ...


def reasons_of(run: _Run, at: Alignment) -> tuple[str, ...]:
    """The verdict of the last solution `at` in words, then what became of base, rows and log."""
    more = []
    if (left := run.onward.left) is not None:
        went_on = "alignment goes on in motion" if under_way(at) else "the gyros carry it on"
        more.append(f"the base left its place at {left:.1f} s: {run.onward.until_then} until then, {went_on}")
    found = run.intake.counts.words()
    if found:
        more.append(found)
    for key, feed in run.feeds.items():
        if feed.left_out:
            more.append(f"{key}: {feed.left_out} row{'s' * (feed.left_out > 1)} left out")
    if run.log.merged > 1:
        since = f", the last {run.duration / 3600.0:.1f} h count" if run.log.dropped else ""
        more.append(f"the log is long: rows are kept as increments over {run.log.merged} of them{since}")
    if run.failure:
        more.append(run.failure)
    return (*at.reasons, *more)
