"""Weighted particles of one run: drawn, remembered, weighed, summed up and resampled.

Source: G. Kitagawa, J. Comput. Graph. Stat. 5, 1996 (systematic resampling).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.linalg import Array, Size, load
from truenorth.filters.linearisation import Points, decompose
from truenorth.filters.nonlinear_steps import copy
from truenorth.filters.nonlinear_system import NonlinearRuns
from truenorth.filters.recursion import Workspace


class Cloud(NamedTuple):
    """L particles of one run."""

    log_weight: Array  # (L,) of normalised weights
    weight: Array  # (L,)
    X: Array  # (L, n)
    P: Array  # (L or 0, N, N) of the linear states; 0 where there are none
    X_next: Array
    P_next: Array
    h: Array  # (L, m) predicted measurements


@compiled
def cloud_of(size: Size, system: NonlinearRuns, particles: int, linear: bool) -> Cloud:
    """Zeros throughout."""
    N, n, m = len(size), system.P0.shape[1], system.z.shape[2]
    L = particles if linear else 0
    return Cloud(
        np.zeros(particles),
        np.zeros(particles),
        np.zeros((particles, n)),
        np.zeros((L, N, N)),
        np.zeros((particles, n)),
        np.zeros((L, N, N)),
        np.zeros((particles, m)),
    )


@compiled(forceinline=True)
def draw(s: Points, generator: np.random.Generator) -> None:
    """``X += S xi``: the nonlinear states from their distribution, the others with what that says of them."""
    for k in range(len(s.S)):
        xi = generator.standard_normal()
        for j in range(len(s.X)):
            s.X[j] += s.S[k, j] * xi


@compiled
def start_cloud(
    size: Size,
    system: NonlinearRuns,
    run: int,
    order: NDArray[np.int64],
    generator: np.random.Generator,
    w: Workspace,
    s: Points,
    cloud: Cloud,
    memory: Array,
) -> bool:
    """Take the particles from the memory, or draw them from the prior where there is none."""
    L, n = cloud.X.shape
    if not np.isnan(memory[0]):
        at = L
        for i in range(L):
            cloud.log_weight[i] = memory[i]
            for j in range(n):
                cloud.X[i, j] = memory[at]
                at += 1
        for i in range(len(cloud.P)):
            for j in range(n):
                for k in range(n):
                    cloud.P[i, j, k] = memory[at]
                    at += 1
        return True
    b = run if system.x0.shape[0] > 1 else 0
    load(size, system.P0[run if system.P0.shape[0] > 1 else 0], w.P)
    if not decompose(size, w.P, order, s):
        return False
    for i in range(L):
        for j in range(n):
            s.X[j] = system.x0[b, j]
        draw(s, generator)
        for j in range(n):
            cloud.X[i, j] = s.X[j]
        cloud.log_weight[i] = -np.log(L)
        if len(cloud.P) > 0:
            copy(size, s.rest, cloud.P[i])
    return True


@compiled
def remember_cloud(cloud: Cloud, memory: Array) -> None:
    """All particles, to go on from."""
    L, n = cloud.X.shape
    at = L
    for i in range(L):
        memory[i] = cloud.log_weight[i]
        for j in range(n):
            memory[at] = cloud.X[i, j]
            at += 1
    for i in range(len(cloud.P)):
        for j in range(n):
            for k in range(n):
                memory[at] = cloud.P[i, j, k]
                at += 1


@compiled
def normalise(cloud: Cloud) -> float:
    """Make weights sum to 1; the logarithm of what they summed to."""
    largest = -np.inf
    for i in range(len(cloud.log_weight)):
        largest = max(largest, cloud.log_weight[i])
    total = 0.0
    for i in range(len(cloud.log_weight)):
        total += np.exp(cloud.log_weight[i] - largest)
    log_total = largest + np.log(total)
    for i in range(len(cloud.log_weight)):
        cloud.log_weight[i] -= log_total
        cloud.weight[i] = np.exp(cloud.log_weight[i])
    return log_total


@compiled
def moments(size: Size, weight: Array, X: Array, P: Array, mean: Array, covariance: Array) -> None:
    """Mean and covariance of a mixture: within its members and among them."""
    L, n = X.shape
    for j in range(n):
        total = 0.0
        for i in range(L):
            total += weight[i] * X[i, j]
        mean[j] = total
    for j in range(n):
        for k in range(j + 1):
            total = 0.0
            for i in range(L):
                total += weight[i] * (X[i, j] - mean[j]) * (X[i, k] - mean[k])
            for i in range(len(P)):
                total += weight[i] * P[i, j, k]
            covariance[j, k] = total
            covariance[k, j] = total


@compiled
def resample(size: Size, generator: np.random.Generator, cloud: Cloud) -> None:
    """Systematic resampling: one random number, equal steps along the summed weights."""
    L, n = cloud.X.shape
    step = 1.0 / L
    wanted = step * generator.random()
    source, reached = 0, cloud.weight[0]
    for i in range(L):
        while reached < wanted and source < L - 1:
            source += 1
            reached += cloud.weight[source]
        for j in range(n):
            cloud.X_next[i, j] = cloud.X[source, j]
        if len(cloud.P) > 0:
            copy(size, cloud.P[source], cloud.P_next[i])
        wanted += step
    for i in range(L):
        for j in range(n):
            cloud.X[i, j] = cloud.X_next[i, j]
        if len(cloud.P) > 0:
            copy(size, cloud.P_next[i], cloud.P[i])
        cloud.log_weight[i] = -np.log(L)
        cloud.weight[i] = np.exp(cloud.log_weight[i])
