"""Error bands: what a damped INS may be off by, with the log's own errors, whether its method knows of them or not.

A network and a Kalman filter without the log's errors are estimators with a model that is not the whole truth. What they are
off by follows from the covariance of all that plays a part: the errors of the undamped INS and of the log, as the whole model
has them, and what the estimator makes of them with its own gains. For the filters, with ``A_i = (I - K_i H_i) Phi_i`` and the
change of what filter 1 smooths over a step for filter 2,

    e+ = Phi e + w,    x1+ = A_1 x1 + K_1 (H e+ + n),    x2+ = A_2 x2 + K_2 (x1+ - x1)_v/T

and the bands are those of ``x1 - e``. The fusion's error is ``x2 - e + w (x1 - x2)``, in which the difference of the filters is
known: where filter 1 is far off, they differ and its weight is small. Its bands are of the error given that difference.

A fix from outside is a row of filter 1 as the log's are: ``H`` shows place and heading of ``e``, ``n`` is the fix's own error. Of a
network, and of a filter that begins anew with it, ``n`` is what place or heading are then off by.

Source: R. Brown, P. Hwang, *Introduction to Random Signals and Applied Kalman Filtering*, 4th ed. (2012), sec. 5.7 (suboptimal
filters); J. Farrell, M. Barth, *The Global Positioning System and Inertial Navigation* (1999), sec. 4.10 (covariance analysis).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import linearised
from truenorth.damping.filters import SETTLING, Filter, silences
from truenorth.damping.fix_rows import ROWS, FixRows
from truenorth.damping.loop import LONGEST_STEP, Loop, transition_and_input
from truenorth.errors.marine import DV, MOTION
from truenorth.filters.gains import Gains, filter_gains
from truenorth.filters.kalman import kalman
from truenorth.filters.system import LinearSystem
from truenorth.state.track import Track

Array = NDArray[np.float64]

PART = 600  # epochs at a time: some 40 MB


class Bands(NamedTuple):
    """One-sigma of what is left: errors (K+1, 7), and what INS and log then differ by (K+1, 2), m/s."""

    errors: Array
    residual: Array


def widest(bands: Sequence[Bands]) -> Bands:
    """The largest of several, each by another reading of the log's errors of which none is ruled out."""
    return Bands(*(np.max(sizes, axis=0) for sizes in zip(*bands, strict=True)))


