"""Do gyros and accelerometers have the same forward axis? The log once more with its gyros half a turn about the vertical.

A vehicle that stays level hardly turns about its level axes: gyros of which both are reversed see the earth turn about the opposite
of north, and an odometer follows the heading that they give, half a turn off, as well as the right one. What they leave behind is
the vehicle's pitching and rolling: level then swings by twice that, and the force with it. This is one rival, and it is tried as it
is: by chance its likelihood ratio exceeds ``exp(c / 2)`` in less than ``exp(-c / 2)`` of sound logs (Markov's inequality). Half a
turn about another axis reverses the vertical gyro too, which the first turn of the vehicle contradicts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.errors import DataError
from truenorth.estimate.rivals import likelihood_ratio
from truenorth.estimate.sensor_delay import not_of_gyros
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit
from truenorth.state.track import Track

HALF_TURN = np.array([-1.0, -1.0, 1.0])


def half_turn_evidence(task: MovingTask, track: Track, *, gated: bool) -> list[Evidence]:
    """Whether gyros whose level axes are reversed would fit the measurements better.

    Parameters
    ----------
    task : MovingTask
        Of gyros that find north: the rival begins with its own.
    track : Track
        Of the log as it is.
    gated : bool
        Whether measurements may be rejected.
    """
    rival = replace(task, record=replace(task.record, gyro=task.record.gyro * HALF_TURN))
    try:
        other = rival.run(rival.by_the_earth(), gated=gated)
    except DataError:  # the filter broke down: no explanation
        return []
    ratio = likelihood_ratio(not_of_gyros(track), other.residuals)
    if ratio <= limit("half turn"):
        return []
    return [contradiction("axes.half_turn", "imu_axes", ratio=ratio, chance=limit("half turn"))]
