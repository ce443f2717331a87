"""Do all sensors of a vehicle under way show the same moment? Its receiver, its gyros against its accelerometers."""

from __future__ import annotations

from dataclasses import replace

from truenorth.alignment.in_motion_learnt import SHOWN_DELAY, delay_of
from truenorth.alignment.in_motion_start import Guess, led_back
from truenorth.alignment.in_motion_task import LATENCY_SIGMA, MovingTask
from truenorth.core.errors import DataError
from truenorth.estimate.rivals import likelihood_ratio, moved
from truenorth.estimate.sensor_delay import gyro_delay_evidence
from truenorth.navigation.second_look import wrong_lag
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.track import Track


def clock_evidence(task: MovingTask, track: Track, guess: Guess, first: Guess, *, gated: bool) -> list[Evidence]:
    """What measurements say against the clock of a receiver whose latency is given, and against gyros of the same moment.

    A receiver that is later than it is said to be looks like gyros that are early: its lag is left open first. Rivals of the gyros
    have two passes: the guess is that of the log as it is, and `first` that of its first pass.
    """
    found: list[Evidence] = []
    if task.gnss is not None and task.antenna.latency_sigma == 0.0:
        open_ = replace(task, antenna=replace(task.antenna, latency_sigma=LATENCY_SIGMA))
        try:
            late = open_.run(guess, gated=gated)
        except DataError:  # the filter broke down: no explanation
            return []
        lag = delay_of(late, "GNSS")
        if lag is not None and abs(lag[0]) > SHOWN_DELAY * lag[1]:
            ratio = likelihood_ratio(track.residuals, late.residuals)
            if ratio > limit("rival"):
                off = wrong_lag("GNSS", "gnss", task.antenna, lag[0], lag[1])
                found.append(replace(off, kind="known", effect=moved(track, late)))
        task, track = open_, late

    def other(record: ImuRecord) -> Track:
        rival = replace(task, record=record)
        return rival.run(led_back(record, rival.run(guess, gated=gated), task.spec, first), gated=gated)

    return found + gyro_delay_evidence(other, track, task.record)