def network_bands(
    course: Track,
    loop: Loop,
    whole: Filter,
    mu: Array,
    *,
    log: bool,
    absent: NDArray[np.bool_] | None = None,
    fixes: FixRows | None = None,
) -> Bands:
    """Of an INS with this loop: errors, network states, biases and errors of the log together.

    Parameters
    ----------
    course : Track
        From the switch on.
    whole : Filter
        All errors of INS and log: model, covariance at the switch, white noise of an epoch of the log.
    mu : (K+1,) array
        How far it is damped at the epochs.
    log : bool
        It is fed with the log; else damping is internal.
    absent : (K+1,) array of bool, optional
        Epochs at which the log says nothing: in steps without a row the INS goes on undamped.
    fixes : FixRows, optional
        With which place and heading begin anew.
    """
    stride = max(1, int(LONGEST_STEP / course.interval + 1e-9))
    coarse = course[::stride]
    model, P0 = whole.model, whole.P0
    F, _ = linearised(coarse, model)
    M, N = loop.matrices(F, coarse.position[1:, 0], np.interp(coarse.time[1:], course.time, mu))
    n, first = M.shape[1], MOTION.stop
    there = np.ones(len(course)) if absent is None or not log else np.where(absent, 0.0, 1.0)
    rows = _rows_in_steps(0.5 * (there[1:] + there[:-1]), stride, len(coarse) - 1)
    M[rows == 0.0, :, DV] += N[rows == 0.0]
    N[rows == 0.0] = 0.0
    count = n + model.states - first
    A, inputs = np.zeros((len(coarse) - 1, count, count)), np.zeros((len(coarse) - 1, count, 2))
    A[:, :n, :n], inputs[:, :n] = M, N
    A[:, MOTION, n:] = F[:, MOTION, first:]
    A[:, n:, n:] = F[:, first:, first:]
    placed = np.concatenate([np.arange(first), np.arange(n, count)])  # the model's states
    H = np.zeros((len(coarse) - 1, 2, count))
    H[:, :, placed] = whole.rows(coarse)  # dv - d: what is shown by the INS less what the log adds
    if log:
        added = H.copy()
        added[:, :, DV] = 0.0
        A -= inputs @ added
    Phi, Gamma = transition_and_input(A, inputs, coarse.interval)
    P = np.zeros((count, count))
    P[np.ix_(placed, placed)] = P0
    white = whole.sigma**2 / np.maximum(rows, 1.0) * log
    Q = white[:, None, None] * (Gamma @ np.swapaxes(Gamma, -1, -2))
    Q[:, placed[:, None], placed] += model.noise_of(coarse.interval, 0.5 * (coarse.v_n[1:] + coarse.v_n[:-1]))
    fixed = np.zeros(len(rows), dtype=bool)
    if fixes is not None:
        fix_sigma = fixes.sigma_of_steps(stride, len(rows))
        fixed |= np.isfinite(fix_sigma).any(axis=1)
        # The fix's own error is all that is left.
        for k, shown in zip(*np.nonzero(np.isfinite(fix_sigma)), strict=True):
            state = ROWS[shown]
            Phi[k, state] = Q[k, state] = Q[k, :, state] = 0.0
            Q[k, state, state] = fix_sigma[k, shown] ** 2
    joint = _covariances(Phi, Q, P)
    errors = np.diagonal(joint, axis1=1, axis2=2)[:, MOTION]
    residual = _variances(H[np.maximum(np.arange(len(joint)) - 1, 0)], joint)
    return _spread(course, coarse, errors, residual + whole.sigma**2, np.where(fixed, 0.0, rows))


