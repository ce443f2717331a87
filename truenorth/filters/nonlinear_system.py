"""The nonlinear system that every nonlinear filter takes, and the compiled functions that make it.

A model is a handful of small functions of one epoch. Each is decorated with its kind, which declares its signature, so
that kernels take it as a pointer: no kernel is compiled anew for another model::

    @vector_function
    def transition(x, p, out):
        out[0] = x[0] + p[0] * x[1]
        out[1] = x[1]

    @matrix_function
    def transition_jacobian(x, p, out):
        out[0, 0], out[0, 1] = 1.0, p[0]
        out[1, 1] = 1.0

Kernels do not watch bounds; therefore each function is called once in Python, where a wrong index is an error, when a
system is made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from truenorth.core.compiled import Callback
from truenorth.core.errors import DataError, UsageError
from truenorth.filters.stack import Array, System, flatten_runs

VECTOR = "void(float64[::1], float64[::1], float64[::1])"
MATRIX = "void(float64[::1], float64[::1], float64[:, ::1])"


def vector_function(function: Callable[[Array, Array, Array], None]) -> Callback:
    """Declare ``f(x, p, out)`` that fills the vector `out`: a transition, a measurement, a retraction.

    `out` holds anything on entry and is as long as what it stands for; `x` and `p` are not to be changed.
    """
    return Callback(function, VECTOR)


def matrix_function(function: Callable[[Array, Array, Array], None]) -> Callback:
    """Declare ``f(x, p, out)`` that fills the matrix `out`: a Jacobian.

    `out` is zero on entry, so that only the elements that are not zero need be filled.
    """
    return Callback(function, MATRIX)


@vector_function
def added(x: Array, dx: Array, out: Array) -> None:
    """``x + dx``: the retraction of a vector space."""
    for i in range(len(x)):
        out[i] = x[i] + dx[i]


@matrix_function
def not_given(x: Array, p: Array, out: Array) -> None:
    """Stand-in for a Jacobian that a filter does without."""
    out[0, 0] = np.nan


@dataclass(frozen=True)
class NonlinearSystem(System):
    """A nonlinear system with additive Gaussian noise in discrete time, of one run or of many.

    ``x_k = f(x_{k-1}, p_k) + w_k``, ``z_k = h(x_k, p_k) + v_k``, with ``w ~ N(0, Q)``, ``v ~ N(0, R)``; epochs are
    ``k = 0 .. K-1`` and ``x0, P0`` stand *before* epoch 0, which is also predicted.

    Where the state is no vector (an attitude), `retract` says how an error `dx` of n numbers moves a state of s
    numbers; then ``x = retract(x_hat, dx)`` with ``dx ~ N(0, P)``, noise and Jacobians are those of `dx`, and
    ``f(x)`` is disturbed by ``retract(f(x), w)``. Errors chosen as the motion's own (invariant errors) make Jacobians
    that do not depend on the estimate. Data that an invariant innovation needs, such as ``C_hat z - d``, go into `p`,
    with `z` zero.

    Leading axes (shown as ``...``) are runs and broadcast. What does not change in time has a time axis of length 1.

    Parameters
    ----------
    transition : vector function
        ``f(x, p, out)``, of s numbers.
    measurement : vector function
        ``h(x, p, out)``, of m numbers.
    Q : (..., K, n, n) array
        Covariance of the process noise of the interval from k-1 to k.
    R : (..., K, m, m) array
        Covariance of the measurement noise; may be semidefinite.
    z : (..., K, m) array
        Measurements; NaN is an absent row.
    x0 : (..., s) array
    P0 : (..., n, n) array
    p : (..., K, q) array, optional
        Parameters of each epoch: what the functions need to know besides the state (intervals, rates, known inputs).
    transition_jacobian : matrix function, optional
        ``df/dx``, (n, n); for the extended filters, and for all that treat a part of the states as linear.
    measurement_jacobian : matrix function, optional
        ``dh/dx``, (m, n).
    retract : vector function, optional
        ``retract(x, dx, out)``, of s numbers; without it ``x + dx``, and s = n.

    Raises
    ------
    UsageError
        Shapes that do not fit or a function that is not compiled or reaches beyond its arrays, naming the argument.
    DataError
        A non-finite number, an asymmetric or indefinite covariance, naming the argument, run and epoch.
    """

    transition: Callback
    measurement: Callback
    Q: Array
    R: Array
    z: Array
    x0: Array
    P0: Array
    p: Array | None = None
    transition_jacobian: Callback | None = None
    measurement_jacobian: Callback | None = None
    retract: Callback | None = None

    @property
    def axes(self) -> Mapping[str, str]:
        """Axes of each array behind the leading (run) axes."""
        x = "n" if self.retract is None else "s"
        return {"Q": "Knn", "R": "Kmm", "z": "Km", "x0": x, "P0": "nn", "p": "Kq"}

    def __post_init__(self) -> None:
        """Convert and check all arrays, and try all functions."""
        super().__post_init__()
        x = self.x0[(0,) * (self.x0.ndim - 1)].copy()
        p = np.zeros(0) if self.p is None else self.p[(0,) * (self.p.ndim - 1)].copy()
        n, m = self.states, self.rows
        _try("transition", self.transition, VECTOR, x, p, x.shape)
        _try("measurement", self.measurement, VECTOR, x, p, (m,))
        if self.transition_jacobian is not None:
            _try("transition_jacobian", self.transition_jacobian, MATRIX, x, p, (n, n))
        if self.measurement_jacobian is not None:
            _try("measurement_jacobian", self.measurement_jacobian, MATRIX, x, p, (m, n))
        if self.retract is not None:
            _try("retract", self.retract, VECTOR, x, np.zeros(n), x.shape)


class Functions(NamedTuple):
    """The functions of a system as the kernels take them."""

    transition: Any
    transition_jacobian: Any
    measurement: Any
    measurement_jacobian: Any
    retract: Any


class NonlinearRuns(NamedTuple):
    """The arrays of a system as the kernels take them: one run axis in front, of length 1 where all runs share."""

    Q: Array
    R: Array
    z: Array
    x0: Array
    P0: Array
    p: Array


def functions_of(system: NonlinearSystem) -> Functions:
    """The functions of a system, with stand-ins for those not given."""
    return Functions(
        system.transition.compiled,
        (system.transition_jacobian or not_given).compiled,
        system.measurement.compiled,
        (system.measurement_jacobian or not_given).compiled,
        (system.retract or added).compiled,
    )


def nonlinear_runs_of(system: NonlinearSystem, shape: tuple[int, ...]) -> NonlinearRuns:
    """Bring each array of a system to ``(B or 1, ...)``, contiguous and read-only (one type for the kernels)."""
    flat = {}
    for name, axes in system.axes.items():
        value = getattr(system, name)
        flat[name] = flatten_runs(np.zeros((1, 0)) if value is None else value, len(axes), shape)
    return NonlinearRuns(**flat)


def require_jacobians(system: NonlinearSystem, reason: str) -> None:
    """Refuse a system without Jacobians.

    Raises
    ------
    UsageError
        Naming the one that is missing.
    """
    for name in ("transition_jacobian", "measurement_jacobian"):
        if getattr(system, name) is None:
            raise UsageError(f"NonlinearSystem: {name} is not given, but {reason} needs it")


def require_vector_space(system: NonlinearSystem, reason: str) -> None:
    """Refuse a system whose state is no vector.

    Raises
    ------
    UsageError
        The system has a retraction.
    """
    if system.retract is not None:
        raise UsageError(f"NonlinearSystem: retract is given, but {reason} is for vector states; use extended")


def _try(name: str, function: Any, signature: str, x: Array, p: Array, shape: tuple[int, ...]) -> None:
    """Call a function in Python at the first epoch, where a wrong index is an error, not a wrong number."""
    kind = "vector_function" if signature == VECTOR else "matrix_function"
    if not isinstance(function, Callback) or function.signature != signature:
        raise UsageError(
            f"NonlinearSystem: {name} is {function!r}, expected a function decorated with truenorth.filters.{kind}"
        )
    out = np.zeros(shape)
    if signature == VECTOR:
        out[:] = np.nan
    before = x.copy(), p.copy()
    try:
        function(x, p, out)
    except (IndexError, ValueError) as error:
        raise UsageError(
            f"NonlinearSystem: {name} does not fit the arrays it is given, x of {len(x)} numbers, "
            f"{'dx' if name == 'retract' else 'p'} of {len(p)} and out of shape {shape}: {error}"
        ) from None
    if not (np.array_equal(x, before[0]) and np.array_equal(p, before[1])):
        raise UsageError(f"NonlinearSystem: {name} changes its arguments; it may write to out only")
    if not np.isfinite(out).all():
        index = ", ".join(str(i) for i in np.argwhere(~np.isfinite(out))[0])
        raise DataError(
            f"NonlinearSystem: {name} leaves out[{index}] not finite at epoch 0 for the state x0; expected it to fill "
            "all of out with finite numbers"
        )
