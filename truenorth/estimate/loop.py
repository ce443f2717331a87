"""The closed loop, compiled: mechanise to the next event, carry the covariance there, measure, correct, go on.

An event is an epoch of the filter's own grid, an epoch of output, or a measurement at any time: the sample in which it
falls is taken in two parts. A re-timed measurement holds at its stamp less a delay as it is known *now*: when it comes is
decided as the loop goes. Corrections are fed back at once, so that the error state is zero between events; before a loop is closed
they are kept apart, and all is linear about the motion that the start leads to.

``run(task, memory)``: all that the loop knows is in its memory, and samples after the last event stay
with the caller; handed in again with the next ones, chunks of any size give the bits of one batch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.row import AT_ARM, AT_LAG
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import copy_corner, load
from truenorth.estimate import along_curve, shown_late
from truenorth.estimate.apart import innovations_there, is_exact
from truenorth.estimate.correct import (
    arm_turned,
    damp_height,
    disturb,
    feed_back,
    joint_nis,
    keep_apart,
    measure,
    set_place,
    touched,
    update_held,
)
from truenorth.estimate.memory import (
    ABSENT,
    DISTURB,
    IN_BODY,
    PLACE,
    REJECTED,
    REOPENED,
    USED,
    Events,
    Kept,
    Memory,
    Model,
    Samples,
    Sources,
    Task,
)
from truenorth.estimate.predict import describe, describe_instant, predict_to_event, take_sample
from truenorth.filters.recursion import SOUND, update, workspace
from truenorth.state.now import NOW_BEHIND, NOW_LENGTH
from truenorth.strapdown.wander import set_matrix

Array = NDArray[np.float64]

LONGEST_STEP = 0.3  # of the vertical loop's time constant: longer steps would make it swing
SAME_TIME = 1e-6  # s: an event this near the end of a sample is at its end
_PHI, _DV = 0, 3


class Room(NamedTuple):
    """What an event is worked out in.

    `F` (N, N), `rate` (n,), `S` (3, 4), `R` (3,), `now`; `Phi`, `Q` since it, or (0, 0); places of `columns` (N,); `s`, `aux`, `x`
    of an output; of a motion whose errors are kept apart `there`, as `now`, and `z` (3,), once they are taken off;
    `bent` for rows along a curve.
    """

    F: Array
    rate: Array
    S: Array
    R: Array
    now: Array
    Phi: Array
    Q: Array
    columns: NDArray[np.int64]
    s: Array
    aux: Array
    x: Array
    there: Array
    z: Array
    bent: along_curve.Bent


@borrowing(forceinline=True)
def correct(
    size: Any,
    m: Memory,
    model: Model,
    sources: Sources,
    events: Events,
    k: int,
    number: int,
    time: float,
    w: Any,
    room: Room,
    kept: Kept,
    link: int,
    exact: bool,
) -> int:
    """Take event k, a measurement, `number` in the histories; with `exact` its innovations are `room.z`. The failure, if any."""
    source, now, R = events.source[k], room.now, room.R
    for a in range(3):
        R[a] = events.variance[k, a]
    measure(m, model, sources, source, events.measured[k], now, w, R)
    if model.opened and not exact:
        shown_late.as_it_moves(model.lag, m.x, w.H)
    arm_turned(sources.states[source, AT_ARM], m.sums.C_now, w, R)
    if sources.action[source] == PLACE:
        if not np.isnan(w.z[0]):
            set_place(size, m, now, R, w)
        return SOUND
    for a in range(3):
        w.R[a, a] = R[a]
        if np.isnan(events.variance[k, a]):
            w.z[a] = np.nan
        elif exact:
            w.z[a] = room.z[a]
        elif model.opened:
            for b in range(len(m.x)):
                w.z[a] -= w.H[a, b] * m.x[b]
    if model.opened:
        shown_late.as_late_as_known(model.lag, m.x, now, w.H)
    kept.when[number] = time
    in_body, lever = along_curve.knows_body(model, m.s, m.aux, w.P), along_curve.lever_now(model, m.s, m.lever, w.P)
    if in_body and sources.over_ground[source]:
        along_curve.follow(size, m, model.drift, lever, w, room.bent)
    for a in range(3):
        kept.innovation[number, a] = w.z[a]
    columns = room.columns[: touched(w.H, room.columns)]
    count, nis = joint_nis(size, w, columns, room.S, kept.sigma[number])
    if count == 0:
        return SOUND
    kept.nis[number] = nis
    kept.verdict[number] = USED
    smoothing = kept.Phi.shape[0] > 0
    if not nis <= sources.gates[source, count - 1]:
        kept.verdict[number] = REJECTED
        m.refused[source] += 1
        if m.refused[source] <= sources.patience[source]:
            return SOUND
        # It has jumped and stays there: open the states that take it up.
        kept.verdict[number] = REOPENED
        jump = 0.0
        for a in range(3):
            if not np.isnan(w.z[a]):
                jump += w.z[a] * w.z[a]
        for a in range(sources.opens[source], sources.opens[source] + 3):
            w.P[a, a] += jump
            if smoothing:
                room.Q[a, a] += jump
    m.refused[source] = 0
    if smoothing:
        for a in range(3):
            kept.R[link, a] = w.R[a, a]
            for b in range(len(m.aux)):
                kept.H[link, a, b] = w.H[a, b]
    loop = sources.loop[source]
    if loop > 0.0:
        damp_height(size, m.sums.C_now, min(time - m.heard[0], LONGEST_STEP * loop), loop, w)
        m.heard[0] = time
    elif model.held:
        failure = update_held(size, w, model.dynamics.held, columns)
        if failure != SOUND:
            return failure
    else:
        failure, _, _ = update(size, w, False, True, columns)
        if failure != SOUND:
            return failure
    if smoothing:
        for b in range(len(m.aux)):
            kept.dx[link, b] = w.x[b]
    if model.opened:
        shown_late.keep_moment(model.lag, w.x, w.P)
        keep_apart(m.x, w.x)
        if time >= model.until:
            feed_back(m.s, m.aux, m.x, model.dynamics.turns)
            set_matrix(m.s, m.sums.C_now)
        return SOUND
    if smoothing:
        along_curve.keep_reset(m, model, in_body, lever, w.x, kept.D[link])
    along_curve.reset(m, model, in_body, lever, w)
    if model.invariant >= IN_BODY:
        along_curve.move_lever(m.lever, w.x, sources.over_ground[source], w.P)
    shown_late.keep_moment(model.lag, w.x, w.P)
    if smoothing:
        shown_late.keep_link(model.lag, w.x, kept.D[link])
    feed_back(m.s, m.aux, w.x, model.dynamics.turns)
    set_matrix(m.s, m.sums.C_now)
    return SOUND


@borrowing(forceinline=True)
def keep(m: Memory, model: Model, w: Any, room: Room, time: float, j: int, kept: Kept) -> None:
    """Put out the state at an epoch, less its known errors."""
    for a in range(len(m.s)):
        room.s[a] = m.s[a]
    for a in range(len(m.aux)):
        room.aux[a], room.x[a] = m.aux[a], m.x[a]
    if model.opened:
        feed_back(room.s, room.aux, room.x, model.dynamics.turns)
    kept.time[j] = time
    kept.lever[j, 0], kept.lever[j, 1] = m.lever[0], m.lever[1]
    for a in range(12):
        kept.state[j, a] = room.s[a]
    for a in range(9, len(m.aux)):
        kept.aux[j, a] = room.aux[a]
    if kept.P.shape[0] > 0:
        copy_corner(w.P, kept.P[j], len(m.aux), len(m.aux))


@borrowing
def keep_link(kept: Kept, link: int, n: int, Phi: Any, Q: Any) -> None:
    """Put out transition and noise since the last event, for the smoother, and begin them anew."""
    for a in range(n):
        for b in range(n):
            kept.Phi[link, a, b] = Phi[a, b]
            kept.Q[link, a, b] = Q[a, b]
    for a in range(len(Phi)):
        for b in range(len(Phi)):
            Phi[a, b] = 1.0 * (a == b)
            Q[a, b] = 0.0


@borrowing(forceinline=True)
def time_of(samples: Samples, i: int, done: float) -> float:
    """Where the loop stands, a part `done` of sample i taken."""
    if i < len(samples.step):
        return samples.end[i] - (1.0 - done) * samples.step[i]
    if i == 0:
        return samples.end[0] - samples.step[0]
    return samples.end[i - 1]


@borrowing(forceinline=True)
def next_event(events: Events, late: Events, sources: Sources, aux: Any, k: int, r: int, took: bool) -> Any:
    """The next re-timed event's time, whether it shares its stamp with one just taken, whether it is the next, and when."""
    target = np.inf
    if r < len(late.time):
        target = late.time[r]
        at_lag = sources.states[late.source[r], AT_LAG]
        if at_lag >= 0:
            target -= aux[at_lag]
    # What has one stamp belongs to one epoch, even where the first of it has moved the delay.
    together = took and r < len(late.time) and late.time[r] == late.time[r - 1]
    retimed = together or k >= len(events.time) or target <= events.time[k]
    return target, together, retimed, target if retimed else events.time[k]


