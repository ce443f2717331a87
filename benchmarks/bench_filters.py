"""Speed of the linear filters; other libraries on the same work: ``python -m benchmarks peers``.

15 states, a 3-row measurement every tenth step, prediction at every step. Many runs share all but their measurements.
Run: ``python -m benchmarks.bench_filters``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.timing import best as seconds
from truenorth.filters import LinearSystem, fading, feedback, innovation_adaptive, kalman, smoother, square_root

STATES, ROWS, EVERY = 15, 3, 10
RUNS, REPEATS = 200, 15
LIMIT_ONE, LIMIT_EIGHT, LIMIT_MANY, CORES = (
    0.5,
    0.15,
    0.1,
    2,
)  # us: of the plain form, one run, 8 runs, and 200 on two cores


def system(
    epochs: int, runs: tuple[int, ...] = (), every: int = EVERY, seed: int = 0, states: int = STATES
) -> LinearSystem:
    """A stable system without structure."""
    rng = np.random.default_rng(seed)
    Phi = np.eye(states) + 0.01 * rng.standard_normal((states, states))
    Phi /= 1.001 * np.max(np.abs(np.linalg.eigvals(Phi)))
    z = rng.standard_normal((*runs, epochs, ROWS))
    z[..., np.arange(epochs) % every != 0, :] = np.nan
    return LinearSystem(
        Phi=Phi[None],
        Q=0.01 * np.eye(states)[None],
        H=rng.standard_normal((1, ROWS, states)),
        R=np.diag([0.5, 1.0, 2.0])[None],
        z=z,
        x0=np.zeros(states),
        P0=np.eye(states),
    )


def best(call: Callable[[], object], steps: int, repeats: int = REPEATS) -> float:
    """Shortest time of a step over repeats, us."""
    return 1e6 * seconds(call, repeats) / steps


def main() -> None:
    one, eight, many = system(20_000), system(20_000, (8,)), system(2_000, (RUNS,))
    apart = replace(eight, Phi=np.tile(eight.Phi, (8, 1, 1, 1)))

    print(f"  {STATES} states, {ROWS} rows every {EVERY}th step; us a step (a run and step where there are many runs)")
    ours = {
        "plain": best(lambda: kalman(one, joseph=False), one.epochs),
        "Joseph": best(lambda: kalman(one), one.epochs),
        "full history": best(lambda: kalman(one, history="full"), one.epochs),
        "feedback": best(lambda: feedback(one), one.epochs),
        "fading": best(lambda: fading(one, kind="single"), one.epochs),
        "R from a window": best(lambda: innovation_adaptive(one), one.epochs),
        "square root": best(lambda: square_root(one), one.epochs),
        "smoother": best(lambda: smoother(one), one.epochs, 5),
    }
    show("one run, truenorth", ours, LIMIT_ONE)
    every = system(20_000, every=1)
    update = {
        "plain": best(lambda: kalman(every, joseph=False), every.epochs),
        "Joseph": best(lambda: kalman(every), every.epochs),
    }
    show("one run, update at each step", update)

    steps = 8 * eight.epochs
    together = {
        "plain": best(lambda: kalman(eight, joseph=False), steps, 5),
        "Joseph": best(lambda: kalman(eight), steps, 5),
        "Joseph, each with its own Phi": best(lambda: kalman(apart), steps, 5),
    }
    show("8 runs, 1 thread", together, LIMIT_EIGHT)
    steps = RUNS * many.epochs
    show(f"{RUNS} runs, 1 thread", {"plain": best(lambda: kalman(many, joseph=False), steps, 5)})
    shared = {
        "plain": best(lambda: kalman(many, joseph=False, workers=CORES), steps),
        "Joseph": best(lambda: kalman(many, workers=CORES), steps),
    }
    show(f"{RUNS} runs, {CORES} threads", shared, LIMIT_MANY)


def show(title: str, figures: dict[str, float], limit: float | None = None) -> None:
    """A line for each figure; the limit is that of the first."""
    for i, (name, figure) in enumerate(figures.items()):
        verdict = f"(limit {limit:g})" if limit is not None and i == 0 else ""
        print(f"  {f'{title}, {name}':48s}{figure:8.3f}  {verdict}".rstrip())


if __name__ == "__main__":
    main()
