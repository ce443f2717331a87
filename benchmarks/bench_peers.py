"""Truenorth and other libraries on the same data in one run: the same result first, then the time of each.

Each round times all of a job one after the other by processor time, so that what else the machine does falls on all
alike; a ratio is the median of the rounds, its spread their least and largest. A library that is not installed is named.
``make bench`` installs them all (``benchmarks/peers.txt``) in an environment of their own; where none is missing the table
is written into docs/performance.md.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.bench_filters import system
from benchmarks.bench_mechanisation import COUNT, T, log
from benchmarks.timing import write_between
from truenorth.core.attitude import dcm_from_euler, dcm_from_quaternion, rotation_vector_from_dcm
from truenorth.filters import LinearSystem, kalman
from truenorth.state.state import State
from truenorth.strapdown.level import inertial_integrals, integrate_attitude, mechanise

Array = NDArray[np.float64]
ROUNDS = 15
LEAST = 0.05  # s of processor time of each in a round
EPOCHS, RUNS = 1000, 200
MARKS = "<!-- peers: made by make bench -->", "<!-- peers end -->"
MISSING = {
    "navlie": "its version in the registry, 0.0.1, needs a package (pylie) that the registry does not have",
    "MATLAB toolboxes (PSINS)": "they need MATLAB",
}


class Peer(NamedTuple):
    """Another library: `make` imports it and gives what is timed, whose result is compared with ours."""

    name: str
    make: Callable[[], Callable[[], Any]]
    note: str = ""


class Job(NamedTuple):
    """The same work by us and by others."""

    title: str
    steps: int
    ours: Callable[[], Any]
    apart: Callable[[Any, Any], float]  # between a result of theirs and ours
    tolerance: float
    unit: str
    peers: list[Peer]


def largest(theirs: Any, ours: Any) -> float:
    """Largest difference, over the largest number."""
    return float(np.max(np.abs(np.asarray(theirs) - ours)) / np.max(np.abs(ours)))


# ------------------------------------------------------------------------------------------- Kalman filters


def by_filterpy(s: LinearSystem) -> Callable[[], Array]:
    from filterpy.kalman import KalmanFilter

    def run() -> Array:
        f = KalmanFilter(dim_x=s.states, dim_z=s.rows)
        f.x, f.P, f.F, f.Q, f.H, f.R = s.x0[:, None].copy(), s.P0.copy(), s.Phi[0], s.Q[0], s.H[0], s.R[0]
        for z in s.z:
            f.predict()
            f.update(z[:, None])
        return np.asarray(f.x[:, 0])

    return run


def at_first(s: LinearSystem) -> tuple[Array, Array]:
    """Their initial value stands at the first measurement, ours before it."""
    return s.Phi[0] @ s.x0, s.Phi[0] @ s.P0 @ s.Phi[0].T + s.Q[0]


def by_pykalman(s: LinearSystem) -> Callable[[], Array]:
    from pykalman import KalmanFilter

    x, P = at_first(s)
    f = KalmanFilter(s.Phi[0], s.H[0], s.Q[0], s.R[0], initial_state_mean=x, initial_state_covariance=P)
    return lambda: np.asarray(f.filter(s.z)[0][-1])


def by_simdkalman(s: LinearSystem) -> Callable[[], Array]:
    from simdkalman import KalmanFilter

    x, P = at_first(s)
    f = KalmanFilter(s.Phi[0], s.Q[0], s.H[0], s.R[0])
    more: dict[str, Any] = {"filtered": True, "smoothed": False, "likelihoods": False}
    z = np.atleast_3d(s.z) if s.runs else s.z[None]
    return lambda: np.squeeze(
        f.compute(z, 0, initial_value=x, initial_covariance=P, **more).filtered.states.mean[:, -1]
    )


def by_gtsam(s: LinearSystem) -> Callable[[], Array]:
    import gtsam

    none, still = np.zeros((s.states, 1)), np.zeros(1)
    Q, R = (gtsam.noiseModel.Diagonal.Variances(np.diag(M[0])) for M in (s.Q, s.R))

    def run() -> Array:
        f = gtsam.KalmanFilter(s.states)
        p = f.init(s.x0, s.P0)
        for z in s.z:
            p = f.update(f.predict(p, s.Phi[0], none, still, Q), s.H[0], z, R)
        return np.asarray(p.mean())

    return run


def by_dynamax(s: LinearSystem) -> Callable[[], Array]:
    import jax
    import jax.numpy as jnp
    from dynamax.linear_gaussian_ssm import LinearGaussianSSM, lgssm_filter

    jax.config.update("jax_enable_x64", True)
    x, P = at_first(s)
    parameters, _ = LinearGaussianSSM(s.states, s.rows).initialize(
        initial_mean=jnp.asarray(x),
        initial_covariance=jnp.asarray(P),
        dynamics_weights=jnp.asarray(s.Phi[0]),
        dynamics_covariance=jnp.asarray(s.Q[0]),
        emission_weights=jnp.asarray(s.H[0]),
        emission_covariance=jnp.asarray(s.R[0]),
    )
    compiled = jax.jit(lambda z: lgssm_filter(parameters, z).filtered_means[-1])
    z = jnp.asarray(s.z)
    return lambda: np.asarray(compiled(z))


# ---------------------------------------------------------------------------------------------- strapdown


def by_pyins(start: State) -> Callable[[], Array]:
    import pandas as pd
    from pyins import strapdown, transform
    from pyins.util import ACCEL_COLS, GYRO_COLS, LLA_COLS, RPH_COLS, VEL_COLS

    swap = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])  # of vectors; north-east-down from ENU as well
    record = log()
    frd = np.hstack([record.gyro @ swap.T, record.accel @ swap.T])
    # It wants the sample before the first; its own one-sample algorithm then makes the same corrections.
    imu = pd.DataFrame(
        np.vstack([np.zeros(6), frd]), np.concatenate([[0.0], record.time]), columns=GYRO_COLS + ACCEL_COLS
    )
    rph = transform.mat_to_rph(swap @ start.C_nb @ swap.T)
    pva = pd.Series(
        [np.degrees(start.lat), np.degrees(start.lon), start.alt, 0, 0, 0, *rph],
        LLA_COLS + VEL_COLS + RPH_COLS,
        name=0.0,
    )

    def run() -> Array:
        increments = strapdown.compute_increments_from_imu(imu, "increment")
        table = strapdown.Integrator(pva).integrate(increments)
        return np.radians(table[["lat", "lon"]].to_numpy()[1:])

    return run


def by_ahrs() -> Callable[[], Array]:
    from ahrs.filters import AngularRate

    gyro = np.vstack([np.zeros(3), log().gyro / T])  # its first row is the start

    return lambda: np.asarray(AngularRate(gyr=gyro, frequency=1.0 / T, method="closed").Q[-1])


def by_preintegration() -> Callable[[], Array]:
    import gtsam

    record = log()
    force, rate = record.accel / T, record.gyro / T
    parameters = gtsam.PreintegrationParams.MakeSharedU(9.8)

    def run() -> Array:
        sums = gtsam.PreintegratedImuMeasurements(parameters, gtsam.imuBias.ConstantBias())
        for f, w in zip(force, rate, strict=True):
            sums.integrateMeasurement(f, w, T)
        return np.asarray(sums.deltaVij())

    return run


def turned(theirs: Array, ours: Array) -> float:
    """Angle between two quaternions, rad."""
    return float(np.linalg.norm(rotation_vector_from_dcm(dcm_from_quaternion(theirs) @ dcm_from_quaternion(ours).T)))


def jobs() -> list[Job]:
    """Everything that is compared."""
    one, many = system(EPOCHS, every=1), system(EPOCHS, (RUNS,), every=1)
    record = log()
    start = State.at(dcm_from_euler(1.0, 0.01, -0.02), np.radians(34.2), np.radians(108.9), 400.0)
    ends = np.array([0, COUNT])

    def metres(theirs: Array, ours: Array) -> float:
        return float(6.4e6 * np.abs(theirs - ours).max())

    return [
        Job(
            "Kalman filter, 15 states, 3 rows at every step",
            EPOCHS,
            lambda: kalman(one).x[-1],
            largest,
            1e-8,
            "relative",
            [
                Peer("filterpy", lambda: by_filterpy(one)),
                Peer("pykalman", lambda: by_pykalman(one), "keeps all covariances"),
                Peer("simdkalman", lambda: by_simdkalman(one)),
                Peer("gtsam", lambda: by_gtsam(one), "square-root information"),
                Peer("dynamax", lambda: by_dynamax(one), "compiled by JAX, after its compilation"),
            ],
        ),
        Job(
            f"the same, {RUNS} runs at once",
            EPOCHS * RUNS,
            lambda: kalman(many).x[:, -1],
            largest,
            1e-8,
            "relative",
            [Peer("simdkalman", lambda: by_simdkalman(many))],
        ),
        Job(
            "strapdown over the ellipsoid, 600 s at 100 Hz",
            COUNT,
            lambda: mechanise(record, start).position[:, :2],
            metres,
            0.1,
            "m",
            [Peer("pyins", lambda: by_pyins(start), "its gravity grows linearly; gives Euler angles in a table")],
        ),
        Job(
            "attitude from gyros alone, the same log",
            COUNT,
            lambda: integrate_attitude(record.gyro)[-1],
            turned,
            1e-6,
            "rad",
            [Peer("ahrs", by_ahrs, "constant rate within a sample, ours with coning")],
        ),
        Job(
            "preintegration of rate and force, the same log",
            COUNT,
            lambda: inertial_integrals(record.gyro, record.accel, record.steps, ends)[1][-1],
            largest,
            1e-4,
            "relative, of velocity",
            [Peer("gtsam", by_preintegration, "also its covariance; called sample by sample from Python")],
        ),
    ]


def spent(call: Callable[[], Any]) -> float:
    """Processor time of a call, s; a short one is repeated, as its first passes find nothing of it in the caches."""
    begun, calls = time.process_time(), 0
    while calls == 0 or time.process_time() - begun < LEAST:
        call()
        calls += 1
    return (time.process_time() - begun) / calls


def compared(job: Job) -> list[str]:
    """Rows of the table."""
    expected, ready, rows = job.ours(), [], []
    for peer in job.peers:
        try:
            call = peer.make()
        except ImportError as error:
            rows.append(f"| {job.title} | {peer.name} | | | | not installed ({error.name or error}) |")
            continue
        apart = job.apart(call(), expected)
        if not apart < job.tolerance:
            raise SystemExit(f"{job.title}: {peer.name} is {apart:.3g} {job.unit} from ours, above {job.tolerance:g}")
        ready.append((peer, call, apart))
    rounds = np.array([[spent(call) for call in (job.ours, *(c for _, c, _ in ready))] for _ in range(ROUNDS)])
    us = 1e6 * np.median(rounds, axis=0) / job.steps
    for i, (peer, _, apart) in enumerate(ready, 1):
        ratio = rounds[:, i] / rounds[:, 0]
        note = f"{apart:.1g} {job.unit} apart" + (f"; {peer.note}" if peer.note else "")
        rows.append(
            f"| {job.title} | {peer.name} | {us[0]:.3g} | {us[i]:.3g} | "
            f"{np.median(ratio):.3g} ({ratio.min():.3g} to {ratio.max():.3g}) | {note} |"
        )
    return rows


def main() -> None:
    lines = [
        "| work | by | ours, us a step | theirs | theirs over ours (spread) | same result? |",
        "| --- | --- | ---: | ---: | ---: | --- |",
    ]
    for job in jobs():
        lines += compared(job)
    lines += ["", *(f"Not compared: {name}, {why}." for name, why in MISSING.items())]
    print("\n".join(lines))
    if not any("not installed" in line for line in lines):
        write_between(MARKS, lines)


if __name__ == "__main__":
    main()
