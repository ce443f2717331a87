"""The passes of a transfer alignment: they fit the noise of the master's rows, and lead to the motion to linearise about.

The first two are closed loops, which find their way from a start that is off by degrees. Those after them are open loops about what
the pass before has found (:mod:`truenorth.alignment.transfer_nominal`), until they find nothing new.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import FIRST_NOISE, Translation
from truenorth.aiding.source import Aiding
from truenorth.alignment.transfer_bending import bend_along
from truenorth.alignment.transfer_columns import columns_along
from truenorth.alignment.transfer_filter import (
    Assumed,
    Linear,
    Matching,
    axes_along,
    master_aiding,
    transfer_filter,
)
from truenorth.alignment.transfer_nominal import Carried, Nominal, carried_back, carried_for, found_by
from truenorth.alignment.transfer_rows import by_rows
from truenorth.alignment.transfer_smoothed import LONGEST, flatter_along
from truenorth.errors.bending import BENDING
from truenorth.errors.master import ARM, DELAY, FILTER, MOUNTING, TransferModel
from truenorth.estimate.batch import OpenPass, settle
from truenorth.estimate.memory import REOPENED, USED
from truenorth.quality.stamps import scattered, stamp_scatter
from truenorth.quality.whiteness import whiteness
from truenorth.records import ImuRecord, MasterRecord
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

CLOSED = 2  # passes of a closed loop
MOST = 8  # open ones
WIDER = 3.0  # the same master's velocity and force are not quite news to each other
SURELY = 5.0  # sigmas of a delay that the slow part of the motion has shown: the phase of the fast part is known by it
SETTLED = 0.3  # of a sigma: a pass that moves attitude, arm, delay and seat by less is the last
PIECE = 10.0  # s, of innovations: longer than a seat that bends remembers
LEAST = 0.1  # of the noise to begin with: less is not believed
AS_FAR = 0.5  # of the step before: a step back of the fitted noise by more goes to and fro


@dataclass(frozen=True)
class Found:
    """What the passes lead to."""

    noise: tuple[float, float]  # of translation and attitude of the master's rows
    linear: Linear
    nominal: Nominal
    left: float = 0.0  # sigmas that the last pass has still moved what it found by


class _Steps:
    """From pass to pass the noise of the rows moves to what was fitted, by half as much from there on where it goes to and fro.

    What the filter's own state has of the innovations is taken off them, and is as large as the noise that it was given: where that
    is too large, too much is taken off, and the next noise is too small. In a short log it went from 2 m to .1 m and back for ever;
    by .1 m the gate rejected half of the rows.
    """

    def __init__(self) -> None:
        self.last, self.share = np.zeros(2), np.ones(2)

    def taken(self, noise: tuple[float, float], fitted: tuple[float, float]) -> tuple[float, float]:
        """The noise of the next pass; steps are of its logarithm."""
        old, new = np.array(noise), np.array(fitted)
        there = np.isfinite(old) & np.isfinite(new)
        step = np.log(np.divide(new, old, out=np.ones(2), where=there))
        self.share[(step * self.last < 0.0) & (np.abs(step) > AS_FAR * np.abs(self.last))] = 0.5
        self.last = self.share * step
        result = np.where(there, old * np.exp(self.last), new)
        return float(result[0]), float(result[1])


class _Log:
    """Two logs, and the motion that they are linearised about: the loop does it row by row."""

    def __init__(self, nominal: Nominal, mounting: slice | None) -> None:
        self.nominal, self.mounting = nominal, mounting

    def linearise(self) -> Nominal:
        """The motion."""
        return self.nominal

    def correct(self, x: Array) -> None:
        """Take what was found off it."""
        self.nominal = self.nominal.corrected(x, self.mounting)


def found_in_passes(
    slave: ImuRecord,
    master: MasterRecord,
    model: TransferModel,
    handed: Callable[[tuple[float, float]], tuple[ImuRecord, Start]],
    assumed: Assumed,
    noise: tuple[float, float],
    fitted: Sequence[bool],
    kind: Translation,
    tell: Callable[[str], None],
) -> Found:
    """Passes that fit the noise of the master's rows, and find the motion to linearise about.

    Parameters
    ----------
    handed : callable
        The slave's record and its start, by the noise of the rows.
    fitted : two of bool
        Whether each noise is to be fitted.
    """
    linear: Linear | None = None
    passes, steps = 0, _Steps()

    def once(nominal: Nominal | None) -> Track:
        nonlocal noise, linear, passes
        tell(f"pass {passes + 1}")
        part, start = handed(noise)
        # Of an acceleration the columns must be known at the right time: the first look at the delay is by velocity.
        velocity = kind == "acceleration" and passes == 0
        rows = Matching(*noise, kind, limit("master's gate") if passes > 0 else 0.0)
        if velocity:
            rows = Matching(FIRST_NOISE["velocity"], noise[1])
        track = transfer_filter(part, master, model, start, rows, assumed, linear=linear, nominal=nominal)
        noise = noise if velocity else steps.taken(noise, _refitted(track, noise, fitted, kind))
        if passes + 1 == CLOSED and kind == "velocity":
            track = _arm_as_said(track)
        begin = linear.begin if linear is not None else delay_found(track) if velocity else None
        passes += 1
        means = noise[0] if kind == "velocity" and np.isfinite(noise[0]) else None
        found = _linear(part, master, track, model, assumed, begin, means, linear, passes >= CLOSED)
        linear = found if velocity else _with_scatter(found, linear, track, master_aiding(master, model, assumed, rows))
        return track

    for _ in range(CLOSED):
        track = once(None)
    part, mounting = handed(noise)[0], model.slice_of(MOUNTING)
    log = _Log(found_by(part, track, model), mounting)

    def open_loop(nominal: Nominal) -> OpenPass:
        track = once(nominal)
        led_back = found_by(part, track, model)
        return OpenPass(track, nominal.off(led_back.C_nb, led_back.values, mounting), (DELAY, ARM, MOUNTING))

    last = settle(log, open_loop, lambda found: found.moved, enough=SETTLED, most=MOST)
    assert linear is not None
    return Found(noise, linear, log.nominal.corrected(last.found.end, mounting), last.moved)


def _arm_as_said(track: Track) -> Track:
    """Without what a closed loop says of the arm, to begin open loops with.

    The noise in its columns parts a delay from an arm forward, which in turns at a steady speed are one: a consumer slave's arm was
    15 m, of one that was known to 1 m. What is worked out for such an arm has fifteen times the noise of the gyros' spin.
    """
    at = track.layout.slice_of(ARM)
    if at is None:
        return track
    sensors = track.sensors.copy()
    sensors[:, at] = 0.0
    return replace(track, sensors=sensors)


def delay_found(track: Track) -> tuple[float, float] | None:
    """The delay that a pass by velocity tells, with `WIDER` times its sigma, to begin the matching of acceleration with.

    Over the onset of a manoeuvre (some tenths of a second) a force is no straight line: with a delay off by 50 ms its column is
    wrong by several sigmas of a row, and the first rows would settle the delay falsely. None: there is no such state.
    """
    tau = track.layout.slice_of(DELAY)
    if tau is None:
        return None
    first, last = (float(np.sqrt(P[tau, tau][0, 0])) for P in (track.P[0], track.P[-1]))
    return float(track.sensors[-1, tau][0]), min(first, WIDER * last)


def _linear(
    slave: ImuRecord,
    master: MasterRecord,
    track: Track,
    model: TransferModel,
    assumed: Assumed,
    begin: tuple[float, float] | None,
    sigma: float | None,
    before: Linear | None,
    opened: bool,
) -> Linear:
    """Attitudes at the master's rows as the slave's gyros and the final answer have them; else as the master gives its own.

    Where rows of velocity with this noise, m/s, come next, with what their filter makes flatter; in an open loop, their columns.
    Of a seat that bends, how.
    """
    C_nb, carried = np.full((len(master), 3, 3), np.nan), carried_back(slave, track, carried_for(slave, model))
    rows = np.searchsorted(master.time - assumed.delay, by_rows(track).stamp)
    C_nb[rows] = carried.C_nb
    C_nm = C_nb @ axes_along(track, assumed)[-1].T
    if master.C_nb is not None:
        C_nm = np.where(np.isnan(C_nm), master.C_nb, C_nm)
    tau = track.layout.slice_of(DELAY)
    late, phase = (
        (0.0, math.inf) if tau is None else (float(track.sensors[-1, tau][0]), SURELY * float(track.sigma[-1, tau][0]))
    )
    columns = flatter = C_late = None
    own = track.layout.slice_of(FILTER)
    # No filter is early, or later than is borne: what is found beyond is the fault of something else, and a row there tells less.
    of_filter = 0.0 if own is None else float(np.clip(track.sensors[-1, own][0], 0.0, LONGEST))
    held = master.time - assumed.delay - late - of_filter
    bend = None
    if any(model.flexure_sigma) and master.C_nb is not None:
        C_rigid, when = rigid_rows(master, track, carried, assumed)
        own_k = track.layout.slice_of(BENDING)
        coupling = np.array(model.coupling) + (0.0 if own_k is None else track.sensors[-1, own_k])
        bend = bend_along(slave, carried, C_rigid, when, model, coupling)
    if sigma is not None:
        if of_filter != 0.0:
            C_late = np.full_like(C_nb, np.nan)
            C_late[rows] = carried.at(slave, held[rows])
        seat = (assumed.lever_arm, assumed.lever_arm_sigma)
        flatter = flatter_along(slave, track, carried, model, held, seat, sigma, bend)
    if sigma is not None and opened:
        said = (assumed.lever_arm, assumed.lever_arm_sigma, assumed.delay_sigma)
        calibrated = before is not None and before.columns is not None
        columns = columns_along(slave, track, carried, model, held, said, sigma, calibrated, bend)
    return Linear(C_nm, C_nb, late, begin, phase, columns, flatter=flatter, late=of_filter, C_late=C_late, bend=bend)


def rigid_rows(master: MasterRecord, track: Track, carried: Carried, assumed: Assumed) -> tuple[Array, Array]:
    """Attitudes of the rigid body (K, 3, 3) at a master's rows, by its own and the mounting, in the axes in which `carried.q` is.

    With them the times at which they held (K,), s, by what a pass has found.
    """
    assert master.C_nb is not None
    rows, tau = np.searchsorted(master.time - assumed.delay, by_rows(track).stamp), track.layout.slice_of(DELAY)
    late = 0.0 if tau is None else float(track.sensors[-1, tau][0])
    C_nb = master.C_nb[rows] @ axes_along(track, assumed)[-1]
    return np.swapaxes(carried.C_n0, 1, 2) @ C_nb, master.time[rows] - assumed.delay - late


def _with_scatter(found: Linear, before: Linear | None, track: Track, sources: list[Aiding]) -> Linear:
    """With what stamps that scatter add to the sigmas of rows, each kind by itself: often they come in other messages."""
    had = {} if before is None else before.scatter
    measured = [source for source in sources if source.does == "measurement"]
    scatter = {s.name: stamp_scatter(track, [s], had.get(s.name, 0.0)) for s in measured}
    added = {name: sigmas for s in measured for name, sigmas in scattered([s], track, scatter[s.name]).items()}
    return replace(found, scatter=scatter, scattered=added)


def _refitted(
    track: Track, noise: tuple[float, float], fitted: Sequence[bool], first: Translation
) -> tuple[float, float]:
    """Noise by which the innovations of the later three quarters have the spread that the filter says, medians throughout.

    Where they are coloured (a seat that bends, vibration between the rows), as much as white noise of their density: so many rows
    tell delay, arm and mounting no better than fewer.
    """
    later, said = slice(len(track) // 4, None), by_rows(track)
    result = list(noise)
    for kind, (sigma, least) in enumerate(zip(noise, (FIRST_NOISE[first], FIRST_NOISE["attitude"]), strict=True)):
        if not fitted[kind]:
            continue
        columns = slice(3 * kind, 3 * kind + 3)
        nu, claimed = said.innovation[later, columns], said.sigma[later, columns]
        if np.isfinite(nu).any():
            spread = (1.4826 * float(np.nanmedian(np.abs(nu)))) ** 2
            of_state = max(0.0, float(np.nanmedian(claimed**2)) - sigma**2)
            used = np.isin(said.verdict[later, kind], (USED, REOPENED))
            colour = _colour(track.time[later][used], (nu / claimed)[used])
            result[kind] = max(colour * math.sqrt(max(spread - of_state, 0.0)), LEAST * least)
    return result[0], result[1]


def _colour(time: Array, e: Array) -> float:
    """By how much a mean of innovations (K, 3), each by its sigma, errs more than one of white ones: the least of all pieces.

    A line is taken off each piece: what drifts, or jumps once, is no noise, and is judged as such.
    """
    if len(time) == 0:
        return 1.0
    pieces = max(1, int((time[-1] - time[0]) / PIECE))
    found = []
    for x in np.array_split(e[:, np.isfinite(e).all(axis=0)], pieces):
        line = np.column_stack([np.ones(len(x)), np.arange(len(x))])
        x = x - line @ np.linalg.lstsq(line, x, rcond=None)[0]
        seen = whiteness(x / max(float(np.sqrt(np.mean(x**2))), 1e-300))
        found.append(seen.colour if seen.sure else 1.0)
    return min(found)
