"""What linear and nonlinear systems share: arrays over runs and epochs that belong together, checked once."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.compiled import compiled
from truenorth.core.errors import DataError, UsageError

Array = NDArray[np.float64]
S = TypeVar("S", bound="System")

ASYMMETRY = 1e-9  # of a covariance, relative to the two variances; more is a mistake, less is rounding
NEGATIVE = 1e-9  # of a covariance's smallest pivot, relative to its variance: rounding
SOUND, NEGATIVE_VARIANCE, ASYMMETRIC, NEGATIVE_MINOR, NEGATIVE_PIVOT = range(5)  # what a covariance can be


class System(ABC):
    """Base of frozen dataclasses with fields that are arrays of numbers: leading axes are runs, then time, then rows.

    A subclass says by `axes` which fields are arrays and what their axes behind the runs are, a letter each: K is time
    (of length 1 for what does not change), any other letter is a length that all fields share.
    """

    x0: Array
    P0: Array
    z: Array

    @property
    @abstractmethod
    def axes(self) -> Mapping[str, str]:
        """Axes of each array behind the leading (run) axes."""

    def __post_init__(self) -> None:
        """Convert and check all arrays."""
        self._take({name: getattr(self, name) for name in self.axes}, dict.fromkeys(self.axes))

    def _take(self, arrays: Mapping[str, Array | None], before: Mapping[str, Array | None]) -> None:
        """Convert these arrays, take them, and check them; `before` are those that stood in their place."""
        for name, value in arrays.items():
            if value is None:
                object.__setattr__(self, name, None)
                continue
            axes = self.axes[name]
            array = _floats(self._owner, name, value)
            if array.ndim < len(axes):
                shape = _shape_text(axes)
                hint = " (a constant matrix needs a time axis of length 1)" if axes[0] == "K" else ""
                raise UsageError(f"{self._owner}: {name} has shape {array.shape}, expected {shape}{hint}")
            object.__setattr__(self, name, array)
        if any(_shape_of(before[name]) != _shape_of(getattr(self, name)) for name in before):
            self._check_shapes()
        for name, value in arrays.items():
            if value is not None:
                _check_finite(self._owner, name, self.axes[name], getattr(self, name))
        for name in ("Q", "R", "P0"):
            if name in arrays:
                _check_covariance(self._owner, name, self.axes[name], getattr(self, name))

    @property
    def states(self) -> int:
        """Number of states, n."""
        return int(self.P0.shape[-1])

    @property
    def rows(self) -> int:
        """Number of measurement rows, m."""
        return int(self.z.shape[-1])

    @property
    def epochs(self) -> int:
        """Number of epochs, K."""
        if self.z.shape[-2] > 1:  # whatever is of one epoch goes with it
            return int(self.z.shape[-2])
        axes = self.axes
        return max(a.shape[-len(axes[name])] for name, a in self._arrays() if axes[name][0] == "K")

    @property
    def runs(self) -> tuple[int, ...]:
        """Shape of the run axes; ``()`` for a single run."""
        axes, arrays = self.axes, self._arrays()
        of_runs = [name for name, a in arrays if a.ndim > len(axes[name])]
        if not of_runs:
            return ()
        return np.broadcast_shapes(*(a.shape[: a.ndim - len(axes[name])] for name, a in arrays))

    def with_arrays(self: S, **arrays: Array | None) -> S:
        """The same system with other arrays of some names; these alone are checked."""
        other = copy(self)
        other._take(arrays, {name: getattr(self, name) for name in arrays})
        return other

    def with_made(self: S, **arrays: Array | None) -> S:
        """The same system with other arrays that the caller made himself of sound ones: nothing is converted or checked.

        Parameters
        ----------
        **arrays
            Contiguous, of doubles, finite, in shapes that fit; covariances as they must be.
        """
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        other.__dict__.update(arrays)
        return other

    def between(self: S, start: int, stop: int) -> S:
        """Epochs ``start <= k < stop``; go on from the state that a filter left behind epoch ``start - 1``."""
        cut = {}
        for name, a in self._arrays():
            time = -len(self.axes[name])
            if self.axes[name][0] == "K" and a.shape[time] > 1:
                cut[name] = a[(Ellipsis, slice(start, stop)) + (slice(None),) * (-time - 1)]
        return replace(self, **cut)  # type: ignore[type-var]

    def _arrays(self) -> list[tuple[str, Array]]:
        return [(name, a) for name in self.axes if (a := getattr(self, name)) is not None]

    @property
    def _owner(self) -> str:
        return type(self).__name__

    def _check_shapes(self) -> None:
        sizes, owner = {"K": 1}, {"K": ""}
        for name in ("x0", "P0", "z"):  # a length is as the first of these says that has it
            array = getattr(self, name)
            for axis, length in zip(self.axes[name], array.shape[array.ndim - len(self.axes[name]) :]):
                if axis not in sizes:
                    sizes[axis], owner[axis] = length, name
        if self.x0.shape[-1] == 0:
            raise UsageError(f"{self._owner}: x0 has no states")
        for name, a in self._arrays():
            for axis, length in zip(self.axes[name], a.shape[a.ndim - len(self.axes[name]) :]):
                if axis == "K" and length == 0:
                    raise UsageError(f"{self._owner}: {name} has no epochs, shape {a.shape}")
                if axis not in sizes or (axis == "K" and sizes["K"] == 1):
                    sizes[axis], owner[axis] = length, name
                elif length != sizes[axis] and not (axis == "K" and length == 1):
                    raise UsageError(
                        f"{self._owner}: {name} has shape {a.shape}, expected {_shape_text(self.axes[name])} with "
                        f"{axis} = {sizes[axis]} as in {owner[axis]}" + (" or 1" if axis == "K" else "")
                    )
        try:
            _ = self.runs
        except ValueError:
            shapes = ", ".join(f"{name} {a.shape}" for name, a in self._arrays())
            raise UsageError(f"{self._owner}: the run axes do not broadcast: {shapes}") from None


def flatten_runs(a: Array, core: int, shape: tuple[int, ...]) -> Array:
    """One run axis in front of the last `core` axes: of length 1 if all runs share `a`, else their number."""
    if a.ndim == core and a.flags.c_contiguous:
        flat = a[None]
        flat.flags.writeable = False
        return flat
    lead, tail = a.shape[: a.ndim - core], a.shape[a.ndim - core :]
    if any(length != 1 for length in lead):
        a = np.broadcast_to(a, shape + tail)
        lead = shape
    flat = np.ascontiguousarray(a).reshape((math.prod(lead), *tail)).view()
    flat.flags.writeable = False
    return flat


def _floats(owner: str, name: str, value: ArrayLike) -> Array:
    try:
        return np.ascontiguousarray(value, dtype=np.float64) if np.ndim(value) else np.asarray(value, float)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{owner}: {name} is not an array of numbers ({error})") from None


def _shape_of(a: Array | None) -> tuple[int, ...]:
    return () if a is None else a.shape


def _shape_text(axes: str) -> str:
    return "(..., " + ", ".join(axes) + ")"


def _where(axes: str, index: tuple[int, ...]) -> str:
    """Index of an element in words: `epoch 12 of run (3,), row 0`."""
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


def _check_finite(owner: str, name: str, axes: str, a: Array) -> None:
    # A finite sum has finite terms: one pass, no temporary; only where it fails is the culprit looked for.
    with np.errstate(over="ignore", invalid="ignore"):
        if name != "z" and np.isfinite(a.sum()):
            return
    bad = np.isinf(a) if name == "z" else ~np.isfinite(a)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        allowed = " (NaN, for an absent row, is allowed)" if name == "z" else ""
        raise DataError(f"{owner}: {name} is {a[index]} at {_where(axes, index)}, expected a finite number{allowed}")


def _check_covariance(owner: str, name: str, axes: str, a: Array) -> None:
    """Symmetric and positive semidefinite, each matrix of the stack; `Q` by its variances and 2x2 minors only."""
    n = a.shape[-1]
    fault, k, i, j, value = _first_fault(np.ascontiguousarray(a).reshape(-1, n, n), name != "Q", np.empty((n, n)))
    if fault == SOUND:
        return
    before = tuple(int(x) for x in np.unravel_index(k, a.shape[:-2]))
    here, mirrored = (*before, i, j), (*before, j, i)
    place = _where(axes, here)
    if fault == NEGATIVE_VARIANCE:
        raise DataError(f"{owner}: {name} has the variance {value} at {place}, expected a positive semidefinite matrix")
    if fault == NEGATIVE_PIVOT:
        raise DataError(
            f"{owner}: {name} is not positive semidefinite at {place}: "
            f"given the rows before it, a variance of {value} of the given one is left"
        )
    text = "is not symmetric" if fault == ASYMMETRIC else "is not positive semidefinite"
    raise DataError(
        f"{owner}: {name} {text} at {place}: {a[here]} there, {a[mirrored]} in its "
        f"mirror image, variances {a[(*before, i, i)]} and {a[(*before, j, j)]}"
    )


@compiled
def _first_fault(a: Any, pivots: bool, work: Any) -> Any:
    """Fault, matrix, row, column and figure of the first that is found in (M, n, n) symmetric matrices.

    Variances, then both halves, then minors of two rows, then (with `pivots`) those of ``L D L'`` of the correlation
    matrix, which need (n, n) `work`.
    """
    count, n = a.shape[0], a.shape[1]
    for k in range(count):
        for i in range(n):
            if a[k, i, i] < 0.0:
                return NEGATIVE_VARIANCE, k, i, i, a[k, i, i]
    for fault in (ASYMMETRIC, NEGATIVE_MINOR):
        for k in range(count):
            for i in range(n):
                for j in range(i):
                    scale = np.sqrt(a[k, i, i] * a[k, j, j])
                    if fault == ASYMMETRIC:
                        bad = abs(a[k, i, j] - a[k, j, i]) > ASYMMETRY * scale
                    else:
                        bad = abs(a[k, i, j]) > (1.0 + NEGATIVE) * scale
                    if bad:
                        return fault, k, i, j, a[k, i, j]
    if pivots:
        for k in range(count):
            row = _negative_pivot(a[k], work)
            if row >= 0:
                return NEGATIVE_PIVOT, k, row, row, work[row, row]
    return SOUND, 0, 0, 0, 0.0


@compiled
def _negative_pivot(P: Any, A: Any) -> int:
    """Row of the first negative pivot of the correlation matrix of `P`, which stands in `A` then; -1 without one."""
    n = P.shape[0]
    for i in range(n):
        for j in range(n):
            scale = np.sqrt((P[i, i] if P[i, i] > 0.0 else 1.0) * (P[j, j] if P[j, j] > 0.0 else 1.0))
            A[i, j] = P[i, j] / scale
    for j in range(n):
        if A[j, j] < -NEGATIVE * (j + 1):
            return j
        if A[j, j] > NEGATIVE:
            for i in range(j + 1, n):
                share = A[i, j] / A[j, j]
                for m in range(j + 1, n):
                    A[i, m] -= share * A[j, m]
    return -1
