"""`Aligner`: rows in, an answer at any time.

The procedure that aligns a whole log looks back: it fits the motion of the base and passes over the log more than once. It runs
again on all rows so far whenever the log has grown by a tenth, within a share of one core; between two runs the gyros carry the
last answer on, and its uncertainty with it. :meth:`Aligner.finish` is that procedure on all rows, so that the last answer is that
of :func:`truenorth.align` on the same log, to the bit as long as the rows fit into memory one by one (see :mod:`.log`).
"""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.alignment import Alignment, align
from truenorth.core.attitude import euler_from_dcm, euler_sigma
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.position import Position
from truenorth.live.carry import Carry
from truenorth.live.intake import Counts, Intake
from truenorth.live.log import MOST_ROWS, Kind, Log
from truenorth.live.remaining import seconds_to
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec, imu_spec

Array = NDArray[np.float64]

FIRST = 20.0  # s of log before the first answer: a filter needs as much
GROWTH = 1.1  # times the length of the last solution, from which the next is due
SHARE = 0.1  # of one core, for solutions
SETTLED = 20.0  # s after a solution, from which a drive that began in its rows would have been noticed


@dataclass(frozen=True)
class Answer:
    """What is known now.

    Attributes
    ----------
    time : float, s
        Of the newest row.
    C_nb : (3, 3) array
    sigma, floor : (3,) arrays, rad
        Of heading, pitch, roll; the floor is the part that waiting does not improve.
    status : str
        Of the last solution, see :class:`truenorth.Alignment`.
    reasons : tuple of str
    solution : Alignment
        The last one, at its own epoch.
    counts : Counts
        Rows taken and left out.
    left : float or None, s
        When the base began to leave its place; the solution ends there, and the gyros carry it on.
    """

    time: float
    C_nb: Array
    sigma: Array
    floor: Array
    status: str
    reasons: tuple[str, ...]
    solution: Alignment
    counts: Counts
    left: float | None = None

    @property
    def euler(self) -> Array:
        """(3,) heading, pitch, roll, rad."""
        return np.array(euler_from_dcm(self.C_nb))

    @property
    def heading_known(self) -> bool:
        """Whether the heading may be used."""
        return self.status == "aligned"

    def remaining(self, goal: float) -> float | None:
        """Seconds until the one-sigma heading error comes down to `goal` (rad); 0: it has; None: it will not."""
        return seconds_to(self.solution, float(self.sigma[0]), goal, self.time)

    def summary(self) -> dict[str, Any]:
        """One flat dictionary in degrees, ready for JSON; a heading that may not be used is None."""
        heading, pitch, roll = np.degrees(self.euler)
        heading_sigma, pitch_sigma, roll_sigma = np.degrees(self.sigma)
        return {
            "time_s": self.time,
            "status": self.status,
            "heading_deg": float(heading) if self.heading_known else None,
            "pitch_deg": float(pitch),
            "roll_deg": float(roll),
            "heading_sigma_deg": float(heading_sigma),
            "pitch_sigma_deg": float(pitch_sigma),
            "roll_sigma_deg": float(roll_sigma),
            "heading_sigma_floor_deg": float(np.degrees(self.floor[0])),
            "solution_time_s": self.solution.time,
            "reasons": list(self.reasons),
            "rows": self.counts.taken,
            "rows_left_out": self.counts.left_out,
        }