@compiled
def take_up(size: Any, m: Memory) -> Any:
    """A workspace with the covariance as it was left."""
    w = workspace(size, 3)
    load(size, m.P, w.P)
    for a in range(len(m.aux)):
        w.largest[a] = m.largest[a]
    return w


@borrowing
def put_back(m: Memory, w: Any) -> None:
    """Remember the covariance. No slice is assigned: what would report a wrong shape takes seconds to compile."""
    for a in range(len(m.aux)):
        m.largest[a] = w.largest[a]
        for b in range(len(m.aux)):
            m.P[a, b] = w.P[a, b]


@borrowing
def go_through(size: Any, task: Task, m: Memory, kept: Kept, w: Any, room: Room) -> Any:
    """The loop of :func:`run`, in what that made room for."""
    samples, start, events, late, sources, model, horizon = task
    F, rate, now, Phi, Q = room.F, room.rate, room.now, room.Phi, room.Q
    n, smoothing = len(m.aux), kept.Phi.shape[0] > 0
    set_matrix(m.s, m.sums.C_now)
    s, aux, sums, sensors, fixed_altitude = m.s, m.aux, m.sums, model.sensors, model.fixed_altitude
    zero = np.int64(0)  # typed: what is handed a plain 0 is compiled once more, for a literal
    i, k, r, j, link = start, zero, zero, zero, zero
    failure, number, took = SOUND, zero, np.bool_(False)
    while k < len(events.time) or r < len(late.time):
        target, together, retimed, time = next_event(events, late, sources, aux, k, r, took)
        reached = True
        while not together:
            if i >= horizon:
                # The end of what may be taken: an event at it is reached, one behind it is not.
                edge = samples.end[horizon - 1] if horizon > 0 else samples.end[0] - samples.step[0]
                reached = time - edge < SAME_TIME
                break
            T = samples.step[i]
            ahead = time - (samples.end[i] - (1.0 - m.done[0]) * T)
            if ahead < SAME_TIME:
                break
            ends = ahead > (1.0 - m.done[0]) * T - SAME_TIME
            part = 1.0 - m.done[0] if ends else ahead / T
            take_sample(s, samples, i, part, ends, sensors, fixed_altitude, aux, sums)
            i, m.done[0] = (i + 1, 0.0) if ends else (i, m.done[0] + part)
        if not reached:
            break
        if not retimed and events.source[k] < 0 and not events.output[k] and m.sums.T[0] <= model.spare:
            k += 1
            continue
        if model.covariance and m.sums.T[0] > 0.0:
            predict_to_event(size, m, model, F, rate, now, w, Q, Phi)
            if model.invariant >= IN_BODY:
                along_curve.lengthen_lever(m, F, w.P, Q)
            if len(model.dynamics.acts) > 0:
                feed_back(m.s, m.aux, w.x, model.dynamics.turns)
                set_matrix(m.s, m.sums.C_now)
        of = late if retimed else events
        e = r if retimed else k
        number = len(events.time) + r if retimed else k
        source = of.source[e]
        if source >= 0 and sources.action[source] == DISTURB:
            disturb(of, e, w.P)
            if smoothing:
                disturb(of, e, Q)
        elif source >= 0:
            here = time_of(samples, i, m.done[0])
            behind = here - target if retimed else 0.0
            # Earlier than it can be reached, by a delay that has just grown, or where the start was taken from: nothing new.
            if retimed:
                took = together or (m.means.T[0] > 0.0 and abs(behind) < samples.step[max(0, i - 1)])
            if took or not retimed:
                since = 0.0
                if retimed:
                    since = here - late.time[r]
                exact = is_exact(model, w.P)
                describe(m, model, now)
                if exact:
                    innovations_there(m, model, sources, of, e, samples, i, since, w, room)
                now[NOW_BEHIND] = since
                if sources.instant[source]:
                    describe_instant(samples, i, m.done[0], model, m.aux, now)
                failure = correct(
                    size, m, model, sources, of, e, number, here if retimed else time, w, room, kept, link, exact
                )
                if failure != SOUND:
                    break
        if smoothing and (source >= 0 or of.output[e]):
            keep_link(kept, link, n, Phi, Q)
            link += 1
        if of.output[e] and not (retimed and kept.verdict[number] == ABSENT):
            keep(m, model, w, room, kept.when[number] if retimed else time, j, kept)
            j += 1
        if retimed:
            r += 1
        else:
            k += 1
    return failure, i, number if failure != SOUND else k, r, j


@compiled
def run(size: Any, task: Task, m: Memory, kept: Kept) -> Any:
    """Go on through all events that the samples reach.

    Parameters
    ----------
    task : Task
    m, kept : Memory, Kept
        Changed in place.

    Returns
    -------
    failure : int
        Of :mod:`truenorth.filters.recursion`.
    sample : int
        The next to be taken.
    event, row : int
        The next events of either kind; with a failure, event is where, counted as the histories are.
    outputs : int
    """
    n, N = len(m.aux), len(size)
    w = take_up(size, m)
    links = N * (kept.Phi.shape[0] > 0)
    room = Room(
        np.zeros((N, N)),
        np.zeros(n),
        np.zeros((3, 4)),
        np.zeros(3),
        np.zeros(NOW_LENGTH),
        np.zeros((links, links)),
        np.zeros((links, links)),
        np.zeros(N, dtype=np.int64),
        np.zeros(len(m.s)),
        np.zeros(n),
        np.zeros(n),
        np.zeros(NOW_LENGTH),
        np.zeros(3),
        along_curve.bent(N),
    )
    for a in range(links):
        room.Phi[a, a] = 1.0
    result = go_through(size, task, m, kept, w, room)
    put_back(m, w)
    return result
