"""Many runs of the Kalman filter on a CUDA device and on this processor: the same result first, then the time of each.

15 states (and as many as an alignment on the move has), 3 rows at every step; systems of their own (a block of threads a run),
and runs that share the covariance (a thread).
Times are on the clock, transfers included. Run: ``python -m benchmarks cuda``.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace

import numpy as np

from benchmarks.bench_filters import STATES, system
from benchmarks.timing import best
from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, kalman

EPOCHS, REPEATS = 500, 3
APART, MANY, SHARED = (100, 1000, 5000), (100, 1000), (1000, 10_000, 100_000)
ON_THE_MOVE = 37  # states
TOLERANCE = 1e-10


def of_its_own(runs: int, states: int = STATES) -> LinearSystem:
    """Each run its own transition."""
    many = system(EPOCHS, (runs,), every=1, states=states)
    scale = 1.0 - 0.01 * np.random.default_rng(1).uniform(size=(runs, 1, 1, 1))
    return replace(many, Phi=scale * many.Phi)


def main() -> None:
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        begun = time.perf_counter()
        kalman(of_its_own(2), device="cuda")
    except UsageError as error:
        print(f"  not measured: {error}")
        return
    print(f"  first call, kernels compiled: {time.perf_counter() - begun:.1f} s")
    print(f"  {'us a step and run':28}{'runs':>8}{f'{cores} cores':>10}{'device':>10}{'ratio':>8}{'apart':>10}")
    for title, sizes, make in (
        ("systems of their own", APART, of_its_own),
        (f"the same, {ON_THE_MOVE} states", MANY, lambda runs: of_its_own(runs, ON_THE_MOVE)),
        ("covariance shared", SHARED, lambda runs: system(EPOCHS, (runs,), every=1)),
    ):
        for runs in sizes:
            s = make(runs)
            here, there = kalman(s, workers=cores), kalman(s, device="cuda")
            apart = float(np.max(np.abs(there.x - here.x)) / np.max(np.abs(here.x)))
            if not apart < TOLERANCE:
                raise SystemExit(f"{title}: the device is {apart:.3g} from the processor, above {TOLERANCE:g}")
            each = 1e6 / (runs * EPOCHS)
            ours = each * best(lambda s=s: kalman(s, workers=cores), REPEATS)  # type: ignore[misc]
            theirs = each * best(lambda s=s: kalman(s, device="cuda"), REPEATS)  # type: ignore[misc]
            print(f"  {title:28}{runs:8d}{ours:10.4f}{theirs:10.4f}{ours / theirs:8.1f}{apart:10.1g}")


if __name__ == "__main__":
    main()
