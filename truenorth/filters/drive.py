"""From a system to a kernel and back to estimates: one driver for all filters."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal, TypedDict, TypeVar, get_args

import numpy as np

from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import Array, Size, padded
from truenorth.filters.recursion import NO_FILTER, NO_INNOVATION_VARIANCE, NOT_FINITE, Histories
from truenorth.filters.stack import System
from truenorth.filters.system import Estimates, FilterState, runs_of

History = Literal["last", "sigma", "full"]
HISTORIES = get_args(History)
T = TypeVar("T", bound=tuple[Any, ...])


class Running(TypedDict, total=False):
    """How a filter is run; options that all filters take.

    Attributes
    ----------
    history : "last", "sigma" or "full"
        Keep the last epoch only (the default), also x and sigma of every epoch, or also P of every epoch.
    innovations : bool or None
        Keep innovations, their covariances and NIS of every epoch; None, the default: where a history is kept.
    workers : int
        Threads that share the runs, 1 by default; the bits do not depend on it.
    """

    history: History
    innovations: bool | None
    workers: int


class NoFilterError(DataError):
    """No H-infinity filter keeps the bound."""


Kernel = Callable[[Size, Any, int, Histories], None]
Flatten = Callable[[Any, tuple[int, ...]], Any]


def drive(
    kernel: Kernel,
    system: System,
    state: FilterState | None,
    *,
    history: History = "last",
    innovations: bool | None = None,
    workers: int = 1,
    memory: Array | None = None,
    adaptation: int = 0,
    flatten: Flatten = runs_of,
) -> Estimates:
    """Run a kernel over all runs of a system and shape what it kept.

    Parameters
    ----------
    kernel : callable
        ``kernel(size, runs, epochs, histories)``.
    system, state
        As in :func:`truenorth.filters.kalman`.
    history, innovations, workers
        See :class:`Running`.
    memory : (a,) array, optional
        What an adaptive filter begins with, where no `state` says better.
    adaptation : int
        Figures that an adaptive filter reports of each epoch.
    flatten : callable
        ``flatten(system, shape)`` brings the system's arrays to what the kernel takes.
    """
    if history not in HISTORIES:
        raise UsageError(f'history is {history!r}, expected "last", "sigma" or "full"')
    if state is not None:
        system = system.with_arrays(x0=state.x, P0=state.P)
    shape, epochs = system.runs, system.epochs
    runs = flatten(system, shape)
    keep_innovations = history != "last" if innovations is None else innovations
    out = _histories(shape, system, history, epochs if keep_innovations else 0, adaptation)
    if memory is not None:
        out = out._replace(memory=np.tile(memory, (len(out.x), 1)))
    if state is not None:
        out.log_likelihood[:] = np.broadcast_to(state.log_likelihood, shape).ravel()
        out.memory[:] = _remembered(state, out.memory.shape[1], shape)

    size = padded(system.states)
    if len(out.x) == 1 and workers == 1:
        kernel(size, runs, epochs, out)
    else:
        in_parts(
            len(out.x),
            workers,
            lambda start, stop: kernel(size, part(runs, start, stop), epochs, part(out, start, stop)),
        )
    _raise_failure(out, shape)

    shaped: list[Any] = [a.reshape(shape + a.shape[1:]) if shape else a[0] for a in out]
    out = Histories(*shaped)
    after = FilterState(out.x[..., -1, :], out.P[..., -1, :, :], out.log_likelihood, out.memory)
    of_rows = out.innovation, out.innovation_covariance, out.nis, out.log_likelihood
    return Estimates(out.x, out.sigma, out.P, *of_rows, after, out.adaptation)


def _remembered(state: FilterState, length: int, shape: tuple[int, ...]) -> Array:
    if state.memory.shape[-1] != length:
        raise UsageError(
            f"the state remembers {state.memory.shape[-1]} figures, expected {length}: it is of another filter"
        )
    return np.broadcast_to(state.memory, (*shape, length)).reshape(math.prod(shape), length)


def _histories(
    shape: tuple[int, ...], system: System, history: History, innovations: int, adaptation: int
) -> Histories:
    count, n, m, epochs = math.prod(shape), system.states, system.rows, system.epochs
    of_x = 1 if history == "last" else epochs
    of_P = epochs if history == "full" else 1
    return Histories(
        x=np.empty((count, of_x, system.x0.shape[-1])),
        sigma=np.empty((count, of_x, n)),
        P=np.empty((count, of_P, n, n)),
        innovation=np.empty((count, innovations, m)),
        innovation_covariance=np.empty((count, innovations, m, m)),
        nis=np.zeros((count, innovations)),
        log_likelihood=np.zeros(count),
        adaptation=np.empty((count, innovations, adaptation)),
        memory=np.empty((count, 0)),
        failure=np.zeros((count, 2), dtype=np.int64),
    )


def in_parts(count: int, workers: int, call: Callable[[int, int], None]) -> None:
    """Call ``call(start, stop)`` over all `count` runs, shared among threads; the kernels hold no lock."""
    if workers < 1:
        raise UsageError(f"workers is {workers}, expected at least 1")
    if workers == 1 or count == 1:
        call(0, count)
        return
    edges = np.linspace(0, count, min(workers, count) + 1).astype(int)
    from concurrent.futures import ThreadPoolExecutor  # many runs at once are rare, and it loads much

    with ThreadPoolExecutor(len(edges) - 1) as pool:
        list(pool.map(call, edges[:-1], edges[1:]))


def part(arrays: T, start: int, stop: int) -> T:
    """Runs ``start <= run < stop`` of a named tuple of arrays; what all runs share stays whole."""
    return type(arrays)(*(a[start:stop] if len(a) > 1 else a for a in arrays))


def _raise_failure(out: Histories, shape: tuple[int, ...]) -> None:
    if not out.failure.any():
        return
    failed = np.flatnonzero(out.failure[:, 0])
    reason, epoch = out.failure[failed[0]]
    run = f" of run {', '.join(str(i) for i in np.unravel_index(failed[0], shape))}" if shape else ""
    if reason == NO_FILTER:
        raise NoFilterError(
            f"no H-infinity filter keeps this bound: at epoch {epoch}{run} the error to be bounded reaches it; take a "
            "larger bound"
        )
    if reason == NO_INNOVATION_VARIANCE:
        raise DataError(
            f"the filter broke down at epoch {epoch}{run}: the variance of an innovation is not positive and finite; "
            "R is zero where the state is already known, S does not fit Q and R, or Phi has made P overflow"
        )
    if reason == NOT_FINITE:
        raise DataError(
            f"the filter broke down at epoch {epoch}{run}: transition, measurement or a Jacobian of the system gives a "
            "number that is not finite there; see whether the state has left the range in which the model holds"
        )
    raise DataError(
        f"the filter broke down at epoch {epoch}{run}: the covariance P is lost in rounding; use Joseph's form "
        "(joseph=True) or the filter square_root, a smaller P0, or more process noise"
    )
