"""Passes over the log of a receiver that filters its velocities: of another moment than its places, and without quick swings."""

from __future__ import annotations

from dataclasses import replace

from truenorth.alignment.in_motion_passes import Pass, once_more
from truenorth.alignment.in_motion_start import Guess
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.errors import DataError
from truenorth.estimate.moments import explained_by_two, velocities_apart

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
