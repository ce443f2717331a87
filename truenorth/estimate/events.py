"""Events of a closed loop in order: the filter's grid, output, and measurements that wait until their time has come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.position import POSITION_OF_KNOWN_MOTION
from truenorth.aiding.source import Aiding
from truenorth.core.errors import UsageError
from truenorth.errors.model import InsModel
from truenorth.estimate.loop import SAME_TIME
from truenorth.estimate.memory import AS_IT_IS, Memory, Samples
from truenorth.quality.innovations import REST
from truenorth.strapdown.increments import ImuRows

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class Setting:
    """What a closed loop keeps to as long as it runs."""

    model: InsModel  # with the groups that the sources ask for (see :func:`with_states`)
    # the sensors; of the rows they hold, :func:`begin` takes note, more come with :func:`go_on`
    sources: tuple[Aiding, ...] = ()
    stride: int = 1  # samples from one prediction of the filter to the next
    # output at every so many of these, at the beginning and at the end; 0: only after measurements that ask for it, and the
    # stride is the longest step of the filter, which predicts at measurements where these come as often
    every: int = 1
    covariance: bool = True  # carry the covariance; needed for any aiding
    smooth: bool = False  # keep what the smoother needs: of a log in one chunk
    invariant: int = AS_IT_IS  # how a correction is fed back
    # s; before it corrections are not fed back: all is linearised about the motion as the start leads to it. None: they always are
    open_until: float | None = None
    exact: bool = False  # innovations of that loop are those of the motion with its errors taken off

    @property
    def grid(self) -> int:
        """Samples from one event of the filter's own to the next; half a stride where such events may be passed over."""
        return self.stride if self.every else max(1, self.stride // 2)

    def spare(self, interval: float) -> float:
        """How long (s) the filter may wait at an event of its own until the next one, with samples of this interval (s)."""
        return 0.0 if self.every else (self.stride - self.grid + 0.5) * interval


class Rows(NamedTuple):
    """Measurements that wait for their time: (K,) stamp, source, output; (K, M) measured, (K, 3) variance."""

    time: Array
    source: Integers
    output: NDArray[np.bool_]
    measured: Array
    variance: Array

    def at(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Rows:
        """Some of them."""
        return Rows(*(np.ascontiguousarray(a[chosen]) for a in self))  # type: ignore[arg-type]  # each keeps its kind


@dataclass(frozen=True)
class LoopState:
    """Where a closed loop is: with it, it goes on as if it had never stopped."""

    memory: Memory  # of the kernel
    samples: Samples  # the last that it took, and those that wait
    taken: int  # how many of these it took
    count: int  # samples before these
    waiting: Rows  # measurements that wait, and re-timed ones
    late: Rows
    rows: ImuRows | None  # the last two rows of the record, or one that waits for a second
    interval: float  # s; nominal, of the samples
    begin: float  # s; of the first sample
    outside: tuple[int, ...]  # measurements of each source that no sample covers
    fresh: bool = True  # it has taken nothing yet
    finished: bool = False  # the last sample was said to be the last
    passed: tuple[int, ...] = ()  # of those outside: they came for a time already passed


def received(setting: Setting, state: LoopState, aiding: Sequence[Aiding]) -> LoopState:
    """Measurements put where they wait."""
    if not aiding:
        return state
    names = [source.name for source in setting.sources]
    width = state.waiting.measured.shape[1]
    parts: dict[bool, list[Rows]] = {False: [state.waiting], True: [state.late]}
    for sensor in aiding:
        if sensor.name not in names:
            raise UsageError(f"{sensor.name}: no source of this loop; expected one of {', '.join(names)}")
        count = len(sensor.time)
        measured = np.full((count, width), np.nan)
        measured[:, : sensor.measured.shape[1]] = sensor.measured
        number = np.full(count, names.index(sensor.name), dtype=np.int64)
        output = np.array(np.broadcast_to(sensor.output, count), dtype=bool)
        parts[sensor.retimed].append(Rows(sensor.time, number, output, measured, sensor.sigma**2))
    waiting, late = (Rows(*(np.concatenate(a) for a in zip(*parts[kind], strict=True))) for kind in (False, True))
    # Measurements of one stamp in the order of their sources: what puts out comes last.
    return replace(state, waiting=waiting, late=late.at(np.lexsort(np.stack([late.source, late.time]))))


def planned(setting: Setting, state: LoopState, horizon: int, last: bool) -> tuple[Rows, LoopState]:
    """Events up to the horizon in order: the filter's grid, output and measurements; the state without those."""
    ends, count = state.samples.end, state.count
    number = 1 + np.arange(count + state.taken, count + horizon)
    on, output = number % setting.grid == 0, np.zeros(len(number), dtype=bool)
    if setting.every:
        output = number % (setting.stride * setting.every) == 0
    if last and len(on):
        on[-1], output[-1] = True, setting.every > 0
    times, outputs = ends[state.taken : horizon][on], output[on]
    if state.fresh:
        times, outputs = np.append(state.begin, times), np.append(setting.every > 0, outputs)
    grid = len(times)
    waiting = state.waiting
    near = np.clip(np.searchsorted(ends, waiting.time), 0, len(ends) - 1)
    near = np.where((near > 0) & (waiting.time - ends[near - 1] < ends[near] - waiting.time), near - 1, near)
    at = np.where(np.abs(ends[near] - waiting.time) < SAME_TIME, ends[near], waiting.time)
    first = _reached(state)
    edge = ends[horizon - 1] if horizon else state.begin
    passed, due = at < first, (at >= first) & (at <= edge)
    outside = _counted(state.outside, waiting.source[passed | ((at > edge) & last)])
    # What lies before the first sample of all has come in time.
    gone = state.passed if state.fresh else _counted(state.passed, waiting.source[passed])
    width = waiting.measured.shape[1]
    events = Rows(
        np.append(times, at[due]),
        np.append(np.full(grid, -1, dtype=np.int64), waiting.source[due]),
        np.append(outputs, waiting.output[due]),
        np.concatenate([np.zeros((grid, width)), waiting.measured[due]]),
        np.concatenate([np.zeros((grid, 3)), waiting.variance[due]]),
    )
    # By time, measurements before the output of their time.
    order = np.lexsort(np.stack([1.0 * (events.source == -1), events.time]))
    return events.at(order), replace(state, waiting=waiting.at(~(passed | due)), outside=outside, passed=gone)


def _counted(before: tuple[int, ...], more: Integers) -> tuple[int, ...]:
    """How many measurements there are of each source, with those of the sources `more`."""
    return tuple(count + int(np.sum(more == k)) for k, count in enumerate(before))


def _reached(state: LoopState) -> float:
    """Time up to which samples are taken."""
    done = float(state.memory.done[0])
    if state.taken < len(state.samples.end) and done > 0.0:
        return float(state.samples.end[state.taken] - (1.0 - done) * state.samples.step[state.taken])
    return float(state.samples.end[state.taken - 1]) if state.taken else state.begin


def lag_of_fixes(setting: Setting) -> int:
    """The state that is the delay of places over the ground; -1: there is none, its column is given, or a sensor shows velocity.

    That knows the column of the delay by more than the places that it stands in. That nothing moves shows none.
    """
    source = late_fixes(setting.sources)
    if source is None or source.row is POSITION_OF_KNOWN_MOTION:
        return -1
    return setting.model.layout.first_of(source.states["lag"].name)


def late_fixes(sources: Sequence[Aiding]) -> Aiding | None:
    """Places over the ground whose delay is estimated by them alone; None: there are none, or a sensor shows velocity."""
    if any(_shows_velocity(source) for source in sources):
        return None
    for source in sources:
        if (
            source.row.over_ground
            and source.row.unit == "m"
            and source.does == "measurement"
            and "lag" in source.states
        ):
            return source
    return None


def _shows_velocity(source: Aiding) -> bool:
    return source.row.unit == "m/s" and source.does == "measurement" and source.name not in REST