def filter_bands(
    course: Track,
    whole: Filter,
    one: Filter,
    two: Filter | None = None,
    fused: tuple[Array, Array] | None = None,
    absent: NDArray[np.bool_] | None = None,
) -> Bands:
    """Of filter 1, or of filters 1 and 2 fused, that do not know all errors of the log.

    Parameters
    ----------
    course : Track
        From the switch on.
    whole : Filter
        All errors of INS and log, as in :func:`network_bands`.
    one, two : Filter
        As they run; filter 2 takes the fixes of filter 1.
    fused : (weight, difference), optional
        Of filters 1 and 2: (K+1, 7) the weight of filter 1, and by how much its estimate differs from filter 2's.
    absent : (K+1,) array of bool, optional
        Epochs at which the log says nothing: the filters go on without it.
    """
    step = LONGEST_STEP if two is None else two.window
    stride = max(1, int(step / course.interval + 1e-9))
    coarse = course[::stride]
    n, m = whole.model.states, one.model.states
    count = n + m + (0 if two is None else m)
    e, x1, x2 = slice(0, n), slice(n, n + m), slice(n + m, count)
    v1 = slice(x1.start + DV.start, x1.start + DV.stop)
    joint, P1 = np.zeros((count, count)), one.P0
    joint[e, e] = whole.P0
    P2 = None if two is None else two.P0
    absent = np.zeros(len(course), dtype=bool) if absent is None else absent
    silent = silences(absent, max(1, round(SETTLING / course.interval)))[::stride]
    many = _rows_in_steps(np.where(absent[1:], 0.0, 1.0), stride, len(coarse) - 1)
    seen1, R1 = _rows_of_one(one, many, stride)
    fixed = seen1[:, 2:].any(axis=1)
    # Until filter 1 has settled nothing goes into filter 2.
    silent = silent | (np.arange(-1, len(coarse) - 1) * coarse.interval < SETTLING - 1e-6)
    share, apart = (None, None) if fused is None else (fused[0][::stride], fused[1][::stride])
    errors, residual = np.empty((len(coarse), MOTION.stop)), np.empty((len(coarse), 2))
    errors[0], residual[0] = np.diagonal(whole.P0)[MOTION], whole.sigma**2
    off, differs = np.zeros((2, MOTION.stop, count))  # of the last filter, and between the two
    last = x1 if two is None else x2
    off[:, MOTION] = -np.eye(MOTION.stop)
    off[:, last.start : last.start + MOTION.stop] = np.eye(MOTION.stop)
    differs[:, x1.start : x1.start + MOTION.stop] = np.eye(MOTION.stop)
    for begin in range(0, len(coarse) - 1, PART):
        part = coarse[begin : begin + PART + 1]
        rows, steps = slice(begin + 1, begin + len(part)), slice(begin, begin + len(part) - 1)
        mean = 0.5 * (part.v_n[1:] + part.v_n[:-1])
        _, Phi = linearised(part, whole.model)
        Q, H = np.broadcast_to(whole.model.noise_of(part.interval, mean), Phi.shape), _with_fixes(whole, one, part)
        F1, Phi1 = linearised(part, one.model)
        Q1, H1 = one.model.noise_of(part.interval, mean)[:1], _with_fixes(one, one, part)
        if one.fixes is not None:
            Q1 = Q1 + one.fixes.unknown(seen1[steps, 2:], m)
        first, P1 = _gains(Phi1, Q1, H1, R1[steps], ~seen1[steps], P1)
        A, G = np.zeros((len(part) - 1, count, count)), np.zeros((len(part) - 1, count, H.shape[1]))
        B = np.zeros((len(part) - 1, count, n))  # of the noise that drives the errors
        A[:, e, e], B[:, e] = Phi, np.eye(n)
        A[:, x1, e], A[:, x1, x1] = first.gain @ H @ Phi, first.step
        B[:, x1], G[:, x1] = first.gain @ H, first.gain
        if two is not None and P2 is not None:
            white = np.full((len(part) - 1, 2), two.sigma**2 / (stride if two.overlap else 1))
            R2 = np.concatenate([white, np.diagonal(R1[steps], axis1=1, axis2=2)[:, 2:]], axis=1)
            absent2 = np.concatenate([np.repeat(silent[rows, None], 2, axis=1), ~seen1[steps, 2:]], axis=1)
            H2 = np.concatenate([F1[:, DV, :m], H1[:, 2:]], axis=1)
            second, P2 = _gains(Phi1, Q1, H2, R2[:, :, None] * np.eye(H2.shape[1]), absent2, P2)
            K2, of_fixes = second.gain[:, :, :2] / part.interval, second.gain[:, :, 2:]
            A[:, x2], B[:, x2], G[:, x2] = K2 @ A[:, v1], K2 @ B[:, v1], K2 @ G[:, v1]
            A[:, x2, x2] += second.step
            A[:, x2, v1] -= K2
            A[:, x2, e] += of_fixes @ H[:, 2:] @ Phi
            B[:, x2] += of_fixes @ H[:, 2:]
            G[:, x2, 2:] += of_fixes
        driven = B @ Q @ np.swapaxes(B, -1, -2) + G @ R1[steps] @ np.swapaxes(G, -1, -2)
        joints = _covariances(A, driven, joint)[1:]
        joint = joints[-1]
        seen = np.repeat(off[None, DV], len(part) - 1, axis=0)
        seen[:, :, e] = -H[:, :2]  # x - (dv - d): the residual's slow part
        errors[rows], residual[rows] = _variances(off, joints), _variances(seen, joints)
        if share is not None and apart is not None:
            differs[:, x2.start : x2.start + MOTION.stop] = -np.eye(MOTION.stop)
            known = share[rows], apart[rows], _variances(differs, joints)
            errors[rows] = _given(errors[rows], _variances(off, joints, differs), *known)
            with_log = _variances(seen, joints, differs[DV])
            residual[rows] = _given(residual[rows], with_log, *(column[:, DV] for column in known))
    residual[1:] += whole.sigma**2
    return _spread(course, coarse, errors, residual, np.where(fixed, 0.0, many))


