"""Specific force of pieces of a log, and what readings of the gyros leave of it, by least squares."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_quaternion, skew
from truenorth.strapdown.inertial_integration import integrate_attitude

Array = NDArray[np.float64]

AXES = np.eye(3)
AVERAGED = 5  # cells of a tenth of a second: gyros differentiated over as many have a 25th of the noise power
MOST_OF_IT = 0.5  # of the squares of the turns about an axis, that an indexer makes
# Values at the first edge of a piece and the next, by the means in the first four cells: exact for a cubic.
EDGES = np.array([[25.0, -23.0, 13.0, -3.0], [3.0, 13.0, -5.0, 1.0]]) / 12.0


class TiltBench:
    """Specific force (P, L, 3) of pieces, and what readings of the gyros leave of it."""

    def __init__(self, force: Array, interval: float, C_sb: Array | None, accel_bias: float = 0.0) -> None:
        self.force, self.interval, self.C_sb, self.accel_bias = force, interval, C_sb, accel_bias

    def carried(self, theta: Array) -> tuple[Array, Array]:
        """Force and the arm's columns (P L 3, 4) in axes that do not turn, pieces freed of a line, and ``C_is`` (P, L, 3, 3)."""
        columns, C = self.columns(theta)
        return self.freed(columns).reshape(-1, 4), C

    def columns(self, theta: Array) -> tuple[Array, Array]:
        """Force and columns as :meth:`carried` gives them, by pieces (P, L, 3, 4) and with their lines, and ``C_is``."""
        C = np.stack([dcm_from_quaternion(integrate_attitude(piece)) for piece in theta])
        C = 0.5 * (C[:, 1:] + C[:, :-1])  # in the middle of a cell, to second order in its turn
        base = C if self.C_sb is None else C @ self.C_sb
        w = theta / self.interval
        if self.C_sb is not None:
            w = self._turning(base)
            w = np.concatenate([w[:, :1], 0.5 * (w[:, 1:] + w[:, :-1]), w[:, -1:]], axis=1)
        W = skew(changes(w) / self.interval) + skew(w) @ skew(w)
        return np.concatenate([C @ self.force[..., None], base @ W], axis=3), C

    def up(self, C: Array) -> Array:
        """(P, 3) the vertical of each piece in axes that do not turn, by attitudes ``C_is`` (P, L, 3, 3)."""
        up = np.mean(C @ self.force[..., None], axis=1)[..., 0]
        return np.asarray(up / np.linalg.norm(up, axis=1, keepdims=True))

    def _turning(self, base: Array) -> Array:
        """(P, L-1, 3) rates from cell to cell of attitudes (P, L, 3, 3), rad/s."""
        turn = np.swapaxes(base[:, :-1], -1, -2) @ base[:, 1:]
        return np.stack([turn[..., 2, 1], turn[..., 0, 2], turn[..., 1, 0]], axis=-1) / self.interval

    def scales_by_angles(self, theta: Array) -> Array | None:
        """(3,) scale errors of the gyros by the turns of their indexer, NaN about an axis that it hardly turns; None without one.

        What the gyros show beyond these turns is the base's own, and goes to and fro.
        """
        if self.C_sb is None:
            return None
        turn = self.C_sb[:, :-1] @ np.swapaxes(self.C_sb[:, 1:], -1, -2)
        made = np.stack([turn[..., 2, 1], turn[..., 0, 2], turn[..., 1, 0]], axis=-1)
        seen = 0.5 * (theta[:, 1:] + theta[:, :-1])
        squares = np.sum(made**2, axis=(0, 1))
        much = squares > MOST_OF_IT * np.sum(seen**2, axis=(0, 1))
        return np.where(much, np.sum((seen - made) * made, axis=(0, 1)) / np.maximum(squares, 1e-300), np.nan)

    def freed(self, x: Array) -> Array:
        """Without a constant and a slope in each piece."""
        flat, basis = x.reshape(len(x), x.shape[1], -1), _line(x.shape[1])
        return np.asarray((flat - basis @ (basis.T @ flat)).reshape(x.shape))

    def averaged(self, x: Array) -> Array:
        """Means over `AVERAGED` cells, pieces freed of a line."""
        sums = np.cumsum(x, axis=1)
        return self.freed((sums[:, AVERAGED:] - sums[:, :-AVERAGED]) / AVERAGED)

    def left(self, theta: Array) -> float:
        """RMS of specific force that gyros with these increments do not explain, m/s^2."""
        flat, _ = self.carried(theta)
        return math.sqrt(squares_left(flat[:, 0], flat[:, 1:]) / len(flat))

    def small(self, theta: Array) -> tuple[Array, Array]:
        """(7,) a small delay of the gyros, s, errors of their scale factors, delays by turns about each axis; and one-sigmas.

        The base's own motion is in these, and what a single piece alone shows has no small one. So is a bias of the accelerometers:
        in axes that do not turn it turns with the IMU, as gravity does in the IMU's, and passes for gyros that turn too far.

        All is averaged over half a second: the angular acceleration that an arm is fitted to has the noise of the gyros in it,
        differentiated. On a rope of 15 m that of gyros of .05 deg/sqrt(h) made the arm too short, and scale factors 3 % wrong.
        """
        columns, C = self.columns(theta)
        up = (C @ self.force[..., None])[..., 0]
        rate = (C @ (theta / self.interval)[..., None])[..., 0]
        rate -= rate.mean(axis=1, keepdims=True)
        turns = C * theta[..., None, :]  # about each axis, in axes that do not turn
        angle = np.cumsum(turns, axis=1) - 0.5 * turns
        # Gyros that are late have not turned yet.
        late = [self.averaged(-rate[..., i, None] * np.cross(AXES[i], up)).ravel() for i in range(3)]
        scale = [self.averaged(np.cross(angle[..., i], up)).ravel() for i in range(3)]
        biased = self.accel_bias * self.averaged(C).reshape(-1, 3)
        flat = self.averaged(columns).reshape(-1, 4)
        of_all = by_pieces(len(theta), flat, [late[0] + late[1] + late[2], *scale], biased)
        of_each = by_pieces(len(theta), flat, [*late, *scale], biased)
        off, sigma = (np.append(whole[:4], each[:3]) for whole, each in zip(of_all, of_each, strict=True))
        return off, sigma

    def rate(self, theta: Array) -> float:
        """RMS of the rates, rad/s."""
        return float(np.sqrt(np.mean(np.sum((theta / self.interval) ** 2, axis=-1))))

    def rate_up(self, theta: Array) -> float:
        """RMS of the rate about the vertical, rad/s."""
        up = self.force.mean(axis=1, keepdims=True) if self.C_sb is None else self.force
        up = up / np.linalg.norm(up, axis=-1, keepdims=True)
        return float(np.sqrt(np.mean(np.sum(theta / self.interval * up, axis=-1) ** 2)))


