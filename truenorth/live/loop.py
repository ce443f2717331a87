"""The closed loop of a navigation while its log is still running: rows and measurements in, a track and the newest epoch out.

From time to time the loop looks back at all rows so far, as :func:`truenorth.navigate` does at a whole log: errors of its aids that
last, which no single row shows, are then states of it, and it takes the rows anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Aiding
from truenorth.core.errors import DataError
from truenorth.errors.model import InsModel
from truenorth.estimate.events import LoopState, Setting
from truenorth.estimate.run import begin, go_on, with_states
from truenorth.live.bridges import Gap, bridged, unbroken
from truenorth.live.feed import Feed
from truenorth.live.intake import LATE
from truenorth.live.lasting import AHEAD, NEWEST, Shown, lasting_errors, next_glance, next_look
from truenorth.live.log import Kind, Log
from truenorth.live.noise_seen import NoiseSeen
from truenorth.live.past import Past
from truenorth.live.siblings import Siblings
from truenorth.navigation.first_row import carried_to, lost_after, row_before_gap
from truenorth.navigation.given import fed_back
from truenorth.navigation.procedure import FINE, PLUMB_LINE
from truenorth.navigation.result import Altitude
from truenorth.navigation.start import force_at_rest
from truenorth.quality.stamps import stamp_notes, stamp_scatter
from truenorth.records import ImuRecord
from truenorth.records.lost_rows import lack_rows
from truenorth.records.specs import ImuSpec
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start
from truenorth.state.track import Track
from truenorth.strapdown.increments import ImuRows

Array = NDArray[np.float64]

FIRST = 20  # rows that show the interval of sampling


class Loop:
    """Where a run is, in bounded memory.

    Parameters
    ----------
    start : Start
    spec : ImuSpec
        Without what is known of the IMU.
    kind : {"rates", "increments"}
        What a row is.
    altitude : {"fixed", "free", "baro", "gnss"}
        How height is kept.
    output : float, s
        Between two epochs of the track.
    mountings : mapping of str to Mounting
        Of feeds to which none is given, by their keys.
    """

    made_anew: ClassVar[tuple[str, ...]] = ("_made",)  # not kept in a file
    _made: Setting | None = None
    _first: Array = np.empty((0, 7))  # the row made before a gap at the start: it never came, the log has it not

    def __init__(
        self,
        start: Start,
        spec: ImuSpec,
        kind: Kind,
        altitude: Altitude,
        output: float,
        mountings: Mapping[str, Mounting],
    ) -> None:
        self.start, self.spec, self.kind, self.altitude, self.output = start, spec, kind, altitude, output
        self.mountings = dict(mountings)
        self.failure = ""
        self.shown = Shown({})  # of the aids, by the last look
        self._looked = -np.inf  # s, when it looked back last
        self._glanced = start.time  # s, and at innovations alone
        self._glances = 0
        self._waiting: list[Array] = []
        self._anew()

    def _anew(self) -> None:
        """Forget all rows that were taken."""
        self.past = Past()
        self.gaps: list[Gap] = []
        self.siblings = Siblings(self.start)
        self._noise = NoiseSeen(self.spec, self.kind)
        self._made = None
        self._more = False  # whether rows of a source have come that the loop did not know of
        self._state: LoopState | None = None
        self._interval = 0.0
        # The row that was taken last, as it came; of the start its time alone counts.
        self._last = np.full(7, self.start.time)
        self._sent: dict[str, dict[str, float]] = {}

    @property
    def end(self) -> float:
        """Up to where rows are taken, s."""
        return float(self._last[0])

    @property
    def begun(self) -> bool:
        """Whether there is an epoch to be put out."""
        return self._state is not None

    def add(self, rows: Array) -> None:
        """Let rows (K, 7) wait until they are taken."""
        self._waiting.append(rows)

    def setting(self, feeds: Mapping[str, Feed]) -> Setting:
        """What the loop keeps to until it begins anew."""
        if self._made is None:
            self._made = self._set(feeds)
        return self._made

    def _set(self, feeds: Mapping[str, Feed]) -> Setting:
        found = self.shown.mountings
        asked = [
            source
            for key, feed in feeds.items()
            for source in feed.sources(self.altitude, self.mountings.get(key), found.get(key))
        ]
        sources = [*self.shown.with_states(asked), Aiding.disturbance("gap"), Aiding.disturbance("noise")]
        stride, every = max(1, round(FINE / self._interval)), max(1, round(self.output / FINE))
        model = with_states(self._model(), sources)
        return Setting(model, tuple(sources), stride, every, invariant=fed_back(sources))

    def _model(self) -> InsModel:
        noise, fixed = self.spec.with_random_walks(self._interval), self.altitude == "fixed"
        standing = force_at_rest(self.start)
        return InsModel.from_spec(noise, standing=standing, groups=PLUMB_LINE.groups, fixed_altitude=fixed)

    def advance(self, until: float, feeds: Mapping[str, Feed], log: Log) -> None:
        """Take the rows and measurements up to a time, and look back where it is time to."""
        while not self.failure:
            look = next_look(self._looked, self._begun(feeds, log))
            if (at := min(look, self._next_glance())) >= until:
                break
            self._advance(at, feeds, log)
            if at == look:
                self._looked = at
                self._look_back(feeds, log)
            else:
                self._glanced = at
                self._glance(feeds)
        self._advance(until, feeds, log)
        # Of a receiver whose headings come later than its first fix:
        if self._more and (rows := self._taken(log)) is not None:
            self._take_anew(rows, self.shown, feeds, log)
            self._more = False

    def _next_glance(self) -> float:
        """The time of the next glance, s: of rows that were taken since the last one, or else of those that wait."""
        waiting = (float(rows[0, 0]) for rows in self._waiting)
        row = self.end if self.end > self._glanced else min(waiting, default=np.inf)
        return next_glance(self._glanced, self.start.time, row)

    def _begun(self, feeds: Mapping[str, Feed], log: Log) -> list[float]:
        """When the rows of each aid begin that the loop takes, s."""
        rows = [feed.rows[:, 0] for feed in feeds.values()]
        begin = max(self.start.time, float(log.rows[0, 0])) if len(log) and log.merged == 1 else np.inf
        firsts = [np.searchsorted(time, begin) for time in rows]
        return [float(time[first]) for time, first in zip(rows, firsts, strict=True) if first < len(time)]

    def _advance(self, until: float, feeds: Mapping[str, Feed], log: Log) -> None:
        """Take the rows and measurements up to a time; rows that come for a time before it are too late."""
        if self.failure or not self._waiting:
            return
        rows = np.vstack(self._waiting)
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        if self._state is None and len(rows) < FIRST:
            return
        if self._state is None:
            if (found := self._from_start(rows, log)) is None:
                return
            rows = found
            self._begin(rows, feeds, log)
        self._waiting = [rows]
        count = int(np.searchsorted(rows[:, 0], until, side="right"))
        late = int(np.searchsorted(rows[:, 0], self.end, side="right"))
        if count <= late:
            return
        part, self._waiting = rows[late:count], [rows[count:]] if count < len(rows) else []
        assert self._state is not None
        setting = self.setting(feeds)
        try:
            measured = self._measurements(feeds, until + AHEAD)
            samples, disturbances, gaps = self._bridged(part, log)
            self.gaps += gaps
            aiding = [*measured, *disturbances, self._noise.growth(part)]
            self._state, track = go_on(setting, self._state, samples, aiding)
        except DataError as error:
            self.failure = str(error)
            return
        self._last = part[-1].copy()
        self.past.add(track)
        self.siblings.take(setting, samples, aiding, track)

    def _from_start(self, rows: Array, log: Log) -> Array | None:
        """The rows from the start's epoch on: where the first ones are lost, with one as the last before it, and the gap behind it.

        None where late rows may still fill that gap, or where no row says how the vehicle moved before it.
        """
        self._interval = float(np.median(np.diff(rows[:FIRST, 0])))
        first, interval = float(rows[0, 0]), np.array([self._interval])
        before = float(log.earlier[-1, 0]) if len(log.earlier) else self.start.time
        lost = lost_after(self.start, first, self._interval)
        if not lost or not lack_rows(rows[:, 0], np.zeros(1, int), np.array([first - before]), interval)[0]:
            return rows
        if log.end - LATE <= first:
            return None
        if not len(log.earlier):
            self.failure = (
                f"the rows of the IMU begin {first - self.start.time:.3f} s after the start at {self.start.time:.3f} "
                "s: what the vehicle did until then is not known; push the rows before it as well, or align again"
            )
            return None
        self._first = row_before_gap(first, lost, self._interval, log.earlier[-1, 1:])[None]
        return np.vstack([self._first, rows])

    def _begin(self, rows: Array, feeds: Mapping[str, Feed], log: Log) -> None:
        """Make the loop ready, when enough rows are there to know their interval."""
        setting = self.setting(feeds)
        time = float(rows[0, 0]) - self._interval
        # The row that the epoch lies in:
        holding = log.earlier[-1] if time > self.start.time and len(log.earlier) else rows[0]
        row = np.append(time, holding[1:])
        start = carried_to(self.start, row, self._interval, increments=self.kind == "increments")
        if start is not self.start:
            self.start, self.siblings, self._last = start, Siblings(start), np.full(7, time)
        self._state = begin(setting, self.start, time, self._interval)
        if feeds:  # else errors grow as the start says
            self.siblings.begin(setting, time, self._interval)

    def _taken(self, log: Log) -> ImuRecord | None:
        """All rows that were taken; None where they are too few to begin anew with, or were added up, or the loop broke down."""
        first, last = np.searchsorted(log.rows[:, 0], (self.start.time, self.end), side="right")
        if self.failure or self._state is None or log.merged > 1 or last - first < FIRST:
            return None
        return log.record(self.start.time, self.end, before=self._first)

    def _look_back(self, feeds: Mapping[str, Feed], log: Log) -> None:
        """Take all rows so far anew, with errors of aids that last as these rows show them."""
        if (rows := self._taken(log)) is None:
            return
        aids = {key: feed.looked_at(self.end, self.mountings.get(key)) for key, feed in feeds.items()}
        shown = lasting_errors(rows, self.start, self._model(), self.altitude, self.spec, aids)
        before = (self.shown.slow, self.shown.mountings, self.shown.converging)
        if shown.stamps or any((shown.slow, shown.mountings, shown.converging, *before)):
            self._take_anew(rows, shown, feeds, log)

    def _glance(self, feeds: Mapping[str, Feed]) -> None:
        """Count the scatter of a receiver's stamps from now on, where innovations show it by now: no row is taken anew."""
        if self.shown.stamps or self.failure or (track := self.past.track) is None:
            return
        self._glances += 1
        seen = replace(track, residuals=self.past.newest(NEWEST))
        if stamps := stamp_scatter(seen, self.setting(feeds).sources, 0.0, self._glances):
            said = [*self.shown.said, *stamp_notes(stamps)]
            self.shown = self.shown._replace(stamps=stamps, said=said, since=self._glanced + AHEAD)

    def _take_anew(self, rows: ImuRecord, shown: Shown, feeds: Mapping[str, Feed], log: Log) -> None:
        """Take all rows so far anew, by these errors of aids that last and by all sources that there are now."""
        before = vars(self).copy()
        notes, waiting = self.past.notes, self._waiting
        self.shown = shown
        self._anew()
        self.past.notes = notes
        self._waiting = [np.column_stack([rows.time, rows.gyro, rows.accel])]
        self._advance(float(rows.time[-1]), feeds, log)
        self._waiting += waiting
        if self.failure:  # it broke down with these errors: as before
            vars(self).update(before)

    def _bridged(self, rows: Array, log: Log) -> tuple[ImuRows, list[Aiding], list[Gap]]:
        begins = self.end == self.start.time
        coming = np.sort(np.concatenate([np.empty(0), *(block[:, 0] for block in self._waiting)]))
        coming = coming[coming > rows[-1, 0]]
        return bridged(rows, self._last, coming, self._interval, log, begins=begins)

    def _measurements(self, feeds: Mapping[str, Feed], until: float) -> list[Aiding]:
        """New ones of all feeds up to a time; those of a feed whose rows cannot be are left out."""
        found: list[Aiding] = []
        for key, feed in feeds.items():
            try:
                sent = self._sent.setdefault(key, {})
                given, later = self.mountings.get(key), self.shown.mountings.get(key)
                found += feed.measurements(self.altitude, given, sent, self.start.time, until, later, self.shown.on)
            except DataError as error:
                self.past.note(key, str(error))
        known = {source.name for source in self.setting(feeds).sources}
        self._more |= any(source.name not in known for source in found)
        return [source for source in found if source.name in known]

    def now(self, feeds: Mapping[str, Feed], log: Log) -> tuple[Track, Sequence[Track], float] | None:
        """One epoch: the loop carried over the rows that wait, which it does not take; siblings there, and how far they were."""
        if self._state is None:
            return None
        setting = self.setting(feeds)
        waiting = np.vstack(self._waiting) if self._waiting else np.empty((0, 7))
        waiting = waiting[waiting[:, 0] > self.end]
        # A gap too long to bridge ends it, unless late rows fill it: the answer holds before it.
        waiting = unbroken(waiting, self._last, self._interval, begins=self.end == self.start.time)
        samples, found = None, self.past.last
        if len(waiting) and not self.failure:
            samples, disturbances, _ = self._bridged(waiting, log)
            found = go_on(setting, self._state, samples, disturbances, last=True)[1][-1:]
        if found is None:
            return None
        return found, self.siblings.now(setting, float(found.time[0]), samples), self.siblings.most

    def settle(self, feeds: Mapping[str, Feed]) -> None:
        """Let the loops of other starts take all that this one has taken."""
        if self._state is not None:
            self.siblings.settle(self.setting(feeds))
