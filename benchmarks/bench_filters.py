"""Speed of the Kalman filter beside filterpy and simdkalman, on the same system in the same run.

15 states, a 3-row measurement every tenth step, prediction at every step. Run: ``python -m benchmarks.bench_filters``.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable

import numpy as np

from truenorth.filters import LinearSystem, fading, kalman, smoother, square_root

STATES, ROWS, EVERY = 15, 3, 10
RUNS, REPEATS = 200, 5


def system(epochs: int, runs: tuple[int, ...] = (), every: int = EVERY, seed: int = 0) -> LinearSystem:
    """A stable system without structure."""
    rng = np.random.default_rng(seed)
    Phi = np.eye(STATES) + 0.01 * rng.standard_normal((STATES, STATES))
    Phi /= 1.001 * np.max(np.abs(np.linalg.eigvals(Phi)))
    z = rng.standard_normal((*runs, epochs, ROWS))
    z[..., np.arange(epochs) % every != 0, :] = np.nan
    return LinearSystem(
        Phi=Phi[None],
        Q=0.01 * np.eye(STATES)[None],
        H=rng.standard_normal((1, ROWS, STATES)),
        R=np.diag([0.5, 1.0, 2.0])[None],
        z=z,
        x0=np.zeros(STATES),
        P0=np.eye(STATES),
    )


def best(call: Callable[[], object], steps: int, repeats: int = REPEATS) -> float:
    """Shortest time of a step over repeats, us."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times) / steps


def by_filterpy(s: LinearSystem) -> np.ndarray:
    from filterpy.kalman import KalmanFilter

    f = KalmanFilter(dim_x=STATES, dim_z=ROWS)
    f.x, f.P, f.F, f.Q, f.H, f.R = s.x0[:, None].copy(), s.P0.copy(), s.Phi[0], s.Q[0], s.H[0], s.R[0]
    for z in s.z:
        f.predict()
        if not np.isnan(z[0]):
            f.update(z[:, None])
    return f.x[:, 0]


def by_simdkalman(s: LinearSystem) -> np.ndarray:
    import simdkalman

    f = simdkalman.KalmanFilter(s.Phi[0], s.Q[0], s.H[0], s.R[0])
    # Its initial value stands at the first measurement, ours before it.
    x, P = s.Phi[0] @ s.x0, s.Phi[0] @ s.P0 @ s.Phi[0].T + s.Q[0]
    result = f.compute(
        np.atleast_3d(s.z), 0, initial_value=x, initial_covariance=P, filtered=True, smoothed=False, likelihoods=False
    )
    return result.filtered.states.mean[:, -1]


def main() -> None:
    one, few = system(20_000), system(1_000)
    many, few_many = system(2_000, (RUNS,)), system(200, (RUNS,))
    cores = os.cpu_count() or 1

    x = kalman(few).x[-1]
    np.testing.assert_allclose(by_filterpy(few), x, rtol=1e-8, atol=1e-10)
    x = kalman(few_many).x[:, -1]
    np.testing.assert_allclose(by_simdkalman(few_many), x, rtol=1e-8, atol=1e-10)

    print(f"{STATES} states, {ROWS} rows every {EVERY}th step; us a step (a run and step where there are many runs)")
    ours = best(lambda: kalman(one), one.epochs)
    print(f"  one run,  truenorth, Joseph            {ours:8.3f}")
    print(f"  one run,  truenorth, plain             {best(lambda: kalman(one, joseph=False), one.epochs):8.3f}")
    print(f"  one run,  truenorth, full history      {best(lambda: kalman(one, history='full'), one.epochs):8.3f}")
    print(f"  one run,  truenorth, smoother          {best(lambda: smoother(one), one.epochs):8.3f}")
    print(f"  one run,  truenorth, fading            {best(lambda: fading(one, kind='single'), one.epochs):8.3f}")
    print(f"  one run,  truenorth, square root       {best(lambda: square_root(one), one.epochs):8.3f}")
    theirs = best(lambda: by_filterpy(few), few.epochs)
    print(f"  one run,  filterpy (Joseph)            {theirs:8.3f}   {theirs / ours:.0f} times ours")
    every = system(20_000, every=1)
    print(f"  one run,  truenorth, update each step  {best(lambda: kalman(every), every.epochs):8.3f}")
    steps = RUNS * many.epochs
    alone = best(lambda: kalman(many), steps)
    print(f"  {RUNS} runs, truenorth, 1 thread          {alone:8.3f}")
    ours = best(lambda: kalman(many, workers=cores), steps)
    print(f"  {RUNS} runs, truenorth, {cores} threads         {ours:8.3f}")
    theirs = best(lambda: by_simdkalman(few_many), RUNS * few_many.epochs, 2)
    print(f"  {RUNS} runs, simdkalman                   {theirs:8.3f}   {theirs / ours:.0f} times ours")


if __name__ == "__main__":
    main()
