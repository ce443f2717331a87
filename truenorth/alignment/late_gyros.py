"""Are the gyros of a base that sways, or of an IMU that turns on it, late? By the filter's own response to gyros that are.

Gravity carried by gyros that are late by ``d`` is askew by the rate times ``d``, the attitude is that much behind, and the velocity
of a lever arm comes as much later. The fit of all signed orders and delays (:mod:`truenorth.quality.tilt`) needs no filter and sees
.03 s and more: what the base itself does is all noise to it. The filter of the answer has the base's own motion among its states.
The same log with gyros a little later, about the same attitude, errors and arms, says what a delay does to its measurements;
through its gains that is a signature in its innovations, and twice the logarithm of the likelihood ratio ``b^2 / A``
(:mod:`truenorth.estimate.responses`) is a chi-square of one degree of freedom where the clocks agree: one of 2000 sound logs
exceeds the limit of a hint.

A moored ship, whose waves carry her as they roll her, looks like delays of .03 to .3 s (see `tilt.py`), and the axes do not tell
the two apart. So this refuses no log: tilt and turn are in sigma, however large.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.alignment.matched import innovations_of
from truenorth.estimate.responses import Seen, likeliest
from truenorth.estimate.staying import StayingLog
from truenorth.records import ImuRecord
from truenorth.records.interpolation import gyros_behind
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.limits import limit

Array = NDArray[np.float64]

STEP = 1e-3  # s, with which is asked
FASTEST = math.sqrt(2.0)  # of a tone, against its RMS: the answer may be of any moment


def response_to_late_gyros(log: StayingLog, z: Array) -> Array:
    """(K, 3) what gyros that are late add to the measurements `z` of a log, by the second of their delay.

    About the same attitude, with the same errors and arms taken off: the arm of a ship's IMU, five metres from her centre, adds a
    quarter to what gravity makes.
    """
    later = log.with_record(gyros_behind(log.record, STEP))
    return np.asarray((later.linearise().z - z) / STEP)


def late_gyros_evidence(fine: FineAlignment, response: Array, record: ImuRecord) -> list[Evidence]:
    """A delay of the gyros that is likelier than chance, with the tilt, and the turn about the vertical, that it makes.

    Parameters
    ----------
    fine : FineAlignment
        On the mean velocity of intervals.
    response : (K, 3) array
        Of :func:`response_to_late_gyros`.
    record : ImuRecord
        That it was made of.
    """
    white = innovations_of(fine, response[..., None]).white
    ratio, size = likeliest([Seen(fine.integrals.time[1:], white[..., 0], white[..., 1:])])
    if ratio <= limit("hint"):
        return []
    delay = float(size[0])
    effect = turned_by(delay, record)
    figures: dict[str, Figure] = {
        "delay": abs(delay),
        "ratio": ratio,
        "chance": limit("hint"),
        "heading": effect.heading,
        "level": effect.level,
    }
    side = "late" if delay > 0.0 else "early"
    return [Evidence(f"response.gyros_{side}", figures, "hint", effect, ("common_clock",))]


def turned_by(delay: float, record: ImuRecord) -> Effect:
    """What an IMU turns about the level and about the vertical in the time of a delay (s), at any moment of its record.

    Rows without any force, of an accelerometer that was silent there, have no vertical and are left out.
    """
    turned = FASTEST * abs(delay)
    force = np.linalg.norm(record.accel, axis=1, keepdims=True)
    there = force[:, 0] > 0.0
    rate = record.gyro[there] / (record.interval if record.kind == "increments" else 1.0)
    up = record.accel[there] / force[there]
    about = np.sum(rate * up, axis=1)
    tilt = turned * math.sqrt(max(float(np.mean(np.sum(rate**2, axis=1) - about**2)), 0.0))
    return Effect(heading=turned * math.sqrt(float(np.mean(about**2))), level=tilt)
