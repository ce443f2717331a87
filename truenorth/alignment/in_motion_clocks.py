"""Do all sensors of a vehicle under way show the same moment? Its receiver and wheel, its gyros against its accelerometers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.in_motion_moments import two_moments
from truenorth.alignment.in_motion_passes import Pass, begun, once_more
from truenorth.alignment.in_motion_start import Guess, backtracked, led_back
from truenorth.alignment.in_motion_task import LATENCY_SIGMA, OUTPUT, MovingTask
from truenorth.core.errors import DataError
from truenorth.estimate.latency import SHOWN_DELAY, as_it_runs, as_stamped, best_rate, counted_between, delay_of
from truenorth.estimate.other_clocks import best_clock, clock_ratio
from truenorth.estimate.rivals import likelihood_ratio, moved
from truenorth.estimate.sensor_delay import gyro_delay_evidence
from truenorth.navigation.second_look import wrong_lag
from truenorth.records import ImuRecord, OdometerRecord
from truenorth.state.evidence import Effect, Evidence, Kind
from truenorth.state.limits import limit, may_be_chance
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

MORE_PASSES = 4  # of a log whose clocks are left open


def clock_evidence(task: MovingTask, track: Track, guess: Guess, first: Guess, *, gated: bool) -> list[Evidence]:
    """What measurements say against the clock of a receiver whose latency is given, and against gyros of the same moment.

    A receiver that is later than it is said to be looks like gyros that are early, and so does a wheel, whose slip
    goes with acceleration as a delay does: their lags are left open first, and the receiver's rows taken when they
    held. Of a tractor that rough ground rocks at 1 to 2 Hz a receiver late by some .01 s within its .03 s made gyros .03
    s later likelier by 30. Rivals of the gyros have two passes: the guess is that of the log as it is, and `first`
    that of its first pass. Neither they nor the log as it is have a wheel say that it stays on the road.
    """
    found: list[Evidence] = []
    shut = {"GNSS": ("gnss", task.antenna)} if task.gnss is not None else {}
    if task.odometer is not None:
        log = "odometer" if isinstance(task.odometer, OdometerRecord) else "velocity log"
        shut[log] = (log.split()[0], task.wheel)
    shut = {name: (key, m) for name, (key, m) in shut.items() if m.latency_sigma == 0.0}
    if shut:
        try:
            open_, guess, late, ratio = _of_open_clocks(task, guess, track, first, gated=gated)
        except DataError:  # the filter broke down: no explanation
            return []
        if ratio > limit("rival"):
            kind: Kind = "hint" if may_be_chance(ratio) else "known"
            counted = counted_between(late, "GNSS", open_.antenna, task.antenna)
            lags = {name: delay_of(counted, name) for name in shut}
            off = {name: lag for name, lag in lags.items() if lag is not None and abs(lag[0]) > SHOWN_DELAY * lag[1]}
            whole = moved(track, late)
            share = Effect(*(size / math.sqrt(max(len(off), 1)) for _, size in whole.items()))
            for name, lag in off.items():
                key, mounting = shut[name]
                found.append(replace(wrong_lag(name, key, mounting, lag[0], lag[1]), kind=kind, effect=share))
        task, track = open_, late
    seen = delay_of(track, "GNSS")
    if seen is not None:  # its column is that of no delay, and gyros that are later bring what it lacks
        task = replace(task, antenna=as_it_runs(task.antenna, track))
        track = task.run(guess, gated=gated)

    if isinstance(task.odometer, OdometerRecord):
        task = replace(task, sprung=True)
        track = task.run(guess, gated=gated)

    def led_by(record: ImuRecord, other: ImuRecord) -> Track:
        once = replace(task, record=other).run(guess, gated=gated)
        begin = led_back(once, backtracked(other, once), task.spec, first)
        return replace(task, record=record).run(begin, gated=gated)

    return found + gyro_delay_evidence(lambda record: led_by(record, record), track, task.record, led_by)


def on_another_clock(task: MovingTask, found: Pass) -> tuple[MovingTask, Pass, list[Evidence]]:
    """Task and first pass on a receiver's clock that runs far apart from the IMU's, where the log says so; else the same."""
    end = float(found.track.time[-1])
    until = end if task.record.time[-1] - end > OUTPUT else None  # of a bank's log the first part

    def run(antenna: Mounting) -> Track:
        return replace(task, antenna=antenna).run(found.guess, gated=False, until=until)

    best, unsure = (None, []) if task.gnss is None else best_clock(run, task.antenna, found.track)
    if best is None:
        return task, found, unsure
    apart = replace(task, antenna=best.antenna)
    other = begun(apart, found.guess, best.track)
    try:
        usual, far = _to_its_end(task, found), _to_its_end(apart, other)
    except DataError:  # the filter broke down: no explanation
        return task, found, unsure
    shown, likelier = best_rate(far[1]), clock_ratio(usual[1], far[1], usual[0], far[0]) > limit("rival")
    if likelier and shown is not None and abs(far[0].clock.rate + shown[0]) > SHOWN_DELAY * shown[1]:
        return apart, other, unsure
    return task, found, unsure


def _to_its_end(task: MovingTask, found: Pass) -> tuple[Mounting, Track]:
    """Antenna and track once passes have found the delays.

    Begun far from a delay of .5 s, a log fits a rate that comes near it in the end.
    """
    first = found.guess
    for _ in range(MORE_PASSES):
        task, much = task.learnt(found.track)
        found = once_more(task, found, first)
        if found.settled and not much:
            break
    task, found = two_moments(task, found, first)
    return task.antenna, task.run(found.guess, gated=False)


class _Opened(NamedTuple):
    """The task with its aids' clocks left open, where it begins, its track, and how much likelier than the one with clocks shut."""

    task: MovingTask
    guess: Guess
    track: Track
    ratio: float


def _of_open_clocks(task: MovingTask, guess: Guess, track: Track, first: Guess, *, gated: bool) -> _Opened:
    """The log with clocks left open.

    What passes with shut clocks have learnt of noise may be the work of a clock. Passes of its own learn anew then; with what they
    have learnt, and no gate, the log tells shut clocks from open ones.
    """
    open_ = replace(task, antenna=_opened(task.antenna), wheel=_opened(task.wheel))
    late = open_.run(guess, gated=gated)
    ratio = likelihood_ratio(track.residuals, late.residuals)
    usual = _Opened(open_, guess, late, ratio)
    if not (task.factors or task.scatter or task.unseen):
        return usual
    anew = replace(open_, factors={}, scatter=0.0, unseen=0.0, scattered={})
    try:
        found = begun(anew, first, anew.run(first, gated=False))
        for _ in range(MORE_PASSES):
            anew, much = anew.learnt(found.track)
            found = once_more(anew, found, first)
            if not much and found.settled:
                break
        shut = replace(anew, antenna=task.antenna, wheel=task.wheel)
        both = (
            as_stamped(tried.run(found.guess, gated=False).residuals, tried.antenna, tried.wheel)
            for tried in (shut, anew)
        )
        ratio = likelihood_ratio(*both)
    except DataError:  # the filter broke down: what was found before stands
        return usual
    return _Opened(anew, found.guess, found.track, ratio) if ratio > usual.ratio else usual


def _opened(mounting: Mounting) -> Mounting:
    """A sensor whose clock is not taken for known, as late all the time."""
    if mounting.latency_sigma > 0.0:
        return mounting
    return replace(mounting, latency_sigma=LATENCY_SIGMA, drift=mounting.clock)
