"""Prediction in the closed loop: sample by sample the vehicle, from event to event the covariance."""

from __future__ import annotations

from typing import Any

from truenorth.core import earth
from truenorth.core.compiled import borrowing
from truenorth.core.linalg import (
    four_rows_within,
    mirror_upper,
    multiply,
    propagate_covariance,
    scale_columns,
    scale_row,
)
from truenorth.errors.dynamics import ALONE, couple_pairs, noise_of_pairs
from truenorth.errors.group import columns_at
from truenorth.errors.ins import DYNAMIC, couple_sensors, error_dynamics, transition
from truenorth.estimate.memory import BACK, Memory, Model, Samples, Sums
from truenorth.state.layout import STATES
from truenorth.state.now import (
    NOW_BEHIND,
    NOW_C,
    NOW_EARTH,
    NOW_FORCE,
    NOW_FORCE_B,
    NOW_FORCE_W,
    NOW_GYRO_NOISE,
    NOW_MEAN_RATE,
    NOW_NORTH,
    NOW_OTHER_RATE,
    NOW_PUSH,
    NOW_RATE,
    NOW_RATE_NOISE,
    NOW_SINCE,
    NOW_SPIN,
    NOW_TURN,
)
from truenorth.strapdown.wander import acceleration, advance, azimuth, earth_axis, set_matrix

_PHI, _DV, _BG, _BA = 0, 3, 9, 12
WHOLE = 12  # rows and columns that are summed whole: the dynamic states, and what fills up the last four


@borrowing(forceinline=True)
def take_sample(
    s: Any,
    samples: Samples,
    i: int,
    part: float,
    ends: bool,
    sensors: Any,
    fixed_altitude: bool,
    aux: Any,
    sums: Sums,
) -> None:
    """Advance through a part of sample i, sensor errors taken off, and add it to the sums."""
    T = samples.step[i]
    w = (samples.dtheta[i, 0], samples.dtheta[i, 1], samples.dtheta[i, 2])
    f = (samples.dvel[i, 0], samples.dvel[i, 1], samples.dvel[i, 2])
    w = (w[0] - T * aux[9], w[1] - T * aux[10], w[2] - T * aux[11])
    f = (f[0] - T * aux[12], f[1] - T * aux[13], f[2] - T * aux[14])
    a, b = sensors[0], sensors[1]
    if a >= 0:
        w = (w[0] - T * aux[a], w[1] - T * aux[a + 1], w[2] - T * aux[a + 2])
    if b >= 0:
        f = (f[0] - T * aux[b], f[1] - T * aux[b + 1], f[2] - T * aux[b + 2])
    half = 0.5 * part * T
    for j in range(3):
        sums.vectors[1, j] += half * s[4 + j]
        for k in range(3):
            sums.C[j, k] += half * sums.C_now[j, k]
    advance(s, T, part, w, f, ends, fixed_altitude)
    set_matrix(s, sums.C_now)
    for j in range(3):
        sums.vectors[0, j] += s[21 + j]
        sums.vectors[1, j] += half * s[4 + j]
        sums.vectors[2, j] += part * w[j]
        sums.vectors[3, j] += part * f[j]
        for k in range(3):
            sums.C[j, k] += half * sums.C_now[j, k]
    sums.T[0] += part * T


@borrowing(forceinline=True)
def describe(m: Memory, model: Model, now: Any) -> None:
    """Fill in what rows and columns are given of this epoch, but for what is needed of it sample by sample."""
    s, C = m.s, m.sums.C_now
    for j in range(24):
        now[j] = s[j]
    axis = earth_axis(s)
    force = (m.means.vectors[0, 0], m.means.vectors[0, 1], m.means.vectors[0, 2])
    push = acceleration(s, force, model.fixed_altitude)
    for j in range(3):
        for k in range(3):
            now[NOW_C + 3 * j + k] = C[j, k]
        now[NOW_EARTH + j] = earth.EARTH_RATE * axis[j]
        now[NOW_MEAN_RATE + j] = m.means.vectors[2, j]
        now[NOW_PUSH + j] = push[j]
        now[NOW_FORCE_W + j] = force[j]
        now[NOW_FORCE_B + j] = m.means.vectors[3, j]
    for j in range(3):
        now[NOW_TURN + j] = m.means.vectors[2, j] - _earth_along(now, j)
    now[NOW_SINCE] = m.means.T[0]
    now[NOW_GYRO_NOISE] = model.dynamics.noise[_PHI]
    now[NOW_BEHIND] = 0.0
    now[NOW_NORTH], now[NOW_NORTH + 1] = azimuth(s)


