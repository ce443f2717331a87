"""Where the Kalman filter of many runs is worked out: on the processor, or on a CUDA device where there is one."""

from __future__ import annotations

import warnings
from typing import Any, Literal, get_args

import numpy as np

from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array
from truenorth.filters.drive import part
from truenorth.filters.recursion import SOUND, Histories
from truenorth.filters.shared import shares
from truenorth.filters.system import LinearSystem, Runs, runs_of

Device = Literal["cpu", "cuda", "auto"]

FEWEST = 100  # runs: a device has about as many multiprocessors, and a block keeps one of them busy
SAVED = (
    1.5e11  # multiplications, 10 s of a core, that it must save: the first call takes as long to compile its kernels
)
CORES = {"own": 60.0, "shared": 10.0}  # that an H200 stands for: by itself, and by what it waits for its memory
BLOCK_BYTES = 48 * 1024  # what the threads of a block share, on every device
SHARE = 0.8  # of the device's free memory
THREADS = 64  # of a block, where a thread is a run
WARP = 32  # threads that go together
EACH = 32  # elements of a covariance to a thread, where a block is a run: few threads wait less for one another


def on_cuda(device: Device, system: LinearSystem, workers: int = 1) -> bool:
    """Whether the runs go to a CUDA device; "auto" takes it where there is one that saves time against so many threads.

    Raises
    ------
    UsageError
        An unknown device; "cuda" where there is none, or where the system is too large for it.
    """
    if device not in get_args(Device):
        raise UsageError(f'device is {device!r}, expected "cpu", "cuda" or "auto"')
    if device == "cpu" or (device == "auto" and not _worth(system, workers)):
        return False
    fault = _fault(system.states, system.rows)
    if fault and device == "cuda":
        raise UsageError(f'device is "cuda", but {fault}')
    return not fault


def _worth(system: LinearSystem, workers: int) -> bool:
    n, m, epochs = system.states, system.rows, system.epochs
    count = int(np.prod(system.runs, dtype=int))
    if count < FEWEST:
        return False
    of_state, of_covariance = n * n + 2 * m * n, 1.5 * n**3 + 3 * m * n * n
    once = shares(runs_of(system, system.runs), count, epochs)
    work = count * epochs * (of_state if once else of_state + of_covariance)
    return work * (1.0 / max(workers, 1) - 1.0 / CORES["shared" if once else "own"]) > SAVED


def _fault(n: int, m: int) -> str:
    """Why a CUDA device cannot do the work; nothing where it can."""
    try:
        from numba import cuda
    except ImportError:
        return "numba-cuda is not installed: pip install 'truenorth[cuda]'"
    if not cuda.is_available():
        return "there is no CUDA device here, or Numba lacks what it needs besides the driver: pip install 'truenorth[cuda]'"
    from truenorth.filters.cuda import shared_bytes

    if shared_bytes(n, m) > BLOCK_BYTES:
        return f'{n} states and {m} rows are too many for it: its threads share {BLOCK_BYTES // 1024} KiB; take device="cpu"'
    return ""


def run_on_cuda(runs: Runs, epochs: int, joseph: bool, out: Histories) -> None:
    """Filter all runs, as many at a time as the memory of the device holds."""
    if shares(runs, len(out.x), epochs):
        _run_shared(runs, epochs, joseph, out)
        return
    for start, stop in _parts(runs, out):
        _blocks(part(runs, start, stop), epochs, joseph, part(out, start, stop), np.empty((1, 0, 0)))


def _run_shared(runs: Runs, epochs: int, joseph: bool, out: Histories) -> None:
    """The covariance once, by one block, which keeps the gains; then each run's state, by a thread."""
    from numba import cuda

    from truenorth.filters.cuda import run_by_thread

    n, m = runs.H.shape[3], runs.H.shape[2]
    gains, first = np.zeros((epochs, m, n + 1)), part(out, 0, 1)
    before = first.log_likelihood.copy()
    _blocks(part(runs, 0, 1), epochs, joseph, first, gains)
    if first.failure[0, 0] != SOUND:
        out.failure[:] = first.failure
        return
    first.log_likelihood[:] = before
    alike = {"sigma": out.sigma, "P": out.P, "innovation_covariance": out.innovation_covariance}
    for of_all in alike.values():
        of_all[1:] = of_all[:1]
    own = Histories(**(out._asdict() | {name: a[:, :0] for name, a in alike.items()}))
    of_gains = cuda.to_device(gains)
    for start, stop in _parts(runs, own):
        there, here = _sent(part(runs, start, stop)), part(own, start, stop)
        found = _room(here)
        _launch(run_by_thread(n), -(-(stop - start) // THREADS), THREADS, there, epochs, of_gains, found)
        _fetch(found, here)


def _blocks(runs: Runs, epochs: int, joseph: bool, out: Histories, gains: Any) -> None:
    """Runs that fit into the memory, a block each."""
    from numba import cuda

    from truenorth.filters.cuda import run_by_block

    n, m = runs.H.shape[3], runs.H.shape[2]
    tied = bool(runs.S.any() or runs.R[..., ~np.eye(m, dtype=np.bool_)].any())
    threads = WARP * -(-n * n // (EACH * WARP))
    there, found, of_gains = _sent(runs), _room(out), cuda.to_device(gains)
    _launch(run_by_block(n, m), len(out.x), threads, there, epochs, tied, joseph, found, of_gains)
    _fetch(found, out)
    if gains.size:
        of_gains.copy_to_host(gains)


def _sent(runs: Runs) -> Any:
    return Runs(*map(_to_device, runs))


def _room(out: Histories) -> Any:
    """Arrays on the device; what is added to is sent."""
    from numba import cuda

    begun = ("log_likelihood", "failure")
    return Histories(
        **{k: _to_device(a) if k in begun else cuda.device_array(a.shape, a.dtype) for k, a in out._asdict().items()}
    )


def _to_device(a: Array) -> Any:
    """A copy on the device, in C order.

    An axis of one element may have stride 0 (a view of what all runs share): Numba then takes the array for a broadcast one and
    counts its pieces in Python, which took five times as long as the filter. A flat view has no such axis.
    """
    from numba import cuda

    return cuda.to_device(np.ascontiguousarray(a).reshape(-1).reshape(a.shape))


def _launch(kernel: Any, blocks: int, threads: int, *arguments: Any) -> None:
    """Call a kernel; that few blocks leave most of a device idle, as Numba warns, is known: the covariance of all is one."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*Grid size")
        kernel[blocks, threads](*arguments)


def _fetch(there: Any, here: Histories) -> None:
    for of_device, of_host in zip(there, here):
        if of_host.size:
            of_device.copy_to_host(of_host)


def _parts(runs: Runs, out: Histories) -> list[tuple[int, int]]:
    """Runs that the free memory of the device holds at a time, in addition to what all share."""
    from numba import cuda

    own = [a for a in runs if len(a) > 1]
    common = sum(a.nbytes for a in runs if len(a) == 1)
    count = len(out.x)
    each = (sum(a.nbytes for a in own) + sum(a.nbytes for a in out)) / count
    free = SHARE * cuda.current_context().get_memory_info()[0] - common
    at_once = int(max(1, min(count, free / each)))
    return [(start, min(start + at_once, count)) for start in range(0, count, at_once)]
