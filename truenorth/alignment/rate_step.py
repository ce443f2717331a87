"""Did a gyro's bias change while the base stood still? Its rate says so directly, and sooner than the velocity of the base does.

On a base that is still the rate of each second is the earth's, the bias and white noise. A step or a ramp of it is matched with the
rates of the whole log, their mean being free. The noise is that of neighbouring seconds; by the instability of its bias a
sound gyro differs between two times as well.

The mean rate of a second is the way from the attitude at its beginning to that at its end. A generator's 10.01 Hz moves both alike,
and the next ones a little further: a slow rate that no gyro's bias makes (.013 deg: 2 deg/h). So what is found has to be there
between mean attitudes of seconds as well, in which such a line is less by its number of periods.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import SIGNATURES
from truenorth.alignment.passing_turn import passing_turns
from truenorth.alignment.task import Task
from truenorth.alignment.usual import usual
from truenorth.core.earth import EARTH_RATE
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure, Kind
from truenorth.state.limits import limit, may_be_chance
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

FEWEST = 60  # seconds


def rate_step_evidence(task: Task, C_nb: Array, spec: ImuSpec) -> list[Evidence]:
    """The step or ramp of a gyro's rate that is most likely, on a still base, and what it does to heading.

    A rate about east turns heading as a bias does, one about the vertical by its angle.

    Parameters
    ----------
    task : Task
    C_nb : (3, 3) array
    spec : ImuSpec
    """
    motion = task.motion
    count = len(motion.time)
    turns = motion.fraction("rotating") > 0.0 or passing_turns(motion).any()
    if motion.overall != "still" or count < FEWEST or turns:  # a turn shares the earth's rate anew
        return []
    instability = max(spec.gyro_bias_instability, usual("gyro", "bias_instability", spec.gyro_random_walk))
    size, ratio = _matched(motion.rate, 0.5, instability)
    if ratio.max() <= limit("hint"):
        return []
    size, ratio = _matched(_between_means(task.record), 1.0, instability)
    best, axis = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    if ratio[best, axis] <= limit("hint"):
        return []
    change = C_nb[:, axis] * float(size[best, axis])
    span = float(motion.time[-1] - motion.time[0])
    heading = abs(change[0]) / (EARTH_RATE * math.cos(task.position.lat)) + 0.5 * span * abs(change[2])
    figures: dict[str, Figure] = {
        "axis": "xyz"[axis],
        "onset": SIGNATURES[best][1] * span,
        "size": abs(float(size[best, axis])),
        "ratio": float(ratio[best, axis]),
        "chance": limit("hint"),
        "heading": heading,
        "level": 0.0,
    }
    kind: Kind = "hint" if may_be_chance(float(ratio[best, axis])) else "bounded"
    return [Evidence("bias.gyro_steps", figures, kind, Effect(heading=heading), ("still_part",))]


def _matched(rate: Array, share: float, instability: float) -> tuple[Array, Array]:
    """Sizes (S, 3) of all signatures in rates (K, 3), rad/s, and their likelihood ratios.

    `share` of the mean square of neighbours' differences is the noise of a second.
    """
    shapes = _shapes(len(rate))
    energy = (shapes**2).sum(axis=0)[:, None]
    size = shapes.T @ (rate - rate.mean(axis=0)) / energy
    noise = share * ((rate[1:] - rate[:-1]) ** 2).mean(axis=0)
    return size, size**2 / (noise / energy + 2.0 * instability**2)


def _between_means(record: ImuRecord) -> Array:
    """(K, 3) rates, rad/s, from the mean attitude of each second to that of the next.

    Of white noise of variance s^2 in the rate of a second they have 2/3 s^2, of neighbours s^2/6 in common: half the mean square of
    neighbours' differences is s^2/2, and the variance of a mean that of the seconds.
    """
    second = np.floor(record.time - (record.time[0] - record.interval) - 0.5 * record.interval).astype(int)
    attitude = np.cumsum(increments(record)[0], axis=0)
    rows = np.bincount(second)
    means = np.stack([np.bincount(second, axis) for axis in attitude.T], axis=1)[rows > 0] / rows[rows > 0][:, None]
    return np.asarray(np.diff(means[:-1], axis=0))  # the last second may be a part of one


@lru_cache(maxsize=2)
def _shapes(count: int) -> Array:
    """(K, S) of all signatures, about their means; nobody writes to it."""
    shapes = np.stack([_shape(course, round(onset * count), count) for course, onset in SIGNATURES], axis=1)
    shapes -= shapes.mean(axis=0)
    shapes.flags.writeable = False
    return shapes


def _shape(course: str, begin: int, count: int) -> Array:
    """(K,) of a step, or of a ramp to one at the end, from second `begin` on."""
    after = np.arange(count) >= begin
    return after.astype(float) if course == "step" else after * (np.arange(count) - begin) / (count - begin)