@borrowing(forceinline=True)
def _earth_along(now: Any, j: int) -> float:
    """The earth's rate along an axis of the body, rad/s."""
    total = 0.0
    for k in range(3):
        total += now[NOW_C + 3 * k + j] * now[NOW_EARTH + k]
    return total


@borrowing(forceinline=True)
def describe_instant(samples: Samples, i: int, done: float, model: Model, aux: Any, now: Any) -> None:
    """Rate, its derivative and specific force at a part `done` of sample i.

    The rate is the slope of the polynomial through the angles at the ends of four samples: a line through their rates would take
    some per cent off the rate of a body that shakes at a twelfth of the sampling rate, and make a lever arm that much too long. Its
    derivative and the force, of which the noise matters more, are of a line. The other rate weighs the outer and the inner
    samples so that its noise is not correlated with that of the first.
    """
    middle = i
    if done > 0.5:
        middle = i + 1
    first, last = max(0, middle - BACK), min(len(samples.step), middle + BACK)
    middle = max(first + 1, min(middle, last - 1))
    at = samples.end[middle - 1]
    t = samples.end[i - 1] if i > 0 else samples.end[0] - samples.step[0]
    if i < len(samples.step):
        t += done * samples.step[i]
    slow_gyro, slow_accel = model.sensors[0], model.sensors[1]
    for j in range(3):
        before, after, pushed, pushes = 0.0, 0.0, 0.0, 0.0
        T_before, T_after = 0.0, 0.0
        for k in range(first, last):
            if k < middle:
                before += samples.dtheta[k, j]
                pushed += samples.dvel[k, j]
                T_before += samples.step[k]
            else:
                after += samples.dtheta[k, j]
                pushes += samples.dvel[k, j]
                T_after += samples.step[k]
        T = T_before + T_after
        spin = (after / T_after - before / T_before) / (0.5 * T)
        growth = (pushes / T_after - pushed / T_before) / (0.5 * T)
        now[NOW_RATE + j] = -aux[_BG + j]
        force = (pushed + pushes) / T - aux[_BA + j]
        if slow_gyro >= 0:
            now[NOW_RATE + j] -= aux[slow_gyro + j]
        if slow_accel >= 0:
            force -= aux[slow_accel + j]
        since = t - at - 0.5 * (T_after - T_before)
        now[NOW_SPIN + j] = spin
        now[NOW_FORCE + j] = force + growth * since
    weight, outside, noise = 0.0, 0.0, 0.0
    for k in range(last - 1, first - 1, -1):
        weight += _slope_weight(samples, first, last, k, t)
        noise += weight * weight * samples.step[k]
        if k in (first, last - 1):
            outside += weight * samples.step[k]
        for j in range(3):
            now[NOW_RATE + j] += weight * samples.dtheta[k, j]
    now[NOW_RATE_NOISE] = noise * now[NOW_GYRO_NOISE]
    for j in range(3):
        now[NOW_OTHER_RATE + j] = now[NOW_RATE + j]
    if last - first == 2 * BACK:
        outer = (1.0 - outside) / (1.0 - 2.0 * outside)
        for j in range(3):
            off = 0.0
            for k in range(first, last):
                share = 1.0 - outer
                if k in (first, last - 1):
                    share = outer
                off += 0.5 * share * samples.dtheta[k, j] / samples.step[k]
            now[NOW_OTHER_RATE + j] = off - aux[_BG + j]
            if slow_gyro >= 0:
                now[NOW_OTHER_RATE + j] -= aux[slow_gyro + j]
    for j in range(3):
        now[NOW_TURN + j] = now[NOW_RATE + j] - _earth_along(now, j)


