"""The linear system that every filter takes, and the estimates that every filter gives."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.errors import DataError, UsageError

Array = NDArray[np.float64]

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
ASYMMETRY = 1e-9  # of a covariance, relative to the two variances; more is a mistake, less is rounding
NEGATIVE = 1e-9  # of a covariance's smallest pivot, relative to its variance: rounding


@dataclass(frozen=True)
class LinearSystem:
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

    def __post_init__(self) -> None:
        for name, axes in AXES.items():
            value = getattr(self, name)
            if value is None:
                continue
            array = _floats(name, value)
            if array.ndim < len(axes):
                shape = _shape_text(axes)
                hint = " (a constant matrix needs a time axis of length 1)" if axes[0] == "K" else ""
                raise UsageError(f"LinearSystem: {name} has shape {array.shape}, expected {shape}{hint}")
            object.__setattr__(self, name, array)
        self._check_shapes()
        for name in AXES:
            value = getattr(self, name)
            if value is not None:
                _check_finite(name, value)
        for name in ("Q", "R", "P0"):
            _check_covariance(name, getattr(self, name))

    @property
    def states(self) -> int:
        """Number of states, n."""
        return int(self.x0.shape[-1])

    @property
    def rows(self) -> int:
        """Number of measurement rows, m."""
        return int(self.z.shape[-1])

    @property
    def epochs(self) -> int:
        """Number of epochs, K."""
        return max(a.shape[-len(AXES[name])] for name, a in self._arrays() if AXES[name][0] == "K")

    @property
    def runs(self) -> tuple[int, ...]:
        """Shape of the run axes; ``()`` for a single run."""
        return np.broadcast_shapes(*(a.shape[: a.ndim - len(AXES[name])] for name, a in self._arrays()))

    def between(self, start: int, stop: int) -> LinearSystem:
        """Epochs ``start <= k < stop``; go on from the state that a filter left behind epoch ``start - 1``."""
        cut = {}
        for name, a in self._arrays():
            time = -len(AXES[name])
            if AXES[name][0] == "K" and a.shape[time] > 1:
                cut[name] = a[(Ellipsis, slice(start, stop)) + (slice(None),) * (-time - 1)]
        return replace(self, **cut)

    def _arrays(self) -> list[tuple[str, Array]]:
        return [(f.name, getattr(self, f.name)) for f in fields(self) if getattr(self, f.name) is not None]

    def _check_shapes(self) -> None:
        sizes = {"n": self.x0.shape[-1], "m": self.z.shape[-1], "K": 1}
        owner = {"n": "x0", "m": "z", "K": ""}
        if sizes["n"] == 0:
            raise UsageError("LinearSystem: x0 has no states")
        for name, a in self._arrays():
            for axis, length in zip(AXES[name], a.shape[a.ndim - len(AXES[name]) :]):
                if axis == "K" and length == 0:
                    raise UsageError(f"LinearSystem: {name} has no epochs, shape {a.shape}")
                if axis == "K" and sizes["K"] == 1:
                    sizes["K"], owner["K"] = length, name
                elif length != sizes[axis] and not (axis == "K" and length == 1):
                    raise UsageError(
                        f"LinearSystem: {name} has shape {a.shape}, expected {_shape_text(AXES[name])} with "
                        f"{axis} = {sizes[axis]} as in {owner[axis]}" + (" or 1" if axis == "K" else "")
                    )
        try:
            _ = self.runs
        except ValueError:
            shapes = ", ".join(f"{name} {a.shape}" for name, a in self._arrays())
            raise UsageError(f"LinearSystem: the run axes do not broadcast: {shapes}") from None


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
        What an adaptive filter remembers beside; of length 0 for others.
    """

    x: Array
    P: Array
    log_likelihood: Array
    memory: Array


@dataclass(frozen=True)
class Estimates:
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
    zero = {"u": np.zeros((1, system.states)), "S": np.zeros((1, system.states, system.rows))}
    flat = {}
    for name, axes in AXES.items():
        value = getattr(system, name)
        flat[name] = flatten_runs(zero[name] if value is None else value, len(axes), shape)
    return Runs(**flat)


