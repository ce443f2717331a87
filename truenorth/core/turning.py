"""How far gyros explain the turning of gravity: unit, order and signs of their axes against the accelerometers'.

Gravity's direction in body axes turns as ``du/dt = -w x u`` whatever the mounting, so that data in which it turns show the
gyros' scale and their axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TURN_STEP = 0.5  # s, over which the turn of gravity is compared with the gyros
LEAST_TURN = np.radians(0.5)  # rad, RMS of gravity's turn over TURN_STEP, for a judgement on the gyros
AGREES = 0.8  # share of gravity's turn that the gyros must explain for a claim
EQUAL = 0.02  # readings whose shares differ by less are equals
ARM = 10.0  # m, how far above or below the axis about which it rocks an IMU may sit: on a mast, on a bridge
AXES = "xyz"


@dataclass(frozen=True)
class Turning:
    """How the gyros explain the turning of gravity in body axes."""

    scale: float  # measured rate over the rate that gravity's direction shows, axes as given; NaN where nothing turned
    agreement: float  # share of gravity's turning explained with the axes as given and that scale, at most 1
    # signed axes, such as ``+y +x -z``, of the reading that agrees best: what the gyro columns x, y, z hold
    best_axes: str
    best_agreement: float  # its agreement
    best_scale: float  # measured rate over the rate that gravity's direction shows, in that reading
    # The same with the axes as given, of an IMU on an arm from the axis about which its base rocks.
    arm_scale: float
    arm_agreement: float
    arm_unscaled: float  # the share at a scale of one; negative where such turns are farther off than none


def fit_turning(interval: float, rates: Array) -> Turning:
    """Fit the gyros to the turn of gravity, ``du = -theta x u``, for all 48 signed axes.

    Cells of 0.1 s in which the specific force is not of its usual size are left out of both sides; both are
    then averaged over 0.5 s twice, against noise. The agreement of a reading is the share of ``sum |du|^2`` that
    it explains with its best positive scale.

    An IMU on an arm r from the axis about which its base rocks feels ``dw/dt x r`` as well, which swings the specific force in
    step with the tilt: at 0.4 Hz an arm of 1.6 m as far as gravity does. A unit acts alike on slow and quick turns, an arm by the
    square of their frequency: fitted together they are kept apart where the base rocks in more than one tone.

    Parameters
    ----------
    interval : float, s
        Of the cells, about 0.1 s.
    rates : (6, cells) array
        Mean rates and mean specific forces of even cells, in any unit; an arm at a scale of one is in metres of rad/s and m/s^2.

    Returns
    -------
    Turning
        All NaN where the record is too short or nothing turned.
    """
    nothing = Turning(np.nan, np.nan, "", *[np.nan] * 5)
    cells = max(1, round(TURN_STEP / interval))
    size = np.linalg.norm(rates[3:], axis=0)
    if rates.shape[1] < 20 * cells or not np.all(size > 0.0):
        return nothing
    up = rates[3:] / size
    usual = np.abs(size / np.median(size) - 1.0) < 0.1
    good = usual[1:] & usual[:-1]
    turn = _smooth(np.where(good, np.diff(up, axis=1), 0.0), cells)
    if np.sqrt(np.mean(np.sum(turn**2, axis=0))) < LEAST_TURN * interval / TURN_STEP:
        return nothing
    angle = rates[:3] - rates[:3].mean(axis=1, keepdims=True)  # bias and earth rate; a sway keeps its swing
    theta = 0.5 * interval * (angle[:, 1:] + angle[:, :-1])
    middle = np.where(good, 0.5 * (up[:, 1:] + up[:, :-1]), 0.0)

    # Turn if axis i holds column j, for all i and j: each reading is a sum of three of the nine.
    turned = [-np.cross(axis, middle, axisb=0, axisc=0) for axis in np.eye(3)]
    basis = np.stack([[_smooth(about * theta[j], cells).ravel() for j in range(3)] for about in turned])
    products = np.einsum("ijn,kln->ijkl", basis, basis)
    overlaps, total = basis @ turn.ravel(), float(np.sum(turn**2))
    readings = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            reading = np.zeros((3, 3))
            reading[range(3), order] = signs
            power = float(np.einsum("ij,ijkl,kl", reading, products, reading))
            overlap = float(np.sum(reading * overlaps))
            explained = max(0.0, overlap) ** 2 / (power * total) if power > 0.0 else 0.0
            readings.append((explained, power / overlap if overlap > 0.0 else np.nan, order, signs))
    identity = next(r for r in readings if r[2] == (0, 1, 2) and r[3] == (1.0, 1.0, 1.0))
    most = max(r[0] for r in readings)
    # A turn about one axis leaves others open: of equals, the reading nearest to the axes as given.
    equals = [r for r in readings if r[0] > most - EQUAL]
    best = max(equals, key=lambda r: sum(sign for i, sign in enumerate(r[3]) if r[2][i] == i))
    own, arm = basis[range(3), range(3)].sum(axis=0), _swing_on_an_arm(interval, angle, rates[3:], good)
    on_arm = _scale_and_arm(turn.ravel(), own, arm)
    return Turning(identity[1], identity[0], _columns(best[2], best[3]), best[0], best[1], *on_arm)


def _swing_on_an_arm(interval: float, w: Array, f: Array, good: NDArray[np.bool_]) -> Array:
    """(n, 3) how the direction of the forces f (3, cells) turns where rates w act on an arm of a metre along x, y or z."""
    cells, size = max(1, round(TURN_STEP / interval)), np.linalg.norm(f, axis=0)
    quickening = np.gradient(w, interval, axis=1)
    columns = []
    for axis in np.eye(3):
        swing = np.cross(quickening, axis, axisa=0, axisc=0) / size
        swing -= np.sum(swing * f, axis=0) * f / size**2  # what lengthens the force does not turn it
        columns.append(_smooth(np.where(good, np.diff(swing, axis=1), 0.0), cells).ravel())
    return np.stack(columns, axis=1)


def _scale_and_arm(turn: Array, own: Array, swing: Array) -> tuple[float, float, float]:
    """Scale and agreement of turns `own` (n,) on any arm; and their agreement at a scale of one, on an arm of `ARM` at most."""
    total = float(turn @ turn)
    both = np.column_stack([own, swing])
    factors, arm = _fitted(both, turn), _fitted(swing, turn - own)
    arm *= ARM / max(float(np.linalg.norm(arm)), ARM)
    agreement = 1.0 - float(np.sum((turn - both @ factors) ** 2)) / total
    unscaled = 1.0 - float(np.sum((turn - own - swing @ arm) ** 2)) / total
    return (1.0 / float(factors[0]) if factors[0] > 0.0 else np.nan), agreement, unscaled


def _fitted(columns: Array, values: Array) -> Array:
    """Factors of columns (n, m) that leave the least squares of values (n,); a column of zeros has none."""
    size = np.sqrt(np.einsum("ki,ki->i", columns, columns))
    even = columns / np.where(size > 0.0, size, 1.0)
    factors = np.linalg.lstsq(np.einsum("ki,kj->ij", even, even), np.einsum("ki,k->i", even, values), rcond=None)[0]
    return np.asarray(factors / np.where(size > 0.0, size, 1.0))


def _smooth(signal: Array, cells: int) -> Array:
    """(3, m) means over `cells`, taken twice, of every `cells`-th column."""
    for step in (1, cells):
        total = np.zeros((len(signal), signal.shape[1] + 1))
        np.cumsum(signal, axis=1, out=total[:, 1:])
        signal = (total[:, cells::step] - total[:, :-cells:step]) / cells
    return signal


def _columns(order: tuple[int, ...], signs: tuple[float, ...]) -> str:
    """What the columns x, y, z hold when axis i is column ``order[i]`` times ``signs[i]``."""
    names = [""] * 3
    for axis, (column, sign) in enumerate(zip(order, signs)):
        names[column] = ("+" if sign > 0 else "-") + AXES[axis]
    return " ".join(names)