@borrowing(forceinline=True)
def _slope_weight(samples: Samples, first: int, last: int, k: int, t: float) -> float:
    """By which the value at the end of sample k enters the slope at `t` of the polynomial through all ends (Lagrange)."""
    start, own, slope = samples.end[first] - samples.step[first], samples.end[k], 0.0
    for a in range(first - 1, last):
        if a != k:
            product = 1.0
            for b in range(first - 1, last):
                if b not in (k, a):
                    other = samples.end[b] if b >= first else start
                    product *= (t - other) / (own - other)
            slope += product / (own - (samples.end[a] if a >= first else start))
    return slope


@borrowing(forceinline=True)
def predict_to_event(
    size: Any, m: Memory, model: Model, F: Any, rate: Any, now: Any, w: Any, Q: Any, link: Any
) -> None:
    """Carry ``P`` over the samples summed up, and the nominal values of what decays; clear the sums.

    `Q` and `link` gather the noise and the transition since the last event for the smoother; of length 0 they do not.
    """
    sums, means, aux, d = m.sums, m.means, m.aux, model.dynamics
    T = sums.T[0]
    for j in range(3):
        for k in range(3):
            means.C[j, k] = sums.C[j, k] / T
            sums.C[j, k] = 0.0
        for k in range(4):
            means.vectors[k, j] = sums.vectors[k, j] / T
            sums.vectors[k, j] = 0.0
    means.T[0], sums.T[0] = T, 0.0
    axis = earth_axis(m.s)
    error_dynamics(means.C, means.vectors[0], means.vectors[1], axis, m.s[11], False, model.fixed_altitude, F)
    couple_sensors(means.C, model.sensors, model.fixed_altitude, F)
    if len(d.acts) > 0:
        act(m, model, F, now)
    n = len(d.decay)
    # What changes along the way goes with the speed that is to be expected, `E v^2`: an estimate of nothing is no standstill.
    speed = 0.0
    for j in range(3):
        speed += means.vectors[1, j] ** 2 + w.P[_DV + j, _DV + j]
    speed = speed**0.5
    for i in range(n):
        rate[i] = d.decay[i] + speed * d.along[i]
    transition(size, F, rate, T, w.Phi, w.Phi_t)
    couple_pairs(d, F, T, w.Phi, w.Phi_t)
    for g in range(len(d.acts)):
        for i in range(DYNAMIC):
            for j in range(d.first[g], d.first[g] + d.width[g]):
                w.x[i] += w.Phi[i, j] * aux[j]  # what is assumed of a group that acts is taken off
    if model.opened:
        carry(d.pair, w.Phi, m.x, w.a)
    for i in range(n):
        w.Q[i, i] = 0.5 * T * (d.noise[i] + speed * d.wander[i])
    for i in range(9, n):
        j = d.pair[i]
        if j >= 0:
            w.Q[i, j] = w.Q[j, i] = 0.0
            x, y = aux[i], aux[j]
            aux[i], aux[j] = w.Phi[i, i] * x + w.Phi[i, j] * y, w.Phi[j, i] * x + w.Phi[j, j] * y
        elif j == ALONE:
            aux[i] *= w.Phi[i, i]
    # Scale factors act along the axis that turns, misalignments across it.
    x, y, z = means.vectors[2, 0] ** 2, means.vectors[2, 1] ** 2, means.vectors[2, 2] ** 2
    k, c = 0.5 * T * model.turn_scale, 0.5 * T * model.turn_cross
    turning = (k * x + c * (y + z), k * y + c * (z + x), k * z + c * (x + y))
    for i in range(3):
        for j in range(3):
            total = d.noise[_PHI] * 0.5 * T * (i == j)
            for q in range(3):
                total += means.C[i, q] * turning[q] * means.C[j, q]
            w.Q[_PHI + i, _PHI + j] = total
            w.P[_PHI + i, _PHI + j] += total
    for i in range(3, n):
        w.P[i, i] += w.Q[i, i]
    if len(link) > 0:
        multiply(size, w.Phi, link, w.temporary)
        for a in range(len(size)):
            for b in range(len(size)):
                link[a, b] = w.temporary[a, b]
                Q[a, b] += w.Q[a, b]
    noise_of_pairs(d, w.Phi, w.Q)
    if len(link) > 0:
        propagate_covariance(size, w.Phi, w.Phi_t, w.Q, Q, w.temporary)
    propagate_errors(reach_of(model), d.pair, w.Phi, w.Phi_t, w.Q, w.P, w.temporary, w.t)


