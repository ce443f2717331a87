"""How the base of an indexer turns, by the IMU's attitude as aligned and the encoder's angles: in it is what these are off by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.encoder_angles import CarriedAngles
from truenorth.alignment.fine import FineAlignment
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.core.indexing import DIRECTIONS, C_bs_from_angles, chained
from truenorth.errors.matrices import MATRICES, matrices_of, without_errors
from truenorth.errors.staying import BIASES, STATES
from truenorth.quality.encoder import mean_attitude
from truenorth.quality.encoder_patterns import Turns
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial import earth_rotation, integrate

Array = NDArray[np.float64]

CELL = 0.1  # s, about which the base is looked at
SLEW = 0.05  # s, before and after a time, in which its rate is seen: a start of a slew takes tenths of a second
FAR = 0.75  # steps of the encoder's rows: farther from each of them a time has no angle of its own


def base_turns(
    fine: FineAlignment, record: ImuRecord, carried: CarriedAngles, axes: Sequence[str], lat: float, spec: ImuSpec
) -> Turns | None:
    """Turns of the base about its mean attitude, at even times.

    Parameters
    ----------
    fine : FineAlignment
        The IMU's; its sensors' errors are taken off.
    record : ImuRecord
    carried : CarriedAngles
        Of the encoder, at the edges of the record's rows.
    axes : sequence of {"x", "y", "z"}
        The outermost first.
    lat : float, rad
    spec : ImuSpec
        As large as it says errors of the gyros may be left, that their fit has mistaken for others.
    """
    if len(carried.time) < 2:
        return None
    step = carried.step * max(1, round(CELL / carried.step))
    count = int((carried.time[-1] - carried.time[0]) / step + 1e-3)
    time = carried.time[-1] - step * np.arange(count, -1, -1)
    edges = carried.record.time
    before = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, len(edges) - 2)
    share = np.clip((time - edges[before]) / (edges[before + 1] - edges[before]), 0.0, 1.0)[:, None]
    rows = np.unique(np.concatenate([before, before + 1]))
    errors = fine.taken + fine.end[: len(fine.taken)]
    known = len(errors) >= STATES + MATRICES
    off = matrices_of(errors[STATES : STATES + MATRICES]) if known else (np.zeros((3, 3)),) * 2
    right = without_errors(record, errors[BIASES], *off)
    C_is = integrate(right, fine.integrals.intervals[0], rows_at=rows - 1).C_ib_at
    angles = np.unwrap(carried.record.angles.reshape(len(edges), -1), axis=0)
    C_bs = C_bs_from_angles(axes, angles[rows])
    C_n0_i = fine.misalignment_at(np.eye(3), 0.0)[0]
    C_nb = np.swapaxes(earth_rotation(edges[rows] - edges[0], lat), 1, 2) @ (C_n0_i @ C_is) @ np.swapaxes(C_bs, 1, 2)
    mean = mean_attitude(C_nb)
    turn = np.asarray(rotation_vector_from_dcm(mean.T @ C_nb))
    at = np.searchsorted(rows, before)
    turn = turn[at] * (1.0 - share) + turn[np.searchsorted(rows, before + 1)] * share
    own = angles[before] * (1.0 - share) + angles[before + 1] * share
    C_bs = C_bs_from_angles(axes, own)
    gyro, sigma = _gyro_errors(right, edges, C_bs, before, spec, known=known)
    nearest = np.clip(np.searchsorted(carried.time, time), 1, len(carried.time) - 1)
    away = np.minimum(np.abs(carried.time[nearest] - time), np.abs(carried.time[nearest - 1] - time))
    directions = [
        chained([np.array(DIRECTIONS[a]) for a in axes[:i]], own[:, :i]) @ np.array(DIRECTIONS[axes[i]])
        for i in range(len(axes))
    ]
    there = away < FAR * carried.step
    return Turns(time, turn, there, own, C_bs, tuple(directions), gyro, sigma, mean[2], rates_at(edges, angles, time))


def rates_at(edges: Array, angles: Array, time: Array) -> Array:
    """(K, A) rates of carried angles at times, rad/s."""
    first, last = (np.clip(time + shift, edges[0], edges[-1]) for shift in (-SLEW, SLEW))
    by = [np.interp(last, edges, column) - np.interp(first, edges, column) for column in angles.T]
    return np.stack(by, axis=-1) / (last - first)[:, None]


def _gyro_errors(
    record: ImuRecord, edges: Array, C_bs: Array, before: Array, spec: ImuSpec, *, known: bool
) -> tuple[Array, Array]:
    """(K, 3, m) what errors of the gyros turn the base by, and their one-sigmas (m,); `known`: with scale factors and the like."""
    apart = np.diff(edges[before], append=edges[before[-1] + 1])
    columns, sigma = [np.cumsum(C_bs * apart[:, None, None], axis=0)], [np.full(3, spec.gyro_bias)]
    if known:
        turned = np.cumsum(increments(record)[0], axis=0)
        turned = np.diff(turned[before], axis=0, append=turned[before[-1:]])
        columns.append(np.cumsum(np.einsum("kai,kj->kaij", C_bs, turned).reshape(len(C_bs), 3, 9), axis=0))
        matrix = np.full((3, 3), spec.gyro_misalignment)
        np.fill_diagonal(matrix, spec.gyro_scale_factor)
        sigma.append(matrix.ravel())
    there = np.concatenate(sigma)
    return np.concatenate(columns, axis=2)[:, :, there > 0.0], there[there > 0.0]
