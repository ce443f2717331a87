"""A base that lists: it tilts so evenly that no window of seconds shows motion, as a ship that takes in ballast.

Gravity moves in the axes of the IMU then. An accelerometer that drifts looks the same, and what tells the two apart are the
gyros. Of a base that stays, the level part of their mean rate is the earth's, ``|w_level| = w_ie cos L``; of one that lists it is
so after the turn that gravity shows is taken off:

    f' = -w x f,   w_tilt = (f' x f) / |f|^2,   |w_level - w_tilt| = w_ie cos L

A base is said to list where the gyros contradict the first and bear the second out. Where both hold to within the gyros' biases,
nothing tells, and gravity that moves stays a contradiction (:func:`truenorth.alignment.bias_step.gravity_evidence`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import DRIFT_BLOCK, FEWEST_BLOCKS
from truenorth.alignment.passing_turn import passing_turns
from truenorth.alignment.task import Task
from truenorth.alignment.usual import usual
from truenorth.core.attitude import length_of
from truenorth.core.earth import EARTH_RATE
from truenorth.quality.regimes import SWAYING, MotionSummary
from truenorth.records.specs import ImuSpec
from truenorth.state.limits import limit

Array = NDArray[np.float64]

LISTS = "the base lists: it tilts steadily, as its gyros bear out; its own motion is fitted to the log"
CONTRADICTS, BEARS_OUT = 5.0, 3.0  # sigmas of the mean rate and the gyros' bias
FIVE_TIMES = 0.2  # without a specification: of what the earth's rate misses by, what may be left of it with the tilt


def as_listing(task: Task, spec: ImuSpec | None) -> Task:
    """The task, its base one that sways instead of one at rest, where it lists: its mean rate is not the earth's."""
    return replace(task, motion=_swaying(task.motion)) if lists(task, spec) else task


def lists(task: Task, spec: ImuSpec | None) -> bool:
    """Whether a base that seems to rest tilts steadily, as its gyros say."""
    motion = task.motion
    turns = motion.fraction("rotating") > 0.0 or passing_turns(motion).any()
    if motion.overall not in ("still", "disturbed") or len(motion.time) < DRIFT_BLOCK * FEWEST_BLOCKS or turns:
        return False
    f = motion.specific_force.mean(axis=0)
    turn, besides, sways = _line(motion.time, np.cumsum(motion.rate, axis=0))
    # What the gyros see besides a steady turn, people and a swell, is taken off the forces.
    slope, _, scatter = _line(motion.time, motion.specific_force + np.cross(besides, f))
    tilt, scatter = np.cross(slope, f) / (f @ f), scatter / length_of(f)
    if length_of(tilt) ** 2 <= limit("drift") * scatter**2:
        return False
    up = f / length_of(f)
    rate, north = turn + motion.rate_bias, EARTH_RATE * math.cos(task.position.lat)
    level = rate - (rate @ up) * up
    stays, tilts = abs(length_of(level) - north), abs(length_of(level - tilt) - north)
    noise = float(motion.angle_noise.max())
    bias = usual("gyro", "bias", noise) if spec is None else math.sqrt(float(spec.bias_variance[:3].max()))
    known = math.hypot(
        bias, noise * math.sqrt(1.2 / task.record.duration)
    )  # the slope of an angle that walks: 6/5 N^2/T
    left = BEARS_OUT * math.hypot(known, scatter)
    if spec is None:  # biases differ by decades from IMU to IMU
        left = max(min(left, FIVE_TIMES * stays), BEARS_OUT * scatter)
    return stays > CONTRADICTS * math.hypot(known, sways) and tilts < left


def _line(time: Array, values: Array) -> tuple[Array, Array, float]:
    """Slope (3,) of a line through values (m, 3) of seconds, what is left (m, 3), and one sigma of the slope's length.

    What is left within a block passes; that of blocks scatters.
    """
    about = time - time.mean()
    slope = about @ values / (about @ about)
    left = values - values.mean(axis=0) - np.outer(about, slope)
    count = len(left) // DRIFT_BLOCK
    blocks = left[: count * DRIFT_BLOCK].reshape(count, DRIFT_BLOCK, 3).mean(axis=1)
    return slope, left, math.sqrt(float((blocks**2).sum()) / (count - 2.0) * DRIFT_BLOCK / (about @ about))


def _swaying(motion: MotionSummary) -> MotionSummary:
    whole = replace(motion.regimes[0], stop=motion.regimes[-1].stop, kind="swaying")
    return replace(motion, kind=np.full_like(motion.kind, SWAYING), regimes=(whole,))
