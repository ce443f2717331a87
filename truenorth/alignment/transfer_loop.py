"""The closed loop of transfer alignment, compiled: mechanise the slave to the master's row, measure, correct, go on.

A row of the master belongs to the time of its stamp less the delay assumed *now*; the slave's solution at the sample nearest
to it is carried over the rest, half an interval at most, by its rate and acceleration. Nothing of the master is interpolated,
and a delay that the filter finds is taken off at once: only what is left of it is linearised.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.attitude import cross, quaternion_from_rotation_vector, quaternion_product
from truenorth.core.compiled import compiled
from truenorth.core.linalg import load, propagate_covariance
from truenorth.estimate.loop import joint_nis, set_matrix
from truenorth.filters.recursion import SOUND, update, workspace
from truenorth.models.transfer import attitude_rows, transfer_dynamics, transfer_transition, velocity_rows
from truenorth.state.layout import STATES as INS_STATES
from truenorth.strapdown.coning import coefficients
from truenorth.strapdown.level import mechanise_increments

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

ABSENT, USED, REJECTED, REOPENED = range(4)
_DV, _PHI, _BA, _BG = 0, 3, 6, 9
_TAU, _ARM, _MOUNT, _FLEX = range(4)
STATE = 19  # of the mechanisation: attitude, velocity, place, memory
SPAN = 2  # samples on each side of an epoch, over which its rate and acceleration are taken
K_WITHIN, K_BEFORE = coefficients("previous")

_radii_at = compiled(earth.radii_at)
_normal_gravity_at = compiled(earth.normal_gravity_at)


class Samples(NamedTuple):
    """Increments of the slave: (N,) lengths and ends of the intervals, (N, 3) rad and m/s."""

    step: Array
    end: Array
    dtheta: Array
    dvel: Array


class Master(NamedTuple):
    """Rows of the master, NaN where it does not say.

    (M,) times, known delay taken off; (M, 3) velocity, place (latitude, longitude, height) and acceleration, in n; (M, 3, 3)
    attitude; and the attitudes of master and slave that the model is linearised with, the slave's NaN where its own is to be taken.
    """

    time: Array
    velocity: Array
    place: Array
    acceleration: Array
    C_nm: Array
    C_linear: Array
    C_slave: Array


class Loop(NamedTuple):
    """What the kernel needs of the model and of the measurements.

    `noise` (n,) densities, `places` (4,), `flexure` (3,) variances with `beta`, `turn`: see
    :class:`truenorth.models.transfer.TransferModel`. `velocity`, `attitude` (3,) variances of the master's rows and `gates` (2,)
    largest NIS of either. `arm` (3,): the known one, beside which its states count. `longest`: samples in a step of the filter.
    `patience`: rows rejected in a row until a jump is believed.
    """

    noise: Array
    places: Integers
    flexure: Array
    beta: float
    turn: float
    velocity: Array
    attitude: Array
    gates: Array
    arm: Array
    longest: int
    patience: int


class Kept(NamedTuple):
    """Of each row of the master: the slave's sample (-1: none), state, what is assumed, sigma, innovations, NIS, verdict.

    NIS and verdict are those of velocity and attitude; `P` is kept where its first axis is as long.
    """

    sample: Integers
    state: Array
    aux: Array
    C_mb: Array
    sigma: Array
    P: Array
    innovation: Array
    innovation_sigma: Array
    nis: Array
    verdict: Integers


@compiled
def rates_at(samples: Samples, i: int, aux: Any, out: Any) -> None:
    """Mean rate and specific force, and angular acceleration, about the end of sample i - 1: rows of `out` (3, 3)."""
    first, last = max(0, i - SPAN), min(len(samples.step), i + SPAN)
    middle = max(first + 1, min(i, last - 1))
    for j in range(3):
        before, after, force = 0.0, 0.0, 0.0
        T_before, T_after = 0.0, 0.0
        for k in range(first, last):
            force += samples.dvel[k, j]
            if k < middle:
                before += samples.dtheta[k, j]
                T_before += samples.step[k]
            else:
                after += samples.dtheta[k, j]
                T_after += samples.step[k]
        T = T_before + T_after
        out[0, j] = (before + after) / T - aux[_BG + j]
        out[1, j] = force / T - aux[_BA + j]
        out[2, j] = (after / T_after - before / T_before) / (0.5 * T)


@compiled
def carry(
    size: Any,
    samples: Samples,
    first: int,
    last: int,
    loop: Loop,
    s: Any,
    aux: Any,
    room: Any,
    path: Any,
    w: Any,
    F: Any,
    full: Any,
) -> None:
    """Mechanise through samples ``first .. last - 1`` and carry the covariance with them."""
    count = last - first
    C, mean = np.zeros((3, 3)), np.zeros((3, 3))
    angle = np.zeros(3)
    T = 0.0
    for k in range(count):
        step = samples.step[first + k]
        room[k, 0] = step
        T += step
        for j in range(3):
            room[k, 1 + j] = samples.dtheta[first + k, j] - step * aux[_BG + j]
            room[k, 4 + j] = samples.dvel[first + k, j] - step * aux[_BA + j]
            angle[j] += room[k, 1 + j]
    set_matrix(s, C)
    v0 = (s[4], s[5], s[6])
    half = 0.5 * samples.step[first]
    for i in range(3):
        for j in range(3):
            mean[i, j] = half * C[i, j]
    mechanise_increments(
        room[:count, 0], room[:count, 1:4], room[:count, 4:7], path[:0, 0], K_BEFORE, False, 1, 0, s, path[:count]
    )
    for k in range(count):
        set_matrix(path[k], C)
        half = 0.5 * samples.step[first + k]
        if k + 1 < count:
            half += 0.5 * samples.step[first + k + 1]
        for i in range(3):
            for j in range(3):
                mean[i, j] += half * C[i, j]
    for i in range(3):
        for j in range(3):
            mean[i, j] /= T
    lat, alt = s[7], s[9]
    v = (0.5 * (s[4] + v0[0]), 0.5 * (s[5] + v0[1]), 0.5 * (s[6] + v0[2]))
    force = inertial(lat, alt, v, ((s[4] - v0[0]) / T, (s[5] - v0[1]) / T, (s[6] - v0[2]) / T))
    axis = (0.0, np.cos(lat), np.sin(lat))
    transfer_dynamics(mean, force, v, axis, alt, full, F)
    transfer_transition(F, T, loop.places[_FLEX], loop.beta, w.Phi, w.Phi_t)
    turning = loop.turn * (angle[0] ** 2 + angle[1] ** 2 + angle[2] ** 2) / (T * T)
    for i in range(len(loop.noise)):
        w.Q[i, i] = 0.5 * T * loop.noise[i]
        if _PHI <= i < _PHI + 3:
            w.Q[i, i] += 0.5 * T * turning
        w.P[i, i] += w.Q[i, i]
    at = loop.places[_FLEX]
    if at >= 0:
        for i in range(3):
            a, b, c, d = (
                w.Phi[at + i, at + i],
                w.Phi[at + i, at + 3 + i],
                w.Phi[at + 3 + i, at + i],
                w.Phi[at + 3 + i, at + 3 + i],
            )
            x, y = loop.flexure[i], loop.beta * loop.beta * loop.flexure[i]
            w.Q[at + i, at + i] = x - a * a * x - b * b * y
            w.Q[at + 3 + i, at + 3 + i] = y - c * c * x - d * d * y
            w.Q[at + i, at + 3 + i] = -a * c * x - b * d * y
            w.Q[at + 3 + i, at + i] = w.Q[at + i, at + 3 + i]
            aux[at + i], aux[at + 3 + i] = a * aux[at + i] + b * aux[at + 3 + i], c * aux[at + i] + d * aux[at + 3 + i]
    propagate_covariance(size, w.Phi, w.Phi_t, w.Q, w.P, w.temporary)


@compiled(inline="always")
def inertial(lat: float, alt: float, v: Any, change: Any) -> Any:
    """Specific force in n of a velocity that changes so: ``dv/dt + (2 w_ie + w_en) x v - g``."""
    sine, cosine = np.sin(lat), np.cos(lat)
    R_M, R_N = _radii_at(sine * sine)
    wE, wN = -v[1] / (R_M + alt), v[0] / (R_N + alt)
    coriolis = cross((wE, 2.0 * earth.EARTH_RATE * cosine + wN, 2.0 * earth.EARTH_RATE * sine + wN * sine / cosine), v)
    g = _normal_gravity_at(sine * sine, alt)
    return change[0] + coriolis[0], change[1] + coriolis[1], change[2] + coriolis[2] + g


@compiled
def feed_back(s: Any, aux: Any, C_mb: Any, places: Any, x: Any) -> None:
    """Take the estimated errors off the slave and what is assumed; the estimate is zero again."""
    q = quaternion_from_rotation_vector((x[_PHI], x[_PHI + 1], x[_PHI + 2]))
    s[0], s[1], s[2], s[3] = quaternion_product(q, (s[0], s[1], s[2], s[3]))
    for j in range(3):
        s[4 + j] -= x[_DV + j]
    for j in range(_BA, len(aux)):
        aux[j] += x[j]
    at = places[_MOUNT]
    if at >= 0:
        E, C = np.zeros((3, 3)), C_mb.copy()
        set_matrix(quaternion_from_rotation_vector((x[at], x[at + 1], x[at + 2])), E)
        for i in range(3):
            for j in range(3):
                C_mb[i, j] = E[i, 0] * C[0, j] + E[i, 1] * C[1, j] + E[i, 2] * C[2, j]
    for j in range(len(x)):
        x[j] = 0.0


@compiled
def turn(C: Any, angle: Any) -> None:
    """``C exp([angle x])`` in place."""
    E = np.zeros((3, 3))
    set_matrix(quaternion_from_rotation_vector((angle[0], angle[1], angle[2])), E)
    for i in range(3):
        a, b, c = C[i, 0], C[i, 1], C[i, 2]
        for j in range(3):
            C[i, j] = a * E[0, j] + b * E[1, j] + c * E[2, j]


@compiled
def run(
    size: Any, samples: Samples, master: Master, loop: Loop, s: Any, aux: Any, C_mb: Any, P: Any, kept: Kept
) -> Any:
    """Align through all rows of the master.

    Parameters
    ----------
    samples : Samples
    master : Master
    loop : Loop
    s : (19,) array
        The slave's state at the beginning of the first sample, see :mod:`truenorth.strapdown.level`; left as it is at the end.
    aux : (n,) array
        What is assumed: biases, delay and lever arm beside the known ones, flexure, in the places of their states; its first six
        and those of the mounting are not used.
    C_mb : (3, 3) array
        Slave to master axes, as assumed.
    P : (n, n) array
    kept : Kept

    Returns
    -------
    failure : int
        Of :mod:`truenorth.filters.recursion`.
    row : int
        At which.
    """
    n, N = len(aux), len(size)
    w = workspace(size, 3)
    load(size, P, w.P)
    for i in range(n):
        w.Phi[i, i] = 1.0
        w.Phi_t[i, i] = 1.0
    F, full, S = np.zeros((6, N)), np.zeros((INS_STATES, INS_STATES)), np.zeros((3, 4))
    room, path = np.zeros((loop.longest, 7)), np.zeros((loop.longest, 10))
    C, C_t, reference, rates = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((3, 3))
    v, a, w_eb, w_nb, arm, bent = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    C_seat, along = np.zeros((3, 3)), np.zeros(3)
    refused = np.zeros(2, np.int64)
    at_tau, at_arm, at_mount, at_flex = loop.places[0], loop.places[1], loop.places[2], loop.places[3]
    done = 0
    for k in range(len(master.time)):
        target = master.time[k]
        if at_tau >= 0:
            target -= aux[at_tau]
        stop = done
        while stop < len(samples.step) and samples.end[stop] - 0.5 * samples.step[stop] <= target:
            stop += 1
        while done < stop:
            upto = min(stop, done + loop.longest)
            carry(size, samples, done, upto, loop, s, aux, room, path, w, F, full)
            done = upto
        kept.sample[k] = done - 1
        kept.verdict[k, 0] = ABSENT
        kept.verdict[k, 1] = ABSENT
        ahead = np.inf
        if done > 0:
            ahead = target - samples.end[done - 1]
            ahead_most = 0.75 * samples.step[done - 1]
        if done > 0 and -ahead_most < ahead < ahead_most:
            set_matrix(s, C)
            rates_at(samples, done, aux, rates)
            for j in range(3):
                arm[j] = loop.arm[j]
                if at_arm >= 0:
                    arm[j] += aux[at_arm + j]
            lat, alt = s[7], s[9]
            sine, cosine = np.sin(lat), np.cos(lat)
            R_M, R_N = _radii_at(sine * sine)
            w_ie = (0.0, earth.EARTH_RATE * cosine, earth.EARTH_RATE * sine)
            w_en = (-s[5] / (R_M + alt), s[4] / (R_N + alt), s[4] / (R_N + alt) * sine / cosine)
            drop = inertial(lat, alt, (s[4], s[5], s[6]), (0.0, 0.0, 0.0))
            sweep = cross((rates[0, 0], rates[0, 1], rates[0, 2]), (arm[0], arm[1], arm[2]))
            swing = cross((rates[0, 0], rates[0, 1], rates[0, 2]), sweep)
            roll = cross((rates[2, 0], rates[2, 1], rates[2, 2]), (arm[0], arm[1], arm[2]))
            better = not np.isnan(master.C_slave[k, 0, 0])
            for j in range(3):
                w_eb[j] = rates[0, j]
                w_nb[j] = rates[0, j]
                own, arms = -drop[j], 0.0
                along[j] = own
                for i in range(3):
                    w_eb[j] -= C[i, j] * w_ie[i]
                    w_nb[j] -= C[i, j] * (w_ie[i] + w_en[i])
                    turned = C[j, i]
                    if better:
                        turned = master.C_slave[k, j, i]
                    along[j] += turned * rates[1, i]
                    own += C[j, i] * rates[1, i]
                    arms += C[j, i] * (swing[i] + roll[i])
                v[j] = s[4 + j] + own * ahead
                a[j] = along[j] - arms
                if not np.isnan(master.acceleration[k, j]):
                    a[j] = master.acceleration[k, j]
                bent[j] = w_nb[j] * ahead
            for i in range(3):
                for j in range(3):
                    C_t[i, j] = C[i, j]
            turn(C_t, bent)

            for kind in range(2):
                for i in range(3):
                    for j in range(N):
                        w.H[i, j] = 0.0
                    w.R[i, i] = loop.velocity[i] if kind == 0 else loop.attitude[i]
                if kind == 0:
                    if np.isnan(master.velocity[k, 0]):
                        continue
                    velocity_rows(C_t, v, a, w_eb, arm, loop.places, master.velocity[k], w.H, w.z)
                else:
                    if np.isnan(master.C_nm[k, 0, 0]):
                        continue
                    for i in range(3):
                        for j in range(3):
                            C_seat[i, j] = C_mb[i, j]
                    if at_flex >= 0:
                        turn(C_seat, aux[at_flex : at_flex + 3])
                    for i in range(3):
                        for j in range(3):
                            total = 0.0
                            for m in range(3):
                                total += master.C_nm[k, i, m] * C_seat[m, j]
                            reference[i, j] = total
                    attitude_rows(C_t, w_nb, reference, master.C_linear[k], loop.places, w.H, w.z)
                for i in range(3):
                    nu = w.z[i]
                    for j in range(n):
                        nu -= w.H[i, j] * w.x[j]
                    kept.innovation[k, 3 * kind + i] = nu
                _, nis = joint_nis(size, w, S, kept.innovation_sigma[k, 3 * kind : 3 * kind + 3])
                kept.nis[k, kind] = nis
                if nis > loop.gates[kind]:
                    kept.verdict[k, kind] = REJECTED
                    refused[kind] += 1
                    if refused[kind] <= loop.patience:
                        continue
                    # The master has jumped and stays there: open the state that takes it up.
                    kept.verdict[k, kind] = REOPENED
                    at = _DV
                    if kind == 1:
                        at = at_mount if at_mount >= 0 else _PHI
                    for i in range(3):
                        size_of_jump = 0.0
                        for j in range(3):
                            size_of_jump += kept.innovation[k, 3 * kind + j] ** 2
                        w.P[at + i, at + i] += size_of_jump
                else:
                    kept.verdict[k, kind] = USED
                refused[kind] = 0
                failure, _, _ = update(size, w, False, True)
                if failure != SOUND:
                    return failure, k
            feed_back(s, aux, C_mb, loop.places, w.x)
            if not np.isnan(master.place[k, 0]):
                set_matrix(s, C)
                east, north, up = 0.0, 0.0, 0.0
                for j in range(3):
                    east += C[0, j] * arm[j]
                    north += C[1, j] * arm[j]
                    up += C[2, j] * arm[j]
                s[7] = master.place[k, 0] + north / (R_M + alt) - s[5] * ahead / (R_M + alt)
                s[8] = master.place[k, 1] + (east - s[4] * ahead) / ((R_N + alt) * cosine)
                s[9] = master.place[k, 2] + up - s[6] * ahead
        for j in range(10):
            kept.state[k, j] = s[j]
        for j in range(n):
            kept.aux[k, j] = aux[j]
            kept.sigma[k, j] = np.sqrt(w.P[j, j])
        for i in range(3):
            for j in range(3):
                kept.C_mb[k, i, j] = C_mb[i, j]
        if kept.P.shape[0] > 0:
            for i in range(n):
                for j in range(n):
                    kept.P[k, i, j] = w.P[i, j]
    for i in range(n):
        for j in range(n):
            P[i, j] = w.P[i, j]
    return SOUND, len(master.time)
