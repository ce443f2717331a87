"""One live run: rows of a source into an aligner and a journal, answers to whoever listens, until good enough or the end."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import Alignment
from truenorth.core.errors import AlignmentError
from truenorth.core.position import Position
from truenorth.formats.layout import Layout
from truenorth.live.aligner import SHARE, Aligner
from truenorth.live.answer import Answer
from truenorth.live.journal import Journal
from truenorth.live.log import Kind
from truenorth.live.sources import open_source
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]
Listener = Callable[[Aligner, Answer | None, str], None]


@dataclass
class Session:
    """A live run."""

    source: str  # see :func:`truenorth.live.sources.open_source`
    place: Position
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None
    layout: Layout = field(default_factory=Layout)  # columns, units and axes of the rows
    method: str = "auto"
    share: float = SHARE  # of one core, for solutions
    every: float = 1.0  # s; between two calls of the listeners, by the wall clock
    until: float | None = None  # rad; one-sigma of heading with which to stop; None: only at the end of the source
    folder: Path | None = None  # where the rows are kept
    resume: bool = False  # go on with the rows in `folder`
    opened: Callable[[str], None] = lambda source: None  # called with the source's text when rows can come

    def run(self, listeners: Sequence[Listener] = ()) -> Alignment:
        """Align until the source ends, the heading is good enough, or an interrupt.

        Returns
        -------
        Alignment
            Of all rows, as :func:`truenorth.align` gives it.

        Raises
        ------
        UsageError, DataError
            A source that cannot be opened or read.
        AlignmentError
            Too few rows for any answer.
        """
        journal = None if self.folder is None else Journal(self.folder, resume=self.resume)
        earlier = [] if journal is None else list(journal.earlier())
        last = max((float(rows[-1, 0]) for _, rows in earlier), default=-np.inf)
        source = open_source(self.source, self.layout, last)
        self.opened(self.source)
        aligner: Aligner | None = None
        due = 0.0
        try:
            for rows in source:
                if aligner is None and (len(rows) or earlier):
                    aligner = self._aligner(source.kind if len(rows) else earlier[0][0], earlier, journal)
                if aligner is None:
                    continue
                if len(rows):
                    aligner.push(rows[:, 0], rows[:, 1:4], rows[:, 4:])
                if clock.monotonic() >= due:
                    due = clock.monotonic() + self.every
                    answer = aligner.answer
                    self._publish(listeners, aligner, answer, _note(source.note, source.broken))
                    if self._good(answer):
                        break
        except KeyboardInterrupt:
            pass
        if aligner is None and earlier:
            aligner = self._aligner(earlier[0][0], earlier, journal)
        if aligner is None:
            raise AlignmentError(f"{self.source}: no rows came; nothing to align")
        if journal is not None:
            journal.flush(source.kind)
        found = aligner.finish()
        self._publish(listeners, aligner, aligner.answer, _note(source.note, source.broken))
        return found

    def _aligner(self, kind: Kind, earlier: Sequence[tuple[Kind, Array]], journal: Journal | None) -> Aligner:
        """An aligner that has the rows of an earlier run, and writes what it takes from now on."""
        keep = [False]

        def taken(rows: Array) -> None:
            if keep[0] and journal is not None:
                journal.add(rows, kind)

        aligner = Aligner(self.place, self.imu, kind=kind, method=self.method, share=self.share, taken=taken)
        for _, rows in earlier:
            aligner.push(rows[:, 0], rows[:, 1:4], rows[:, 4:])
        keep[0] = True
        return aligner

    def _publish(self, listeners: Sequence[Listener], aligner: Aligner, answer: Answer | None, note: str) -> None:
        for listener in listeners:
            listener(aligner, answer, note)

    def _good(self, answer: Answer | None) -> bool:
        return (
            self.until is not None
            and answer is not None
            and answer.heading_known
            and float(answer.sigma[0]) <= self.until
        )


def _note(note: str, broken: int) -> str:
    return "; ".join(filter(None, (note, f"{broken} lines could not be read" if broken else "")))
