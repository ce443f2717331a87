"""Coarse alignment of a run: the paper's dual vector, and better ways to use the same integrals."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.encoder_angles import angles_at
from truenorth.coarse.lever_arm import RateSource, arm_velocity
from truenorth.coarse.wahba import q_method, triad
from truenorth.core.attitude import misalignment
from truenorth.core.indexing import C_bs_from_angles
from truenorth.papers.rotary.truth import AXES, INDEXER_RATES, Run
from truenorth.records import ImuRecord
from truenorth.strapdown.increments import increments
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, gravity_velocity, integrate

Array = NDArray[np.float64]

FIRST, LAST = 50, 120  # s: the paper's t_k1 and t_k2
SOURCES: tuple[RateSource, ...] = ("gyros", "nominal", "attitude")


class Sampled(NamedTuple):
    """A stretch of a run at whole seconds."""

    integrals: InertialIntegrals  # of the IMU
    # dict of (K+1, 3) arrays, m/s; velocity that the lever arm makes, in the IMU's frame at the start, by the source of the
    # base's rate
    arm: dict[RateSource, Array]


def sample(run: Run, record: ImuRecord, sources: tuple[RateSource, ...] = ("gyros",)) -> Sampled:
    """Integrate a stretch of a run and make the lever arm's velocity; the stretch needs a sample beyond its last second."""
    step = record.interval
    per_second = round(1.0 / step)
    count = (len(record) - 1) // per_second
    rows = np.arange(count + 1) * per_second - 1  # the last row of each second, -1 at the start
    around = rows[:, None] + np.array([-1, 0, 1])
    integrals = integrate(record.between(None, record.time[rows[-1]]), 1.0)
    attitudes = integrate(record, 1.0, rows_at=np.maximum(around, 0).ravel()).C_ib_at.reshape(-1, 3, 3, 3)
    rate = increments(record)[0] / step
    # At the start there is no step before: the frame at rest half a step, then as the first increment turns it.
    first = attitudes[0, 1]
    attitudes[0] = np.stack([first.T, np.eye(3), first])
    w = 0.5 * (rate[np.maximum(rows, 0)] + rate[rows + 1])
    w[0] = rate[0]
    start = record.time[0] - step
    C_bs = np.broadcast_to(np.eye(3), attitudes.shape)
    nominal = np.zeros((count + 1, 3))
    if run.encoder is not None:
        times = start + (around + 1) * step
        C_bs = C_bs_from_angles(AXES, angles_at(run.encoder, times.ravel(), AXES).reshape(*times.shape, 2))
        nominal = INDEXER_RATES[1] * np.eye(3)[0] + INDEXER_RATES[0] * C_bs[:, 1, 2, :]  # of x, and of z seen from s
    arm = {source: arm_velocity(source, run.arm, step, attitudes, C_bs, w, nominal) for source in sources}
    return Sampled(integrals, arm)


def coarse_errors(run: Run, sampled: Sampled) -> dict[tuple[str, str], Array]:
    """Misalignment (E, N, U; rad) at the end of coarse alignment, by method and source of the base's rate."""
    integrals = sampled.integrals
    t, place = integrals.time, run.place
    r = -gravity_velocity(t, place.lat, place.alt)
    C_true = run.C_ns(np.array([integrals.start + t[LAST]]))[0]
    C_n_n0 = earth_rotation(t[LAST], place.lat).T
    errors: dict[tuple[str, str], Array] = {}
    for source, arm in sampled.arm.items():
        b = integrals.velocity - (arm - arm[0])
        ends = np.arange(1, LAST + 1)
        starts = ends // 2
        found = {
            "dual_vector": dual_vector_as_printed(b[FIRST], b[LAST], r[FIRST], r[LAST]),
            "triad": triad(b[LAST], b[FIRST], r[LAST], r[FIRST]),
            "q_method": q_method(b[ends] - b[starts], r[ends] - r[starts]),
        }
        for method, C_n0_i in found.items():
            C_hat = C_n_n0 @ C_n0_i @ integrals.C_ib[LAST]
            of = skew_part if method == "dual_vector" else misalignment
            errors[method, source] = of(C_hat, C_true)
    return errors


def dual_vector_as_printed(b1: Array, b2: Array, r1: Array, r2: Array) -> Array:
    """The paper's eq. 22 on unit vectors: usable only so, and no rotation where the two pairs enclose different angles."""
    (b1, b2, r1, r2) = (v / np.linalg.norm(v) for v in (b1, b2, r1, r2))
    C: Array = np.linalg.solve(np.stack([r1, r2, np.cross(r1, r2)]), np.stack([b1, b2, np.cross(b1, b2)]))
    return C


def skew_part(C_hat: Array, C: Array) -> Array:
    """``phi`` of a computed matrix that is no rotation."""
    E = C_hat @ C.T
    S = 0.5 * (E - E.T)
    return np.array([-S[2, 1], -S[0, 2], -S[1, 0]])
