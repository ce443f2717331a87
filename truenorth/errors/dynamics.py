"""How groups of error states run by themselves, for kernels: arrays over all states, and the second-order pairs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import borrowing
from truenorth.errors.group import FIGURES, Group
from truenorth.state.layout import STATES

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

ALONE, RATE = -1, -2


class Dynamics(NamedTuple):
    """Of each state (n,): inverse correlation time (1/s) and distance (1/m), noise density and, along the way, per metre.

    `pair` is the place of a value's rate in a second-order process (`ALONE`: none; `RATE`: it is one itself), `omega`
    and `zeta` its frequency and damping, `still` the value's stationary variance. `held` states are considered, not
    corrected; `turns` (T,) are first states of rotations. `acts` (G,), `figures` (G, 8), `first` (G,) and `count` (G,):
    the columns of groups that act on the INS.
    """

    decay: Array
    noise: Array
    along: Array
    wander: Array
    pair: Integers
    omega: Array
    zeta: Array
    still: Array
    held: NDArray[np.bool_]
    turns: Integers
    acts: Integers
    figures: Array
    first: Integers
    width: Integers


def dynamics_of(groups: Sequence[Group], noise: Array) -> Dynamics:
    """The arrays of these groups behind the fifteen states, whose own noise densities come first in `noise`."""
    n = STATES + sum(len(group.prior) for group in groups)
    decay, along, wander, omega, zeta, still = np.zeros((6, n))
    density, pair, held = np.zeros(n), np.full(n, ALONE), np.zeros(n, dtype=np.bool_)
    density[:STATES] = noise[:STATES]
    turns, acting, firsts = [], [], []
    at = STATES
    for group in groups:
        m = len(group.sigma)
        own = slice(at, at + m)
        held[at : at + len(group.prior)] = group.considered
        if group.frequency > 0.0:
            pair[own] = np.arange(at + m, at + 2 * m)
            pair[at + m : at + 2 * m] = RATE
            omega[own], zeta[own], still[own] = group.frequency, group.damping, group.sigma**2
        elif (
            group.drift > 0.0
        ):  # a frequency of nothing, critically damped: value and rate go on as they are, without noise
            pair[own] = np.arange(at + m, at + 2 * m)
            pair[at + m : at + 2 * m] = RATE
            zeta[own] = 1.0
        else:
            decay[own], along[own] = 1.0 / group.correlation_time, 1.0 / group.correlation_distance
            density[own] = 2.0 * group.sigma**2 / group.correlation_time + group.walk**2
            wander[own] = 2.0 * group.sigma**2 / group.correlation_distance
        if group.rotation:
            turns.append(at)
        if group.acts is not None:
            acting.append(group)
            firsts.append(at)
        at += len(group.prior)
    figures = np.zeros((len(acting), FIGURES))
    for row, group in zip(figures, acting, strict=True):
        row[: len(group.figures)] = group.figures
    return Dynamics(
        decay,
        density,
        along,
        wander,
        pair,
        omega,
        zeta,
        still,
        held,
        np.array(turns, dtype=np.int64),
        np.array([group.acts.address for group in acting], dtype=np.int64),
        figures,
        np.array(firsts, dtype=np.int64),
        np.array([len(group.prior) for group in acting], dtype=np.int64),
    )


@borrowing
def second_order(omega: float, zeta: float, T: float) -> Any:
    """Transition of value and rate over T: four numbers, by rows.

    Critically damped: ``e^-wT [1 + wT, T; -w^2 T, 1 - wT]``; less: with the damped frequency ``w sqrt(1 - zeta^2)``.
    """
    e = math.exp(-zeta * omega * T)
    if zeta >= 1.0:
        return e * (1.0 + omega * T), e * T, -e * omega * omega * T, e * (1.0 - omega * T)
    damped = omega * math.sqrt(1.0 - zeta * zeta)
    c, s = math.cos(damped * T), math.sin(damped * T) / damped
    return e * (c + zeta * omega * s), e * s, -e * omega * omega * s, e * (c - zeta * omega * s)


@borrowing(forceinline=True)
def couple_pairs(d: Dynamics, F: Any, T: float, Phi: Any, Phi_t: Any) -> None:
    """Second-order processes in a transition whose other rows are filled in: their own blocks, and how they drive the INS."""
    half = 0.5 * T * T
    for i in range(STATES, len(d.pair)):
        j = d.pair[i]
        if j < 0:
            continue
        w = d.omega[i]
        Phi[i, i], Phi[i, j], Phi[j, i], Phi[j, j] = second_order(w, d.zeta[i], T)
        for k in range(9):
            Phi[k, i] -= half * F[k, j] * w * w
            Phi[k, j] += half * (F[k, i] - 2.0 * d.zeta[i] * w * F[k, j])
            Phi_t[i, k], Phi_t[j, k] = Phi[k, i], Phi[k, j]
        Phi_t[i, i], Phi_t[i, j], Phi_t[j, i], Phi_t[j, j] = Phi[i, i], Phi[j, i], Phi[i, j], Phi[j, j]


@borrowing(forceinline=True)
def noise_of_pairs(d: Dynamics, Phi: Any, Q: Any) -> None:
    """``Q = P - Phi P Phi'`` with the stationary P of each second-order process."""
    for i in range(STATES, len(d.pair)):
        j = d.pair[i]
        if j < 0:
            continue
        x, y = d.still[i], d.omega[i] * d.omega[i] * d.still[i]
        a, b, c, e = Phi[i, i], Phi[i, j], Phi[j, i], Phi[j, j]
        Q[i, i] = x - a * a * x - b * b * y
        Q[j, j] = y - c * c * x - e * e * y
        Q[i, j] = -a * c * x - b * e * y
        Q[j, i] = Q[i, j]
