"""The Kalman filter of many runs on a CUDA device: a block of threads a run; runs that share the covariance, a thread each.

The steps are those of :mod:`truenorth.filters.recursion`, in their order. The threads of a block share out the elements of
a matrix, which stands in the memory of the block. What all of them ask about (a variance, an innovation) each works out for itself,
so that all take the same way. Only :mod:`truenorth.filters.device` imports this module: it loads `numba.cuda`.
"""

# mypy: ignore-errors
# (What a kernel calls is Numba's, whose hints are of the functions behind it.)

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

from numba import cuda, float64

from truenorth.filters.recursion import (
    JOSEPH_RANGE,
    LOG_2PI,
    NO_INNOVATION_VARIANCE,
    NOT_POSITIVE,
    PLAIN_RANGE,
    ROUNDING,
    SOUND,
)


class Shared(NamedTuple):
    """What the threads of a block share: of n states and m rows."""

    x: Any  # (n,)
    P: Any  # (n, n)
    Phi: Any  # (n, n)
    T: Any  # (n, n), worked in
    a: Any  # (n,) covariance of a row with the state
    k: Any  # (n,) its gain
    t: Any  # (n,), worked in
    largest: Any  # (n,) variance of each state so far
    R: Any  # (m, m)
    S_t: Any  # (m, n) covariance of each row's noise with the state
    v: Any  # (m,) estimate of each row's noise
    g: Any  # (m,)


def shared_bytes(n: int, m: int) -> int:
    """Of :class:`Shared`."""
    return 8 * (3 * n * n + 5 * n + m * m + m * n + 2 * m)


@cuda.jit(device=True)
def _at(a, run, epoch):
    """Where an array has what is for a run and an epoch: runs may share it, and time may not change it."""
    return run if a.shape[0] > 1 else 0, epoch if a.shape[1] > 1 else 0


@cuda.jit(device=True)
def _lower(e, n):
    """Row and column of element `e` of a lower triangle: of an even number of rows a short and a long one stand side by side."""
    even = n + n % 2
    i, j = e // (even + 1), e % (even + 1)
    return (i, j) if j <= i else (even - 1 - i, j - i - 1)


@cuda.jit(device=True)
def _dot(a, b):
    total = 0.0
    for k in range(a.shape[0]):
        total += a[k] * b[k]
    return total


@cuda.jit(device=True)
def _begin(w, system, run):
    me, wide, n = cuda.threadIdx.x, cuda.blockDim.x, w.x.shape[0]
    x0, P0 = system.x0[run if system.x0.shape[0] > 1 else 0], system.P0[run if system.P0.shape[0] > 1 else 0]
    for i in range(me, n, wide):
        w.x[i], w.largest[i] = x0[i], P0[i, i]
        for j in range(n):
            w.P[i, j] = P0[i, j]
        for row in range(w.S_t.shape[0]):
            w.S_t[row, i] = 0.0


