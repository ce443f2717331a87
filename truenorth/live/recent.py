"""The newest rows as they came, in blocks: what a new solution, or a drive that is noticed late, has to go through again."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 256  # rows, up to which smaller blocks are put together


class Recent:
    """Blocks of rows ``time, gyro (3), accel (3)`` in the order in which they came."""

    def __init__(self) -> None:
        self._blocks: deque[Array] = deque()
        self._open = np.empty((BLOCK, 7))  # a block that is being filled
        self._count = 0

    def add(self, rows: Array) -> None:
        """Take rows in."""
        count = self._count + len(rows)
        if count > BLOCK:
            self._settle()
            if len(rows) >= BLOCK:
                self._blocks.append(rows)
                return
            count = len(rows)
        self._open[self._count : count] = rows
        self._count = count

    def forget(self, before: float) -> None:
        """Let blocks go whose rows are all older than this time, s."""
        while self._blocks and self._blocks[0][-1, 0] < before:
            self._blocks.popleft()

    def __iter__(self) -> Iterator[Array]:
        yield from self._blocks
        if self._count:
            yield self._open[: self._count].copy()

    def _settle(self) -> None:
        if self._count:
            self._blocks.append(self._open[: self._count].copy())
            self._count = 0
