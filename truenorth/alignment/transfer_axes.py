"""Scale factors and misalignments of a slave's sensors, as states where what they do stands out of the master's rows.

A gyro's scale factor `k` moves a velocity that is carried over an arm `r` by ``k w r``, and an accelerometer's that by `k` times
what the force beyond its mean makes of it: alike in each manoeuvre, so that n rows of noise `s` tell it from ``s / sqrt(n)`` on.
A consumer IMU 30 m from the master of a ship that rolls has 2 cm/s of the one and 1 cm/s of the other: its arm was up to 18
sigmas off without these states, and level and heading 11. A tactical IMU that turns for ten seconds has 1 cm/s of accelerometers'
axes: its level was 1.85 of its sigma off. Gyros also turn attitude wrongly, wherever they sit: those that show it against their own
noise have their states.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import Matched
from truenorth.alignment.transfer_filter import Assumed
from truenorth.errors.axes import accel_axes, axis_sigma, gyro_axes, standing, turning_axes
from truenorth.errors.group import Group
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

PIECE = 0.5  # s: of means that hold a vehicle's motion, and little noise
ROW = 0.05  # m/s: noise of a master's rows
SEEN = 1.0  # sigmas of the mean of all rows


def slave_axes(
    slave: ImuRecord, master: MasterRecord, spec: ImuSpec, assumed: Assumed, what: Matched
) -> tuple[Group, ...]:
    """The groups of states that a log asks for: of gyros, of accelerometers."""
    found = list(turning_axes(spec))
    if what.translation is None:
        return tuple(found)
    part = slave.between(master.time[0] - assumed.delay, master.time[-1] - assumed.delay)
    rate, pushed = _motion(part if len(part) > 1 else slave)
    gyro, accel = (float(sigma.max()) for sigma in axis_sigma(spec))
    arm = math.hypot(*assumed.lever_arm, math.sqrt(3.0) * assumed.lever_arm_sigma)
    least = SEEN * ROW / math.sqrt(len(master))
    if not found and gyro * rate * arm > least:
        found.append(gyro_axes(spec))
    if accel * pushed > least:
        found.append(accel_axes(spec, standing(assumed.C_mb)))
    return tuple(found)


def same_axes(spec: ImuSpec, assumed: Assumed, groups: Collection[str]) -> tuple[Group, ...]:
    """Those of `groups` (names) as another specification has them."""
    of_both = gyro_axes(spec), accel_axes(spec, standing(assumed.C_mb))
    return tuple(group for group in of_both if group.name in groups)


def _motion(slave: ImuRecord) -> tuple[float, float]:
    """RMS of the turn rate, rad/s, and of the velocity, m/s, that the specific force beyond its mean makes.

    A force that sways makes little of it. One that a turn holds for ten seconds makes ten times as much as it does in one, and what
    it makes of a false scale factor is taken for a tilt.
    """
    rows = max(1, round(PIECE / slave.interval))
    count = max(1, len(slave) // rows)
    means = []
    for values in increments(slave):
        pieces = values[: count * rows] if len(values) >= count * rows else values
        means.append(np.array([piece.mean(axis=0) for piece in np.array_split(pieces, count)]) / slave.interval)
    rate, force = means
    pushed = np.cumsum(force - force.mean(axis=0), axis=0) * rows * slave.interval
    return (
        math.sqrt(float(np.mean(np.sum(rate**2, axis=1)))),
        math.sqrt(float(np.sum(np.var(pushed, axis=0)))),
    )
