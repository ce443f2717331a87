"""Does the sea push a base in step with its tilt? What looks like late gyros may be that: how much of it a delay does not explain.

The wave that tilts a base also pushes it. Of waves of frequency w the tilt ``(x, y)`` of a base goes with a push
``K(jw) (x, y)``: a 2 x 2 matrix of gains and phases, which the base's response decides. Gyros that are late by ``d`` leave
``g (1 - exp(-jwd))`` times the tilt itself: the same about both axes, nothing across, in quadrature with the tilt and growing with
w. In a narrow band of waves a push has some of that, and a fit of the delay alone takes it for one: rafts and buoys seem .1 to .7 s
late or early.

A delay explains all that goes with the tilt; a push has parts that no delay explains. With the delay taken off the gyros the
level force is fitted once more with ``K = K0 + K1 jw + K2 (jw)^2``: tilt, its rate and its acceleration, along and across. What
this explains beyond the delay is the base's own. Of sound buoys, rafts and ships at the quay it was .12 to thousands of times the
squares that the delay explains, of late gyros on swaying ships and gondolas 0 to .2, as a rule .01.

So it is with scale factors: gyros that turn too far leave nothing that goes with the tilt once they are put right, a push does.

A push of the same shape as a delay hides one, or makes one seem: no record of gyros and accelerometers tells the two apart. Where a
push is there, a delay is in sigma, with all that it may have hidden, and refuses no log.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.tilt_bench import AXES, TiltBench, squares_left

Array = NDArray[np.float64]


class Push(NamedTuple):
    """Of the sea in step with a base's tilt, against what may be wrong of its gyros."""

    share: float  # squares of level force that go with the tilt and are not this, by those that it explains
    level: float  # m/s^2, RMS along an axis of the level force that the gyros as given do not explain


NO_PUSH = Push(0.0, 0.0)


def push_in_step(bench: TiltBench, theta: Array, right: Array) -> Push:
    """What goes with the tilt of a base beyond a delay, or other scale factors, of its gyros.

    Parameters
    ----------
    theta : (P, L, 3) array, rad
        Turns of the base, as its gyros show them.
    right : (P, L, 3) array, rad
        The same with what may be wrong of them put right.

    Returns
    -------
    Push
        Its share is infinite where what is put right explains nothing.
    """
    given, _ = _left(bench, theta)
    left, alone = _left(bench, right)
    share = (left - alone) / (given - left) if given > left else math.inf
    return Push(share, math.sqrt(1.5 * given / theta.size))


def _left(bench: TiltBench, theta: Array) -> tuple[float, float]:
    """Squares of the level force that the gyros and an arm leave, and that a push in step with the tilt leaves as well."""
    flat, C = bench.carried(theta)
    up = bench.up(C)
    x, y = _level_axes(up)
    turned = (C @ theta[..., None])[..., 0]
    tilt = np.cross(np.cumsum(turned, axis=1) - 0.5 * turned, up[:, None])  # the way that gravity seems to go
    rate = np.cross(turned, up[:, None]) / bench.interval
    acceleration = np.gradient(rate, bench.interval, axis=1)
    columns = [
        bench.freed(np.sum(moved * along[:, None], axis=2, keepdims=True) * push[:, None])
        for moved in (tilt, rate, acceleration)
        for along in (x, y)
        for push in (x, y)
    ]
    known = flat.reshape(*theta.shape, 4)
    all_of = np.concatenate([known, np.stack(columns, axis=3)], axis=3)
    level = level_parts(all_of, up).reshape(-1, all_of.shape[3])
    return squares_left(level[:, 0], level[:, 1:4]), squares_left(level[:, 0], level[:, 1:])


def level_parts(x: Array, up: Array) -> Array:
    """(P, L, 2, N) level parts of columns (P, L, 3, N), by the vertical (P, 3) of each piece."""
    return np.stack([np.einsum("plic,pi->plc", x, axis) for axis in _level_axes(up)], axis=2)


def _level_axes(up: Array) -> tuple[Array, Array]:
    """Two level axes (P, 3) of each piece, of which the first is across the axis of the IMU that is the most level."""
    axis = AXES[np.argmin(np.abs(up.mean(axis=0)))]
    x = np.cross(axis, up)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return x, np.cross(up, x)
