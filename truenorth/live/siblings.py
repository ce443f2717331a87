"""The same rows from starts that are one sigma off: whether the heading of a running answer depends on its start as sigma says.

The rule is that of :func:`truenorth.navigate` (:mod:`truenorth.navigation.by_start`), up to now: loops of the other starts take the
same rows and measurements as the answer's own, and are compared with it at each epoch of its track. They may fall behind, by
`BEHIND` at the most, until an answer asks: chunks change no bit. Where the start and its gyro leave heading to within a few degrees
there is nothing to ask.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.estimate.events import LoopState, Setting
from truenorth.estimate.run import begin, go_on
from truenorth.live.past import Past
from truenorth.navigation.by_start import LINEAR, Others, stretch
from truenorth.state.state import Start
from truenorth.state.track import Track
from truenorth.strapdown.increments import ImuRows

BEHIND = 10.0  # s


class Siblings:
    """The loops of other starts.

    Parameters
    ----------
    start : Start
        Of the answer.
    """

    def __init__(self, start: Start) -> None:
        self.others = Others.of(start)
        self.most = 0.0  # sigmas by which they have been away since the log last showed heading
        self._pasts = [Past() for _ in self.others.starts]
        self._states: list[LoopState] = []  # none: not begun, or one of them broke down, so that nothing is compared
        self._rows: list[ImuRows] = []  # that they have not taken, and what came with them
        self._aiding: list[Aiding] = []
        self._own: list[Track] = []
        self._end = start.time

    def begin(self, setting: Setting, time: float, interval: float) -> None:
        """Begin where the answer's own loop does, see :func:`truenorth.estimate.run.begin`."""
        self._states = [begin(setting, start, time, interval) for start in self.others.starts]
        self._end = time

    def take(self, setting: Setting, rows: ImuRows, aiding: Sequence[Aiding], own: Track) -> None:
        """Take rows and measurements that the answer's own loop has taken, and what it has put out."""
        if not self._states:
            return
        if any(len(a.time) and a.time.min() <= self._end for a in aiding):
            self.settle(setting)  # what was late there is late here
        self._rows.append(rows)
        self._aiding += [a for a in aiding if len(a.time)]
        self._own += [replace(own, residuals=())] if len(own) else []
        self._end = float(rows.time[-1])
        if self._end - self._rows[0].time[0] > BEHIND:
            self.settle(setting)

    def settle(self, setting: Setting) -> None:
        """Take all that waits."""
        if not self._rows:
            return
        rows, aiding, own = _joined(self._rows), self._aiding, self._own
        self._rows, self._aiding, self._own = [], [], []
        try:
            gone = [go_on(setting, state, rows, aiding) for state in self._states]
        except DataError:
            self._states = []
            return
        self._states = [state for state, _ in gone]
        tracks = [_without_covariance(track) for _, track in gone]
        for past, track in zip(self._pasts, tracks, strict=True):
            past.add(track)
        for track in own:
            self.most = stretch(track, self.others.moved(track, tracks), self.most)

    def now(self, setting: Setting, time: float, rows: ImuRows | None) -> list[Track]:
        """Where they are at a time; none where nothing is to be compared.

        Parameters
        ----------
        setting : Setting
        time : float, s
        rows : ImuRows or None
            Up to that time, which the loops do not take; None: it is their last epoch.
        """
        if self.others.free(np.array([time]))[0] < LINEAR:
            return []
        self.settle(setting)
        if rows is None:
            ends = [past.last for past in self._pasts if self._states]
            return [end for end in ends if end is not None]
        try:
            return [_without_covariance(go_on(setting, state, rows, last=True)[1])[-1:] for state in self._states]
        except DataError:
            return []

    def along(self, ends: Sequence[Track]) -> list[Track]:
        """Their thinned tracks, with last epochs."""
        return [past.with_end(end) for past, end in zip(self._pasts, ends, strict=False)]


def _joined(rows: Sequence[ImuRows]) -> ImuRows:
    time, gyro, accel = (np.concatenate(parts) for parts in list(zip(*rows, strict=True))[:3])
    return ImuRows(time, gyro, accel, rows[0].kind, rows[0].source)


def _without_covariance(track: Track) -> Track:
    return replace(track, P=track.P[:0], residuals=())
