"""The particle filter, Rao-Blackwellised in the states in which the model is linear.

Each particle holds values of the nonlinear states and, for the others given these, a normal distribution that a Kalman
filter carries on: one epoch predicts all states at once, draws the nonlinear ones from their part, and conditions the
others on what was drawn. The weight is multiplied by the likelihood of the measurement, all linear states integrated
out. With all states nonlinear it is the bootstrap filter; nothing is linear then and no Jacobian is needed.

Sources: N. J. Gordon, D. J. Salmond, A. F. M. Smith, Novel approach to nonlinear/non-Gaussian Bayesian state estimation,
IEE Proc. F 140, 1993; T. Schoen, F. Gustafsson, P.-J. Nordlund, Marginalized particle filters for mixed linear/nonlinear
state-space models, IEEE Trans. Signal Process. 53, 2005; G. Kitagawa, J. Comput. Graph. Stat. 5, 1996 (systematic resampling).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Unpack

import numpy as np
from numpy.typing import NDArray

from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import Array, Size
from truenorth.filters.cloud import Cloud, cloud_of, draw, moments, normalise, remember_cloud, resample, start_cloud
from truenorth.filters.drive import Running, drive
from truenorth.filters.linearisation import (
    Points,
    decompose,
    finite,
    measure_tangent,
    points,
    predict_tangent,
)
from truenorth.filters.nonlinear_steps import add_noise, are_correlated, copy, keep_point, load_epoch, load_rows
from truenorth.filters.nonlinear_system import (
    Functions,
    NonlinearRuns,
    NonlinearSystem,
    functions_of,
    nonlinear_runs_of,
    require_jacobians,
    require_vector_space,
)
from truenorth.filters.quadrature import QuadratureRule
from truenorth.filters.recursion import (
    LOG_2PI,
    NO_INNOVATION_VARIANCE,
    NOT_FINITE,
    NOT_POSITIVE,
    SOUND,
    Histories,
    Workspace,
    conclude,
    innovate,
    update,
    workspace,
)
from truenorth.filters.robust import squared
from truenorth.filters.sigma_points import cholesky_order
from truenorth.filters.system import Estimates, FilterState


class NumberedRuns(NamedTuple):
    """The arrays of a system, and the number of each run."""

    Q: Array
    R: Array
    z: Array
    x0: Array
    P0: Array
    p: Array
    number: NDArray[np.int64]


@compiled
def predict_particle(
    size: Size,
    functions: Functions,
    order: NDArray[np.int64],
    generator: np.random.Generator,
    i: int,
    w: Workspace,
    s: Points,
    cloud: Cloud,
) -> int:
    """Carry particle i to the epoch: all states, then the draw; the failure, if any."""
    for j in range(len(s.X)):
        s.X[j] = cloud.X[i, j]
    if len(cloud.P) > 0:
        copy(size, cloud.P[i], w.P)
        if not predict_tangent(size, functions, w, s):
            return NOT_FINITE
        add_noise(size, w)
        if not decompose(size, w.P, order, s):
            return NOT_POSITIVE
        copy(size, s.rest, w.P)
    else:  # the noise was decomposed once for all
        functions.transition(s.X, s.p, s.x)
        for j in range(len(s.X)):
            s.X[j] = s.x[j]
        if not finite(s.X):
            return NOT_FINITE
    draw(s, generator)
    return SOUND


@compiled
def weigh_particle(
    size: Size, functions: Functions, w: Workspace, s: Points, linear: bool, nu: Array, W: Array
) -> tuple[int, float]:
    """Condition the linear states on the measurement; the failure, if any, and the log-likelihood."""
    if linear:
        if not measure_tangent(size, functions, w, s):
            return NOT_FINITE, 0.0
        innovate(size, w, nu, W)
        failure, _, log_likelihood = update(size, w, are_correlated(w.R), True)
        for j in range(len(s.X)):
            s.X[j] += w.x[j]
        return failure, log_likelihood
    functions.measurement(s.X, s.p, s.h)
    if not finite(s.h):
        return NOT_FINITE, 0.0
    for r in range(len(nu)):
        w.z[r] -= s.h[r]
        nu[r] = w.z[r]
        for q in range(len(nu)):
            W[r, q] = w.R[r, q]
    nis, present = squared(w.z, w.R)  # leaves the pivots on the diagonal
    log_likelihood = -0.5 * (nis + present * LOG_2PI)
    for r in range(len(nu)):
        if not np.isnan(nu[r]):
            if not w.R[r, r] > 0.0:
                return NO_INNOVATION_VARIANCE, 0.0
            log_likelihood -= 0.5 * np.log(w.R[r, r])
    return SOUND, log_likelihood


@compiled
def particle_run(
    size: Size,
    functions: Functions,
    system: NonlinearRuns,
    run: int,
    epochs: int,
    order: NDArray[np.int64],
    particles: int,
    threshold: float,
    generator: np.random.Generator,
    out: Histories,
) -> None:
    """Particle filter of one run."""
    n, rows, d = system.P0.shape[1], system.z.shape[2], len(order)
    linear = d < n
    w, s = (
        workspace(size, rows),
        points(size, system, QuadratureRule(np.zeros((0, d)), np.zeros(0), np.zeros(0))),
    )
    cloud = cloud_of(size, system, particles, linear)
    mean, covariance = np.zeros(n), np.zeros((n, n))
    nu, W, nu_bar, W_bar = np.zeros(rows), np.zeros((rows, rows)), np.zeros(rows), np.zeros((rows, rows))
    if not start_cloud(size, system, run, order, generator, w, s, cloud, out.memory[run]):
        conclude(out, run, 0, NOT_POSITIVE, 0.0, 0.0)
        return
    for i in range(particles):
        cloud.weight[i] = np.exp(cloud.log_weight[i])
    keep_rows = out.innovation.shape[1] > 0
    for epoch in range(epochs):
        load_epoch(size, system, run, epoch, w, s)
        present = load_rows(size, system, run, epoch, w)
        failure, log_likelihood = SOUND, 0.0
        if not linear and not decompose(size, w.Q, order, s):
            failure = NOT_POSITIVE
        for r in range(rows):
            nu_bar[r] = w.z[r]
            for q in range(rows):
                W_bar[r, q] = 0.0
        for i in range(particles):
            if failure == SOUND:
                failure = predict_particle(size, functions, order, generator, i, w, s, cloud)
            if failure == SOUND and (present > 0 or keep_rows):
                load_rows(size, system, run, epoch, w)
                failure, log_likelihood = weigh_particle(size, functions, w, s, linear, nu, W)
                cloud.log_weight[i] += log_likelihood
                for r in range(rows):
                    cloud.h[i, r] = s.h[r]
                    nu_bar[r] -= cloud.weight[i] * s.h[r]
                    for q in range(rows):
                        W_bar[r, q] += cloud.weight[i] * W[r, q]
            for j in range(n):
                cloud.X[i, j] = s.X[j]
            if linear:
                copy(size, w.P, cloud.P[i])
        nis = 0.0
        if keep_rows:
            for r in range(rows):
                s.h[r] = 0.0
                for i in range(particles):
                    s.h[r] += cloud.weight[i] * cloud.h[i, r]
            for i in range(particles):
                for r in range(rows):
                    for q in range(rows):
                        W_bar[r, q] += cloud.weight[i] * (cloud.h[i, r] - s.h[r]) * (cloud.h[i, q] - s.h[q])
            for r in range(rows):
                out.innovation[run, epoch, r] = nu_bar[r]
                for q in range(rows):
                    out.innovation_covariance[run, epoch, r, q] = W_bar[r, q]
            nis, _ = squared(nu_bar, W_bar)
        log_total = normalise(cloud)
        if failure == SOUND and not np.isfinite(log_total):
            failure = NO_INNOVATION_VARIANCE
        if not conclude(out, run, epoch, failure, nis, log_total):
            return
        squares = 0.0
        for i in range(particles):
            squares += cloud.weight[i] * cloud.weight[i]
        if keep_rows:
            out.adaptation[run, epoch, 0] = 1.0 / squares
        if out.x.shape[1] > 1 or epoch == epochs - 1:
            moments(size, cloud.weight, cloud.X, cloud.P, mean, covariance)
            keep_point(out, run, epoch, epochs - 1, mean, covariance)
        if 1.0 / squares < threshold * particles:
            resample(size, generator, cloud)
    remember_cloud(cloud, out.memory[run])


def particle(
    system: NonlinearSystem,
    state: FilterState | None = None,
    *,
    generators: np.random.Generator | Sequence[np.random.Generator],
    particles: int = 1000,
    nonlinear: Sequence[int] | None = None,
    threshold: float = 0.5,
    **running: Unpack[Running],
) -> Estimates:
    """Particle filter.

    Resampled particles differ again by the process noise only: for states that hardly move, a prior much wider than
    the posterior asks for many particles, and one that is too narrow is not found out. See `adaptation`.

    Parameters
    ----------
    system : NonlinearSystem
        Without retraction; with both Jacobians where `nonlinear` leaves states out.
    state : FilterState, optional
        From an earlier call with the same options, to go on from; its `memory` is the particles. Chunks give the bits
        of one batch if they are given the same generators, which remember where they stand.
    generators : numpy.random.Generator or sequence of them
        One for each run, in the order of the run axes; a run does not depend on how many there are besides it.
    particles : int
    nonlinear : sequence of int, optional
        The states to be drawn; all of them, if not given. The model must be linear in the others once these are given.
    threshold : float
        Resample where the effective sample size falls below this part of the particles.
    **running
        ``history``, ``innovations``, ``workers``: see :class:`truenorth.filters.Running`.

    Returns
    -------
    Estimates
        Mean and covariance of the particles; a mean may stand where no particle does. `adaptation` holds the
        effective sample size before resampling. ``exp(log_likelihood)`` is unbiased.

    Raises
    ------
    UsageError
        An option out of range, a missing Jacobian or generator.
    DataError
        The filter broke down, or no particle explains a measurement at all, naming run and epoch.
    """
    require_vector_space(system, "the particle filter")
    order = cholesky_order(system, nonlinear)
    n, linear = system.states, len(order) < system.states
    if linear:
        require_jacobians(system, "a particle filter with linear states")
    if particles < 2:
        raise UsageError(f"particles is {particles}, expected at least 2")
    if not 0.0 <= threshold <= 1.0:
        raise UsageError(f"threshold is {threshold}, expected a part of the particles between 0 and 1")
    shape = system.runs if state is None else np.broadcast_shapes(system.runs, state.x.shape[:-1])
    count = int(np.prod(shape, dtype=int))
    several = [generators] if isinstance(generators, np.random.Generator) else list(generators)
    if len(several) != count or not all(isinstance(g, np.random.Generator) for g in several):
        raise UsageError(f"generators are {len(several)}, expected one numpy.random.Generator for each of {count} runs")
    if len({id(g.bit_generator) for g in several}) < count:
        raise UsageError("generators: two runs share one, expected a different one for each run")
    functions = functions_of(system)

    def flatten(system: NonlinearSystem, shape: tuple[int, ...]) -> NumberedRuns:
        return NumberedRuns(*nonlinear_runs_of(system, shape), np.arange(count))

    def kernel(size: Size, runs: NumberedRuns, epochs: int, out: Histories) -> None:
        arrays = NonlinearRuns(*runs[:-1])
        for run, number in enumerate(runs.number):
            particle_run(size, functions, arrays, run, epochs, order, particles, threshold, several[number], out)

    return drive(
        kernel,
        system,
        state,
        memory=np.full(particles * (1 + n + (n * n if linear else 0)), np.nan),
        adaptation=1,
        flatten=flatten,
        **running,
    )


def cloud_in(state: FilterState, particles: int) -> tuple[Array, Array]:
    """Weights (..., L) and particles (..., L, n) that a state of :func:`particle` remembers.

    Where the mean means little (an angle that has gone around, two hypotheses) they are what to ask. In linear states a
    particle holds the mean of its normal distribution.
    """
    memory, n = state.memory, state.x.shape[-1]
    X = memory[..., particles : particles * (1 + n)]
    return np.exp(memory[..., :particles]), X.reshape(*memory.shape[:-1], particles, n)