@cuda.jit(device=True)
def _predict(w, system, run, epoch):
    """``x = Phi x + u``, ``P = Phi P Phi' + Q``."""
    me, wide, n = cuda.threadIdx.x, cuda.blockDim.x, w.x.shape[0]
    Phi, Q, u = (
        system.Phi[_at(system.Phi, run, epoch)],
        system.Q[_at(system.Q, run, epoch)],
        system.u[_at(system.u, run, epoch)],
    )
    if epoch == 0 or system.Phi.shape[1] > 1:
        for e in range(me, n * n, wide):
            w.Phi[e // n, e % n] = Phi[e // n, e % n]
    cuda.syncthreads()
    for e in range(me, n * n, wide):
        i, j = e // n, e % n
        total = 0.0
        for k in range(n):
            total += w.Phi[i, k] * w.P[k, j]
        w.T[i, j] = total
    for i in range(me, n, wide):
        w.t[i] = _dot(w.Phi[i], w.x) + u[i]
    cuda.syncthreads()
    for e in range(me, (n + 1) // 2 * (n + n % 2 + 1), wide):
        i, j = _lower(e, n)
        if i < n:
            total = _dot(w.T[i], w.Phi[j]) + Q[i, j]
            w.P[i, j] = total
            w.P[j, i] = total
    for i in range(me, n, wide):
        w.x[i] = w.t[i]
    cuda.syncthreads()


@cuda.jit(device=True)
def _load_noise(w, system, run, epoch, tied):
    """Load ``R`` and ``S``; whether the noise of a row is correlated at this epoch."""
    me, wide, n, m = cuda.threadIdx.x, cuda.blockDim.x, w.x.shape[0], w.R.shape[0]
    R, S = system.R[_at(system.R, run, epoch)], system.S[_at(system.S, run, epoch)]
    for i in range(me, m, wide):
        w.v[i] = 0.0
        for j in range(m):
            w.R[i, j] = R[i, j]
        if tied:
            for j in range(n):
                w.S_t[i, j] = S[j, i]
    cuda.syncthreads()
    correlated = False
    if tied:
        for i in range(m):
            for j in range(m):
                correlated = correlated or (i != j and w.R[i, j] != 0.0)
            for j in range(n):
                correlated = correlated or w.S_t[i, j] != 0.0
    return correlated


@cuda.jit(device=True)
def _covariance_of_row(w, h, row):
    """``a = P h + s``."""
    cuda.syncthreads()
    for i in range(cuda.threadIdx.x, w.x.shape[0], cuda.blockDim.x):
        w.a[i] = _dot(w.P[i], h) + w.S_t[row, i]
    cuda.syncthreads()


@cuda.jit(device=True)
def _innovate(w, H, z, innovation, covariance):
    """``z - H x`` and ``H P H' + H S + S' H' + R``."""
    for i in range(w.R.shape[0]):
        _covariance_of_row(w, H[i], i)
        for j in range(cuda.threadIdx.x, i + 1, cuda.blockDim.x):
            total = _dot(w.a, H[j]) + _dot(H[i], w.S_t[j]) + w.R[i, j]
            covariance[i, j] = total
            covariance[j, i] = total
            if j == i:
                innovation[i] = z[i] - _dot(H[i], w.x)


@cuda.jit(device=True)
def _update(w, h, row, nu, variance, h_s, correlated, joseph):
    """Condition on one row: ``P -= a a' / variance``, the rest as :func:`truenorth.filters.recursion.update_by_row`."""
    me, wide, n, m = cuda.threadIdx.x, cuda.blockDim.x, w.x.shape[0], w.R.shape[0]
    elements = (n + 1) // 2 * (n + n % 2 + 1)
    for i in range(me, n, wide):  # once: to divide takes a device as long as ten products
        w.k[i] = w.a[i] / variance
        w.x[i] += w.k[i] * nu
    cuda.syncthreads()
    for e in range(me, elements, wide):
        i, j = _lower(e, n)
        if i < n:
            left = w.P[i, j] - w.k[i] * w.a[j]
            w.P[i, j] = left
            w.P[j, i] = left
    cuda.syncthreads()
    if joseph:
        for i in range(me, n, wide):
            w.t[i] = _dot(w.P[i], h) + (w.S_t[row, i] - w.k[i] * (h_s + w.R[row, row]))
        cuda.syncthreads()
        for e in range(me, elements, wide):
            i, j = _lower(e, n)
            if i < n:
                left = w.P[i, j] - 0.5 * (w.t[i] * w.k[j] + w.t[j] * w.k[i])
                w.P[i, j] = left
                w.P[j, i] = left
    if correlated:
        for i in range(row + 1 + me, m, wide):
            w.g[i] = _dot(h, w.S_t[i]) + w.R[row, i]
        cuda.syncthreads()
        for i in range(row + 1 + me, m, wide):
            w.v[i] += w.g[i] / variance * nu
            for j in range(n):
                w.S_t[i, j] -= w.k[j] * w.g[i]
            for j in range(row + 1, m):
                w.R[i, j] -= w.g[i] * w.g[j] / variance
    cuda.syncthreads()


@cuda.jit(device=True)
def _fault_after(w, h, variance, noise, correlated):
    """What is wrong with P after a row; what a row without noise shows is zero there."""
    n = w.x.shape[0]
    if noise == 0.0:
        for i in range(cuda.threadIdx.x, n, cuda.blockDim.x):
            if abs(w.P[i, i]) < ROUNDING * (w.a[i] * w.a[i] / variance):
                for j in range(n):
                    w.P[i, j] = 0.0
                    w.P[j, i] = 0.0
        cuda.syncthreads()
    elif not correlated and variance > JOSEPH_RANGE * noise:
        left = 0.0
        for i in range(n):
            left += h[i] * _dot(w.P[i], h)
        expected = noise * (1.0 - noise / variance)
        if not abs(left - expected) < 0.5 * expected:
            return NOT_POSITIVE
    return SOUND


@cuda.jit(device=True)
def _condition(w, H, z, correlated, joseph, gains):
    """Condition on all rows present: the fault if any, NIS and log-likelihood; `gains` (m, n + 1) may be asked for."""
    n, nis, log_likelihood, present = w.x.shape[0], 0.0, 0.0, 0
    for row in range(w.R.shape[0]):
        present += not math.isnan(z[row])
    if present == 0:
        return SOUND, nis, log_likelihood
    for i in range(cuda.threadIdx.x, n, cuda.blockDim.x):
        w.largest[i] = max(w.largest[i], w.P[i, i])
    for row in range(w.R.shape[0]):
        if math.isnan(z[row]):
            continue
        h, noise, h_s = H[row], w.R[row, row], 0.0
        _covariance_of_row(w, h, row)
        if correlated:
            h_s = _dot(h, w.S_t[row])
        nu, variance = z[row] - _dot(h, w.x) - w.v[row], _dot(h, w.a) + h_s + noise
        cuda.syncthreads()
        if not variance > 0.0:
            return NO_INNOVATION_VARIANCE, nis, log_likelihood
        small = variance < (1.0 - ROUNDING) * noise
        if not correlated and (small or (not joseph and variance > PLAIN_RANGE * noise and noise > 0.0)):
            return NOT_POSITIVE, nis, log_likelihood
        nis += nu * nu / variance
        log_likelihood -= 0.5 * (nu * nu / variance + math.log(variance) + LOG_2PI)
        if gains.shape[0] > 0:
            for i in range(cuda.threadIdx.x, n, cuda.blockDim.x):
                gains[row, i] = w.a[i] / variance
            gains[row, n] = variance
        _update(w, h, row, nu, variance, h_s, correlated, joseph)
        fault = _fault_after(w, h, variance, noise, correlated)
        if fault != SOUND:
            return fault, nis, log_likelihood
    cuda.syncthreads()
    lost = 0
    for i in range(cuda.threadIdx.x, n, cuda.blockDim.x):
        if w.P[i, i] < 0.0:
            lost += w.P[i, i] < -ROUNDING * w.largest[i]
            w.P[i, i] = 0.0
    return (NOT_POSITIVE if cuda.syncthreads_or(lost) else SOUND), nis, log_likelihood


@cuda.jit(device=True)
def _keep(w, out, run, epoch, last):
    """State, sigma and covariance of an epoch in those histories that have room; the last epoch in all."""
    me, wide, n = cuda.threadIdx.x, cuda.blockDim.x, w.x.shape[0]
    if out.x.shape[1] > 1 or epoch == last:
        k = epoch if out.x.shape[1] > 1 else 0
        for i in range(me, n, wide):
            out.x[run, k, i] = w.x[i]
            out.sigma[run, k, i] = math.sqrt(w.P[i, i])
    if out.P.shape[1] > 1 or epoch == last:
        k = epoch if out.P.shape[1] > 1 else 0
        for e in range(me, n * n, wide):
            out.P[run, k, e // n, e % n] = w.P[e // n, e % n]


@cuda.jit(device=True)
def _filter(w, system, run, epochs, tied, joseph, out, gains):
    """One run, by one block."""
    _begin(w, system, run)
    for epoch in range(epochs):
        _predict(w, system, run, epoch)
        correlated = _load_noise(w, system, run, epoch, tied)
        H, z = system.H[_at(system.H, run, epoch)], system.z[_at(system.z, run, epoch)]
        if out.innovation.shape[1] > 0:
            _innovate(w, H, z, out.innovation[run, epoch], out.innovation_covariance[run, epoch])
        of_epoch = gains[epoch if gains.shape[0] > 1 else 0]
        fault, nis, log_likelihood = _condition(w, H, z, correlated, joseph, of_epoch)
        if cuda.threadIdx.x == 0:
            out.log_likelihood[run] += log_likelihood
            if out.nis.shape[1] > 0:
                out.nis[run, epoch] = nis
            if fault != SOUND:
                out.failure[run, 0] = fault
                out.failure[run, 1] = epoch
        if fault != SOUND:
            break
        _keep(w, out, run, epoch, epochs - 1)


@cuda.jit(device=True)
def _follow(x, x_next, system, run, epochs, gains, out):
    """The states of one run that has the gains (K, m, n + 1) of all, by one thread."""
    n, m = x.shape[0], gains.shape[1]
    for i in range(n):
        x[i] = system.x0[run if system.x0.shape[0] > 1 else 0, i]
    for epoch in range(epochs):
        Phi, u, H, z = (
            system.Phi[_at(system.Phi, 0, epoch)],
            system.u[_at(system.u, 0, epoch)],
            system.H[_at(system.H, 0, epoch)],
            system.z[_at(system.z, run, epoch)],
        )
        for i in range(n):
            x_next[i] = _dot(Phi[i], x) + u[i]
        for i in range(n):
            x[i] = x_next[i]
        if out.innovation.shape[1] > 0:
            for row in range(m):
                out.innovation[run, epoch, row] = z[row] - _dot(H[row], x)
        nis = 0.0
        for row in range(m):
            if not math.isnan(z[row]):
                nu, variance = z[row] - _dot(H[row], x), gains[epoch, row, n]
                nis += nu * nu / variance
                out.log_likelihood[run] -= 0.5 * (nu * nu / variance + math.log(variance) + LOG_2PI)
                for i in range(n):
                    x[i] += gains[epoch, row, i] * nu
        if out.nis.shape[1] > 0:
            out.nis[run, epoch] = nis
        if out.x.shape[1] > 1 or epoch == epochs - 1:
            for i in range(n):
                out.x[run, epoch if out.x.shape[1] > 1 else 0, i] = x[i]


@cache
def run_by_block(n: int, m: int) -> Any:
    """The kernel of n states and m rows: run b in block b; `gains` (1 or K, 0 or m, n + 1) are kept where there is room."""

    @cuda.jit
    def kernel(system, epochs, tied, joseph, out, gains):
        x = cuda.shared.array((n,), float64)
        P = cuda.shared.array((n, n), float64)
        Phi = cuda.shared.array((n, n), float64)
        T = cuda.shared.array((n, n), float64)
        a = cuda.shared.array((n,), float64)
        k = cuda.shared.array((n,), float64)
        t = cuda.shared.array((n,), float64)
        largest = cuda.shared.array((n,), float64)
        R = cuda.shared.array((m, m), float64)
        S_t = cuda.shared.array((m, n), float64)
        v = cuda.shared.array((m,), float64)
        g = cuda.shared.array((m,), float64)
        w = Shared(x, P, Phi, T, a, k, t, largest, R, S_t, v, g)
        _filter(w, system, cuda.blockIdx.x, epochs, tied, joseph, out, gains)

    return kernel


@cache
def run_by_thread(n: int) -> Any:
    """The kernel of runs that share all but measurements and initial states: run t by thread t of all."""

    @cuda.jit
    def kernel(system, epochs, gains, out):
        x = cuda.local.array(n, float64)
        x_next = cuda.local.array(n, float64)
        run = cuda.grid(1)
        if run < out.x.shape[0]:
            _follow(x, x_next, system, run, epochs, gains, out)

    return kernel
