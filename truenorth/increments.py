"""From rows of an IMU to increments, and from increments to what rotates and accelerates: coning and sculling.

Sources: P. Savage, "Strapdown inertial navigation integration algorithm design", J. Guid. Control Dyn. 21 (1998),
part 1 eqs. 33-37 (coning) and part 2 eqs. 47-50 (sculling); R. Miller, "A new strapdown attitude algorithm", J. Guid.
Control Dyn. 6 (1983) (three samples); the coefficients of N samples as tabled by J. Mark and D. Tazartes, "Tuning of
coning algorithms to gyro data frequency response characteristics", J. Guid. Control Dyn. 24 (2001).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.errors import UsageError
from truenorth.records import GAP_FACTOR, ImuRecord

Array = NDArray[np.float64]
Algorithm = Literal["previous", "1", "2", "3", "4"]

# Rotation vector of an update of N samples: sum of increments + sum_i k_i dtheta_i x dtheta_N, exact for a pure
# coning motion up to the order 2N of coning angle per sample; sculling takes the same coefficients (Savage's
# equivalence of the two). "previous": one sample an update, with the one before it: dtheta_before x dtheta / 12.
CONING: dict[str, Array] = {
    "previous": np.zeros(0),
    "1": np.zeros(0),
    "2": np.array([2.0 / 3.0]),
    "3": np.array([9.0 / 20.0, 27.0 / 20.0]),
    "4": np.array([54.0 / 105.0, 92.0 / 105.0, 214.0 / 105.0]),
}
PREVIOUS = 1.0 / 12.0


def coefficients(algorithm: str) -> tuple[Array, float]:
    """Coefficients of the samples within an update, and of the sample before it.

    Raises
    ------
    UsageError
        An algorithm that is not known.
    """
    if algorithm not in CONING:
        raise UsageError(f"algorithm {algorithm!r} is not known; choose one of {', '.join(CONING)}")
    return CONING[algorithm], PREVIOUS if algorithm == "previous" else 0.0


def increments(record: ImuRecord, before: Array | None = None) -> tuple[Array, Array]:
    """Angle and velocity increments of each row.

    Increment rows are given back as they are. Rates are taken as instantaneous and integrated by the causal rule of
    third order ``T (5 w_k + 8 w_{k-1} - w_{k-2})/12`` (Adams-Moulton); the first row's interval by its own value, the second's
    and those beside a gap by the trapezoid.

    Parameters
    ----------
    record : ImuRecord
    before : (2, 6) array, optional
        The two rows of rates before the first, one interval apart, so that a chunk goes on where another ended.

    Returns
    -------
    dtheta : (N, 3) array, rad
    dvel : (N, 3) array, m/s
    """
    if record.kind == "increments":
        return record.gyro, record.accel
    rows = np.hstack([record.gyro, record.accel])
    steps = record.steps
    if before is not None:
        rows = np.vstack([before, rows])
        steps = np.concatenate([[record.interval, record.interval], steps])
    T = steps[:, None]
    result = T * rows
    result[1:] = 0.5 * T[1:] * (rows[1:] + rows[:-1])
    regular = np.abs(steps) < GAP_FACTOR * record.interval
    third = np.flatnonzero(regular[2:] & regular[1:-1]) + 2
    result[third] = T[third] / 12.0 * (5.0 * rows[third] + 8.0 * rows[third - 1] - rows[third - 2])
    result = result[0 if before is None else 2 :]
    return np.ascontiguousarray(result[:, :3]), np.ascontiguousarray(result[:, 3:])
