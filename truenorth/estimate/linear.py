"""Rows of measurements along a known motion, for linear systems: the same compiled rows as in the closed loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.row import row_at
from truenorth.aiding.source import Aiding
from truenorth.core.attitude import quaternion_from_dcm
from truenorth.core.compiled import compiled
from truenorth.core.earth import earth_rate_n
from truenorth.errors.model import InsModel
from truenorth.estimate.run import kernel_sources
from truenorth.records.motion import MotionStates
from truenorth.state.now import (
    NOW_C,
    NOW_EARTH,
    NOW_FORCE,
    NOW_LENGTH,
    NOW_MEAN_RATE,
    NOW_NORTH,
    NOW_OTHER_RATE,
    NOW_RATE,
    NOW_TURN,
)
from truenorth.strapdown.wander import C_en

Array = NDArray[np.float64]


def rows_along(motion: MotionStates, sources: list[Aiding], model: InsModel) -> tuple[Array, Array]:
    """Rows of measurements at K epochs of a motion, along east, north, up.

    Parameters
    ----------
    motion : MotionStates
        At the epochs.
    sources : list of Aiding
        Each with K rows.

    Returns
    -------
    z : (K, 3 S) array
        Predicted less measured, nothing being assumed of the groups.
    H : (K, 3 S, n) array
    """
    now = _now(motion)
    of = kernel_sources(sources, model)
    assumed = np.zeros(model.states)
    z, H = np.zeros((len(now), 3 * len(sources))), np.zeros((len(now), 3 * len(sources), model.states))
    for number, source in enumerate(sources):
        measured = np.array(source.measured)
        _rows(of.row[number], now, of.figures[number], of.states[number], assumed, measured, z, H, 3 * number)
    return z, H


def _now(motion: MotionStates) -> Array:
    """(K, n) what rows are given, w along east, north, up."""
    now = np.zeros((len(motion.time), NOW_LENGTH))
    w_ie = earth_rate_n(motion.lat)
    now[:, :4], now[:, 4:7], now[:, 11] = quaternion_from_dcm(motion.C_nb), motion.v_n, motion.alt
    now[:, 7:11] = quaternion_from_dcm(
        np.stack([C_en(lat, lon) for lat, lon in zip(motion.lat, motion.lon, strict=True)])
    )
    now[:, NOW_C : NOW_C + 9] = motion.C_nb.reshape(-1, 9)
    now[:, NOW_EARTH : NOW_EARTH + 3] = w_ie
    now[:, NOW_NORTH + 1] = 1.0
    for place in (NOW_RATE, NOW_OTHER_RATE, NOW_MEAN_RATE):
        now[:, place : place + 3] = motion.w_ib_b
    now[:, NOW_TURN : NOW_TURN + 3] = motion.w_ib_b - np.einsum("kji,kj->ki", motion.C_nb, w_ie)
    now[:, NOW_FORCE : NOW_FORCE + 3] = motion.f_b
    return now


@compiled
def _rows(
    row: int, now: Any, figures: Any, at: Any, assumed: Any, measured: Any, of_z: Any, out: Any, first: int
) -> None:
    H, z, R = np.zeros((3, out.shape[2])), np.zeros(3), np.zeros(3)
    for k in range(len(now)):
        for i in range(3):
            z[i] = np.nan
            for j in range(H.shape[1]):
                H[i, j] = 0.0
        row_at(row)(now[k], figures, at, assumed, measured[k], H, z, R)
        for i in range(3):
            of_z[k, first + i] = z[i]
            for j in range(H.shape[1]):
                out[k, first + i, j] = H[i, j]
