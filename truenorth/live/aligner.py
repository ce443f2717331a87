"""`Aligner`: rows in, an answer at any time.

The procedure that aligns a whole log looks back: it fits the motion of the base and passes over the log more than once. It runs
again on all rows so far whenever the log has grown by a tenth, within a share of one core. Between two runs its filter goes on
about the last solution, and sigma comes down with every ten seconds; on the move the closed loop does, aided by what comes.
:meth:`Aligner.finish` is that procedure on all rows, so that the last answer is that of :func:`truenorth.align` on the same log, to
the bit as long as the rows fit into memory one by one (see :mod:`.log`).

With aiding sensors the regime is watched: as long as they say that the vehicle stays where it is, it is aligned as a base that
stays; once they say that it moves, as a vehicle on the move, from all rows. A master INS aligns it from the first row on. An IMU
that is turned, by an indexer or on a turntable, is aligned as such from the first row on; its answer is that of the last solution.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.aiding.aids import Positions
from truenorth.alignment import Alignment, align
from truenorth.alignment.rotary import SHORTEST
from truenorth.core.errors import AlignmentError, UsageError
from truenorth.core.free_memory import give_back
from truenorth.core.position import Position
from truenorth.estimate.gaps import LONGEST_BRIDGE
from truenorth.estimate.own_clock import moved_by
from truenorth.live.answer import Answer, under_way
from truenorth.live.feed import APART, Feed, shift_as
from truenorth.live.feeds import GnssFeed
from truenorth.live.felt import Felt, without_known
from truenorth.live.intake import LATE, Intake, as_rows
from truenorth.live.kept import keep, kept
from truenorth.live.known_feeds import FEEDS
from truenorth.live.log import MOST_ROWS, Kind, Log
from truenorth.live.navigator import Navigator
from truenorth.live.onward import RECENT, Onward, push
from truenorth.live.reasons import reasons_of
from truenorth.live.regime import Turner, aids_of, reach
from truenorth.live.solving import Solving
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.track import Residuals

Array = NDArray[np.float64]

FIRST = 20.0  # s of log before the first answer: a filter needs as much
GROWTH = 1.1  # times the length of the last solution, from which the next is due
SHARE = 0.1  # of one core, for solutions
# What a run goes on from; the rest is made anew from it.
KEPT = (
    "place", "imu", "method", "share", "feeds", "turner", "log", "intake", "failure", "solutions", "_due",
)  # fmt: skip
NOWHERE = "no place is given, and no fix has come"
MOVING = "the vehicle moves: more rows of the sensors that aid are waited for"


class Aligner:
    """Alignment while its log is still running: of a base that stays (still, shaken or swaying), and on the move.

    Parameters
    ----------
    place : Position, or (lat, lon[, alt]) in degrees and metres, optional
        Not needed with GNSS positions.
    imu : ImuSpec, str, path or mapping, optional
        Specification; on a base that stays it is inferred from the rows when left out.
    aid : sequence of Feed, Positions or Indexer
        Aiding sensors, whose rows come by :meth:`push_gnss`, :meth:`push_odometer`, :meth:`push_velocity` or their own `push`. One
        that is not named here begins with its first row, with the usual mounting. ``Positions()``: a turntable turns the IMU;
        ``Indexer(None)``: an indexer does, on a body that is still, without an encoder (with one: :class:`IndexerFeed`).
    kind : {"rates", "increments"}
        What a row is, see :class:`truenorth.ImuRecord`.
    method : str
        See :func:`truenorth.align`.
    share : float
        Of one core, that solutions may take.
    background : bool
        Solve in a thread of its own, so that :meth:`push` never waits. Without it a solution runs inside :meth:`push`, at times
        that depend on the rows alone.
    most_rows : int
        That are kept one by one, see :class:`truenorth.live.log.Log`.
    """

    def __init__(
        self,
        place: Position | Sequence[float] | None = None,
        imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
        *,
        aid: Sequence[Feed | Turner] = (),
        kind: Kind = "rates",
        method: Any = "auto",
        share: float = SHARE,
        background: bool = True,
        most_rows: int = MOST_ROWS,
    ) -> None:
        if not 0.0 < share <= 1.0:
            raise UsageError(f"share {share}; expected a part of one core above 0, at most 1")
        self.place = None if place is None else Position.of(place)
        self.imu: ImuSpec | None = None
        felt = Felt()
        if imu is not None:
            said = imu_spec(imu)
            felt, self.imu = Felt(said, kind), without_known(said)
        self.method, self.share = method, share
        self.feeds = {feed.key: feed for feed in aid if isinstance(feed, Feed)}
        self.turner = next((a for a in aid if isinstance(a, Turner)), None)
        self.log = Log(kind, most_rows)
        self.on_taken(None)
        self.intake = Intake(felt)
        self.onward = Onward(kind)
        self.failure = ""
        self.solutions = 0
        self._solving, self._newest_in = Solving(share, background), np.inf  # s: last row of the solution that runs
        self._due = self._then_due = -np.inf  # s: of the next solution, and of the one after the one that runs
        self._lock = threading.Lock()

    def __repr__(self) -> str:
        return f"Aligner({self.duration:.1f} s of rows, {self.solutions} solutions so far)"

    def push(self, time: ArrayLike, gyro: ArrayLike, accel: ArrayLike) -> None:
        """Take rows in; any order within a second, any chunks.

        Parameters
        ----------
        time : (K,) array or number, s
        gyro, accel : (K, 3) arrays or (3,)
            Body axes RFU, SI units; see :class:`truenorth.ImuRecord`.

        Raises
        ------
        UsageError
            Shapes that do not fit.
        """
        rows = as_rows(time, gyro, accel)
        with self._lock:
            for block in self.intake.sift(rows):
                self._take(block)
            self._collect()
            self._start_when_due()

    def on_taken(self, taken: Callable[[Array], None] | None) -> None:
        """Call this with each block of rows that is taken in from now on."""
        self._taken = taken or (lambda rows: None)

    def push_gnss(self, time: ArrayLike, lat: Any = None, lon: Any = None, alt: Any = None, **more: Any) -> None:
        """Take fixes in, see :meth:`GnssFeed.push`; they may come up to a second after the IMU's rows of their time."""
        self._feed("gnss").push(time, lat, lon, alt, **more)

    def push_odometer(self, time: ArrayLike, values: ArrayLike) -> None:
        """Take an odometer's rows in, see :meth:`OdometerFeed.push`: speeds, m/s, unless `aid` holds another one."""
        self._feed("odometer").push(time, values)

    def push_master(self, time: ArrayLike, C_nb: Any = None, v_n: Any = None, **more: Any) -> None:
        """Take rows of a master INS in, see :meth:`MasterFeed.push`."""
        self._feed("master").push(time, C_nb, v_n, **more)

    def push_indexer(self, time: ArrayLike, angles: ArrayLike) -> None:
        """Take angles of an indexer in, see :meth:`IndexerFeed.push`: rad, of the axes z and x unless `aid` holds other ones."""
        self._feed("indexer").push(time, angles)

    def push_velocity(self, time: ArrayLike, velocity: ArrayLike, sigma: ArrayLike | None = None) -> None:
        """Take a velocity log's rows in, see :meth:`VelocityFeed.push`: body axes, unless `aid` holds another one."""
        self._feed("velocity").push(time, velocity, sigma)

    def _feed(self, key: str) -> Any:
        return self.feeds.setdefault(key, FEEDS[key]())

    @property
    def first_answer(self) -> float:
        """Length of log from which there is an answer, s."""
        return SHORTEST if self._turned else FIRST

    @property
    def _turned(self) -> bool:
        """Whether something turns the IMU on a base that stays."""
        return self.turner is not None or "indexer" in self.feeds

    @property
    def left(self) -> float | None:
        """When the base began to leave its place, s; None as long as it stays."""
        return self.onward.left

    @property
    def residuals(self) -> tuple[Residuals, ...]:
        """The newest innovations of the loop, under way."""
        return () if self.onward.mover is None else self.onward.mover.residuals

    @property
    def duration(self) -> float:
        """Length of the log since its last gap that cannot be bridged, s."""
        if not len(self.log):
            return 0.0
        return self.log.end - self.log.start

    @property
    def answer(self) -> Answer | None:
        """What is known now; None before the first solution."""
        with self._lock:
            self._collect()
            return self.onward.answer(lambda at: reasons_of(self, at), self.intake.counts)

    def finish(self) -> Alignment:
        """Align all rows as :func:`truenorth.align` would; without a sensor that aids on the move, those before the base left.

        Raises
        ------
        AlignmentError, DataError
            As :func:`truenorth.align`.
        """
        self.close()
        aids = self._aids()
        left = None if aids else self.left
        if self._nowhere:
            raise AlignmentError(f"{NOWHERE}; expected a Position, or fixes of GNSS")
        if self._turned and not aids:
            raise AlignmentError("no angles of the indexer came; expected its encoder's rows")
        found = self._solve(self._record(aids, reach(aids) if left is None else left), aids)
        return self._take_over(found) if left is None else found

    def navigator(self, **options: Any) -> Navigator:
        """Go on from the best alignment there is (:meth:`finish`), without a gap.

        Parameters
        ----------
        **options
            Of :class:`Navigator`.

        Raises
        ------
        AlignmentError, DataError
            As :meth:`finish`; the heading may not be used.
        """
        found = self.finish()
        if self._turned and not isinstance(self.turner, Positions):
            raise UsageError(
                "navigation of an IMU that an indexer turns; expected an IMU that stands still in its body"
            )
        navigator = self.onward.navigator(found, self.feeds, **options)
        for block in self.onward.newest:
            push(navigator, block)
        return navigator

    def save(self, path: str | PathLike[str]) -> Path:
        """Write all that the run goes on from, whole or not at all; see :meth:`load`."""
        with self._lock:
            state = {name: getattr(self, name) for name in KEPT}
            return keep(path, "Aligner", {**state, "onward": self.onward.kept()})

    @classmethod
    def load(cls, path: str | PathLike[str], *, background: bool = True) -> Aligner:
        """The run that :meth:`save` wrote; the last answer is the same to the bit.

        Raises
        ------
        DataError
            No such file, a damaged one, or one of another kind.
        """
        state = kept(path, "Aligner")
        found = cls(state["place"], state["imu"], background=background, share=state["share"], method=state["method"])
        vars(found.onward).update(state.pop("onward"))
        vars(found).update(state)
        if (solution := found.onward.solution) is not None and under_way(solution):
            found._go_on(solution)
        return found

    def close(self) -> None:
        """Wait for a running solution, and let the thread end."""
        self._solving.end()
        self._collect()

    def __enter__(self) -> Aligner:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _take(self, block: Array) -> None:
        if not self.log.add(block):
            self.intake.counts.taken -= len(block)
            self.intake.counts.too_late += len(block)
            return
        self._taken(block)
        if self._lost(self.onward.solution) and self.log.end - self.log.start > LATE:
            self.onward.lose()
            self._due = -np.inf
        self.onward.add(block, min(self.log.end - RECENT, self._newest_in), self.log.last_gap)

    def _lost(self, found: Alignment | None) -> bool:
        """Whether a solution of a base that stays lies before a gap in the rows: what the base did in it, nobody knows."""
        return found is not None and not under_way(found) and found.time <= self.log.last_gap

    def _start_when_due(self) -> None:
        if not self._solving.free or self.duration < self.first_answer or self.log.end < self._due:
            return
        aids = self._aids()
        if self._nowhere:
            self.failure = NOWHERE
        if self._nowhere or (not aids and (self.left is not None or self._turned)):
            return
        if not aids and any(feed.moves_now for feed in self.feeds.values()):
            self.failure = self.failure if self.onward.solution else MOVING
            return
        record = self._record(aids, reach(aids))
        self._newest_in = float(record.time[-1])
        self._then_due = self.log.end + (GROWTH - 1.0) * max(self.duration, FIRST)
        self._solving.start(lambda: self._solve(record, aids))
        self._collect()

    def _aids(self) -> list[Any]:
        return aids_of(self.turner, self.feeds, self.log.end)

    def _record(self, aids: Sequence[Any], until: float = np.inf) -> ImuRecord:
        """The rows since the last gap that cannot be bridged."""
        since = self.log.last_gap if self.left is None else self.onward.gap_before
        if aids and not self._turned:
            time = self.log.rows[:, 0]
            wide = np.flatnonzero(np.diff(time) > LONGEST_BRIDGE)
            since = float(time[wide[-1]]) if wide.size else -np.inf
        return self.log.record(since, until)

    @property
    def _place(self) -> Position | None:
        """What is given, or the fixes of a base that stays."""
        gnss = self.feeds.get("gnss")
        return self.place or (gnss.place if isinstance(gnss, GnssFeed) else None)

    @property
    def _nowhere(self) -> bool:
        """Whether nothing says where this is."""
        return self._place is None and "master" not in self.feeds

    def _solve(self, record: ImuRecord, aids: Sequence[Any]) -> Alignment:
        place = self._place if self._turned or not aids else self.place
        return align(record, place, self.imu, aid=list(aids), method=self.method)

    def _collect(self) -> None:
        """Take over a solution that is ready."""
        ended = self._solving.ready(first=not self.solutions)
        if ended is None:
            return
        self._newest_in, self._due = np.inf, self._then_due
        found, self.failure = ended
        if found is None:
            before = self.onward.solution
            # The vehicle moves, and cannot be aligned yet: that as a base it did not stay is no answer any more.
            if before is not None and not under_way(before) and before.status == "inconsistent" and self._aids():
                self.onward.lose()
            return
        self.solutions += 1
        if under_way(found) or (self.left is None and not self._lost(found)):
            self._take_over(found)
        self.onward.newest.forget(self.log.end - RECENT)
        give_back()  # the rows that came meanwhile, and what the solution before held

    def _take_over(self, found: Alignment) -> Alignment:
        """Go on from a solution, and give it back with how far rows are moved in all: those that come are moved as its were."""
        said = [item for item in found.evidence if item.key not in APART]
        shift_as(found, self.feeds)
        gnss = self.feeds.get("gnss")
        said += [] if gnss is None else moved_by(gnss.offset)
        found = replace(found, evidence=tuple(said))
        self._go_on(found)
        return found

    def _go_on(self, found: Alignment) -> None:
        self.onward.take_over(found, self.feeds, turned=self._turned, gap=self.log.last_gap)
