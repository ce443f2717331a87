"""Passes over the log of a receiver that filters its velocities: of another moment than its places, and without quick swings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from truenorth.alignment.in_motion_passes import Pass, begun, once_more
from truenorth.alignment.in_motion_start import Guess, backtracked, led_back
from truenorth.alignment.in_motion_task import INTERVAL, MovingTask
from truenorth.core.errors import DataError, UsageError
from truenorth.estimate.known_motion import is_led_by_errors
from truenorth.estimate.moment import likeliest_moment, quickness, tells_until
from truenorth.estimate.moments import explained_by_two, velocities_apart
from truenorth.state.evidence import Evidence
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

MOST = 6  # passes, until delays have settled


def two_moments(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Pass]:
    """Task and last pass with a delay of the velocities alone, where the log speaks for it; else the same ones."""
    antenna = velocities_apart(task.antenna, task.gnss)
    if antenna is task.antenna:
        return task, found
    apart = replace(task, antenna=antenna)
    try:
        track = apart.run(found.guess, gated=True)
        if not explained_by_two(track, found.track, delays=True):
            return task, found
        return _settled(apart.learnt(track)[0], found, first)
    except DataError:  # the filter broke down: they are of one moment
        return task, found


def with_smoothed_motion(
    task: MovingTask, found: Pass, first: Guess, tell: Callable[[str], None]
) -> tuple[MovingTask, Pass]:
    """Task and last pass whose places are late by smoothed velocities, where errors of those of the pass matter; else the same."""
    if not is_led_by_errors(found.track, task.aiding(gated=True), INTERVAL):
        return task, found
    tell("smoothing")
    try:
        known = replace(task, moves=task.run(found.guess, gated=True, smooth=True))
        return known, once_more(known, found, first)
    except (DataError, UsageError):  # the filter broke down, or has states that are not smoothed
        return task, found


def of_the_shake(task: MovingTask, found: Pass) -> tuple[MovingTask, Pass, tuple[Evidence, ...]]:
    """Task and first pass with the moment that a receiver shows of an antenna that shakes; else the same ones."""
    if task.gnss is None or (quick := quickness(task.antenna, task.record, found.track)) == 0.0:
        return task, found, ()
    shaken, end = replace(task, shaken=True), tells_until(found.track)
    until = end if end < task.record.time[-1] else None

    def run(antenna: Mounting) -> Track:
        return replace(shaken, antenna=antenna).run(found.guess, gated=False, until=until)

    def again(antenna: Mounting, track: Track) -> Track:
        first, back = found.guess, backtracked(task.record, track)
        # As wide as at first: of a heading that is narrow and off, velocities say which delay it likes best.
        guess = replace(led_back(track, back, task.spec, first), heading_sigma=first.heading_sigma)
        return replace(shaken, antenna=antenna).run(guess, gated=False, until=until)

    best = likeliest_moment(run, again, task.antenna, quick)
    if not best.shown:
        return task, found, ()
    shaken = replace(shaken, antenna=best.antenna, delay_spread=best.spread)
    try:
        return shaken, begun(shaken, found.guess, shaken.run(found.guess, gated=False)), best.evidence
    except DataError:  # the filter broke down
        return task, found, ()


def with_swing_apart(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Pass]:
    """Task and last pass whose estimated arm is not learnt from the antenna's swing (:mod:`truenorth.aiding.velocity`).

    The passes before have found the delays with one arm for all: where two are known to metres from the first pass on, delays that
    are not known yet lose the filter (5 of 48 consumer IMUs under a mast of 2 m on rough ground).
    """
    if task.gnss is None or task.antenna.lever_arm_sigma == 0.0 or not task.gnss.has_velocity.any():
        return task, found
    try:
        return _settled(replace(task, swing_apart=True), found, first)
    except DataError:  # the filter broke down
        return task, found


def _settled(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Pass]:
    """Another task than that of the last pass, and its own last one, once what passes learn has settled."""
    last = once_more(task, found, first)
    for _ in range(MOST - 1):
        later, much = task.learnt(last.track)
        if not much and last.settled:
            break
        task = later
        last = once_more(task, last, first)
    return task, last
