"""The sign of the gyro about the vertical by level force alone, of a base that hardly turns about the vertical.

What a ship turns about her vertical moves gravity in her axes by no more than the product of that turn and her tilt. A wrong
sign leaves twice this, which is less than heave leaves; but heave is vertical, and what a wrong sign leaves is level. Its shape is
known, too: it is the difference of the two readings. The share of it that the level force of the gyros as given holds is nought
where these are right, and one where the sign is wrong.

The base's own level motion is a few lines, and a product of two sways has other ones: an autoregression whitens what is left, which
makes the share several times surer, and the short blocks whose scatter is in its sigma nearly independent.

Of 350 sound ships, moored ships, buoys and gondolas such shares came up to 3.0 sigmas nearer to one than to nought; 4.8 name a
sign. Where waves push a base in step with its tilt the share is about a half, whichever sign is right, and nothing is said.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.analysis.student import student_limit
from truenorth.quality.pushed import level_parts
from truenorth.quality.tilt_bench import TiltBench, by_pieces, squares_left
from truenorth.state.limits import limit

Array = NDArray[np.float64]

ORDER = 30  # of the autoregression, in cells: 3 s, half a period of a sway
BLOCKS = 4  # of a piece, each of 4 s
RIDGE = 1e-6  # of the mean square: lines as sharp as a simulator's leave the autoregression without a single solution


class OneSign(NamedTuple):
    """A gyro whose sign is wrong."""

    axis: int
    given: float  # m/s^2, RMS of level force that the gyros as given leave
    left: float  # m/s^2, the same with this sign changed


def one_sign(bench: TiltBench, theta: Array) -> OneSign | None:
    """The gyro of turns `theta` (P, L, 3) about the vertical, if its sign is wrong by the level force; else None."""
    axis = int(np.argmax(np.abs(bench.force.mean(axis=(0, 1)))))
    given, unturned, other = (
        _level(bench, turns)
        for turns in (theta, np.zeros_like(theta), theta * np.where(np.arange(3) == axis, -1.0, 1.0))
    )
    squares, at_rest, left = (
        squares_left(flat[:, 0], flat[:, 1:4]) for flat in (x.reshape(-1, 7) for x in (given, unturned, other))
    )
    if left >= min(squares, limit("gyros right") * at_rest):
        return None
    # The arm's columns of both readings: neither is favoured.
    columns = np.concatenate(
        [given[..., :1], given[..., 1:4], given[..., :1] - other[..., :1], other[..., 1:4]], axis=3
    )
    whole = np.concatenate([columns, given[..., 4:]], axis=3)
    white = _whitened(whole, _rest(columns))
    blocks = len(theta) * BLOCKS
    flat = white[:, : white.shape[1] // BLOCKS * BLOCKS].reshape(-1, white.shape[3])
    share, sigma = by_pieces(blocks, flat[:, :4], list(flat[:, 4:8].T), flat[:, 8:])
    sure, hint = (student_limit(limit(name), blocks - 1) for name in ("sure delay", "hint of a delay"))
    if share[0] - 0.5 < sure * sigma[0] or abs(share[0] - 1.0) > hint * sigma[0]:
        return None
    count = given[..., 0].size
    return OneSign(axis, float(np.sqrt(squares / count)), float(np.sqrt(left / count)))


def _level(bench: TiltBench, theta: Array) -> Array:
    """(P, M, 2, 7) level force and the arm's columns with these turns, and what one sigma of each bias makes of the force."""
    columns, C = bench.columns(theta)
    return bench.averaged(level_parts(np.concatenate([columns, bench.accel_bias * C], axis=3), bench.up(C)))


def _rest(columns: Array) -> Array:
    """(P, M, 2) what all further columns (P, M, 2, N) leave of the first."""
    flat = columns.reshape(-1, columns.shape[3])
    size = np.maximum(np.linalg.norm(flat, axis=0), 1e-12)
    sizes = np.linalg.lstsq(flat[:, 1:] / size[1:], flat[:, 0], rcond=1e-9)[0]
    return np.asarray((flat[:, 0] - flat[:, 1:] / size[1:] @ sizes).reshape(columns.shape[:3]))


def _whitened(columns: Array, rest: Array) -> Array:
    """(P, M - order, 2, N) columns without what an autoregression of `rest` (P, M, 2) foretells, each level axis by its own."""
    order = min(ORDER, rest.shape[1] // 3)
    parts = []
    for axis in range(2):
        before = np.lib.stride_tricks.sliding_window_view(rest[:, :-1, axis], order, axis=1).reshape(-1, order)
        N = before.T @ before
        N += RIDGE * np.trace(N) / order * np.eye(order)
        weights = np.append(-np.linalg.lstsq(N, before.T @ rest[:, order:, axis].ravel(), rcond=None)[0], 1.0)
        parts.append(np.lib.stride_tricks.sliding_window_view(columns[:, :, axis], order + 1, axis=1) @ weights)
    return np.stack(parts, axis=2)
