"""`Navigator`: from an alignment onward while the log is still running; attitude, velocity and place at any time.

The closed loop of :func:`truenorth.navigate`, fed as rows come. Rows of the last second wait for measurements that come late; an
answer carries the loop over them without taking them, so that it holds at the newest row. Whatever the chunks, the loop gives the
same bits; :meth:`Navigator.finish` is :func:`truenorth.navigate` on all rows.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Aid, Gnss
from truenorth.alignment import Alignment
from truenorth.core.errors import DataError, UsageError
from truenorth.estimate.rivals import counted_once
from truenorth.live.answer import Answer, Motion
from truenorth.live.feed import Feed
from truenorth.live.felt import Felt, without_known
from truenorth.live.intake import LATE, Intake, as_rows, finite_and_small
from truenorth.live.kept import keep, kept
from truenorth.live.log import MOST_ROWS, Kind, Log
from truenorth.live.loop import Loop
from truenorth.live.past import Past
from truenorth.navigation import Navigation, navigate
from truenorth.navigation.by_start import unsure_heading
from truenorth.navigation.curve import with_curve
from truenorth.navigation.given import arm_as_begun, kept_altitude, mountings_found
from truenorth.navigation.procedure import FINE
from truenorth.navigation.result import Altitude, judged_navigation, last_sigma
from truenorth.navigation.start import acting_at_rest, start_of
from truenorth.quality.absolute import known_as_followed
from truenorth.quality.innovations import innovation_evidence
from truenorth.records.base import Late
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, note
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

# What a run goes on from; the rest is made anew from it.
KEPT = (
    "start",
    "spec",
    "_given",
    "_imu",
    "_imu_source",
    "feeds",
    "_mountings",
    "altitude",
    "intake",
    "log",
    "output",
    "_loop",
)
STEP = 0.25  # s: rows are taken in blocks of this length, or when an answer is asked for
NEWEST = 1000  # rows of a receiver that say how well a fix is known


class Navigator:
    """Navigation while its log is still running.

    Parameters
    ----------
    start : Alignment, Start, or path
        See :func:`truenorth.navigate`; rows up to its epoch are passed over.
    imu : ImuSpec or str, optional
        Specification; the alignment's own when left out.
    feeds : sequence of Feed
        Aiding sensors; the caller pushes their rows.
    mountings : mapping of str to Mounting, optional
        Of feeds to which none is given, by their keys; left out: as an alignment on the move has found them.
    altitude : {"fixed", "free", "baro", "gnss"}, optional
        By default what the feeds allow.
    kind : {"rates", "increments"}
        What a row is.
    output : float, s
        Between two epochs of the track.
    most_rows : int
        Kept one by one, see :class:`truenorth.live.log.Log`.
    """

    first_answer = 0.0
    solutions = 1

    def __init__(
        self,
        start: Alignment | Start | str | PathLike[str],
        imu: ImuSpec | str | None = None,
        *,
        feeds: Sequence[Feed] = (),
        mountings: Mapping[str, Mounting] | None = None,
        altitude: Altitude | None = None,
        kind: Kind = "rates",
        output: float = 1.0,
        most_rows: int = MOST_ROWS,
    ) -> None:
        self.start, spec, self._imu_source = start_of(start, imu)
        felt, self.spec = Felt(spec, kind), without_known(spec)
        self._given, self._imu = start, imu
        self.solution = start if isinstance(start, Alignment) else None
        self.feeds = {feed.key: feed for feed in feeds if feed.navigates}
        self._mountings = mountings_found(self.start) | dict(mountings or {})
        self.start = arm_as_begun(self.start, self._mountings.get(Gnss.key))
        dummies: dict[str, Aid] = {key: feed.aid_of(feed.dummy()) for key, feed in self.feeds.items()}
        self.altitude, self._why = kept_altitude(altitude, dummies)
        self.intake, self.log = Intake(felt), Log(kind, most_rows)
        self.output = output
        self._loop = Loop(self.start, self.spec, kind, self.altitude, output, self._mountings)
        self.on_taken(None)
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        return f"Navigator({self.duration:.1f} s of rows since the start)"

    def push(self, time: ArrayLike, gyro: ArrayLike, accel: ArrayLike) -> None:
        """Take rows in; any order within a second, any chunks. See :meth:`Aligner.push`.

        Raises
        ------
        UsageError
            Shapes that do not fit.
        """
        rows = as_rows(time, gyro, accel)
        passed = rows[:, 0] - self.intake.felt.late <= self.start.time
        with self._lock:
            if passed.any() and not self._loop.begun:
                sound = passed & np.logical_and(*finite_and_small(rows))
                self.log.passed_over(rows[sound] - self.intake.felt.late * np.eye(7)[0])
            rows = rows[~passed]
            for block in self.intake.sift(rows):
                if not self.log.add(block):
                    self.intake.counts.taken -= len(block)
                    self.intake.counts.too_late += len(block)
                    continue
                self._taken(block)
                self._loop.add(block)
            if self.log.end - LATE - self._loop.end > STEP:
                self._advance()

    def on_taken(self, taken: Callable[[Array], None] | None) -> None:
        """Call this with each block of rows from now on."""
        self._taken = taken or (lambda rows: None)

    def _advance(self) -> None:
        self._loop.advance(self.log.end - LATE, self.feeds, self.log)

    @property
    def failure(self) -> str:
        """Why the run is at its end; empty while it goes on."""
        return self._loop.failure

    @property
    def past(self) -> Past:
        """What the loop has put out."""
        return self._loop.past

    @property
    def residuals(self) -> tuple[Residuals, ...]:
        """The newest innovations of each source."""
        return self.past.residuals

    @property
    def duration(self) -> float:
        """Since the start, s."""
        return max(0.0, self.log.end - self.start.time)

    @property
    def answer(self) -> Answer | None:
        """Where the vehicle is now, at the newest row; None before the first rows."""
        with self._lock:
            self._advance()
            found = self._loop.now(self.feeds, self.log)
        if found is None:
            return None
        result = self._judged(*found)
        track = result.track
        return Answer(
            time=float(track.time[-1]),
            C_nb=track.C_nb[-1],
            sigma=result.euler_sigma[-1],
            floor=np.zeros(3),
            status="lost" if self.failure else result.status,
            reasons=self._reasons(result),
            solution=self.solution,
            counts=self.intake.counts,
            motion=Motion.known(track.v_n[-1], track.position[-1], track.sigma[-1]),
        )

    @property
    def missing(self) -> DataError | None:
        """What is raised where nothing can be navigated yet: the rows end with the alignment; None from the second row on."""
        if len(self.log) > 1:
            return None
        return DataError(f"navigation: fewer than two rows came after the alignment at {self.start.time:.3f} s")

    def finish(self) -> Navigation:
        """Navigate all rows, as :func:`truenorth.navigate` would; where they are kept one by one no longer, the loop's own track.

        Raises
        ------
        DataError
            As :func:`truenorth.navigate`; fewer than two rows; lost before the first epoch.
        """
        if (missing := self.missing) is not None:
            raise missing
        if self.log.merged == 1 and not self.failure:
            came = {key: feed.until(self.log.end, self._mountings.get(key)) for key, feed in self.feeds.items()}
            aids = {key: aid for key, aid in came.items() if aid is not None}
            found = navigate(
                self.log.record(before=self.log.earlier),
                self._given,
                aid=list(aids.values()),
                altitude=self._kept_with(aids),
                imu=self.spec if self.intake.felt.known else self._imu,
                interval=FINE,
                output=self.output,
            )
            silent = [note("feed.silent", name=key) for key, aid in came.items() if aid is None]
            return replace(found, evidence=(*found.evidence, *silent))
        with self._lock:
            last = self._loop.now(self.feeds, self.log)
            if last is None:
                raise DataError(self.failure)
            track, siblings, _ = last
            return self._judged(self.past.with_end(track), self._loop.siblings.along(siblings))

    def _kept_with(self, aids: Mapping[str, Aid]) -> Altitude | None:
        """How height is kept: as in the loop; where its sensor brought no height, as the aids allow."""
        try:
            return kept_altitude(self.altitude, aids)[0]
        except UsageError:
            return None

    def save(self, path: str | PathLike[str]) -> Path:
        """Write all that the run goes on from, whole or not at all; see :meth:`load`."""
        with self._lock:
            self._loop.settle(self.feeds)
            return keep(path, "Navigator", {name: getattr(self, name) for name in KEPT})

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Navigator:
        """The run that :meth:`save` wrote: it goes on to the same bits.

        Raises
        ------
        DataError
            No such file, a damaged one, or one of another kind.
        """
        state = kept(path, "Navigator", KEPT)
        feeds, mountings = list(state["feeds"].values()), state["_mountings"]
        start = state["_given"] or state["start"]
        found = cls(
            start,
            state["_imu"] if state["_given"] else state["spec"],
            feeds=feeds,
            mountings=mountings,
            altitude=state["altitude"],
        )
        vars(found).update(state)
        found._given = start
        return found

    def close(self) -> None:
        """Nothing runs on."""

    # The verdict

    def _judged(self, track: Track, siblings: Sequence[Track], most: float = 0.0) -> Navigation:
        """The verdict on the loop's track, position known no better than by a fix where nobody spoke of slow errors.

        Heading is known no better than siblings leave it; `most`: how far they were before this track.
        """
        if self._loop.begun:
            track = with_curve(track, self._loop.setting(self.feeds).sources)
        track = replace(track, residuals=self.past.residuals)
        feed, found = self.feeds.get(Gnss.key), self._loop.shown.mountings.get(Gnss.key)
        receiver = None if feed is None else feed.newest(NEWEST, self._mountings.get(Gnss.key), found)
        wanders: list[Evidence] = []
        if isinstance(receiver, Gnss):
            track, wanders = known_as_followed(track, receiver, self.altitude, self.start, self._loop.shown.slow)
        slow = {str(item.figures["name"]) for item in wanders}
        evidence = [
            *innovation_evidence(track.residuals, last_sigma(track), in_sigma=slow),
            *wanders,
            *self._loop.shown.said,
            *self._why,
        ]
        gaps, late = tuple(self._loop.gaps), dict[str, Late]()
        how = (self.altitude, False, gaps, 0, self._imu_source, "live", late, None)
        result = Navigation("navigated", (), track, *how, *acting_at_rest(self.start, self.spec))
        growth = None
        if siblings:
            others = self._loop.siblings.others
            growth = others.growth(track, others.moved(track, siblings), most)
            evidence += unsure_heading(track, growth)
        return judged_navigation(result, counted_once(evidence), growth)

    def _reasons(self, result: Navigation) -> tuple[str, ...]:
        more = [self.failure, self.intake.counts.words(), *self.past.notes.values()]
        return (*result.reasons, *(text for text in more if text))

    def __enter__(self) -> Navigator:
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()
