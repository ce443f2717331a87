"""The velocity that a lever arm makes on a base that turns: ``C_i_b (w_ib x r_b)``, with the rate of the base from several sources.

On an indexer the gyros sense the base and the indexer together. What is left to tell the base's own rate:

``gyros``     their rate, turned into the base, less the indexer's as the encoder's angles tell it
``nominal``   the same, with the indexer's rate as designed
``attitude``  differences of the base's integrated attitude ``C_i_s C_s_b``, which need no rate at all
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.errors import UsageError

Array = NDArray[np.float64]
RateSource = Literal["gyros", "nominal", "attitude"]


def arm_velocity(
    source: RateSource,
    arm: ArrayLike,  # (3,) m, base axes
    step: float,  # s, between an attitude and its neighbours
    C_is: Array,  # (K, 3, 3, 3): attitude of the IMU in the inertial frame, a step before each time, at it, and a step after
    C_bs: Array,  # (K, 3, 3, 3): the same in the base
    w_is_s: Array,  # (K, 3) rad/s: rate of the IMU at the times
    indexer_rate: Array | None = None,  # (K, 3) rad/s: ``w_bs_s`` as designed, for the source "nominal"
) -> Array:
    """(K, 3) velocity of the IMU relative to the base's centre at K times, in the inertial frame, m/s.

    Raises
    ------
    UsageError
        An unknown source.
    """
    if source not in get_args(RateSource):
        raise UsageError(f"rate source {source!r}; expected one of {', '.join(get_args(RateSource))}")
    r = np.asarray(arm, dtype=np.float64)
    if source == "attitude":
        C_ib = C_is @ np.swapaxes(C_bs, -1, -2)
        return np.asarray((C_ib[:, 2] - C_ib[:, 0]) @ r / (2 * step))
    if source == "nominal":
        if indexer_rate is None:
            raise UsageError("rate source 'nominal' without indexer_rate; expected (K, 3) rad/s")
        w_bs_s = indexer_rate
    else:  # C_bs(t+) = C_bs(t-) exp(w_bs_s 2 step)
        w_bs_s = rotation_vector_from_dcm(np.swapaxes(C_bs[:, 0], -1, -2) @ C_bs[:, 2]) / (2 * step)
        w_bs_s = np.einsum("kji,kjl,kl->ki", C_bs[:, 1], C_bs[:, 0], w_bs_s)  # from s a step before into s at the time
    w_ib_b = np.einsum("kij,kj->ki", C_bs[:, 1], w_is_s - w_bs_s)
    v_b = np.cross(w_ib_b, r)
    return np.einsum("kij,klj,kl->ki", C_is[:, 1], C_bs[:, 1], v_b)
