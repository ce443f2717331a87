"""Solutions of the whole log, one after the other: in a thread of their own, within a share of one core, or at once."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from truenorth.alignment import Alignment
from truenorth.core.errors import AlignmentError, DataError
from truenorth.core.free_memory import give_back


class Solving:
    """Runs one solution at a time.

    Parameters
    ----------
    share : float
        Of one core; a solution waits until those before it have taken no more.
    background : bool
        In a thread. Without it :meth:`start` ends when the solution is there.
    """

    def __init__(self, share: float, background: bool) -> None:
        self._share = share
        self._pool = ThreadPoolExecutor(1, "align") if background else None
        self._running: Future[Alignment] | None = None
        self._cost, self._free_at = 0.0, 0.0

    @property
    def free(self) -> bool:
        """Whether a solution may begin."""
        return self._running is None and (self._pool is None or clock.monotonic() >= self._free_at)

    def start(self, solve: Callable[[], Alignment]) -> None:
        """Begin one."""
        if self._pool is not None:
            self._running = self._pool.submit(self._timed, solve)
            return
        self._running = Future()
        try:
            self._running.set_result(self._timed(solve))
        except (AlignmentError, DataError) as error:
            self._running.set_exception(error)

    def ready(self, *, first: bool) -> tuple[Alignment | None, str] | None:
        """The solution that has ended since the last call, or why there is none; None where nothing has ended.

        Parameters
        ----------
        first : bool
            It is the first one: it loads the compiled code as well, and is not counted.
        """
        if self._running is None or not self._running.done():
            return None
        running, self._running = self._running, None
        if not first:
            self._free_at = clock.monotonic() + self._cost * (1.0 / self._share - 1.0)
        try:
            return running.result(), ""
        except (AlignmentError, DataError) as error:
            return None, str(error)

    def end(self) -> None:
        """Wait for a running solution; none begins in a thread after it."""
        if self._pool is not None:
            self._pool.shutdown(wait=True)
            self._pool = None

    def _timed(self, solve: Callable[[], Alignment]) -> Alignment:
        begun = clock.thread_time()
        try:
            return solve()
        finally:
            self._cost = clock.thread_time() - begun
            give_back()
