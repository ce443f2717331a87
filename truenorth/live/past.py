"""What a loop has put out so far, in bounded memory: a thinned track, and the newest innovations of each source."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.state.track import ARRAYS, RESIDUALS, Residuals, Track

Array = NDArray[np.float64]

MOST_EPOCHS = 4000  # of the track; beyond it every second one is dropped
MOST_ROWS = 3000  # of a source's innovations: those that the judge looks at
BATCH = 200  # tracks that are put together at once


class Past:
    """Tracks of parts, one after the other."""

    def __init__(self) -> None:
        self.last: Track | None = None  # the last epoch
        self.notes: dict[str, str] = {}
        self.thinned = 1  # epochs of the loop in one of ours
        self._parts: list[Track] = []
        self._offset = 0
        self._residuals: dict[str, Residuals] = {}

    def note(self, key: str, text: str) -> None:
        """Keep something that is to be said, one text of a key."""
        self.notes[key] = text

    def add(self, track: Track) -> None:
        """Take what the loop has put out."""
        for r in track.residuals:
            self._residuals[r.name] = _joined(self._residuals.get(r.name), r)
        count = len(track.time)
        if not count:
            return
        self.last = _epochs(track, slice(count - 1, None))
        first = -self._offset % self.thinned
        self._offset += count
        if first < count:
            self._parts.append(_epochs(track, slice(first, None, self.thinned)))
        if len(self._parts) >= BATCH:
            self._settle()

    @property
    def track(self) -> Track | None:
        """The thinned track; None before the first epoch."""
        self._settle()
        return self._parts[0] if self._parts else None

    @property
    def residuals(self) -> tuple[Residuals, ...]:
        """The newest innovations of each source."""
        return tuple(self._residuals.values())

    def newest(self, count: int) -> tuple[Residuals, ...]:
        """So many of them."""
        return tuple(_newest(r, count) for r in self.residuals)

    def with_end(self, end: Track) -> Track:
        """The thinned track, and a last epoch."""
        track = self.track
        if track is None or track.time[-1] >= end.time[-1]:
            return end if track is None else track
        return _together([track, end])

    def _settle(self) -> None:
        if len(self._parts) > 1:
            self._parts = [_together(self._parts)]
        while self._parts and len(self._parts[0].time) > MOST_EPOCHS:
            self._parts = [_epochs(self._parts[0], slice(None, None, 2))]
            self.thinned *= 2


def _epochs(track: Track, rows: slice) -> Track:
    return replace(track, residuals=(), **{name: getattr(track, name)[rows].copy() for name in ARRAYS})


def _together(tracks: list[Track]) -> Track:
    arrays: dict[str, Any] = {name: np.concatenate([getattr(t, name) for t in tracks]) for name in ARRAYS}
    return replace(tracks[0], **arrays)


def _joined(first: Residuals | None, second: Residuals) -> Residuals:
    if first is None:
        return second
    parts: dict[str, Any] = {name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in RESIDUALS}
    return _newest(replace(second, **parts), MOST_ROWS)


def _newest(r: Residuals, count: int) -> Residuals:
    parts: dict[str, Any] = {name: getattr(r, name)[-count:] for name in RESIDUALS}
    return replace(r, **parts)