def by_pieces(pieces: int, flat: Array, columns: list[Array], biased: Array) -> tuple[Array, Array]:
    """Sizes of columns (P L 3,) that explain the force best, with the best arm; one-sigmas by leaving out piece after piece.

    `biased` (P L 3, 3) is what a bias of one sigma along each axis makes of the force: what the columns take of it is in sigma.
    """
    A = np.column_stack([*columns, flat[:, 1:]])
    scale = np.maximum(np.linalg.norm(A, axis=0), 1e-12)
    parts = (A / scale).reshape(pieces, -1, len(scale))
    squares, products = (np.swapaxes(parts, 1, 2) @ other for other in (parts, flat[:, 0].reshape(pieces, -1, 1)))

    def solved(N: Array, b: Array) -> Array:
        return np.asarray((np.linalg.pinv(N, rcond=1e-9, hermitian=True) @ b)[..., 0])

    whole, right = squares.sum(axis=0), products.sum(axis=0)
    without = solved(whole - squares, right - products)
    variance = (pieces - 1) / pieces * np.sum((without - without.mean(axis=0)) ** 2, axis=0)
    taken = np.linalg.pinv(whole, rcond=1e-9, hermitian=True) @ ((A / scale).T @ biased)
    variance += np.sum(taken**2, axis=1)
    count = len(columns)
    return solved(whole, right)[:count] / scale[:count], np.sqrt(variance[:count]) / scale[:count]


def _line(length: int) -> Array:
    """(L, 2) orthonormal constant and slope."""
    t = np.arange(length) - 0.5 * (length - 1)
    return np.stack([np.full(length, length**-0.5), t / np.linalg.norm(t)], axis=1)


def squares_left(y: Array, A: Array) -> float:
    """Squares that least squares leaves, by the normal equations."""
    size = np.maximum(np.linalg.norm(A, axis=0), 1e-12)
    unit = A / size
    b = unit.T @ y
    return max(float(y @ y - b @ np.linalg.pinv(unit.T @ unit, rcond=1e-9) @ b), 0.0)


def changes(w: Array) -> Array:
    """(P, L, 3) change over each cell of what has these means in the cells: by its values at their edges, to fourth order.

    A lever arm of 14 m on a ship makes 2 m/s^2; a central difference over two cells would miss a hundredth of it.
    """
    inner = (7.0 * (w[:, 1:-2] + w[:, 2:-1]) - w[:, :-3] - w[:, 3:]) / 12.0
    first = np.tensordot(EDGES, w[:, :4], (1, 1)).swapaxes(0, 1)
    last = np.tensordot(EDGES[::-1, ::-1], w[:, -4:], (1, 1)).swapaxes(0, 1)
    edges = np.concatenate([first, inner, last], axis=1)
    return np.diff(edges, axis=1)


def shifted(theta: Array, cells: float) -> Array:
    """The turns (P, L, 3) of gyros late by so many cells, put right; the ends stay."""
    flat = theta.reshape(-1, 3)
    at = np.arange(len(flat)) + cells
    return np.stack([np.interp(at, np.arange(len(flat)), column) for column in flat.T], axis=1).reshape(theta.shape)
