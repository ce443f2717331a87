"""The linear system that every filter takes, and the estimates that every filter gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.core.shown import Shown
from truenorth.filters.stack import Array, System, flatten_runs

if TYPE_CHECKING:
    import pandas as pd

# Axes of each argument behind the leading (run) axes.
AXES: dict[str, str] = {
    "Phi": "Knn",
    "Q": "Knn",
    "H": "Kmn",
    "R": "Kmm",
    "z": "Km",
    "x0": "n",
    "P0": "nn",
    "u": "Kn",
    "S": "Knm",
}


@dataclass(frozen=True)
class LinearSystem(System):
    """A linear, Gaussian system in discrete time, of one run or of many.

    ``x_k = Phi_k x_{k-1} + u_k + w_k``, ``z_k = H_k x_k + v_k``, with ``w ~ N(0, Q)``, ``v ~ N(0, R)``,
    ``E[w_k v_k'] = S_k``; epochs are ``k = 0 .. K-1`` and ``x0, P0`` stand *before* epoch 0, which is also predicted.

    Leading axes (shown as ``...``) are runs and broadcast. What does not change in time has a time axis of length 1.

    Parameters
    ----------
    Phi : (..., K, n, n) array
        Transition from epoch k-1 to k.
    Q : (..., K, n, n) array
        Covariance of the process noise of that interval.
    H : (..., K, m, n) array
        Measurement matrix.
    R : (..., K, m, m) array
        Covariance of the measurement noise; may be semidefinite.
    z : (..., K, m) array
        Measurements; NaN is an absent row.
    x0 : (..., n) array
    P0 : (..., n, n) array
    u : (..., K, n) array, optional
        Known input, added in the prediction.
    S : (..., K, n, m) array, optional
        Covariance between the process noise of interval k and the measurement noise at k.

    Raises
    ------
    UsageError
        Shapes that do not fit, naming the argument.
    DataError
        A non-finite number, an asymmetric or indefinite covariance, naming the argument, run and epoch.
    """

    Phi: Array
    Q: Array
    H: Array
    R: Array
    z: Array
    x0: Array
    P0: Array
    u: Array | None = None
    S: Array | None = None

    @property
    def axes(self) -> Mapping[str, str]:
        """Axes of each array behind the leading (run) axes."""
        return AXES


@dataclass(frozen=True)
class FilterState:
    """All that a filter needs to go on: pass it as ``state=`` with the next epochs.

    Parameters
    ----------
    x : (..., n) array
    P : (..., n, n) array
    log_likelihood : (...) array
        Of all measurements up to here.
    memory : (..., a) array
        What an adaptive filter remembers besides; of length 0 for others.
    """

    x: Array
    P: Array
    log_likelihood: Array
    memory: Array


@dataclass(frozen=True, repr=False)
class Estimates(Shown):
    """What a filter found. Time axes hold every epoch where the history was asked for, else the last one only.

    Parameters
    ----------
    x : (..., K or 1, n) array
        State after the measurement.
    sigma : (..., K or 1, n) array
        Its standard deviations.
    P : (..., K or 1, n, n) array
        Its covariance.
    innovation : (..., K or 0, m) array
        ``z - H x_predicted``; NaN where the row is absent.
    innovation_covariance : (..., K or 0, m, m) array
        ``H P H' + H S + S' H' + R`` of all rows, present or not.
    nis : (..., K or 0) array
        Normalised innovation squared of the rows present; 0 without any.
    log_likelihood : (...) array
        Of all measurements since the state's beginning.
    state : FilterState
        To go on from.
    adaptation : (..., K or 0, f) array
        What an adaptive filter chose at each epoch (its docstring says what); of width 0 for others.
    """

    x: Array
    sigma: Array
    P: Array
    innovation: Array
    innovation_covariance: Array
    nis: Array
    log_likelihood: Array
    state: FilterState
    adaptation: Array

    @property
    def nis_rows(self) -> NDArray[np.int64]:
        """(..., K or 0) rows present: the degrees of freedom of `nis`."""
        return np.sum(np.isfinite(self.innovation), axis=-1)

    def in_brief(self) -> dict[str, str]:
        """Runs, epochs and states, and the mean NIS over its rows."""
        *runs, epochs, states = self.x.shape
        shown = {"runs": " x ".join(map(str, runs)) or "1", "epochs": str(epochs), "states": str(states)}
        rows = int(self.nis_rows.sum())
        return shown | ({"NIS over rows": f"{float(np.sum(self.nis)) / rows:.3f}"} if rows else {})

    def to_frame(self) -> pd.DataFrame:
        """States and their sigmas at each epoch kept: ``x_0, sigma_0, ...``, and ``nis``; index run and epoch, or epoch alone."""
        import pandas as pd

        states, epochs = self.x.shape[-1], self.x.shape[-2]
        columns: dict[str, Array] = {}
        for i in range(states):
            columns[f"x_{i}"] = self.x[..., i].reshape(-1)
            if self.sigma.shape[:-1] == self.x.shape[:-1]:
                columns[f"sigma_{i}"] = self.sigma[..., i].reshape(-1)
        if self.nis.shape == self.x.shape[:-1]:
            columns["nis"] = self.nis.reshape(-1)
        runs = [f"run_{i}" for i in range(self.x.ndim - 2)]
        index = pd.MultiIndex.from_product([range(n) for n in (*self.x.shape[:-2], epochs)], names=[*runs, "epoch"])
        return pd.DataFrame(columns, index=index if runs else pd.RangeIndex(epochs, name="epoch"))


class Runs(NamedTuple):
    """A system as the kernels take it: one run axis in front, of length 1 where all runs share."""

    Phi: Array
    Q: Array
    H: Array
    R: Array
    z: Array
    x0: Array
    P0: Array
    u: Array
    S: Array


def runs_of(system: LinearSystem, shape: tuple[int, ...]) -> Runs:
    """Bring each array of a system to ``(B or 1, ...)``, contiguous and read-only (one type for the kernels)."""
    u = np.zeros((1, system.states)) if system.u is None else system.u
    S = np.zeros((1, system.states, system.rows)) if system.S is None else system.S
    given = (system.Phi, system.Q, system.H, system.R, system.z, system.x0, system.P0, u, S)
    return Runs._make([flatten_runs(a, len(axes), shape) for a, axes in zip(given, AXES.values(), strict=True)])
