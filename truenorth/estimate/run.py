"""The closed loop over a log, or over its chunks as they come: events in order, the compiled run, its answer in ENU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding import row
from truenorth.aiding.source import Aiding
from truenorth.core.blocks import row_blocks
from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import padded
from truenorth.errors.axes import known_as_bias
from truenorth.errors.deflection import NAME as DEFLECTION
from truenorth.errors.deflection import at_rest
from truenorth.errors.model import InsModel
from truenorth.errors.whole_bias import taken_apart
from truenorth.estimate import loop as kernel
from truenorth.estimate.axes import turn
from truenorth.estimate.events import LoopState, Rows, Setting, lag_of_fixes, planned, received
from truenorth.estimate.memory import (
    ABSENT,
    AHEAD,
    AS_IT_IS,
    BACK,
    DISTURB,
    MEASURE,
    PLACE,
    REJECTED,
    REOPENED,
    Events,
    Kept,
    Model,
    Samples,
    Sources,
    Task,
    memory,
)
from truenorth.filters.recursion import NO_INNOVATION_VARIANCE, SOUND
from truenorth.records import ImuRecord
from truenorth.state.layout import ACCEL_AXES, BA, BG
from truenorth.state.state import Start
from truenorth.state.track import Residuals, Track, in_one
from truenorth.strapdown import wander
from truenorth.strapdown.increments import ImuRows, increments, interval_lengths, read_only

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NEVER = 2**62  # rows: a jump is never believed


def begin(
    setting: Setting,
    start: Start,
    time: float,
    interval: float,
    prior: tuple[Array, Array] | None = None,
    off: Array | None = None,
) -> LoopState:
    """A loop at the beginning of its first sample.

    Parameters
    ----------
    setting : Setting
    start : Start
    time : float, s
        Of the beginning.
    interval : float, s
        Nominal, of the samples.
    prior : (P, values), optional
        Covariance (n, n), ENU, and assumed values (n,) of all states; from the start and the groups when left out.
    off : (n,) array, optional
        Errors of start and values that are known, ENU, none of position: what an open loop is about is not what is likeliest.
    """
    model = setting.model
    n = model.states
    s = wander.state_at(start.C_nb, start.v_n, start.lat, start.lon, start.alt)
    if model.fixed_altitude:
        s[wander.VELOCITY][2] = 0.0
    if prior is not None:
        P0, aux = np.array(prior[0], dtype=np.float64), np.array(prior[1], dtype=np.float64)
    elif start.whole is None:
        aux = np.zeros(n)
        aux[BG], aux[BA] = start.gyro_bias, start.accel_bias
        P0 = model.prior(start.P)
    else:
        P0, aux = taken_apart(model, start.P, np.append(start.gyro_bias, start.accel_bias), start.whole, start.known)
    deflected = model.layout.first_of(DEFLECTION)
    if prior is None and start.plumb > 0.0 and deflected >= 0:
        P0 = at_rest(P0, deflected, start.C_nb, start.lat, start.alt, start.plumb)
    for group in model.groups if prior is None else ():
        if group.name == ACCEL_AXES and group.name not in start.known:
            constant = None if start.whole is None else start.whole.constant[3:]
            P0, aux = known_as_bias(P0, aux, group, model.layout.first_of(ACCEL_AXES), constant)
    place = np.array([[start.lat, start.lon, start.alt]])
    P0 = np.array(P0)[None]
    turn(np.eye(3)[None], s[None, wander.VELOCITY], place, -1.0, P0)
    width = max([3, *(source.measured.shape[1] for source in setting.sources)])
    nothing = Rows(np.zeros(0), np.zeros(0, np.int64), np.zeros(0, bool), np.zeros((0, width)), np.zeros((0, 3)))
    empty = Samples(np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    kernel_memory, none = memory(s, aux, P0[0], time, len(setting.sources), off), (0,) * len(setting.sources)
    state = LoopState(kernel_memory, empty, 0, 0, nothing, nothing, None, interval, time, none, passed=none)
    return received(setting, state, setting.sources)


def go_on(
    setting: Setting,
    state: LoopState,
    record: ImuRecord | ImuRows,
    aiding: Sequence[Aiding] = (),
    *,
    last: bool = False,
) -> tuple[LoopState, Track]:
    """Take more samples and measurements.

    Parameters
    ----------
    setting : Setting
    state : LoopState
        Left as it is.
    record : ImuRecord or ImuRows
        The next samples; one is enough.
    aiding : sequence of Aiding
        New measurements of the setting's sources, known by their names; no later than the samples that pass their time.
    last : bool
        Nothing follows: samples held back for rates are taken, and the end is put out.

    Returns
    -------
    state : LoopState
    track : Track
        Epochs that were put out, and what the measurements taken said.

    Raises
    ------
    DataError
        The filter broke down.
    """
    if state.finished:
        raise UsageError("this loop was said to be at its end; expected a state from before it")
    rows = ImuRows(record.time, record.gyro, record.accel, record.kind, record.source)
    waited = state.rows is not None and len(state.rows.time) < 2
    before = None if waited else state.rows
    new = _stacked(state.rows, rows) if waited and state.rows is not None else rows
    if before is None and len(new.time) < 2 and not last:  # a rate needs the one before it
        return _run(setting, received(setting, replace(state, rows=new), aiding), last)
    parts = (interval_lengths(new, before, state.interval), new.time, *increments(new, before, state.interval))
    joined = (np.concatenate([a, b]) for a, b in zip(state.samples, parts, strict=True))
    samples = Samples(*(read_only(np.ascontiguousarray(a)) for a in joined))
    both = new if before is None else _stacked(before, new)
    state = replace(state, rows=ImuRows(both.time[-2:], both.gyro[-2:], both.accel[-2:], both.kind, both.source))
    state = received(setting, replace(state, samples=samples), aiding)
    return _run(setting, state, last)


def navigate_track(
    record: ImuRecord,
    start: Start,
    model: InsModel,
    aiding: Sequence[Aiding] = (),
    *,
    interval: float = 0.2,
    every: int = 5,
    covariance: bool = True,
    smooth: bool = False,
    invariant: int = AS_IT_IS,
    prior: tuple[Array, Array] | None = None,
    open_until: float | None = None,
    exact: bool = False,
    off: Array | None = None,
) -> Track:
    """Mechanise a log from a start, aided by measurements.

    Parameters
    ----------
    record : ImuRecord
        Its first sample begins at the start's epoch.
    model : InsModel
        With the states that `aiding` asks for among its groups (see :func:`with_states`).
    interval : float, s
        Of the filter's prediction; forces and turns within it are integrated sample by sample.
    every : int
        Output at every so many intervals.
    covariance, smooth : bool
        Carry the covariance, which any aiding needs; smooth over the whole log (Rauch, Tung, Striebel).
    invariant : {AS_IT_IS, OVER_GROUND, IN_BODY} of :mod:`truenorth.estimate.memory`: how a correction is fed back
    prior, off : (P, values) and (n,) array, optional
        Of all states, and of an open loop: see :func:`begin`.
    open_until : float, optional, s
        Before it no correction is fed back: all is linear about the motion that the start leads to, less whose errors the track is.
        `exact`: innovations are what rows say with those errors taken off (:mod:`truenorth.estimate.apart`).

    Raises
    ------
    UsageError
        Smoothing with a vertical loop, of considered states or of re-timed measurements; an open loop with any such option.
    DataError
        The filter broke down (see :func:`truenorth.filters.kalman`).
    """
    if smooth and any(source.loop > 0.0 for source in aiding):
        raise UsageError("a vertical loop has fixed gains and cannot be smoothed; expected a Kalman gain (no loop)")
    if smooth and (any(g.considered for g in model.groups) or any(source.retimed for source in aiding)):
        raise UsageError("considered states and re-timed measurements are not smoothed; expected smooth=False")
    if open_until is not None and (smooth or invariant or any(source.loop > 0.0 for source in aiding)):
        raise UsageError("an open loop feeds nothing back; expected no smooth, no invariant, no vertical loop")
    steps = interval_lengths(record)
    time = float(record.time[0] - steps[0])
    stride = max(1, round(interval * len(record) / (record.time[-1] - time)))
    known = covariance or bool(aiding)
    setting = Setting(model, tuple(aiding), stride, every, known, smooth, invariant, open_until, exact)
    state, tracks = begin(setting, start, time, record.interval, prior, off), []
    for rows in [slice(0, len(record))] if smooth else row_blocks(len(record)):
        part = ImuRows(record.time[rows], record.gyro[rows], record.accel[rows], record.kind, record.source)
        state, track = go_on(setting, state, part, last=rows.stop == len(record))
        tracks.append(track)
    return in_one(tracks)


def with_states(model: InsModel, aiding: Sequence[Aiding]) -> InsModel:
    """The model with the states that the aiding sensors ask for; one that two sources share stands once."""
    groups = {group.name: group for source in aiding for group in source.states.values()}
    return replace(model, groups=(*model.groups, *groups.values()))


def _stacked(first: ImuRows, second: ImuRows) -> ImuRows:
    time, gyro, accel = (np.concatenate([a, b]) for a, b in zip(first[:3], second[:3], strict=True))
    return ImuRows(time, gyro, accel, second.kind, second.source)


def _run(setting: Setting, state: LoopState, last: bool) -> tuple[LoopState, Track]:
    model, sources = setting.model, setting.sources
    n, there = model.states, len(state.samples.end)
    wait = AHEAD if any(source.instant for source in sources) and not last else 0
    # The first sample needs the second: the one before it is not there.
    horizon = max(state.taken, there - wait) if not state.fresh or there > 1 or last else 0
    if state.fresh and not horizon:
        return state, _nothing(model, sources)
    plan, after = planned(setting, state, horizon, last)
    m, late = state.memory.copy(), state.late
    if state.fresh:
        dtheta, dvel = state.samples.dtheta, state.samples.dvel
        # Its coning would be missing, a tilt of nanoradians and millimetres an hour on.
        m.s[wander.LAST_ANGLE] = 2.0 * dtheta[0] - dtheta[min(1, there - 1)]
        m.s[wander.LAST_VELOCITY] = 2.0 * dvel[0] - dvel[min(1, there - 1)]
    kept = _room(setting, plan, late, n)
    of_model = Model(
        model.dynamics,
        model.sensor_states,
        model.fixed_altitude,
        *model.turn_noise,
        setting.invariant,
        model.drift_state,
        setting.covariance,
        any(group.considered for group in model.groups),
        setting.spare(state.interval),
        setting.open_until is not None,
        setting.open_until or 0.0,
        setting.exact,
        lag_of_fixes(setting),
    )
    seen = kernel_sources(sources, model)
    task = Task(state.samples, state.taken, Events(*plan), Events(*late), seen, of_model, horizon)
    code, taken, event, row_, outputs = kernel.run(padded(n), task, m, kept)
    if code != SOUND:
        _raise(code, kept.when[event], sources[int(np.append(plan.source, late.source)[event])])
    residuals = _residuals(sources, plan, late.at(np.arange(row_)), kept, after)
    left, first = late.at(np.arange(row_, len(late.time))), max(0, taken - BACK)
    tail = Samples(*(a[first:] for a in state.samples))
    after = replace(
        after,
        memory=m,
        samples=tail,
        taken=taken - first,
        count=state.count + first,
        late=left,
        fresh=False,
        finished=last,
    )
    states, sensors, P = kept.state[:outputs], kept.aux[:outputs], kept.P[:outputs]
    if setting.smooth:
        from truenorth.estimate.smoothing import smoothed

        states, sensors, P = smoothed(Events(*plan), kept, state.memory.P, of_model)
    C_nb, v_n, position, C_nw = wander.north(states)
    if setting.covariance:
        turn(C_nw, v_n, position, 1.0, P)
    return after, Track(kept.time[:outputs], C_nb, v_n, position, sensors, P, model.layout, residuals)


def _nothing(model: InsModel, sources: Sequence[Aiding]) -> Track:
    """What is put out before the first sample is taken."""
    n, none, three, truth = model.states, np.zeros(0), np.zeros((0, 3)), np.zeros(0, bool)
    silent = tuple(
        Residuals(source.name, none, three, three, none, truth, 0, none, truth, source.row.unit, source.row.axes)
        for source in sources
        if source.does == "measurement"
    )
    return Track(none, np.zeros((0, 3, 3)), three, three, np.zeros((0, n)), np.zeros((0, n, n)), model.layout, silent)


def _room(setting: Setting, plan: Rows, late: Rows, n: int) -> Kept:
    outputs, events = int(plan.output.sum() + late.output.sum()), len(plan.time) + len(late.time)
    links = int(np.sum((plan.source >= 0) | plan.output)) if setting.smooth else 0
    return Kept(
        time=np.empty(outputs),
        state=np.empty((outputs, 12)),
        aux=np.zeros((outputs, n)),
        P=np.empty((outputs if setting.covariance else 0, n, n)),
        when=np.append(plan.time, late.time),
        innovation=np.full((events, 3), np.nan),
        sigma=np.full((events, 3), np.nan),
        nis=np.full(events, np.nan),
        verdict=np.zeros(events, dtype=np.int64),
        Phi=np.empty((links, n, n)),
        Q=np.empty((links, n, n)),
        H=np.zeros((links, 3, n)),
        R=np.ones((links, 3)),
        dx=np.zeros((links, n)),
        D=np.tile(np.eye(n), (links, 1, 1)),
        lever=np.zeros((outputs, 2)),
    )


def kernel_sources(aiding: Sequence[Aiding], model: InsModel) -> Sources:
    """What the kernel needs of the sensors."""
    count = len(aiding)
    figures, gates = np.zeros((count, row.FIGURES)), np.full((count, 3), np.inf)
    states = np.full((count, row.PLACES), -1, dtype=np.int64)
    opens = np.full(count, -1, dtype=np.int64)
    for number, source in enumerate(aiding):
        figures[number, row.ARM : row.MOUNT] = source.lever_arm
        figures[number, row.MOUNT : row.OWN] = source.C_mb.ravel()
        figures[number, row.OWN : row.OWN + len(source.figures)] = source.figures
        gates[number] = source.gates()
        for role, group in source.states.items():
            states[number, row.ROLES[role]] = model.layout.first_of(group.name)
        if source.opens is not None:
            opens[number] = source.opens if isinstance(source.opens, int) else model.layout.first_of(source.opens)
    does = {"disturbance": DISTURB, "place": PLACE}
    return Sources(
        np.array([does.get(source.does, MEASURE) for source in aiding], dtype=np.int64),
        np.array([source.row.function.address for source in aiding], dtype=np.int64),
        figures,
        states,
        gates,
        np.array([source.loop for source in aiding], dtype=np.float64),
        np.array([source.instant for source in aiding], dtype=np.bool_),
        np.array([source.instant and source.row.swings for source in aiding], dtype=np.bool_),
        np.array([source.patience if source.opens is not None else NEVER for source in aiding], dtype=np.int64),
        opens,
        np.array([source.row.over_ground for source in aiding], dtype=np.bool_),
    )


def _residuals(
    sources: Sequence[Aiding], plan: Rows, late: Rows, kept: Kept, after: LoopState
) -> tuple[Residuals, ...]:
    of = np.append(plan.source, late.source)
    verdict = kept.verdict[: len(of)]
    found = []
    for number, source in enumerate(sources):
        if source.does != "measurement":
            continue
        rows = np.flatnonzero((of == number) & (verdict != ABSENT))
        found.append(
            Residuals(
                source.name,
                kept.when[rows],
                kept.innovation[rows],
                kept.sigma[rows],
                kept.nis[rows],
                verdict[rows] != REJECTED,
                after.outside[number],
                np.append(plan.time, late.time)[rows],
                verdict[rows] == REOPENED,
                source.row.unit,
                source.row.axes,
                after.passed[number],
            )
        )
    return tuple(found)


def _raise(code: int, time: float, source: Aiding) -> None:
    of_variance = code == NO_INNOVATION_VARIANCE
    why = "the variance of an innovation is not positive" if of_variance else "the covariance is lost in rounding"
    raise DataError(
        f"navigation broke down at {time:.3f} s, at a measurement of {source.name}: {why}; check its sigmas"
    )
