"""The first alignment on a computer: a second process compiles what comes last, while this one compiles what comes first.

An alignment of a base waits for its kernels one after the other. Those of its end, the Kalman filter with the states of a
sway among them, depend on nothing that comes before. Where the two processes meet, one waits for the other's kernel
(:mod:`truenorth.core.kernel_lock`).
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

LAST = "truenorth.alignment.summed_back.sum_back"  # where it is on the disk, no first alignment waits any more
SWAY_STATES = 39  # of a base with two oscillations along each axis; what is padded to the same size shares its kernel
STATES = 12  # of a base that stays
NAME = "ahead"  # of the lock that a second process holds
EPOCHS, ROWS = 2, 3  # of nothing
CODE = "from truenorth.cli.ahead import compile_last; compile_last()"


def compile_ahead() -> None:
    """Start the second process, where the kernels are not on the disk and there is a second processor for it.

    It ends with this process, but for the kernel that it is at: it reads a pipe that nobody writes to. A process that has been
    started by another of its kind starts none: `truenorth warm` has one for each processor as it is.
    """
    from truenorth.core.kernel_folder import write_folder
    from truenorth.core.kernel_lock import KernelLock

    if "multiprocessing" in sys.modules and sys.modules["multiprocessing"].parent_process() is not None:
        return
    folder = write_folder()
    if folder is None or (os.cpu_count() or 1) < 2 or next(folder.glob(f"{LAST}-*.kernel"), None) is not None:
        return
    if KernelLock(folder / NAME).taken() or _ships():  # of another first command
        return
    silent = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, "-c", CODE], stdin=subprocess.PIPE, stdout=silent, stderr=silent)
    _running.append(process)


def _ships() -> bool:
    """Whether the last kernel comes with the package, of these sources and for this processor."""
    from truenorth.core.processor import folder_of, shipped_level

    level = shipped_level()
    if not level or next(folder_of(level).glob(f"{LAST}-*"), None) is None:
        return False
    from truenorth.alignment.summed_back import sum_back

    return sum_back.is_there(*_of_last())


def _of_last() -> tuple[Any, ...]:
    """Arguments of the kinds that the last kernel is called with."""
    import numpy as np

    cube = np.zeros((1, 1, 1))
    of_gains = (cube, cube, cube, cube)
    return (of_gains, cube, np.zeros((1, 1)), cube, np.zeros(1, dtype=np.int64), cube, cube)


_running: list[subprocess.Popen[bytes]] = []  # held: the pipe would be closed with the object


def compile_last() -> None:
    """What runs in the second process; ends it behind the kernel in which the first one ends."""
    from truenorth.core.kernel_folder import write_folder
    from truenorth.core.kernel_lock import KernelLock

    left_alone = threading.Event()
    threading.Thread(target=_wait_for_end, args=(left_alone,), daemon=True).start()
    folder = write_folder()
    lock = None if folder is None else KernelLock(folder / NAME)
    if lock is not None:
        lock.take()
    try:
        for job in JOBS:
            if left_alone.is_set():
                break
            job()
    finally:
        if lock is not None:
            lock.release()


def _wait_for_end(left_alone: threading.Event) -> None:
    sys.stdin.buffer.read()
    left_alone.set()
    with suppress(AttributeError, OSError):  # not a Unix
        os.setpriority(os.PRIO_PROCESS, os.getpid(), 10)  # not of this thread alone


def _filtered(states: int) -> tuple[Any, Any]:
    """A system without information, and what the filter makes of it."""
    import numpy as np

    from truenorth.filters import LinearSystem, kalman

    K, n, m = EPOCHS, states, ROWS
    Phi, R = np.tile(np.eye(n), (K, 1, 1)), np.tile(np.eye(m), (K, 1, 1))
    H, S = np.zeros((K, m, n)), np.zeros((K, n, m))
    system = LinearSystem(Phi, Phi, H, R, np.zeros((K, m)), np.zeros(n), np.eye(n), S=S)
    return system, kalman(system, history="full")


def filter_sway() -> None:
    """The filter; a base that stays takes the same kernel where its own is not there."""
    _filtered(SWAY_STATES)


def sway() -> None:
    """What a motion of the base looks like, but for its likelihood: the first process is at that meanwhile."""
    import numpy as np

    from truenorth.alignment.motion_likelihood import Series, Walks, parameters
    from truenorth.errors.sway import AxisMotion, Oscillator

    motion = AxisMotion(1.0, (Oscillator(1, 1.0, 1.0, 0.1),))
    orders, logs = parameters(motion)
    Series(np.zeros(16), 1.0, Walks(1.0, 1.0)).expected(orders, logs[None])
    motion.blocks(1.0)


def match() -> None:
    """Gains, and what begins in the log."""
    from types import SimpleNamespace

    import numpy as np

    from truenorth.alignment.bias_step import seen_of
    from truenorth.alignment.matched import Signatures, innovations_of, matched
    from truenorth.filters import filter_gains
    from truenorth.filters.gains import initial_part, through

    system, estimates = _filtered(SWAY_STATES)
    K, n, m = EPOCHS, SWAY_STATES, ROWS
    gains = filter_gains(system, estimates)
    fine: Any = SimpleNamespace(system=system, estimates=estimates, gains=gains)
    state, measured, course = np.zeros((n, 1)), np.zeros((m, 1)), np.zeros((K, m, 1))
    one = Signatures(np.zeros(1, dtype=np.int64), state, measured, np.zeros((1, 1)), state, course)
    initial_part(gains.step, system.P0)
    matched(innovations_of(fine), one)
    through(gains, course)
    seen_of(fine, np.zeros((K, 6, 1)))


def turn() -> None:
    """Attitude by the gyros alone, held against gravity."""
    import numpy as np

    from truenorth.strapdown.inertial_integration import integrate_attitude

    integrate_attitude(np.zeros((EPOCHS, 3)))


def filter_own() -> None:
    """The filter of a base that stays, for the alignments that follow."""
    from truenorth.filters.linear import always_own_size

    always_own_size()
    _filtered(STATES)


JOBS: tuple[Callable[[], None], ...] = (filter_sway, sway, match, turn, filter_own)
