"""Passes over the log of a receiver whose velocities are not of the moment of its places (:mod:`truenorth.estimate.moments`)."""

from __future__ import annotations

from dataclasses import replace

from truenorth.alignment.in_motion_passes import Pass, once_more
from truenorth.alignment.in_motion_start import Guess
from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.errors import DataError
from truenorth.estimate.moments import explained_by_two, velocities_apart

MOST = 6  # passes, until both delays have settled


def two_moments(task: MovingTask, found: Pass, first: Guess) -> tuple[MovingTask, Pass]:
    """Task and last pass with a delay of the velocities alone, where the log speaks for it; else the same ones."""
    antenna = velocities_apart(task.antenna, task.gnss)
    if antenna is task.antenna:
        return task, found
    apart = replace(task, antenna=antenna)
    try:
        track = apart.run(found.guess, gated=True)
        if not explained_by_two(track, found.track):
            return task, found
        other = found
        for _ in range(MOST):
            apart, much = apart.learnt(track)
            if not much and other.settled and other.task is not task:
                break
            other = once_more(apart, other, first)
            track = other.track
    except DataError:  # the filter broke down: they are of one moment
        return task, found
    return apart, other
