"""One live run: rows of a source into an aligner and a journal, answers to whoever listens, until good enough or the end.

From alignment to navigation without a gap: when the heading is as good as wished, when the base leaves its place, or on request.
"""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import Alignment
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.position import Position
from truenorth.core.shown import ARCHIVE, load, save
from truenorth.formats.layout import Layout
from truenorth.live.aid_sources import AidSource, Replayed, open_aid
from truenorth.live.aligner import SHARE, Aligner
from truenorth.live.answer import Answer
from truenorth.live.feed import Feed, shift_as
from truenorth.live.journal import Journal
from truenorth.live.log import Kind
from truenorth.live.navigator import Navigator
from truenorth.live.onward import as_found
from truenorth.live.regime import Turner
from truenorth.live.sources import Source, Stream, open_source
from truenorth.navigation import Navigation
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]
Run = Aligner | Navigator
Listener = Callable[[Run, Answer | None, str], None]

START = "start"  # folder of the alignment that navigation goes on from


@dataclass
class Session:
    """A live run."""

    source: str  # see :func:`truenorth.live.sources.open_source`
    place: Position | None = None  # not needed with GNSS positions
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None
    layout: Layout = field(default_factory=Layout)  # columns, units and axes of the rows
    feeds: Sequence[Feed] = ()  # aiding sensors
    turner: Turner | None = None  # a turntable, or an indexer without an encoder
    aids: Mapping[str, str] = field(default_factory=dict)  # where each feed's rows come from, see :func:`open_aid`
    method: str = "auto"
    share: float = SHARE  # of one core, for solutions
    every: float = 1.0  # s; between two calls of the listeners, by the wall clock
    until: float | None = None  # rad; one-sigma of heading with which alignment ends; None: at the end of the source
    navigate: bool = False  # go on to navigation: at `until`, when the base leaves its place, or when `go` is set
    by_arrival: bool = False  # time is that of arrival, whatever the rows say
    folder: Path | None = None  # where the rows are kept
    resume: bool = False  # go on with the rows in `folder`
    opened: Callable[[str], None] = lambda source: None  # called with the source's text when rows can come
    go: threading.Event = field(default_factory=threading.Event)
    navigation: Navigation | None = None  # of the rows after the alignment, when there were some
    without: str = ""  # why there is no navigation, though it was begun

    def run(self, listeners: Sequence[Listener] = ()) -> Alignment:
        """Align until the source ends, the heading is good enough, or an interrupt; then navigate, if that is wished.

        Returns
        -------
        Alignment
            Of all rows, as :func:`truenorth.align` gives it; of those before navigation began.

        Raises
        ------
        UsageError, DataError
            A source that cannot be opened or read.
        AlignmentError
            Too few rows for any answer.
        """
        journal = None if self.folder is None else Journal(self.folder, self.feeds, resume=self.resume)
        earlier = [] if journal is None else list(journal.earlier())
        last = max((float(rows[-1, 0]) for _, rows in earlier), default=-np.inf)
        source = open_source(self.source, self.layout, last, by_arrival=self.by_arrival)
        aids = self._open_aids(source, journal)
        self.opened(self.source)
        run: Run | None = None
        aligned: Answer | None = None  # stands until navigation has one of its own
        due = 0.0
        try:
            for rows in source:
                if run is None and (len(rows) or earlier):
                    run = self._begin(source.kind if len(rows) else earlier[0][0], earlier, aids, journal)
                if run is None:
                    continue
                if len(rows):
                    _give(run, rows, aids)
                if clock.monotonic() >= due:
                    due = clock.monotonic() + self.every
                    answer = run.answer
                    self._publish(listeners, run, answer or aligned, _notes(source, aids, run))
                    if isinstance(run, Aligner) and self._good(answer):
                        if not self.navigate:
                            break
                        navigator = self._go_on(run, journal)
                        aligned, run = run.answer, navigator
        except KeyboardInterrupt:
            pass
        if run is None and earlier:
            run = self._begin(earlier[0][0], earlier, aids, journal)
        if run is None:
            raise AlignmentError(f"{self.source}: no rows came; nothing to align")
        if journal is not None:
            journal.flush(source.kind)
        found = self._finish(run)
        self._publish(listeners, run, run.answer or aligned, _notes(source, aids, run))
        return found

    def _open_aids(self, source: Source, journal: Journal | None) -> list[AidSource]:
        feeds = {feed.key: feed for feed in self.feeds}
        found: list[AidSource] = []
        for key, text in self.aids.items():
            kept = None if journal is None else journal.aids[key]
            if kept is not None:
                found.append(Replayed(kept.earlier, feeds[key].add))
            aid, listener = open_aid(text, feeds[key], kept, by_arrival=self.by_arrival)
            if listener is not None:
                if not isinstance(source, Stream):
                    raise UsageError(
                        f"source {self.source}: a log has no rows of {key} in between; expected replay:FILE"
                    )
                source.share(listener.hear)
            found.append(aid)
        return found

    def _begin(
        self, kind: Kind, earlier: Sequence[tuple[Kind, Array]], aids: Sequence[AidSource], journal: Journal | None
    ) -> Run:
        """An aligner, or a navigator where an earlier run has come so far, that has the rows of that run.

        What it takes from then on goes into the journal.
        """
        start = None if self.folder is None else self.folder / START
        run: Run
        # A run that was killed while it wrote its start has left the folder alone.
        if earlier and start is not None and (start / ARCHIVE).exists():
            begin = load(start)
            shift_as(begin, {feed.key: feed for feed in self.feeds})  # the journal keeps rows as they were stamped
            run = Navigator(begin, feeds=self.feeds, mountings=as_found(begin), kind=kind)
        else:
            aid = [*self.feeds, *([] if self.turner is None else [self.turner])]
            run = Aligner(self.place, self.imu, aid=aid, kind=kind, method=self.method, share=self.share)
        for _, rows in earlier:
            _give(run, rows, aids)
        run.on_taken(None if journal is None else journal.taker(kind))
        return run

    def _go_on(self, aligner: Aligner, journal: Journal | None) -> Navigator:
        navigator = aligner.navigator()
        navigator.on_taken(None if journal is None else journal.taker(aligner.log.source_kind))
        if self.folder is not None and navigator.solution is not None:
            save(navigator.solution, self.folder / START)
        return navigator

    def _finish(self, run: Run) -> Alignment:
        if isinstance(run, Aligner):
            return run.finish()
        assert run.solution is not None
        if run.missing is None:
            self.navigation = run.finish()
        else:
            self.without = str(run.missing)
        return run.solution

    def _publish(self, listeners: Sequence[Listener], run: Run, answer: Answer | None, note: str) -> None:
        for listener in listeners:
            listener(run, answer, note)

    def _good(self, answer: Answer | None) -> bool:
        """Whether alignment is at its end."""
        if answer is None or not answer.heading_known:
            return False
        if self.navigate and (self.go.is_set() or answer.left is not None):
            return True
        return self.until is not None and float(answer.sigma[0]) <= self.until


def _give(run: Run, rows: Array, aids: Sequence[AidSource]) -> None:
    for aid in aids:
        aid.advance(float(rows[-1, 0]))
    run.push(rows[:, 0], rows[:, 1:4], rows[:, 4:])


def _notes(source: Source, aids: Sequence[AidSource], run: Run) -> str:
    broken = f"{source.broken} lines could not be read" if source.broken else ""
    missing = "" if isinstance(run, Aligner) or run.missing is None else str(run.missing)
    return "; ".join(filter(None, (source.note, broken, *(aid.note for aid in aids), missing)))
