"""An indexer's angles against the gyros: with the right ones the base that carries it sways about one attitude."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, rotation_vector_from_dcm
from truenorth.quality.tilt import whole_cells
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence, contradiction
from truenorth.strapdown.inertial_integration import integrate_attitude

Array = NDArray[np.float64]

CLEARER = 4.0  # times smaller squares of the base's turns that another reading must leave
NET_TURN = math.radians(8.0)  # of the base's mean attitude from the first third of a log to the last: more is no sway
FASTEST = math.radians(60.0)  # rad/s RMS: no ship or vehicle that stays turns faster


def encoder_evidence(
    record: ImuRecord, C_sb: Callable[[Array], Array], others: Mapping[str, Callable[[Array], Array]]
) -> list[Evidence]:
    """Whether the base turns as no base does, and with which other reading of the angles it would not.

    Parameters
    ----------
    C_sb : callable
        Attitude (K, 3, 3) of the base in the IMU at times (s), by the angles as given.
    others : mapping
        The same by other readings of the angles, by their names.
    """
    theta, interval, time = whole_cells(record)
    C_is = dcm_from_quaternion(integrate_attitude(theta))
    time = np.append(time[0] - 0.5 * interval, time + 0.5 * interval)

    def turns(reading: Callable[[Array], Array]) -> tuple[float, float]:
        C = C_is @ reading(time)
        rate = rotation_vector_from_dcm(np.swapaxes(C[:-1], 1, 2) @ C[1:]) / interval
        third = len(C) // 3
        net = _mean(C[:third]).T @ _mean(C[-third:])
        return math.sqrt(float(np.mean(np.sum(rate**2, axis=1)))), float(np.linalg.norm(rotation_vector_from_dcm(net)))

    given, net = turns(C_sb)
    best, name = min((turns(reading)[0], name) for name, reading in others.items())
    if given**2 > CLEARER * best**2:
        return [contradiction("encoder.turns", "encoder", given=given, best=best, reading=name)]
    if net > NET_TURN or given > FASTEST:
        return [contradiction("encoder.drifts", "encoder", net=net, rate=given)]
    return []


def _mean(C: Array) -> Array:
    """The rotation nearest to the mean of some."""
    U, _, Vt = np.linalg.svd(C.mean(axis=0))
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)