def flatten_runs(a: Array, core: int, shape: tuple[int, ...]) -> Array:
    """One run axis in front of the last `core` axes: of length 1 if all runs share `a`, else their number."""
    lead, tail = a.shape[: a.ndim - core], a.shape[a.ndim - core :]
    if any(length != 1 for length in lead):
        a = np.broadcast_to(a, shape + tail)
        lead = shape
    flat = np.ascontiguousarray(a).reshape((int(np.prod(lead, dtype=int)), *tail)).view()
    flat.flags.writeable = False
    return flat


def _floats(name: str, value: ArrayLike) -> Array:
    try:
        return np.ascontiguousarray(value, dtype=np.float64) if np.ndim(value) else np.asarray(value, float)
    except (TypeError, ValueError) as error:
        raise UsageError(f"LinearSystem: {name} is not an array of numbers ({error})") from None


def _shape_text(axes: str) -> str:
    return "(..., " + ", ".join(axes) + ")"


def _where(name: str, index: tuple[int, ...]) -> str:
    """Index of an element in words: `epoch 12 of run (3,), row 0`."""
    axes = AXES[name]
    lead, core = index[: len(index) - len(axes)], index[len(index) - len(axes) :]
    words = []
    if axes[0] == "K":
        words.append(f"epoch {core[0]}")
        core = core[1:]
    if lead:
        words.append(f"run {', '.join(map(str, lead))}")
    if core:
        words.append(f"element [{', '.join(map(str, core))}]")
    return ", ".join(words)


def _check_finite(name: str, a: Array) -> None:
    # A finite sum has finite terms: one pass, no temporary; only where it fails is the culprit looked for.
    with np.errstate(over="ignore", invalid="ignore"):
        if name != "z" and np.isfinite(a.sum()):
            return
    bad = np.isinf(a) if name == "z" else ~np.isfinite(a)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        allowed = " (NaN, for an absent row, is allowed)" if name == "z" else ""
        raise DataError(
            f"LinearSystem: {name} is {a[index]} at {_where(name, index)}, expected a finite number{allowed}"
        )


def _check_covariance(name: str, a: Array) -> None:
    """Symmetric and positive semidefinite, each matrix of the stack; `Q` by its variances and 2x2 minors only."""
    d = np.diagonal(a, axis1=-2, axis2=-1)
    if (d < 0.0).any():
        index = tuple(int(i) for i in np.argwhere(d < 0.0)[0])
        raise DataError(
            f"LinearSystem: {name} has the variance {d[index]} at {_where(name, (*index, index[-1]))}, "
            "expected a positive semidefinite matrix"
        )
    i, j = np.tril_indices(a.shape[-1], -1)
    lower, upper = a[..., i, j], a[..., j, i]
    if not (lower.any() or upper.any()):
        return
    scale = np.sqrt(d[..., i] * d[..., j])
    for bad, text in (
        (np.abs(lower - upper) > ASYMMETRY * scale, "is not symmetric"),
        (np.abs(lower) > (1.0 + NEGATIVE) * scale, "is not positive semidefinite"),
    ):
        if bad.any():
            at = tuple(int(k) for k in np.argwhere(bad)[0])
            index = (*at[:-1], int(i[at[-1]]), int(j[at[-1]]))
            mirrored = (*index[:-2], index[-1], index[-2])
            raise DataError(
                f"LinearSystem: {name} {text} at {_where(name, index)}: {a[index]} there, {a[mirrored]} in its "
                f"mirror image, variances {a[(*index[:-1], index[-2])]} and {a[(*index[:-2], index[-1], index[-1])]}"
            )
    if name != "Q":
        _check_pivots(name, a, d)


def _check_pivots(name: str, a: Array, d: Array) -> None:
    """No negative pivot in ``L D L'`` of the correlation matrix, for the whole stack at once."""
    sigma = np.sqrt(np.where(d > 0.0, d, 1.0))
    A = a / (sigma[..., :, None] * sigma[..., None, :])
    for j in range(a.shape[-1]):
        pivot = A[..., j, j]
        if (pivot < -NEGATIVE * (j + 1)).any():
            index = tuple(int(k) for k in np.argwhere(pivot < -NEGATIVE * (j + 1))[0])
            raise DataError(
                f"LinearSystem: {name} is not positive semidefinite at {_where(name, (*index, j, j))}: "
                f"given the rows before it, a variance of {pivot[index]} of the given one is left"
            )
        column = A[..., j + 1 :, j] / np.where(pivot > NEGATIVE, pivot, np.inf)[..., None]
        A[..., j + 1 :, j + 1 :] -= column[..., :, None] * A[..., None, j, j + 1 :]
