"""The velocity of a line in the accelerometers that no turn explains: a vibration, or a hum of their electronics.

A tone of the force of amplitude A at w rad/s moves the velocity at a row by ``A/w``. If the base shakes, its velocity does so; if
the sensors hum, or pick up a fan or a supply, it does not. An engine that shakes turns its base as well, and the gyros show that:
a turn at the rate W makes the force ``g W/w`` by gravity, and ``r w W`` on an arm r. What is larger than both is a push or a hum,
and nothing that an IMU logs tells one from the other. Aids seldom do: a tone of 19.1 Hz is one of .1 Hz at rows of a second, and
less than their noise. So its RMS velocity may be missing, or too much, at the last row. Of 5 mg at 12 Hz that is .5 mm/s.

A line stands out of the frequencies around it, by far more than white noise does in any frequency of a log. What is broad, as a
road's roughness is, is no line. What the integration makes of a tone counts: of increments ``x / (2 sin x/2)`` of its velocity,
where it turns by x in an interval; of rates what their rule makes of it (:mod:`truenorth.records.vibration`).

The rule is ours.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import GRAVITY_EQUATOR
from truenorth.quality.hum import FEWEST, LINE, SLOWEST
from truenorth.records import ImuRecord
from truenorth.records.vibration import BLOCK, integrated
from truenorth.state.evidence import Effect, Evidence

Array = NDArray[np.float64]

ARM = 5.0  # m: no vehicle shakes about an axis that is much farther from its IMU
AROUND = 25  # frequencies to each side, of which a line stands out
LOUD = 20.0  # times their median: of white noise, one frequency in a million
LEAST = 1e-4  # m/s: less than any aid shows


def line_velocity(record: ImuRecord) -> float:
    """RMS velocity, m/s, of the worst axis, of lines from 5 Hz on in the last seconds of a log: of those that are no turn."""
    length = round(BLOCK / record.interval)
    if len(record) < length or length < FEWEST:
        return 0.0
    x = 2.0 * math.pi * np.arange(length // 2 + 1) / length  # rad in an interval
    fast = x >= SLOWEST * record.interval
    if np.count_nonzero(fast) < 2 * AROUND + 1:
        return 0.0
    x = x[fast]
    w = x / record.interval
    unit = record.interval if record.kind == "increments" else 1.0
    scale = 2.0 * math.sqrt(8.0 / 3.0) / (unit * length)  # to amplitudes: a window of power 3/8
    window = np.hanning(length)[:, None]
    turned, pushed = (
        np.abs(scale * np.fft.rfft((rows - rows.mean(axis=0)) * window, axis=0)[fast]) ** 2
        for rows in (record.gyro[-length:], record.accel[-length:])
    )
    usual = np.median(np.lib.stride_tricks.sliding_window_view(pushed, 2 * AROUND + 1, axis=0), axis=-1)
    usual = np.pad(usual, ((AROUND, AROUND), (0, 0)), mode="edge")
    explained = (GRAVITY_EQUATOR / w + ARM * w) ** 2 * turned.sum(axis=1)
    alone = _of_line(pushed.sum(axis=1)) > _of_line(explained)
    # A frequency of a tone's own, and the others that its window gives it.
    loud = np.stack([_of_line(line) for line in (pushed > LOUD * usual).T], axis=1) > 0.0
    made = np.square(integrated(x, record.kind) / w)[:, None]
    return math.sqrt(0.5 * float(np.max(np.sum(made * pushed * (loud & alone[:, None]), axis=0))))


def _of_line(power: Array) -> Array:
    """(K,) the sum over the frequencies of a tone."""
    return np.convolve(power, np.ones(LINE), "same")


def line_evidence(record: ImuRecord) -> list[Evidence]:
    """What such lines may do to a velocity at the last row: a hint, as bases that are shaken are sound."""
    velocity = line_velocity(record)
    if velocity < LEAST:
        return []
    return [Evidence("record.line", {"size": velocity}, "hint", Effect(velocity=velocity))]
