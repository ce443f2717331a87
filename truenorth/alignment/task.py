"""One alignment to do: the data, the place, the epoch, and what was seen of the motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias import bias_prior
from truenorth.alignment.epoch import Epoch, find_epoch
from truenorth.alignment.passing_turn import means_at_rest
from truenorth.coarse.analytic import Means, means, static_jacobian
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.earth import DEFLECTION, EARTH_RATE, gravity_of_place
from truenorth.core.errors import DataError
from truenorth.core.position import Position
from truenorth.quality.regimes import MotionSummary, motion_summary
from truenorth.records import ImuRecord
from truenorth.records.specified import seen_in
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.increments import across_gaps
from truenorth.strapdown.inertial import earth_rotation

Array = NDArray[np.float64]

FILTER_INTERVAL = 1.0  # s
FEWEST_EPOCHS, MOST_EPOCHS = 60, 5000
LONGEST_BRIDGE = 4.5  # nominal intervals: up to three lost samples are bridged by the next one's rate
LONGEST_BLIND = 120.0  # s: a gyro that does not see the earth turn carries attitude no longer than this


@dataclass(frozen=True)
class Task:
    """One alignment: the data, where, with what, and for when."""

    record: ImuRecord
    position: Position
    interval: float
    epoch: Epoch
    motion: MotionSummary
    means: Means

    @property
    def lat_rate(self) -> Array:
        """``dw_ie_n/dL``, rad/s a radian."""
        return EARTH_RATE * np.array([0.0, -math.sin(self.position.lat), math.cos(self.position.lat)])

    @property
    def gravity(self) -> float:
        """Normal gravity, m/s^2."""
        return gravity_of_place(self.position.lat, self.position.alt)

    def bias_prior(self, spec: ImuSpec, C_n_b: Array) -> Array:
        """(6, 6) prior covariance of what acts as gyro and accelerometer bias here."""
        return bias_prior(spec, C_n_b, self.position, self.lat_rate, self.gravity)

    @property
    def deflection(self) -> Array:
        """(3, 3) covariance of phi from the deflection of the vertical."""
        return deflection_covariance(self.position.lat, self.gravity)

    def in_navigation_axes(self, covariance_n0: Array, time: float) -> Array:
        """Turn a covariance of phi from n0 to n at a time since the start of the log."""
        C = earth_rotation(time, self.position.lat).T
        return C @ covariance_n0 @ C.T


def make_task(record: ImuRecord, position: Position, at: float | None) -> Task:
    """Look at a record and set up its alignment for an epoch (the last sample when `at` is None)."""
    motion = motion_summary(record)
    return Task(
        record=record,
        position=position,
        interval=filter_interval(record),
        epoch=find_epoch(record, at),
        motion=motion,
        means=means_at_rest(record, motion),
    )


def last_part(task: Task) -> Task:
    """The last two minutes before the epoch: level needs no more, and a poor gyro's bias changes over longer.

    An epoch between two samples needs the one behind it, too: the turn up to it is a part of that sample's.
    """
    record, at = task.record, task.epoch.time
    if record.duration <= LONGEST_BLIND:
        return task
    stop = max(at, record.time[0] + LONGEST_BLIND)
    first = int(np.searchsorted(record.time, stop - LONGEST_BLIND)) if at == stop else 0
    behind = task.epoch.row + int(at > record.time[task.epoch.row])
    record = record[first : max(int(np.searchsorted(record.time, stop, "right")), behind + 1)]
    return replace(
        task,
        record=record,
        interval=filter_interval(record),
        epoch=find_epoch(record, at),
        means=means(record),
    )


def level_of(f_b: Array) -> Array:
    """``C_nb`` with the pitch and roll that a specific force shows, and heading zero."""
    up = f_b / np.linalg.norm(f_b)
    return dcm_from_euler(0.0, math.asin(float(np.clip(up[1], -1.0, 1.0))), math.atan2(-up[0], up[2]))


def filter_interval(record: ImuRecord) -> float:
    """One second, less for short logs, more for very long ones."""
    longest = max(FILTER_INTERVAL, record.duration / MOST_EPOCHS)
    return max(2.0 * record.interval, min(longest, record.duration / FEWEST_EPOCHS))


def bridged(record: ImuRecord) -> ImuRecord:
    """The record with up to three lost samples in a row bridged; longer gaps are refused."""
    record.check_rate()
    gaps = record.gaps
    if gaps.size == 0:
        return record
    steps = record.steps / record.interval
    worst = int(gaps[np.argmax(steps[gaps])])
    if steps[worst] > LONGEST_BRIDGE:
        raise DataError(
            f"{record.source}: row {worst + 1}, column time: a gap of {record.steps[worst]:.3f} s after "
            f"{record.time[worst - 1]:.3f} s, where samples come every {record.interval:.4f} s; what the base did in it is "
            "not known: align a part without the gap (`record.between`)"
        )
    return across_gaps(record)


def noise_in(record: ImuRecord, imu: ImuSpec) -> ImuSpec:
    """What a filter sees in a record, lost samples as random walks as well.

    Parameters
    ----------
    record : ImuRecord
        Not bridged yet.
    imu : ImuSpec
        The specification.
    """
    return seen_in(imu, record).with_more_noise(*(lost_walk(record, x) for x in (record.gyro, record.accel)))


def lost_walk(record: ImuRecord, x: Array) -> float:
    """Random walk that bridged samples leave in an integral of the worst axis, unit of its rate times sqrt(s).

    A bridge over ``m`` samples misses ``sum x - m (x_before + x_after) / 2``: as much as it would miss of those that are there.
    """
    gaps = record.gaps[record.gaps > 0]
    if not gaps.size:
        return 0.0
    lost = np.rint(record.steps[gaps] / record.interval).astype(int) - 1
    total, sums = np.zeros(3), np.vstack([np.zeros(3), np.cumsum(x, axis=0)])
    for m, count in zip(*np.unique(lost, return_counts=True), strict=True):
        if 0 < m < len(x) - 1:
            missed = sums[m + 1 : -1] - sums[1 : -m - 1] - 0.5 * m * (x[: -m - 1] + x[m + 1 :])
            total += count * np.mean(missed**2, axis=0)
    scale = record.interval if record.kind == "rates" else 1.0
    return scale * math.sqrt(float(total.max()) / record.duration)


@lru_cache(maxsize=16)
def deflection_covariance(lat: float, g: float) -> Array:
    """(3, 3) covariance of phi from the deflection of the vertical: it tilts as an accelerometer bias. Nobody writes to it."""
    J = static_jacobian(lat, g)[:, :2] * (DEFLECTION * g)
    found = J @ J.T
    found.flags.writeable = False
    return np.asarray(found)