@borrowing
def carry(pair: Any, Phi: Any, x: Any, work: Any) -> None:
    """``x = Phi x``; rows of ``Phi`` behind those of phi, dv and dp hold an element of the diagonal, or of a second-order pair."""
    n = len(x)
    for i in range(DYNAMIC):
        work[i] = 0.0
        for j in range(n):
            work[i] += Phi[i, j] * x[j]
    for v in range(DYNAMIC, n):
        r = pair[v]
        if r >= 0:
            work[v], work[r] = Phi[v, v] * x[v] + Phi[v, r] * x[r], Phi[r, v] * x[v] + Phi[r, r] * x[r]
        elif r == ALONE:
            work[v] = Phi[v, v] * x[v]
    for i in range(n):
        x[i] = work[i]


@borrowing
def propagate_errors(reach: int, pair: Any, Phi: Any, Phi_t: Any, Q: Any, P: Any, work: Any, diagonal: Any) -> None:
    """``P = Phi P Phi' + Q``, symmetric to the bit, in a fifth of the work.

    Rows of ``Phi`` behind those of phi, dv and dp hold an element of the diagonal, or of a second-order pair; columns from `reach`
    on hold no more either, as those states do not act on the INS. All that lies behind the states is zero and stays so.
    """
    n = len(pair)
    used = 4 * ((n + 3) // 4)
    for i in range(0, WHOLE, 4):
        four_rows_within(reach, Phi, P, None, i, 0, used, work)
    for i in range(WHOLE, n):
        scale_row(P, i, WHOLE, used, Phi[i, i], work)
    for i in range(used):
        diagonal[i] = Phi[i, i]
    for v in range(STATES, n):
        r = pair[v]
        if r >= 0:
            for j in range(WHOLE, used):
                work[v, j] = Phi[v, v] * P[v, j] + Phi[v, r] * P[r, j]
                work[r, j] = Phi[r, v] * P[v, j] + Phi[r, r] * P[r, j]
    for i in range(0, WHOLE, 4):
        four_rows_within(reach, work, Phi_t, Q, i, i, WHOLE, P)
    for i in range(n):
        scale_columns(work, i, WHOLE, used, diagonal, Q, P)
    for v in range(STATES, n):
        r = pair[v]
        if r >= 0:
            for i in range(n):
                P[i, v] = work[i, v] * Phi[v, v] + work[i, r] * Phi[v, r] + Q[i, v]
                P[i, r] = work[i, v] * Phi[r, v] + work[i, r] * Phi[r, r] + Q[i, r]
    mirror_upper(used, P)


@borrowing(forceinline=True)
def reach_of(model: Model) -> int:
    """The first state from which on none acts on attitude, velocity or position."""
    d, reach = model.dynamics, STATES
    for at in model.sensors:
        if at >= 0:
            reach = max(reach, at + 3)
    for g in range(len(d.acts)):
        reach = max(reach, d.first[g] + d.width[g])
    return reach


@borrowing
def act(m: Memory, model: Model, F: Any, now: Any) -> None:
    """Columns of the groups that act on the INS."""
    d = model.dynamics
    describe(m, model, now)
    for g in range(len(d.acts)):
        first = d.first[g]
        for i in range(9):
            for j in range(first, first + d.width[g]):
                F[i, j] = 0.0
        columns_at(d.acts[g])(now, d.figures[g], first, m.aux, F)
        for i in range(9):
            for j in range(first, first + d.width[g]):
                if model.fixed_altitude and (i == 5 or i == 8):
                    F[i, j] = 0.0
