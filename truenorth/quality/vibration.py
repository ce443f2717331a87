"""Vibration that a log hardly samples, as evidence: the attitude at the last sample, and the drift that counts as a bias.

The first is of the epoch of the answer, and is added to its sigma here. The second is a bias of the gyros to a filter on the
move (:meth:`truenorth.records.specs.ImuSpec.with_coning_of`), and is only said.
"""

from __future__ import annotations

import math

from truenorth.records import ImuRecord
from truenorth.records.vibration import coning_left, sampling_error
from truenorth.state.evidence import Effect, Evidence

SMALLEST = math.radians(3.0 / 3600.0)  # of angle; .3 sigma of the level of 50 ug: less is added to no answer


def vibration_evidence(record: ImuRecord) -> list[Evidence]:
    """What the sampling of vibration does to attitude and velocity at the last sample, where that is worth a word."""
    if record.kind == "increments":
        return []
    angle, velocity = (sampling_error(rates, record.interval) for rates in (record.gyro, record.accel))
    if angle < SMALLEST:
        return []
    figures = {"size": angle, "rate": 1.0 / record.interval, "drift": coning_left(record)}
    return [Evidence("record.vibration", figures, "known", Effect(heading=angle, level=angle, velocity=velocity))]
