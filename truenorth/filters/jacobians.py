"""Are the Jacobians of a model right? Held against central finite differences of the functions themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truenorth.core.compiled import Callback
from truenorth.core.errors import DataError, UsageError
from truenorth.filters.nonlinear_system import NonlinearSystem, added
from truenorth.filters.sigma_points import cholesky_order
from truenorth.filters.stack import Array

STEP = 1e-4  # of a sigma: truncation about 1e-9 of what the function bends within a sigma


@dataclass(frozen=True)
class JacobianCheck:
    """Largest errors found, as parts of what the row's value scatters over one sigma of the states.

    Parameters
    ----------
    transition, measurement : float
        NaN where the system has no such Jacobian.
    """

    transition: float
    measurement: float


def check_jacobians(
    system: NonlinearSystem,
    generator: np.random.Generator,
    *,
    points: int = 10,
    tolerance: float = 1e-6,
    nonlinear: Sequence[int] | None = None,
) -> JacobianCheck:
    """Compare Jacobians with central differences, at states drawn from the prior and epochs drawn from all.

    Parameters
    ----------
    system : NonlinearSystem
        Its `P0` sets the scale of each state; a state with no variance is moved by 1e-6 of itself (or of 1).
    generator : numpy.random.Generator
    points : int
        States to be drawn, besides `x0` itself.
    tolerance : float
        Largest error allowed, in the measure of :class:`JacobianCheck`, besides what rounding explains.
    nonlinear : sequence of int, optional
        Also test that the columns of all other states do not change with these other states: that the model is
        conditionally linear, as the filters with `nonlinear` need it.

    Raises
    ------
    DataError
        An element is wrong, naming the Jacobian, element, epoch, state, and both values.
    UsageError
        No point, or no Jacobian at all.
    """
    if points < 0:
        raise UsageError(f"points is {points}, expected at least 0")
    if system.transition_jacobian is None and system.measurement_jacobian is None:
        raise UsageError("NonlinearSystem: neither transition_jacobian nor measurement_jacobian is given")
    run = (0,) * len(system.runs)
    x0 = np.broadcast_to(system.x0, (*system.runs, system.x0.shape[-1]))[run].copy()
    P0 = np.broadcast_to(system.P0, (*system.runs, system.states, system.states))[run]
    sigma = np.sqrt(np.diagonal(P0)).copy()
    size = np.abs(x0) if system.retract is None else np.zeros(system.states)
    sigma = np.where(sigma > 0.0, sigma, 1e-6 * np.maximum(size, 1.0) / STEP)
    retract = system.retract or added
    linear = None if nonlinear is None else np.setdiff1d(np.arange(system.states), cholesky_order(system, nonlinear))
    worst = {"transition": np.nan, "measurement": np.nan}
    for point in range(points + 1):
        dx = np.zeros(system.states) if point == 0 else sigma * generator.standard_normal(system.states)
        epoch = int(generator.integers(system.epochs))
        x, p = _moved(retract, x0, dx), _parameters(system, epoch)
        for name, function, jacobian, rows in (
            ("transition", system.transition, system.transition_jacobian, system.states),
            ("measurement", system.measurement, system.measurement_jacobian, system.rows),
        ):
            if jacobian is None:
                continue
            is_state = name == "transition"
            J = _filled(jacobian, x, p, (rows, system.states))
            D, rounding = _differences(function, retract, x, p, sigma, len(x) if is_state else rows, is_state)
            scale = np.abs(D) @ sigma
            error = np.abs(J - D) * sigma
            relative = np.divide(
                error, scale[:, None], out=np.where(error > rounding, np.inf, 0.0), where=scale[:, None] > 0
            )
            excess = error - rounding - tolerance * scale[:, None]
            if not (excess <= 0.0).all():
                i, j = np.unravel_index(int(np.argmax(np.where(np.isnan(excess), np.inf, excess))), excess.shape)
                raise DataError(
                    f"NonlinearSystem: {name}_jacobian has {J[i, j]:.9g} in element [{i}, {j}] at epoch {epoch}, but a "
                    f"central difference gives {D[i, j]:.9g}, at the state {np.array2string(x, precision=6)}"
                )
            worst[name] = np.nanmax([worst[name], relative.max()])
            if linear is not None:
                other = x.copy()
                other[linear] += sigma[linear] * generator.standard_normal(len(linear))
                change = np.abs(_filled(jacobian, other, p, J.shape) - J)[:, linear] * sigma[linear]
                if (change > tolerance * scale[:, None]).any():
                    i, j = np.argwhere(change > tolerance * scale[:, None])[0]
                    raise DataError(
                        f"NonlinearSystem: {name}_jacobian changes in element [{i}, {linear[j]}] at epoch {epoch} with "
                        f"the states that are said to be linear; name all nonlinear states (now {list(nonlinear or [])})"
                    )
    return JacobianCheck(worst["transition"], worst["measurement"])


def _differences(
    function: Callback, retract: Callback, x: Array, p: Array, sigma: Array, length: int, is_state: bool
) -> tuple[Array, Array]:
    """Central differences, in errors where the function gives a state, and what rounding does to them times sigma."""
    columns, rounding = [], []
    y = _filled(function, x, p, (length,))
    # Errors of a state near y from the numbers of the state: the inverse of the retraction's own derivative.
    E = np.eye(length)
    if is_state:
        steps = [1e-6 * np.eye(len(sigma))[j] for j in range(len(sigma))]
        E = np.linalg.pinv(np.stack([(_moved(retract, y, d) - _moved(retract, y, -d)) / 2e-6 for d in steps], axis=1))
    for j in range(len(sigma)):
        dx = np.zeros(len(sigma))
        dx[j] = STEP * sigma[j]
        ahead = _filled(function, _moved(retract, x, dx), p, (length,))
        behind = _filled(function, _moved(retract, x, -dx), p, (length,))
        columns.append(E @ (ahead - behind) / (2.0 * dx[j]))
        lost = np.finfo(float).eps * (np.abs(ahead) + np.abs(behind) + np.abs(y))
        rounding.append(np.abs(E) @ lost * 4.0 / STEP)
    return np.stack(columns, axis=1), np.stack(rounding, axis=1)


def _moved(retract: Callback, x: Array, dx: Array) -> Array:
    out = np.empty_like(x)
    retract(x, dx, out)
    return out


def _filled(function: Callback, x: Array, p: Array, shape: tuple[int, ...]) -> Array:
    out = np.zeros(shape)
    function(x, p, out)
    return out


def _parameters(system: NonlinearSystem, epoch: int) -> Array:
    if system.p is None:
        return np.zeros(0)
    p = system.p[(0,) * (system.p.ndim - 2)]
    return p[epoch if len(p) > 1 else 0].copy()
