"""The epoch loop of the linear filters: one kernel; what a filter does in its own way is chosen by the type of its options.

An epoch is predicted, its measurement is loaded, the filter adapts to the innovations, and the state is conditioned on the rows.
A filter is a ``NamedTuple`` of options and those steps that it does otherwise than the Kalman filter; :func:`variant` takes
both. The type is known when the kernel is compiled, so that the choice costs nothing when it runs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cache
from itertools import chain
from typing import Any, Unpack

from truenorth.core.compiled import OPTIONS, compiled
from truenorth.core.kernel_source import STEPS
from truenorth.core.linalg import Array, Size, padded
from truenorth.filters import recursion
from truenorth.filters.device import Device, on_cuda, run_on_cuda
from truenorth.filters.drive import Running, drive
from truenorth.filters.recursion import (
    SOUND,
    Histories,
    Workspace,
    begin,
    conclude,
    innovate,
    keep,
    load_measurement,
    load_process,
    update,
    workspace,
)
from truenorth.filters.shared import run_shared, shares
from truenorth.filters.system import Estimates, FilterState, LinearSystem, Runs

LARGEST_SIZE = 40  # of the kernels that smaller systems take: that of a swaying base


def room(size: Size, rows: int, options: Any) -> Any:
    """Arrays that a filter works in; the Kalman filter needs none besides the workspace."""
    return 0


def predict(size: Size, w: Workspace, options: Any, own: Any) -> None:
    """``x = Phi x + u``, ``P = Phi P Phi' + Q``."""
    recursion.predict(size, w)


def adapt(size: Size, w: Workspace, options: Any, own: Any, memory: Array) -> None:
    """Change P or R by what the innovations of the predicted state show; the Kalman filter does not."""


def condition(
    size: Size, w: Workspace, options: Any, own: Any, memory: Array, present: int, correlated: bool
) -> tuple[int, float, float]:
    """Condition on the rows present: the failure if any, NIS and log-likelihood."""
    if present == 0:
        return SOUND, 0.0, 0.0
    return update(size, w, correlated, True)


def report(size: Size, w: Workspace, options: Any, own: Any, memory: Array, figures: Array) -> None:
    """Write what the filter chose at this epoch; the Kalman filter chooses nothing."""


def variant(options: type, **steps: Callable[..., Any]) -> None:
    """Name the steps that a filter with options of this type does in its own way.

    Parameters
    ----------
    options : type
        A ``NamedTuple``.
    **steps
        Functions that stand for `room`, `predict`, `adapt`, `condition` or `report`, with the same names of arguments.
    """
    setattr(options, STEPS, steps)


@cache
def _choose_by_type() -> None:
    """Let kernels call each step as the type of the options, its third argument, has it; else as it stands here."""
    from numba.extending import overload

    def chosen_of(step: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *arguments: getattr(arguments[2].instance_class, STEPS).get(step.__name__, step)

    inlined: Any = OPTIONS | {"forceinline": True}
    for step in (room, predict, adapt, condition, report):
        overload(step, jit_options=inlined, strict=False)(chosen_of(step))


@compiled(prepare=_choose_by_type)
def linear_runs(size: Size, system: Runs, epochs: int, options: Any, out: Histories) -> None:
    """Filter each run."""
    rows = system.z.shape[2]
    w, own = workspace(size, rows), room(size, rows, options)
    for run in range(out.x.shape[0]):
        begin(size, system, run, w)
        memory = out.memory[run]
        for epoch in range(epochs):
            load_process(size, system, run, epoch, w)
            predict(size, w, options, own)
            present, correlated = load_measurement(size, system, run, epoch, w)
            adapt(size, w, options, own, memory)
            if out.innovation.shape[1] > 0:
                innovate(size, w, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
            failure, nis, log_likelihood = condition(size, w, options, own, memory, present, correlated)
            if not conclude(out, run, epoch, failure, nis, log_likelihood):
                break
            if out.innovation.shape[1] > 0:
                report(size, w, options, own, memory, out.adaptation[run, epoch])
            keep(out, run, epoch, epochs - 1, w)


class _Sizes:
    """Sizes of the kernels that calls take: the own one, or for few epochs a larger one that is there where the own is not.

    What is padded stays zero, so that the bits are the same; a step of 40 states takes some us more than one of 12, the
    kernel of 12 takes seconds to compile.
    """

    def __init__(self, most: int) -> None:
        self.most = most  # epochs that go through larger kernels before the own one is compiled
        self.taken: dict[tuple[int, type], Size] = {}
        self.epochs: Counter[tuple[int, type]] = Counter()

    def for_call(self, size: Size, runs: Runs, epochs: int, options: Any, out: Histories) -> Size:
        """The size with which :func:`linear_runs` is called."""
        key = (len(size), type(options))
        taken = self.taken.get(key)
        if taken is not None and len(taken) == len(size):
            return size
        self.epochs[key] += epochs * len(out.x)
        rest = (runs, epochs, options, out)
        if self.epochs[key] > self.most or linear_runs.is_there(size, *rest):
            taken = size
        elif taken is None:  # those on the disk before those that another process compiles now
            larger = [padded(n) for n in range(len(size) + 1, LARGEST_SIZE + 1) if n % 8 == 0]
            there = (s for s in larger if linear_runs.is_there(s, *rest))
            under_way = (s for s in [size, *larger] if linear_runs.is_under_way(s, *rest))
            taken = next(chain(there, under_way), size)
        self.taken[key] = taken
        return taken


_sizes = _Sizes(100_000)


def always_own_size() -> None:
    """Compile for each size from now on, however few epochs there are."""
    _sizes.most = 0


def run_linear(
    options: Any,
    system: LinearSystem,
    state: FilterState | None,
    *,
    memory: Array | None = None,
    adaptation: int = 0,
    joseph: bool | None = None,
    device: Device = "cpu",
    **running: Unpack[Running],
) -> Estimates:
    """Run the linear filter that has options of this type; parameters as in :func:`truenorth.filters.drive.drive`.

    `joseph` is of the Kalman filter alone, by whose covariance runs that share a system can go together, and so is `device`.
    """
    there = joseph is not None and on_cuda(device, system, running.get("workers", 1))
    if there:
        running["workers"] = min(1, running.get("workers", 1))  # threads would only wait for one another

    def kernel(size: Size, runs: Runs, epochs: int, out: Histories) -> None:
        if joseph is not None and there:
            run_on_cuda(runs, epochs, joseph, out)
            return
        if joseph is not None and shares(runs, len(out.x), epochs):
            run_shared(size, runs, epochs, joseph, out)
            return
        linear_runs(_sizes.for_call(size, runs, epochs, options, out), runs, epochs, options, out)

    return drive(kernel, system, state, memory=memory, adaptation=adaptation, **running)
