"""Rows as they come, sifted: what is no number, too large, repeated, too late or of another clock is counted and left out.

A sound row goes through at once. A row that is later than expected by more than `JUMP` waits until the rows after it show
whether time has really gone on (a gap) or whether it was a stray of another clock; no sound row is lost by that.
"""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.live.felt import Felt

Array = NDArray[np.float64]

LARGEST_RATE = 200.0  # rad/s: above 11000 deg/s, beyond every gyro of a vehicle
LARGEST_FORCE = 5000.0  # m/s^2: 500 g
LATE = 1.0  # s: a row may stand so long behind a newer one
JUMP = 10.0  # s: a step ahead that has to be confirmed
CONFIRMED = 20  # rows that go on from the step


@dataclass
class Counts:
    """What became of the rows.

    Attributes
    ----------
    taken : int
    reordered : int
        Taken, though they came after a row of later time.
    not_finite, too_large, repeated, too_late, other_clock : int
        Left out.
    """

    taken: int = 0
    reordered: int = 0
    not_finite: int = 0
    too_large: int = 0
    repeated: int = 0
    too_late: int = 0
    other_clock: int = 0

    @property
    def left_out(self) -> int:
        """How many rows were not taken."""
        return self.not_finite + self.too_large + self.repeated + self.too_late + self.other_clock

    def words(self) -> str:
        """What was left out or put in order, such as ``3 rows not finite, 1 row repeated``; empty where nothing was."""
        found = {name.replace("_", " "): count for name, count in asdict(self).items() if name != "taken" and count}
        return ", ".join(f"{count} row{'s' * (count > 1)} {name}" for name, count in found.items())


def as_rows(time: ArrayLike, gyro: ArrayLike, accel: ArrayLike) -> Array:
    """(K, 7) rows ``time, gyro (3), accel (3)`` of one row or many.

    Raises
    ------
    UsageError
        Shapes that do not fit.
    """
    try:
        times, rates, forces = (np.asarray(values, dtype=np.float64) for values in (time, gyro, accel))
    except (ValueError, TypeError):
        fits = False
    else:
        shapes = ((times.size, 3), (3,) if times.size == 1 else (times.size, 3))
        fits = times.ndim <= 1 and rates.shape in shapes and forces.shape in shapes
    if not fits:
        raise UsageError(
            f"rows of shapes {np.shape(time)}, {np.shape(gyro)}, {np.shape(accel)}; expected (K,), (K, 3) and (K, 3)"
        )
    rows = np.empty((times.size, 7))
    rows[:, 0], rows[:, 1:4], rows[:, 4:] = times, rates, forces
    return rows


def finite_and_small(rows: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which rows (K, 7) are finite, and which hold what a sensor may measure."""
    with np.errstate(invalid="ignore"):
        small = (np.abs(rows[:, 1:4]) < LARGEST_RATE).all(axis=1) & (np.abs(rows[:, 4:]) < LARGEST_FORCE).all(axis=1)
    return np.asarray(np.isfinite(rows).all(axis=1)), np.asarray(small)


class Intake:
    """Sifts rows ``time, gyro (3), accel (3)`` in SI units.

    Parameters
    ----------
    felt : Felt, optional
        Takes off what a specification says of the rows: lags, by which stamps become earlier, and places of accelerometers.
    """

    felt = Felt()  # of a run that was kept before there were any

    def __init__(self, felt: Felt | None = None) -> None:
        self.felt = felt or Felt()
        self.counts = Counts()
        self._newest = -np.inf
        self._recent: deque[Array] = deque()  # times of the blocks of the last `LATE` seconds
        self._ahead: list[Array] = []  # rows beyond a jump, not yet confirmed

    def sift(self, rows: Array) -> list[Array]:
        """Sound rows in blocks of ascending time; a block that begins before the newest row so far is to be sorted in.

        Parameters
        ----------
        rows : (K, 7) array
        """
        return [self.felt.corrected(block) for block in self._sifted(self._sound(rows))]

    def _sifted(self, sound: Array) -> list[Array]:
        if not len(sound):
            return []
        if not self._ahead and self._goes_on(sound[:, 0]):
            self._take(sound)
            return [sound]
        blocks: list[Array] = []
        for row in sound:
            blocks += self._one(row)
        return blocks

    def _goes_on(self, time: Array) -> bool:
        """Whether rows follow the newest one and each other without a jump."""
        first = float(time[0])
        if not (first > self._newest and (first - self._newest < JUMP or self._newest == -np.inf)):
            return False
        if len(time) == 1:
            return True
        steps = time[1:] - time[:-1]
        return float(steps.min()) > 0.0 and float(steps.max()) < JUMP

    def _sound(self, rows: Array) -> Array:
        if np.abs(rows[:, 1:]).max(initial=0.0) < LARGEST_RATE and np.isfinite(rows[:, 0]).all():  # NaN is not below
            return rows
        finite, small = finite_and_small(rows)
        self.counts.not_finite += int(np.sum(~finite))
        self.counts.too_large += int(np.sum(finite & ~small))
        return rows[finite & small]

    def _take(self, rows: Array) -> None:
        self.counts.taken += len(rows)
        self._newest = max(self._newest, float(rows[-1, 0]))
        self._recent.append(rows[:, 0])
        while self._recent[0][-1] < self._newest - LATE:
            self._recent.popleft()

    def _one(self, row: Array) -> list[Array]:
        time = float(row[0])
        if time - self._newest >= JUMP and self._newest > -np.inf:
            return self._beyond(row)
        if self._ahead and time > self._newest:  # the old clock goes on: what jumped was another one
            self.counts.other_clock += len(self._ahead)
            self._ahead = []
        if any(time in block for block in self._recent):
            self.counts.repeated += 1
            return []
        if time <= self._newest - LATE:
            self.counts.too_late += 1
            return []
        self.counts.reordered += time < self._newest
        block = row[None, :]
        self._take(block)
        return [block]

    def _beyond(self, row: Array) -> list[Array]:
        if self._ahead and not 0.0 < row[0] - self._ahead[-1][0] < JUMP:
            self.counts.other_clock += len(self._ahead)
            self._ahead = []
        self._ahead.append(row)
        if len(self._ahead) < CONFIRMED:
            return []
        block = np.array(self._ahead)
        self._ahead = []
        self._take(block)
        return [block]