class Aligner:
    """Alignment of a base that stays where it is (still, shaken or swaying), while its log is still running.

    Parameters
    ----------
    place : Position
    imu : ImuSpec, str, path or mapping, optional
        Specification; inferred from the rows when left out.
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
    taken : callable, optional
        Called with each block of rows that is taken in.
    """

    def __init__(
        self,
        place: Position,
        imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
        *,
        kind: Kind = "rates",
        method: Any = "auto",
        share: float = SHARE,
        background: bool = True,
        most_rows: int = MOST_ROWS,
        taken: Callable[[Array], None] | None = None,
    ) -> None:
        if not 0.0 < share <= 1.0:
            raise UsageError(f"share {share}; expected a part of one core above 0, at most 1")
        self.place, self.imu, self.method, self.share = place, None if imu is None else imu_spec(imu), method, share
        self.log = Log(kind, most_rows)
        self._taken = taken or (lambda rows: None)
        self.intake = Intake()
        self.left: float | None = None
        self.failure = ""
        self.solutions = 0
        self._solution: Alignment | None = None
        self._carry: Carry | None = None
        self._earlier: Carry | None = None  # of the solution before, which knows no row of a drive that has just begun
        self._recent: list[Array] = []  # blocks since the running solution was begun
        self._pool = ThreadPoolExecutor(1, "align") if background else None
        self._running: Future[Alignment] | None = None
        self._due, self._cost, self._free_at = FIRST, 0.0, 0.0
        self._lock = threading.Lock()

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
        times = np.atleast_1d(np.asarray(time, dtype=np.float64))
        try:
            rows = np.column_stack([times, np.atleast_2d(gyro), np.atleast_2d(accel)]).astype(np.float64)
        except (ValueError, TypeError):
            rows = np.empty((0, 0))
        if rows.shape != (len(times), 7):
            raise UsageError(
                f"rows of shapes {np.shape(time)}, {np.shape(gyro)}, {np.shape(accel)}; expected (K,), (K, 3) and (K, 3)"
            )
        with self._lock:
            for block in self.intake.sift(rows):
                self._take(block)
            self._collect()
            self._start_when_due()

    @property
    def first_answer(self) -> float:
        """Length of log from which there is an answer, s."""
        return FIRST

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
            at, carry = self._solution, self._carry
            if at is None or carry is None:
                return None
            carry.advance()
            C_nb, phi = carry.C_nb, carry.phi_covariance
            return Answer(
                time=carry.time,
                C_nb=C_nb,
                sigma=euler_sigma(C_nb, phi),
                floor=np.asarray(at.euler_sigma_floor),
                status=at.status,
                reasons=self._reasons(at),
                solution=at,
                counts=self.intake.counts,
                left=self.left,
            )

    def finish(self) -> Alignment:
        """Align all rows (those before the base left its place), as :func:`truenorth.align` would.

        Raises
        ------
        AlignmentError, DataError
            As :func:`truenorth.align`.
        """
        self.close()
        found = self._solve(self._record(np.inf if self.left is None else self.left))
        if self.left is None:
            self._solution, self._carry = found, Carry(found, self.log.source_kind)
        return found

    def close(self) -> None:
        """Wait for a running solution, and let the thread end."""
        if self._pool is not None:
            self._pool.shutdown(wait=True)
            self._collect()
            self._pool = None

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
        if self._running is not None:
            self._recent.append(block)
        for carry in (self._earlier, self._carry):
            if carry is None:
                continue
            carry.add(block)
            if self.left is None and carry.left is not None:
                self.left, self._carry = carry.left, carry
                self._solution = carry.solution

    def _start_when_due(self) -> None:
        if self._running is not None or self.left is not None or self.duration < self._due:
            return
        if self._pool is not None and clock.monotonic() < self._free_at:
            return
        self._recent = []
        record = self._record()
        if self._pool is not None:
            self._running = self._pool.submit(self._solve, record)
            return
        self._running = Future()
        try:
            self._running.set_result(self._solve(record))
        except (AlignmentError, DataError) as error:
            self._running.set_exception(error)
        self._collect()

    def _record(self, until: float = np.inf) -> ImuRecord:
        """The rows since the last gap that cannot be bridged."""
        return self.log.record(self.log.last_gap, until)

    def _solve(self, record: ImuRecord) -> Alignment:
        begun = clock.thread_time()
        try:
            return align(record, self.place, self.imu, method=self.method)
        finally:
            self._cost = clock.thread_time() - begun

    def _collect(self) -> None:
        """Take over a solution that is ready."""
        if self._running is None or not self._running.done():
            return
        running, self._running = self._running, None
        if self.solutions:  # the first one loads the compiled code as well
            self._free_at = clock.monotonic() + self._cost * (1.0 / self.share - 1.0)
        self._due = GROWTH * max(self.duration, FIRST)
        try:
            found = running.result()
        except (AlignmentError, DataError) as error:
            self.failure = str(error)
            return
        self.failure, self.solutions = "", self.solutions + 1
        if self.left is not None:
            return
        self._solution = found
        if self._earlier is None or self._carry is None or self._carry.elapsed > SETTLED:
            self._earlier = self._carry
        self._carry = Carry(found, self.log.source_kind)
        for block in self._recent:
            self._carry.add(block)
        self._recent = []

    def _reasons(self, at: Alignment) -> tuple[str, ...]:
        more = []
        if self.left is not None:
            more.append(
                f"the base left its place at {self.left:.1f} s: the heading is that of the rows until then, carried on by the gyros"
            )
        found = self.intake.counts.words()
        if found:
            more.append(found)
        if self.log.merged > 1:
            more.append(f"the log is long: rows are kept as increments over {self.log.merged} of them")
        if self.failure:
            more.append(self.failure)
        return (*at.reasons, *more)
