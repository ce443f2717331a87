"""The closed loop, compiled: mechanise to the next event, carry the covariance there, measure, correct, go on.

An event is an epoch of the filter's own grid, an epoch of output, or a measurement at any time: the sample in which it
falls is taken in two parts. Corrections are fed back at once, so that the error state is zero between events.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.body_velocity import body_velocity_row
from truenorth.aiding.height import height_row
from truenorth.aiding.position import position_row
from truenorth.aiding.rest import rotation_row
from truenorth.aiding.row import (
    AT_ARM,
    AT_BIAS,
    AT_LAG,
    AT_MOUNT,
    AT_SCALE,
    BODY_VELOCITY,
    DISTURBANCE,
    FIRST_GATE,
    HEIGHT,
    LOOP,
    POSITION,
    ROTATION,
    VELOCITY,
)
from truenorth.aiding.velocity import velocity_row
from truenorth.core import earth
from truenorth.core.attitude import quaternion_from_rotation_vector, quaternion_product, rotate
from truenorth.core.compiled import compiled
from truenorth.core.linalg import load, multiply, propagate_covariance
from truenorth.errors.ins import couple_sensors, error_dynamics, transition
from truenorth.errors.invariant import reset
from truenorth.filters.recursion import SOUND, row_variance, update, workspace
from truenorth.strapdown.wander import acceleration, advance, displace, earth_axis

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

ABSENT, USED, REJECTED = range(3)

LONGEST_STEP = 0.3  # of the loop's time constant: longer steps would make it swing
SAME_TIME = 1e-6  # s: an event this near the end of a sample is at its end
_PHI, _DV, _DP, _BG, _BA = 0, 3, 6, 9, 12
GRAVITY_GRADIENT = 2.0 * earth.GRAVITY_EQUATOR / earth.SEMI_MAJOR  # 1/s^2: of the free vertical channel


class Samples(NamedTuple):
    """Increments of the IMU: (N,) lengths and ends of the intervals, (N, 3) rad and m/s."""

    step: Array
    end: Array
    dtheta: Array
    dvel: Array


class Events(NamedTuple):
    """What happens when: (K,) times in order, source (-1: none) and whether to put out; (K, 3) measured, variance."""

    time: Array
    source: Integers
    output: NDArray[np.bool_]
    measured: Array
    variance: Array


class Sources(NamedTuple):
    """Of each source: its kind (S,), figures (S, 16) and states (S, 5)."""

    kind: Integers
    figures: Array
    states: Integers


class Model(NamedTuple):
    """What of the error model the kernel needs."""

    decay: Array
    noise: Array
    sensors: Integers
    fixed_altitude: bool
    turn_scale: float
    turn_cross: float
    invariant: bool


class Kept(NamedTuple):
    """Histories; an axis of length 0 keeps nothing.

    `state`, `aux`, `P` are those at each output; `innovation`, `sigma`, `nis`, `verdict` those of each event; `Phi, Q,
    H, dx` lead from event to event, for the smoother.
    """

    state: Array
    aux: Array
    P: Array
    innovation: Array
    sigma: Array
    nis: Array
    verdict: Integers
    Phi: Array
    Q: Array
    H: Array
    dx: Array


class Sums(NamedTuple):
    """Integrals over the samples since the last event."""

    C: Array  # int C_wb dt
    C_now: Array
    vectors: Array  # rows: f_w, v_w, angle and velocity increments in the body, errors taken off
    T: Array


@compiled
def set_matrix(s: Any, C: Any) -> None:
    """``C_wb`` of the state's quaternion."""
    w, x, y, z = s[0], s[1], s[2], s[3]
    C[0, 0], C[0, 1], C[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    C[1, 0], C[1, 1], C[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    C[2, 0], C[2, 1], C[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@compiled
def take_sample(
    s: Any, samples: Samples, i: int, done: float, part: float, ends: bool, model: Model, aux: Any, sums: Sums
) -> None:
    """Advance through a part of sample i, sensor errors taken off, and add it to the sums."""
    T = samples.step[i]
    w = (samples.dtheta[i, 0], samples.dtheta[i, 1], samples.dtheta[i, 2])
    f = (samples.dvel[i, 0], samples.dvel[i, 1], samples.dvel[i, 2])
    w = (w[0] - T * aux[9], w[1] - T * aux[10], w[2] - T * aux[11])
    f = (f[0] - T * aux[12], f[1] - T * aux[13], f[2] - T * aux[14])
    a, b, c, d = model.sensors[0], model.sensors[1], model.sensors[2], model.sensors[3]
    if a >= 0:
        w = (w[0] - T * aux[a], w[1] - T * aux[a + 1], w[2] - T * aux[a + 2])
    if b >= 0:
        f = (f[0] - T * aux[b], f[1] - T * aux[b + 1], f[2] - T * aux[b + 2])
    if c >= 0:
        w = (w[0] * (1.0 - aux[c]), w[1] * (1.0 - aux[c + 1]), w[2] * (1.0 - aux[c + 2]))
    if d >= 0:
        f = (f[0] * (1.0 - aux[d]), f[1] * (1.0 - aux[d + 1]), f[2] * (1.0 - aux[d + 2]))
    half = 0.5 * part * T
    for j in range(3):
        sums.vectors[1, j] += half * s[4 + j]
        for k in range(3):
            sums.C[j, k] += half * sums.C_now[j, k]
    advance(s, T, part, w, f, ends, model.fixed_altitude)
    set_matrix(s, sums.C_now)
    for j in range(3):
        sums.vectors[0, j] += s[21 + j]
        sums.vectors[1, j] += half * s[4 + j]
        sums.vectors[2, j] += part * w[j]
        sums.vectors[3, j] += part * f[j]
        for k in range(3):
            sums.C[j, k] += half * sums.C_now[j, k]
    sums.T[0] += part * T


@compiled
def predict_to_event(size: Any, s: Any, model: Model, sums: Sums, means: Sums, F: Any, aux: Any, w: Any) -> None:
    """Carry ``P`` over the samples summed up, and the nominal values of what decays; clear the sums."""
    T = sums.T[0]
    for j in range(3):
        for k in range(3):
            means.C[j, k] = sums.C[j, k] / T
            sums.C[j, k] = 0.0
        for k in range(4):
            means.vectors[k, j] = sums.vectors[k, j] / T
            sums.vectors[k, j] = 0.0
    means.T[0], sums.T[0] = T, 0.0
    axis = earth_axis(s)
    error_dynamics(means.C, means.vectors[0], means.vectors[1], axis, s[11], False, model.fixed_altitude, F)
    couple_sensors(means.C, means.vectors[2], means.vectors[3], model.sensors, model.fixed_altitude, F)
    transition(size, F, model.decay, T, w.Phi, w.Phi_t)
    for i in range(len(model.noise)):
        w.Q[i, i] = 0.5 * T * model.noise[i]
        if i >= 9:
            aux[i] *= w.Phi[i, i]
    # Scale factors act along the axis that turns, misalignments across it.
    x, y, z = means.vectors[2, 0] ** 2, means.vectors[2, 1] ** 2, means.vectors[2, 2] ** 2
    k, m = 0.5 * T * model.turn_scale, 0.5 * T * model.turn_cross
    turning = (k * x + m * (y + z), k * y + m * (z + x), k * z + m * (x + y))
    for i in range(3):
        for j in range(3):
            total = model.noise[_PHI] * 0.5 * T * (i == j)
            for n in range(3):
                total += means.C[i, n] * turning[n] * means.C[j, n]
            w.Q[_PHI + i, _PHI + j] = total
            w.P[_PHI + i, _PHI + j] += total
    for i in range(3, len(model.noise)):
        w.P[i, i] += w.Q[i, i]
    propagate_covariance(size, w.Phi, w.Phi_t, w.Q, w.P, w.temporary)


@compiled
def measure(
    s: Any,
    sums: Sums,
    means: Sums,
    sources: Sources,
    source: int,
    model: Model,
    measured: Any,
    aux: Any,
    mount: Any,
    w: Any,
) -> None:
    """Fill in `H` and `z` of an event's rows."""
    figures, states = sources.figures[source], sources.states[source]
    kind = sources.kind[source]
    for i in range(3):
        w.z[i] = np.nan
        for j in range(w.H.shape[1]):
            w.H[i, j] = 0.0
    C = sums.C_now
    at_arm, at_lag = states[AT_ARM], states[AT_LAG]
    arm = (figures[0], figures[1], figures[2])
    if at_arm >= 0:
        arm = (arm[0] + aux[at_arm], arm[1] + aux[at_arm + 1], arm[2] + aux[at_arm + 2])
    at_bias = states[AT_BIAS]
    bias = (0.0, 0.0, 0.0)
    if at_bias >= 0 and kind == HEIGHT:
        bias = (aux[at_bias], 0.0, 0.0)
    elif at_bias >= 0:
        bias = (aux[at_bias], aux[at_bias + 1], aux[at_bias + 2])
    lag = 0.0
    if at_lag >= 0:
        lag = aux[at_lag]
    axis = earth_axis(s)
    w_ib = (means.vectors[2, 0], means.vectors[2, 1], means.vectors[2, 2])
    w_ie = (earth.EARTH_RATE * axis[0], earth.EARTH_RATE * axis[1], earth.EARTH_RATE * axis[2])
    w_eb = (
        w_ib[0] - (C[0, 0] * w_ie[0] + C[1, 0] * w_ie[1] + C[2, 0] * w_ie[2]),
        w_ib[1] - (C[0, 1] * w_ie[0] + C[1, 1] * w_ie[1] + C[2, 1] * w_ie[2]),
        w_ib[2] - (C[0, 2] * w_ie[0] + C[1, 2] * w_ie[1] + C[2, 2] * w_ie[2]),
    )
    force = (means.vectors[0, 0], means.vectors[0, 1], means.vectors[0, 2])
    push = acceleration(s, force, model.fixed_altitude)
    if kind == POSITION:
        position_row(s, C, arm, lag, bias, at_arm, at_lag, at_bias, measured, w.H, w.z)
    elif kind == VELOCITY:
        velocity_row(s, C, w_eb, push, arm, lag, at_arm, at_lag, measured, w.H, w.z)
    elif kind == BODY_VELOCITY:
        at_scale, at_mount = states[AT_SCALE], states[AT_MOUNT]
        scale = 0.0
        if at_scale >= 0:
            scale = aux[at_scale]
        angles = (0.0, 0.0, 0.0)
        if at_mount >= 0:
            angles = (-aux[at_mount], 0.0, -aux[at_mount + 1])
        q = quaternion_from_rotation_vector(angles)
        for j in range(3):
            mount[0, j], mount[1, j], mount[2, j] = rotate(q, (figures[3 + j], figures[6 + j], figures[9 + j]))
        body_velocity_row(
            s,
            C,
            w_eb,
            push,
            mount,
            arm,
            scale,
            bias,
            lag,
            at_arm,
            at_scale,
            at_mount,
            at_bias,
            at_lag,
            measured,
            w.H,
            w.z,
        )
    elif kind == HEIGHT:
        height_row(s, C, arm, bias[0], at_bias, measured, w.H, w.z)
    elif kind == ROTATION:
        rotation_row(C, w_ib, w_ie, w.H, w.z)
    if model.sensors[0] >= 0:  # the slow bias is a gyro bias like the other
        for i in range(3):
            for j in range(3):
                w.H[i, model.sensors[0] + j] = w.H[i, _BG + j]


@compiled
def joint_nis(size: Any, w: Any, S: Any, sigma: Any) -> Any:
    """How many rows are present, and ``nu' S^-1 nu`` of them together, by Cholesky's factor of ``S``."""
    count = 0
    nis = 0.0
    for i in range(3):
        sigma[i] = np.nan
    for i in range(3):
        if np.isnan(w.z[i]):
            continue
        _, variance, _ = row_variance(size, w, i, False)
        sigma[i] = np.sqrt(variance)
        whitened = w.z[i]
        S[i, i] = variance
        for j in range(i):
            if np.isnan(w.z[j]):
                continue
            total = 0.0
            for k in range(len(size)):
                total += w.a[k] * w.H[j, k]
            for k in range(j):
                if not np.isnan(w.z[k]):
                    total -= S[i, k] * S[j, k]
            S[i, j] = total / S[j, j]
            S[i, i] -= S[i, j] * S[i, j]
            whitened -= S[i, j] * S[j, 3]
        S[i, i] = np.sqrt(S[i, i])
        S[i, 3] = whitened / S[i, i]
        nis += S[i, 3] * S[i, 3]
        count += 1
    return count, nis


@compiled
def damp_height(size: Any, C: Any, T: float, time_constant: float, w: Any) -> None:
    """Third-order loop in place of a Kalman gain: height, velocity and accelerometer bias, all poles at -1/time_constant.

    ``e_h' = e_v - c1 e_h``, ``e_v' = (2 g/R - c2) e_h + b``, ``b' = -c3 e_h``: ``c1 = 3/tau``, ``c2 = 3/tau^2 + 2 g/R``,
    ``c3 = 1/tau^3``. The covariance is that of these gains: ``P = (I - k h) P (I - k h)' + k r k'``.
    """
    nu, variance, _ = row_variance(size, w, 0, False)
    rate = 1.0 / time_constant
    last = T * rate * rate * rate
    for i in range(len(size)):
        w.k[i] = 0.0
    w.k[_DP + 2] = 3.0 * T * rate
    w.k[_DV + 2] = T * (3.0 * rate * rate + GRAVITY_GRADIENT)
    for j in range(3):
        w.k[_BA + j] = C[2, j] * last
    for i in range(len(size)):
        w.x[i] += w.k[i] * nu
        for j in range(len(size)):
            w.P[i, j] += variance * w.k[i] * w.k[j] - (w.k[i] * w.a[j] + w.a[i] * w.k[j])


@compiled
def feed_back(s: Any, aux: Any, n: int, x: Any) -> None:
    """Take the estimated errors off the state and the sensors; the estimate is zero again."""
    q = quaternion_from_rotation_vector((x[0], x[1], x[2]))
    s[0], s[1], s[2], s[3] = quaternion_product(q, (s[0], s[1], s[2], s[3]))
    for j in range(3):
        s[4 + j] -= x[3 + j]
    displace(s, -x[6], -x[7], -x[8])
    for j in range(9, n):
        aux[j] += x[j]
    for j in range(n):
        x[j] = 0.0


@compiled
def run(
    size: Any,
    samples: Samples,
    events: Events,
    sources: Sources,
    model: Model,
    s: Any,
    aux: Any,
    P: Any,
    with_covariance: bool,
    kept: Kept,
) -> Any:
    """Navigate through all events.

    Parameters
    ----------
    s : (24,) array
        The state at the beginning of the first sample; left as it is after the last event.
    aux : (n,) array
        What is assumed of the sensors: biases and all states behind them (its first nine are not used).
    P : (n, n) array
        Of the errors in w.

    Returns
    -------
    failure : int
        Of :mod:`truenorth.filters.recursion`.
    event : int
        At which.
    """
    n, N = len(aux), len(size)
    w = workspace(size, 3)
    load(size, P, w.P)
    F, Phi, Q, S = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N)), np.zeros((3, 4))
    for i in range(N):
        Phi[i, i] = 1.0
    sums = Sums(np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((4, 3)), np.zeros(1))
    means = Sums(np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((4, 3)), np.zeros(1))
    mount = np.zeros((3, 3))
    set_matrix(s, sums.C_now)
    smoothing = kept.Phi.shape[0] > 0
    i, done, j, link = 0, 0.0, 0, 0
    heard = events.time[0]  # of height, by the loop
    for k in range(len(events.time)):
        while i < len(samples.step):
            T = samples.step[i]
            ahead = events.time[k] - (samples.end[i] - (1.0 - done) * T)
            if ahead < SAME_TIME:
                break
            if ahead > (1.0 - done) * T - SAME_TIME:
                take_sample(s, samples, i, done, 1.0 - done, True, model, aux, sums)
                i, done = i + 1, 0.0
            else:
                take_sample(s, samples, i, done, ahead / T, False, model, aux, sums)
                done += ahead / T
        if with_covariance and sums.T[0] > 0.0:
            predict_to_event(size, s, model, sums, means, F, aux, w)
            if smoothing:
                multiply(size, w.Phi, Phi, w.temporary)
                for a in range(N):
                    for b in range(N):
                        Phi[a, b] = w.temporary[a, b]
                        Q[a, b] += w.Q[a, b]
                propagate_covariance(size, w.Phi, w.Phi_t, w.Q, Q, w.temporary)
        source = events.source[k]
        if source >= 0 and sources.kind[source] == DISTURBANCE:
            for a in range(3):
                w.P[_PHI + a, _PHI + a] += events.variance[k, a]
                w.P[_DV + a, _DV + a] += events.measured[k, a]
                Q[_PHI + a, _PHI + a] += events.variance[k, a]
                Q[_DV + a, _DV + a] += events.measured[k, a]
        elif source >= 0:
            measure(s, sums, means, sources, source, model, events.measured[k], aux, mount, w)
            for a in range(3):
                w.R[a, a] = events.variance[k, a]
                if sources.kind[source] == ROTATION and means.T[0] > 0.0:  # a mean rate has the gyros' noise, too
                    w.R[a, a] += model.noise[_PHI] / means.T[0]
                if np.isnan(events.measured[k, a]) or np.isnan(w.z[a]):
                    w.z[a] = np.nan
                kept.innovation[k, a] = w.z[a]
            count, nis = joint_nis(size, w, S, kept.sigma[k])
            if count > 0:
                kept.nis[k] = nis
                kept.verdict[k] = REJECTED
                if nis <= sources.figures[source, FIRST_GATE + count - 1]:
                    kept.verdict[k] = USED
                    if smoothing:
                        for a in range(3):
                            for b in range(n):
                                kept.H[link, a, b] = w.H[a, b]
                    loop = sources.figures[source, LOOP]
                    if loop > 0.0:
                        damp_height(size, sums.C_now, min(events.time[k] - heard, LONGEST_STEP * loop), loop, w)
                        heard = events.time[k]
                    else:
                        failure, _, _ = update(size, w, False, True)
                        if failure != SOUND:
                            return failure, k
                    if smoothing:
                        for b in range(n):
                            kept.dx[link, b] = w.x[b]
                    if model.invariant:
                        reset(s, w.x, w.P)
                    feed_back(s, aux, n, w.x)
                    set_matrix(s, sums.C_now)
        if smoothing and (source >= 0 or events.output[k]):
            for a in range(n):
                for b in range(n):
                    kept.Phi[link, a, b] = Phi[a, b]
                    kept.Q[link, a, b] = Q[a, b]
            for a in range(N):
                for b in range(N):
                    Phi[a, b] = 1.0 * (a == b)
                    Q[a, b] = 0.0
            link += 1
        if events.output[k]:
            for a in range(12):
                kept.state[j, a] = s[a]
            for a in range(9, n):
                kept.aux[j, a] = aux[a]
            if kept.P.shape[0] > 0:
                for a in range(n):
                    for b in range(n):
                        kept.P[j, a, b] = w.P[a, b]
            j += 1
    for a in range(n):
        for b in range(n):
            P[a, b] = w.P[a, b]
    return SOUND, len(events.time)
