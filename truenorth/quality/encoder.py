"""An indexer's angles against the gyros: with the right ones the base that carries it sways about one attitude."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, rotation_vector_from_dcm
from truenorth.core.earth import EARTH_RATE
from truenorth.quality.tilt import whole_cells
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit
from truenorth.strapdown.inertial_integration import integrate_attitude

Array = NDArray[np.float64]

NET_TURN = math.radians(8.0)  # of the base's mean attitude from the first third of a log to the last: more is no sway
BIASED = 4.0  # sigmas of a gyro's bias
USUAL_ZERO = math.radians(0.05)  # rad: indexers are mounted no better, which is no fault but belongs into sigma
FASTEST = math.radians(60.0)  # rad/s RMS: no ship or vehicle that stays turns faster


def encoder_evidence(
    record: ImuRecord,
    C_sb: Callable[[Array], Array],
    others: Mapping[str, Callable[[Array], Array]],
    gyro_bias: float = 0.0,
) -> list[Evidence]:
    """Whether the base turns as no base does, and with which other reading of the angles it would not.

    Parameters
    ----------
    C_sb : callable
        Attitude (K, 3, 3) of the base in the IMU at times (s), by the angles as given.
    others : mapping
        The same by other readings of the angles, by their names.
    gyro_bias : float, rad/s
        One sigma: what it turns by itself between the thirds is no turn of the base.
    """
    theta, interval, time = whole_cells(record)
    C_is = dcm_from_quaternion(integrate_attitude(theta))
    time = np.append(time[0] - 0.5 * interval, time + 0.5 * interval)

    def turns(reading: Callable[[Array], Array]) -> tuple[float, float]:
        C = C_is @ reading(time)
        rate = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:]) / interval
        third = len(C) // 3
        net = mean_attitude(C[:third]).T @ mean_attitude(C[-third:])
        return math.sqrt(float(np.mean(np.sum(rate**2, axis=1)))), float(np.linalg.norm(rotation_vector_from_dcm(net)))

    given, net = turns(C_sb)
    best, name = min((turns(reading)[0], name) for name, reading in others.items())
    if given**2 > limit("clearer encoder") * best**2:
        return [contradiction("encoder.turns", "encoder", given=given, best=best, reading=name)]
    # The base turns with the earth, and by what the gyros drift.
    drifted = (EARTH_RATE + BIASED * gyro_bias) * record.duration * 2.0 / 3.0
    if net > NET_TURN + drifted or given > FASTEST:
        return [contradiction("encoder.drifts", "encoder", net=net, rate=given)]
    return []


def mean_attitude(C: Array) -> Array:
    """The rotation nearest to the mean of some."""
    U, _, Vt = np.linalg.svd(C.mean(axis=0))
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
