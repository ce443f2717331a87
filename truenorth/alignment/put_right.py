"""A sensor of a swaying base put right, and its log aligned anew: is it that, or does the sea push in step with the tilt.

Waves carry a ship to and fro while they roll her. To first order that is what many an error of a sensor makes of a base that sways:
a force in step with the tilt. With the sensor put right the log is aligned anew, its motion fitted anew. Of a true error nothing
goes with the tilt any more then: the motion that was left is the base's own, and the log is likelier by thousands. Of a push, which
has its own phase, frequencies and directions, most is left. Asked is what any push in step would explain of the log that is put
right, ``K = K0 + K1 jw + K2 (jw)^2`` along and across, as of :mod:`truenorth.quality.pushed`.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.bias_step import SENSORS, seen_of
from truenorth.alignment.coarse_sensors import known_sensors
from truenorth.alignment.fine import CoarseStart, FineAlignment
from truenorth.alignment.matched import innovations_of, whitened
from truenorth.alignment.swaying import UNKNOWN_ARM, Mount, SwayAlignment, sway_align, usual_sway
from truenorth.errors.staying import BA, BG
from truenorth.filters.gains import through
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

FAST = 0.5  # rad of phase from row to row, at which an angle comes out 2 % too small


class Anew(Protocol):
    """Of :func:`aligned_anew`."""

    def __call__(self, record: ImuRecord, wide: ImuSpec | None = None) -> SwayAlignment:
        """Align a record; `wide`: as large as that says its sensors' matrices are states."""
        ...


def aligned_anew(
    fine: SwayAlignment,
    start: CoarseStart,
    mount: Mount = UNKNOWN_ARM,
    turned: ImuSpec | None = None,
    axes: ImuSpec | None = None,
) -> Anew:
    """A function that aligns another record about the attitude of an alignment, a motion of the same kind fitted anew.

    A base that does not swing on lines would else be likelier by its swing, not by what is right in the other record.

    Parameters
    ----------
    fine : SwayAlignment
    start, mount, turned, axes
        That it was made of, as in :func:`truenorth.alignment.swaying.sway_align`.
    """
    align = usual_sway if fine.slow_arm is None else sway_align
    about = start._replace(C_n0_i=fine.C_n0_i)

    def again(record: ImuRecord, wide: ImuSpec | None = None) -> SwayAlignment:
        other = about._replace(record=record)
        if about.sensors is not None and mount.C_sb is not None:
            other = other._replace(sensors=known_sensors(other, mount.C_sb, wide or turned))
        return align(other, mount, wide or turned, axes)

    return again


def hardly_sampled(record: ImuRecord) -> bool:
    """Whether the base turns to and fro so fast that from row to row the angle is not a sum of rates: it comes out too small."""
    turned = increments(record)[0]
    turned = turned - turned.mean(axis=0)
    return bool(np.sum(np.diff(turned, axis=0) ** 2) > FAST**2 * np.sum(turned**2))


def likelihood(fine: FineAlignment) -> float:
    """Twice its logarithm."""
    return 2.0 * float(fine.estimates.log_likelihood)


def in_step(fine: FineAlignment) -> float:
    """Squares of the white innovations that a push in step with the tilt explains, along each axis of the base and across."""
    made, _, seen = through_filter(fine, seen_of(fine, _pushes(fine)))
    Q = np.linalg.qr(made)[0]
    return float(np.sum((Q.T @ seen) ** 2))


def _pushes(fine: FineAlignment) -> Array:
    """(K, 6, 18) forces in the IMU's axes that go with the tilt of two of its axes, its rate and its acceleration."""
    log = fine.integrals
    T = log.intervals[:, None]
    C = fine.C_n0_i @ log.C_mean
    up = C[:, 2]  # of n0, along the IMU's axes
    one, other = np.argsort(np.abs(up.mean(axis=0)))[:2]  # those that are the most level
    tilt = up[:, [one, other]] - up[:, [one, other]].mean(axis=0)
    rate = np.gradient(tilt, axis=0) / T
    acceleration = np.gradient(rate, axis=0) / T
    along = C[:, :, one] * [1.0, 1.0, 0.0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    level = np.broadcast_to([0.0, 0.0, 1.0], along.shape)
    ways = along, np.cross(level, along), level
    forces = [moved[:, [j]] * way for moved in (tilt, rate, acceleration) for j in (0, 1) for way in ways]
    errors = np.zeros((len(C), SENSORS.stop - SENSORS.start, len(forces)))
    errors[:, BA.start - BG.start :] = np.swapaxes(C, 1, 2) @ np.stack(forces, axis=2)
    return errors


def through_filter(fine: FineAlignment, signatures: Array) -> tuple[Array, Array, Array]:
    """White innovations (3 K, S) that signatures make, what they leave of the last state (n, S), and those of the log (3 K,)."""
    seen = innovations_of(fine)
    made, left = through(fine.gains, np.ascontiguousarray(signatures))
    return whitened(seen.L, made).reshape(-1, made.shape[2]), left, seen.white[:, :, 0].ravel()
