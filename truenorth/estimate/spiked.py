"""Single rows of an IMU that stand out: knocks, or errors of a transmission? The same log without them, by likelihood ratio.

What a spike is says :mod:`truenorth.quality.spikes`. A vehicle that is knocked has such rows as well, and theirs are true: with
each of them goes a velocity, or a turn, that the measurements show. So the log is run once more with the rows that their
neighbours say. Twice the logarithm of the likelihood ratio says which of the two it is; in doubt what the answer moves by is in
sigma.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.estimate.rivals import effect_of, last_sizes, likelihood_ratio, rival
from truenorth.quality.spikes import spikes_of
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence
from truenorth.state.judge import weight
from truenorth.state.limits import limit
from truenorth.state.track import Track
from truenorth.strapdown.increments import across_gaps, of_own_intervals

Array = NDArray[np.float64]


def without_spikes(record: ImuRecord) -> tuple[ImuRecord, int]:
    """The record with spikes replaced by what their neighbours say, and how many there were.

    Rows of increments are compared without the gaps that they hold: a gap has a part of a spike in the row before it.
    """
    sensors = of_own_intervals(record)
    gyro, accel = ([_mended(x, record.interval) for x in sensor.T] for sensor in sensors)
    count = sum(number for _, number in (*gyro, *accel))
    if count == 0:
        return record, 0
    turns, forces = (np.stack([x for x, _ in sensor], axis=1) for sensor in (gyro, accel))
    return across_gaps(replace(record, gyro=turns, accel=forces)), count


def _mended(values: Array, interval: float) -> tuple[Array, int]:
    """A channel (N,) without spikes, and their number."""
    at, said = spikes_of(values, interval)
    if not len(at):
        return values, 0
    mended = values.copy()
    mended[at] = said
    return mended, len(at)


def spike_evidence(run: Callable[[ImuRecord], Track], first: Track, record: ImuRecord) -> list[Evidence]:
    """Rows that stand out of their neighbours, and that the measurements do not know of.

    Parameters
    ----------
    run : callable
        The same measurements with another record.
    first : track
        Of the record as it is.
    record : ImuRecord
    """
    mended, count = without_spikes(record)
    if count == 0:
        return []
    try:
        other = run(mended)
    except DataError:  # the filter broke down: no explanation
        return []
    ratio, effect = likelihood_ratio(first.residuals, other.residuals), effect_of(first, other)
    if ratio < -limit("rival") or weight(effect, last_sizes(first)) <= limit("negligible"):
        return []  # the measurements show what the rows say, or it does not matter
    return [rival("rival.spikes", {"count": count}, ratio, effect, "source")]
