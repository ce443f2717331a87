"""The first alignment on a computer: a second process compiles what comes last, while this one compiles what comes first.

An alignment of a base waits for its kernels one after the other. Two of the longest, the Kalman filter with the states of a
sway and the match of signatures, come at the end; they depend on nothing that comes before.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading

LAST = "truenorth.alignment.matched._sum_back"  # where it is on the disk, no first alignment waits any more
SWAY_STATES = 39  # of a base with two oscillations along each axis; what is padded to the same size shares its kernel
CODE = "from truenorth.cli.ahead import compile_last; compile_last()"


def compile_ahead() -> None:
    """Start the second process, where the kernels are not on the disk and there is a second processor for it.

    It ends with this process: it reads a pipe that nobody writes to. A process that has been started by another of its kind starts
    none: `truenorth warm` has one for each processor as it is.
    """
    from truenorth.core.kernel_store import write_folder

    if "multiprocessing" in sys.modules and sys.modules["multiprocessing"].parent_process() is not None:
        return
    folder = write_folder()
    if folder is None or (os.cpu_count() or 1) < 2 or next(folder.glob(f"{LAST}-*"), None) is not None:
        return
    silent = subprocess.DEVNULL
    process = subprocess.Popen([sys.executable, "-c", CODE], stdin=subprocess.PIPE, stdout=silent, stderr=silent)
    _running.append(process)


_running: list[subprocess.Popen[bytes]] = []  # held: the pipe would be closed with the object


def compile_last() -> None:
    """What runs in the second process; ends it where the first one is gone."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    call_last()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


def call_last() -> None:
    """Call the kernels on two epochs of nothing, with the types that an alignment gives them."""
    from types import SimpleNamespace

    import numpy as np

    from truenorth.alignment.matched import Signatures, innovations_of, matched
    from truenorth.filters import LinearSystem, filter_gains, kalman

    K, n, m = 2, SWAY_STATES, 3
    Phi, R = np.tile(np.eye(n), (K, 1, 1)), np.tile(np.eye(m), (K, 1, 1))
    H, S = np.zeros((K, m, n)), np.zeros((K, n, m))
    system = LinearSystem(Phi, Phi, H, R, np.zeros((K, m)), np.zeros(n), np.eye(n), S=S)
    nothing = SimpleNamespace(innovation=np.zeros((K, m)), innovation_covariance=R, P=Phi)
    fine = SimpleNamespace(system=system, estimates=nothing, gains=filter_gains(system, nothing))  # type: ignore[arg-type]
    state, measured, course = np.zeros((n, 1)), np.zeros((m, 1)), np.zeros((K, m, 1))
    one = Signatures(np.zeros(1, dtype=np.int64), state, measured, np.zeros((1, 1)), state, course)
    matched(innovations_of(fine), one)  # type: ignore[arg-type]
    kalman(system, history="full")
