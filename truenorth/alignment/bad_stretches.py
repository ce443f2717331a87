"""What stretches of bad samples do to the answer on a base that stays: noise for a while, and a channel that is stuck.

Both go through the filter as it ran. The error of its estimate obeys ``e_k = (I - K_k H_k)(Phi_k e_(k-1) - w_k) + K_k v_k``
(:mod:`truenorth.filters.gains`): noise that the model leaves out adds its own covariance, a channel that stands at a value adds
the pulse by which that differs from what the channel measures otherwise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.fine import FineAlignment
from truenorth.errors.staying import BG, DV, PHI
from truenorth.quality.density import bursts
from truenorth.quality.sampling import check_sampling
from truenorth.records import COLUMNS, ImuRecord
from truenorth.state.evidence import Effect, Evidence

Array = NDArray[np.float64]


def bad_stretches(fine: FineAlignment, record: ImuRecord) -> list[Evidence]:
    """Noise for a while, and stuck channels, with what they do to heading and level."""
    return [*_noisy(fine, record), *_stuck(fine, record)]


def _noisy(fine: FineAlignment, record: ImuRecord) -> list[Evidence]:
    edges, extra = bursts(record)
    loud = np.flatnonzero(extra.any(axis=1))
    if not loud.size:
        return []
    time = fine.integrals.start + fine.integrals.time[1:]
    at = np.clip(np.searchsorted(edges, time) - 1, 0, len(extra) - 1)
    gyro, accel = (np.where(time <= edges[-1], part[at].max(axis=1), 0.0) for part in (extra[:, :3], extra[:, 3:]))
    gain, step, keep = fine.gains.gain, fine.gains.step, fine.gains.keep
    n = fine.system.states
    P = np.zeros((n, n))
    for k, T in enumerate(np.diff(fine.integrals.time)):
        P = step[k] @ P @ step[k].T
        if gyro[k] or accel[k]:
            Q = np.zeros((n, n))
            Q[PHI, PHI], Q[DV, DV] = gyro[k] ** 2 * T * np.eye(3), accel[k] ** 2 * T * np.eye(3)
            P += keep[k] @ Q @ keep[k].T + gain[k] @ gain[k].T * (accel[k] ** 2 * T / 3.0)
    sigma = np.sqrt(np.diag(P)[PHI])
    sensor = "gyro" if extra[:, :3].any() else "accel"
    figures = {"begin": float(edges[loud[0]]), "end": float(edges[loud[-1] + 1]), "heading": float(sigma[2])}
    return [Evidence(f"noise.{sensor}_stretch", figures, "known", Effect(float(sigma[2]), float(sigma[:2].max())))]


def _stuck(fine: FineAlignment, record: ImuRecord) -> list[Evidence]:
    sampling, findings = check_sampling(record)
    if not any(finding.code == "frozen" for finding in findings):
        return []
    found = []
    values = np.hstack([record.gyro, record.accel]) / (record.interval if record.kind == "increments" else 1.0)
    for channel, (first, rows) in enumerate(zip(sampling.longest_at, sampling.longest_runs, strict=True)):
        stuck = slice(int(first), int(first + rows))
        rest = np.delete(values[:, channel], stuck)
        if rows * record.interval < 1.0 or not rest.size:
            continue
        size = float(values[first, channel] - rest.mean())
        off = np.abs(_pulse(fine, channel, record.time[stuck][0], record.time[stuck][-1], size))
        figures = {
            "name": COLUMNS["rates"][channel],
            "begin": float(record.time[first]),
            "length": rows * record.interval,
        }
        found.append(
            Evidence("record.stuck", figures, "known", Effect(float(off[2]), math.hypot(float(off[0]), float(off[1]))))
        )
    return found


def _pulse(fine: FineAlignment, channel: int, begin: float, end: float, size: float) -> Array:
    """(3,) error of attitude that a constant error of one channel between two times leaves."""
    time = fine.integrals.start + fine.integrals.time
    share = np.clip((np.minimum(time[1:], end) - np.maximum(time[:-1], begin)) / np.diff(time), 0.0, 1.0)
    Phi, H = fine.system.Phi, fine.system.H
    gain, step = fine.gains.gain, fine.gains.step
    d, x = np.zeros(fine.system.states), np.zeros(fine.system.states)
    state = BG.start + channel
    for k in range(len(share)):
        d[state] = size * share[k]
        d = Phi[min(k, len(Phi) - 1)] @ d
        x = step[k] @ x + gain[k] @ (H[min(k, len(H) - 1)] @ d)
    d[state] = 0.0
    return (d - x)[PHI]