def _with_fixes(kind: Filter, one: Filter, part: Track) -> Array:
    """(K, m, n) what the log shows of this filter's states, and behind it, where filter 1 has fixes at all, what those show."""
    H = kind.rows(part)
    if one.fixes is None:
        return H
    rows = one.fixes.rows(kind.model.states)
    return np.concatenate([H, np.broadcast_to(rows, (len(H), *rows.shape))], axis=1)


def _rows_of_one(one: Filter, many: Array, stride: int) -> tuple[NDArray[np.bool_], Array]:
    """(K, m) which rows filter 1 has in each coarse step, `many` of the log among them, and (K, m, m) their noise."""
    seen = np.repeat(many[:, None] > 0.0, 2, axis=1)
    variance = np.repeat((one.sigma**2 / np.maximum(many, 1.0))[:, None], 2, axis=1)
    if one.fixes is not None:
        of_fixes = one.fixes.sigma_of_steps(stride, len(many))
        there = np.isfinite(of_fixes)
        seen = np.concatenate([seen, there], axis=1)
        variance = np.concatenate([variance, np.where(there, of_fixes, 1.0) ** 2], axis=1)
    return seen, variance[:, :, None] * np.eye(seen.shape[1])


def _rows_in_steps(there: Array, stride: int, count: int) -> Array:
    """(count,) rows of the log in each coarse step, from those in each interval of the course; a sparse log has none in most."""
    return np.asarray(there[: count * stride].reshape(count, stride).sum(axis=1))


def _covariances(A: Array, Q: Array, P: Array) -> Array:
    """(K+1, n, n) of ``x+ = A x + w``, from `P` on."""
    out = np.empty((len(A) + 1, *P.shape))
    out[0] = P
    for k in range(len(A)):
        P = A[k] @ P @ A[k].T + Q[k]
        out[k + 1] = P
    return out


def _variances(H: Array, P: Array, other: Array | None = None) -> Array:
    """Diagonals of ``H P H'``, or of the covariance with `other` in place of the second H."""
    return np.sum((H @ P) * (H if other is None else other), axis=-1)


def _gains(Phi: Array, Q: Array, H: Array, R: Array, absent: NDArray[np.bool_], P: Array) -> tuple[Gains, Array]:
    """Of a filter's updates at these epochs, (K, m) of its rows absent, and its covariance after them."""
    z = np.where(absent, np.nan, 0.0)
    system = LinearSystem(Phi, Q, H, R, z, np.zeros(len(P)), P)
    found = kalman(system, history="full")
    return filter_gains(system, found), np.asarray(found.P[-1])


def _given(variance: Array, covariance: Array, weight: Array, apart: Array, spread: Array) -> Array:
    """Second moment of ``y + w d``: an error y of filter 2, and the difference d of the filters, which is known.

    Given d, y has the mean ``k d``, ``k = cov(y, d)/var(d)``, and the variance ``var(y) - k^2 var(d)``.
    """
    k = np.divide(covariance, spread, out=np.zeros_like(spread), where=spread > 0.0)
    return np.maximum(variance - k**2 * spread, 0.0) + ((weight + k) * apart) ** 2


def _spread(course: Track, coarse: Track, errors: Array, residual: Array, rows: Array) -> Bands:
    """Roots of these variances, at all epochs of the course; `rows` (K,) of the log in each coarse step, none where a fix is.

    Where in a step the first of few rows comes, and moves the velocity, the step does not say: it has the larger of its ends. So
    with a fix.
    """
    stride = max(1, round(coarse.interval / course.interval))
    after = np.minimum(-(-np.arange(len(course)) // stride), len(coarse) - 1)
    before = np.minimum(np.arange(len(course)) // stride, len(coarse) - 1)
    few = np.append(rows < stride - 0.5, False)[np.minimum(before, len(rows))][:, None]

    def at_all(variance: Array) -> Array:
        sigma: Array = np.sqrt(np.maximum(variance, 0.0))
        between = np.stack([np.interp(course.time, coarse.time, column) for column in sigma.T], axis=1)
        return np.where(few, np.maximum(sigma[before], sigma[after]), between)

    return Bands(at_all(errors), at_all(residual))
