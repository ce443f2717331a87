"""Was the table touched? Steps of the specific force that the gyros do not explain.

On a base that stays, specific force carried by the gyros into axes that do not turn is gravity's reaction and nothing else.
Where it steps from one level to another within a position, either the IMU was tilted in a way that its gyros do not see, or an
accelerometer's offset has jumped; to an alignment both are the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import length_of
from truenorth.errors.whole_bias import time_average
from truenorth.quality.signals import STILL_ANGLE, median_of_rows
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit

Array = NDArray[np.float64]

BLOCKS = 40  # into which a position is cut
SHORTEST = 12  # blocks that say what is usual
ASIDE = 3  # blocks on either side whose means are compared, ...
GAP = 2  # ... and between them, for what takes its time
SETTLED = 5.0  # s after a touch from which the table is at rest again


@dataclass(frozen=True)
class Touch:
    """A step of the specific force."""

    time: float  # s; on the record's clock, about
    step: Array  # (2,) m/s^2: along east and north, of the answer's heading
    usual: float  # m/s^2; scatter of such differences elsewhere in the position

    @property
    def size(self) -> float:
        """m/s^2."""
        return float(np.linalg.norm(self.step))

    def evidence(self, gravity: float) -> Evidence:
        """The step, as the tilt that would make it; what it does to an answer over both parts is not known."""
        return contradiction(
            "table.touched",
            "begin_after",
            time=self.time,
            after=self.time + SETTLED,
            step=self.size,
            usual=self.usual,
            tilt=self.size / gravity,
        )


def find_touch(
    time: Array,
    force: Array,
    gravity: float,
    angle_walk: float = 0.0,
    rate_sigma: float = 0.0,
    correlation_time: float = 300.0,
) -> Touch | None:
    """The largest step within one position, if it is not chance.

    A rate that gyros are off by throughout the position tilts these axes alike from each block to the next, and is no step: the
    median of the steps is taken off. What is left of their biases is how these wander about their mean in it.

    Parameters
    ----------
    time : (K,) array, s
    force : (K, 2) array, m/s^2
        Level specific force in axes that do not turn.
    gravity : float, m/s^2
    angle_walk, rate_sigma : float, rad/sqrt(s) and rad/s
        Random walk of the gyros that carry these axes, and what their biases wander by: they tilt the axes from the blocks before
        to those after, more than neighbouring blocks tell.
    correlation_time : float, s
        Of that wander.
    """
    length = max(1, len(time) // BLOCKS)
    count = len(time) // length
    if count < SHORTEST:
        return None
    blocks = force[: count * length].reshape(count, length, 2).mean(axis=1)
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(blocks, axis=0)])
    before = (sums[ASIDE:] - sums[:-ASIDE])[: -ASIDE - GAP] / ASIDE
    after = (sums[ASIDE:] - sums[:-ASIDE])[ASIDE + GAP :] / ASIDE
    steps = after - before
    steps -= median_of_rows(steps.T)[:, 0]
    size = np.hypot(steps[:, 0], steps[:, 1])
    # Neighbouring blocks tell what is usual: a step is in few of their differences, and the median does not see it.
    usual = median_of_rows(np.abs(blocks[1:] - blocks[:-1]).T)[:, 0] / 0.6745 / math.sqrt(ASIDE)
    scatter = length_of(usual)
    # Means of m blocks, g blocks apart, of a walk of q a block differ by a variance of q (g + 2 m/3), from centre to centre m + g.
    block = length * float(time[-1] - time[0]) / max(len(time) - 1, 1)
    walk = angle_walk * math.sqrt(block * (GAP + 2.0 * ASIDE / 3.0))
    of_mean, _ = time_average(float(time[-1] - time[0]) / correlation_time)
    wander = rate_sigma * math.sqrt(1.0 - of_mean)  # about their mean
    carried = gravity * math.hypot(walk, wander * block * (ASIDE + GAP))
    best = int(np.argmax(size))
    # Of these, neighbours show q 2/3 already, which is not to count twice: what is left of their scatter is white.
    shown = gravity * angle_walk * math.sqrt(2.0 * (2.0 / 3.0) * block / ASIDE)
    white = math.sqrt(max(scatter**2 - shown**2, 0.0))
    by_chance = math.hypot(limit("touched") * white, limit("carried") * carried)
    if size[best] < max(by_chance, STILL_ANGLE * gravity):
        return None
    middle = (best + ASIDE) * length + GAP * length // 2
    return Touch(float(time[middle]), steps[best], scatter)
