"""Which error source makes how much of each sigma? Covariances alone, no simulation.

Each source is carried by itself through the gains that the filter used. If the sources are those of the filter's own
model, the parts add up to its P; if they are others, to what its errors really are (a filter that ignores a source, or
takes it for smaller than it is).

Source: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, sections 7.1 to 7.3 (suboptimal filters, error budgets).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.filters import LinearSystem, kalman
from truenorth.filters.gains import filter_gains, initial_part

Array = NDArray[np.float64]
BudgetHistory = Literal["variance", "full"]
States = slice | Sequence[int]


class Source(NamedTuple):
    """What one source of error contributes; None is nothing.

    Attributes
    ----------
    P0 : (n, n) array, optional
        Initial covariance.
    Q : (K or 1, n, n) array, optional
        Covariance of the process noise.
    R : (K or 1, m, m) array, optional
        Covariance of the measurement noise.
    S : (K or 1, n, m) array, optional
        Covariance of the two.
    """

    P0: Array | None = None
    Q: Array | None = None
    R: Array | None = None
    S: Array | None = None


@dataclass(frozen=True)
class ErrorBudget:
    """Parts of the covariance by source.

    Attributes
    ----------
    sources : tuple of str
    variance : (G, K, n) array
        Part of each state's variance after each epoch.
    P : (G, K or 1, n, n) array
        Part of the covariance, of every epoch with ``history="full"``, else of the last.
    """

    sources: tuple[str, ...]
    variance: Array
    P: Array

    @property
    def sigma(self) -> Array:
        """(K, n) of all sources together."""
        return np.sqrt(self.variance.sum(axis=0))

    @property
    def share(self) -> Array:
        """(G, K, n) part of each source in the variance; they add up to 1."""
        total = self.variance.sum(axis=0)
        return np.divide(self.variance, total, out=np.zeros_like(self.variance), where=total > 0.0)


def error_budget(
    system: LinearSystem, sources: Mapping[str, Source], history: BudgetHistory = "variance"
) -> ErrorBudget:
    """Carry sources of error through the gains of a Kalman filter.

    Parameters
    ----------
    system : LinearSystem
        The filter's model, of one run.
    sources : mapping of str to Source
        Independent of each other; :func:`sources_of` splits the model's own.
    history : "variance" or "full"

    Raises
    ------
    UsageError
        Several runs, no source, or shapes that do not fit.
    """
    if history not in get_args(BudgetHistory):
        raise UsageError(f'history is {history!r}, expected "variance" or "full"')
    if system.runs != ():
        raise UsageError(f"error_budget: the system has runs {system.runs}, expected one run without a run axis")
    if not sources:
        raise UsageError("error_budget: no sources; sources_of(system, groups) gives the model's own")
    gains = filter_gains(system, kalman(system, history="full"))
    gain, keep, step = gains.gain, gains.keep, gains.step
    epochs, n = len(step), system.states
    variance = np.empty((len(sources), epochs, n))
    last: list[Array] = []
    for g, (name, source) in enumerate(sources.items()):
        part = np.zeros((epochs, n, n))
        noise = _noise(name, source, system, gain, keep)
        if noise is not None:
            C = np.zeros((n, n))
            for k in range(epochs):
                C = step[k] @ C @ step[k].T + noise[k]
                part[k] = C
        if source.P0 is not None:
            part += initial_part(step, _fitting(name, "P0", source.P0, system.P0.shape))[0]
        variance[g] = np.diagonal(part, axis1=-2, axis2=-1)
        last.append(part if history == "full" else part[-1:])
    return ErrorBudget(tuple(sources), variance, np.array(last))


def sources_of(system: LinearSystem, groups: Mapping[str, States]) -> dict[str, Source]:
    """Split a model's own uncertainty into initial errors and process noise of groups of states, and measurement noise.

    Parameters
    ----------
    system : LinearSystem
        Of one run.
    groups : mapping of str to slice or indices
        States in no group make one called ``others``.

    Returns
    -------
    dict
        ``NAME, initial``, ``NAME, noise`` and ``measurement noise``, as far as they are not zero; with S, which ties
        process and measurement noise, one source ``noise`` for both.

    Raises
    ------
    UsageError
        A state in two groups, or groups whose initial errors or process noise are correlated.
    """
    n = system.states
    owner = np.full(n, -1)
    names = [*groups, "others"]
    for g, (name, states) in enumerate(groups.items()):
        indices = np.arange(n)[states if isinstance(states, slice) else list(states)]
        if np.any(owner[indices] >= 0):
            twice = int(indices[owner[indices] >= 0][0])
            raise UsageError(f"groups: state {twice} is in {names[owner[twice]]!r} and in {name!r}, expected one group")
        owner[indices] = g
    owner[owner < 0] = len(groups)

    tied = system.S is not None and bool(system.S.any())
    sources = {}
    for key, suffix, matrix in (("P0", "initial", system.P0[None]), ("Q", "noise", system.Q)):
        if key == "Q" and tied:
            continue
        across = (owner[:, None] != owner) & matrix.any(axis=0)
        if across.any():
            i, j = (int(a) for a in np.argwhere(across)[0])
            raise UsageError(
                f"groups: {key} correlates state {i} of {names[owner[i]]!r} with state {j} of {names[owner[j]]!r}; put both "
                "into one group, or give sources of your own"
            )
        for g, name in enumerate(names):
            part = np.where((owner == g)[:, None] & (owner == g), matrix, 0.0)
            if part.any():
                sources[f"{name}, {suffix}"] = Source(P0=part[0]) if key == "P0" else Source(Q=part)
    if tied:
        sources["noise"] = Source(Q=system.Q, R=system.R, S=system.S)
    elif system.R.any():
        sources["measurement noise"] = Source(R=system.R)
    return sources


def _noise(name: str, source: Source, system: LinearSystem, gain: Array, keep: Array) -> Array | None:
    """(K, n, n) what a source adds to its part at each epoch: covariance of ``K v - (I - K H) w``."""
    Kt, keep_t = np.swapaxes(gain, -1, -2), np.swapaxes(keep, -1, -2)
    total: Array | None = None
    if source.Q is not None:
        total = keep @ _fitting(name, "Q", source.Q, system.Q.shape) @ keep_t
    if source.R is not None:
        part = gain @ _fitting(name, "R", source.R, system.R.shape) @ Kt
        total = part if total is None else total + part
    if source.S is not None:
        tie = keep @ _fitting(name, "S", source.S, (1, system.states, system.rows)) @ Kt
        total = (0.0 if total is None else total) - tie - np.swapaxes(tie, -1, -2)
    return total


def _fitting(name: str, key: str, value: Array, shape: tuple[int, ...]) -> Array:
    a = np.asarray(value, dtype=np.float64)
    if a.shape[-2:] != shape[-2:] or a.ndim != len(shape):
        expected = shape if len(shape) == 2 else ("K or 1", *shape[-2:])
        raise UsageError(f"source {name!r}: {key} has shape {a.shape}, expected {expected}")
    return a
