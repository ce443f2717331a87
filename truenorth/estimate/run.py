"""The closed loop over a log: a timeline of events, the compiled run, and its answer turned into ENU."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding import row
from truenorth.aiding.source import COLUMNS, KINDS, Aiding
from truenorth.core.earth import radii
from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import padded
from truenorth.errors.model import InsModel
from truenorth.errors.whole_bias import taken_apart
from truenorth.estimate import loop as kernel
from truenorth.filters.recursion import NO_INNOVATION_VARIANCE, SOUND
from truenorth.records import ImuRecord
from truenorth.state.layout import BA, BG, DP, DV, PHI
from truenorth.state.state import Start
from truenorth.state.track import Residuals, Track
from truenorth.strapdown import wander
from truenorth.strapdown.increments import increments, interval_lengths, read_only

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]
POLE = np.radians(89.999)  # beyond, north has no meaning that a metre of position leaves


@dataclass(frozen=True)
class Timeline:
    """Events in order: (K,) time, source, output; (K, 3) measured, variance; `outside` counts of each source."""

    time: Array
    source: NDArray[np.int64]
    row: NDArray[np.int64]
    output: NDArray[np.bool_]
    measured: Array
    variance: Array
    outside: list[int]


def timeline(ends: Array, begin: float, interval: float, every: int, aiding: Sequence[Aiding]) -> Timeline:
    """Merge the filter's grid (on sample ends), output and measurements.

    Parameters
    ----------
    ends : (N,) array, s
        Of the samples.
    begin : float, s
        Of the first sample.
    interval : float, s
        Of the grid, about.
    every : int
        Output at every so many grid points, at the beginning and at the end.
    aiding : sequence of Aiding
    """
    stride = max(1, round(interval * len(ends) / (ends[-1] - begin)))
    grid = np.unique(np.append(np.arange(stride - 1, len(ends), stride), len(ends) - 1))
    output = (np.arange(1, len(grid) + 1) % every) == 0
    output[-1] = True
    nothing = np.zeros((1 + len(grid), 3))
    times, measured, variance = [np.append(begin, ends[grid])], [nothing], [nothing]
    sources, rows = [np.full(1 + len(grid), -1, np.int64)], [np.zeros(1 + len(grid), np.int64)]
    outputs, outside = [np.append(True, output)], []
    for number, sensor in enumerate(aiding):
        near = np.clip(np.searchsorted(ends, sensor.time), 0, len(ends) - 1)
        near = np.where((near > 0) & (sensor.time - ends[near - 1] < ends[near] - sensor.time), near - 1, near)
        at = np.where(np.abs(ends[near] - sensor.time) < kernel.SAME_TIME, ends[near], sensor.time)
        inside = np.flatnonzero((at >= begin) & (at <= ends[-1]))
        outside.append(len(at) - len(inside))
        times.append(at[inside])
        sources.append(np.full(len(inside), number, np.int64))
        rows.append(inside.astype(np.int64))
        outputs.append(np.zeros(len(inside), dtype=bool))
        measured.append(sensor.measured[inside])
        variance.append(sensor.sigma[inside] ** 2)
    time, source = np.concatenate(times), np.concatenate(sources)
    order = np.lexsort(np.stack([1.0 * (source == -1), time]))  # by time, measurements before the output of their time
    return Timeline(
        time[order],
        source[order],
        np.concatenate(rows)[order],
        np.concatenate(outputs)[order],
        np.ascontiguousarray(np.concatenate(measured)[order]),
        np.ascontiguousarray(np.concatenate(variance)[order]),
        outside,
    )


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
    invariant: bool = False,
) -> Track:
    """Mechanise a log from a start, aided by measurements.

    Parameters
    ----------
    record : ImuRecord
        Its first sample begins at the start's epoch.
    start : Start
    model : InsModel
        With the states that `aiding` asks for among its groups (see :func:`with_states`).
    aiding : sequence of Aiding
    interval : float, s
        Of the filter's prediction; forces and turns within it are integrated sample by sample.
    every : int
        Output at every so many intervals.
    covariance : bool
        Carry the covariance; needed for any aiding.
    smooth : bool
        Smooth over the whole log (Rauch, Tung, Striebel).
    invariant : bool
        Corrections turn velocity with attitude (:mod:`truenorth.errors.invariant`): for starts with a heading that is far off.

    Returns
    -------
    Track

    Raises
    ------
    UsageError
        Smoothing with a vertical loop, or of invariant errors.
    DataError
        The filter broke down (see :func:`truenorth.filters.kalman`).
    """
    if smooth and any(source.loop > 0.0 for source in aiding):
        raise UsageError("a vertical loop has fixed gains and cannot be smoothed; expected a Kalman gain (no loop)")
    if smooth and invariant:
        raise UsageError("invariant errors are not smoothed; align first, then navigate with smooth=True")
    n = model.states
    steps = interval_lengths(record)
    begin = float(record.time[0] - steps[0])
    plan = timeline(record.time, begin, interval, every, aiding)
    outputs, events = int(plan.output.sum()), len(plan.time)
    carried = outputs if covariance or aiding else 0
    links = int(np.sum((plan.source >= 0) | plan.output)) if smooth else 0
    kept = kernel.Kept(
        state=np.empty((outputs, 12)),
        aux=np.zeros((outputs, n)),
        P=np.empty((carried, n, n)),
        innovation=np.full((events, 3), np.nan),
        sigma=np.full((events, 3), np.nan),
        nis=np.full(events, np.nan),
        verdict=np.zeros(events, dtype=np.int64),
        Phi=np.empty((links, n, n)),
        Q=np.empty((links, n, n)),
        H=np.zeros((links, 3, n)),
        dx=np.zeros((links, n)),
    )
    s = wander.state_at(start.C_nb, start.v_n, start.lat, start.lon, start.alt)
    if model.fixed_altitude:
        s[wander.VELOCITY][2] = 0.0
    if start.whole is None:
        aux = np.zeros(n)
        aux[BG], aux[BA] = start.gyro_bias, start.accel_bias
        P0 = model.prior(start.P)
    else:
        P0, aux = taken_apart(model, start.P, np.append(start.gyro_bias, start.accel_bias), start.whole)
    place = np.array([[start.lat, start.lon, start.alt]])
    J = convergence(np.eye(3)[None], s[None, wander.VELOCITY], place, n)[0]
    P0 = _solve(J, P0)
    P = P0.copy()
    dtheta, dvel = increments(record)
    # The sample before the first is not there: its coning would be missing, a tilt of nanoradians and millimetres an hour on.
    s[wander.LAST_ANGLE], s[wander.LAST_VELOCITY] = 2.0 * dtheta[0] - dtheta[1], 2.0 * dvel[0] - dvel[1]
    code, event = kernel.run(
        padded(n),
        kernel.Samples(*(read_only(a) for a in (steps, record.time, dtheta, dvel))),
        kernel.Events(plan.time, plan.source, plan.output, plan.measured, plan.variance),
        _sources(aiding, model),
        kernel.Model(model.decay, model.noise, model.sensor_states, model.fixed_altitude, *model.turn_noise, invariant),
        s,
        aux,
        P,
        carried > 0,
        kept,
    )
    if code != SOUND:
        _raise(code, plan, event, aiding)
    state, sensors, P = kept.state, kept.aux, kept.P
    if smooth:
        from truenorth.estimate.smoothing import smoothed

        state, sensors, P = smoothed(plan, kept, P0)
    C_nb, v_n, position, C_nw = wander.north(state)
    if carried:
        J = convergence(C_nw, v_n, position, n)
        P = J @ P @ np.swapaxes(J, 1, 2)
    residuals = tuple(
        _residuals(source, plan, kept, number) for number, source in enumerate(aiding) if source.kind != "disturbance"
    )
    return Track(plan.time[plan.output], C_nb, v_n, position, sensors, P, model.layout, residuals)


def with_states(model: InsModel, aiding: Sequence[Aiding]) -> InsModel:
    """The model with the states that the aiding sensors ask for; one that two sources share stands once."""
    groups = {group.name: group for source in aiding for group in source.states.values()}
    return replace(model, groups=(*model.groups, *groups.values()))


def convergence(C_nw: Array, v_n: Array, position: Array, n: int) -> Array:
    """(K, n, n) from errors along w to errors along ENU.

    Turned into these axes; and since ENU at the computed place is turned against ENU at the true one by the convergence
    of the meridians, ``c = tan L dp_E/(R_N + h)``: ``phi_U`` grows by it, and velocity is told in axes turned by it.
    """
    J = np.zeros((len(C_nw), n, n))
    J[:] = np.eye(n)
    for group in (PHI, DV, DP):
        J[:, group, group] = C_nw
    lat, alt = position[:, 0], position[:, 2]
    rate = np.tan(np.clip(lat, -POLE, POLE)) / (radii(lat)[1] + alt)
    c = rate[:, None] * C_nw[:, 0, :]  # told by dp along w
    J[:, PHI.stop - 1, DP] = c
    J[:, DV.start, DP] = c * v_n[:, 1:2]
    J[:, DV.start + 1, DP] = -c * v_n[:, :1]
    return J


def _solve(J: Array, P: Array) -> Array:
    inverse = np.linalg.inv(J)
    return np.ascontiguousarray(inverse @ P @ inverse.T)


def _sources(aiding: Sequence[Aiding], model: InsModel) -> kernel.Sources:
    figures = np.zeros((len(aiding), row.FIGURES))
    states = np.full((len(aiding), row.PLACES), -1, dtype=np.int64)
    for number, source in enumerate(aiding):
        figures[number, row.ARM] = source.lever_arm
        figures[number, row.MOUNT] = source.C_mb.ravel()
        figures[number, row.GATES] = source.gates()
        figures[number, row.LOOP] = source.loop
        for role, group in source.states.items():
            states[number, COLUMNS[role]] = model.layout.first_of(group.name)
    return kernel.Sources(np.array([KINDS[source.kind] for source in aiding], dtype=np.int64), figures, states)


def _residuals(source: Aiding, plan: Timeline, kept: kernel.Kept, number: int) -> Residuals:
    rows = np.flatnonzero((plan.source == number) & (kept.verdict != kernel.ABSENT))
    return Residuals(
        source.name,
        plan.time[rows],
        kept.innovation[rows],
        kept.sigma[rows],
        kept.nis[rows],
        kept.verdict[rows] == kernel.USED,
        plan.outside[number],
    )


def _raise(code: int, plan: Timeline, event: int, aiding: Sequence[Aiding]) -> None:
    name = aiding[plan.source[event]].name
    why = (
        "the variance of an innovation is not positive"
        if code == NO_INNOVATION_VARIANCE
        else "the covariance is lost in rounding"
    )
    raise DataError(
        f"navigation broke down at {plan.time[event]:.3f} s, at a measurement of {name}: {why}; check its sigmas"
    )
