"""The gain and covariance that a Kalman filter of a constant system settles at.

Source: B. D. O. Anderson, J. B. Moore, *Optimal Filtering*, 1979, chapter 4 (existence, the Riccati equation).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError, UsageError
from truenorth.core.linalg import symmetric
from truenorth.filters.stack import Array
from truenorth.filters.system import LinearSystem

UNSEEN = 1e-9  # of a mode's length: what measurements or noise reach of it; less is rounding
SOLVED = 1e-6  # of each variance: what the equation may miss by


@dataclass(frozen=True)
class SteadyState:
    """Where the filter settles.

    Parameters
    ----------
    gain : (n, m) array
    P : (n, n) array
        After the measurement.
    P_predicted : (n, n) array
    innovation_covariance : (m, m) array
    poles : (n,) complex array
        Of the error, ``(I - K H) Phi``, slowest first; all inside the unit circle.
    """

    gain: Array
    P: Array
    P_predicted: Array
    innovation_covariance: Array
    poles: NDArray[np.complex128]


def steady_state(system: LinearSystem) -> SteadyState:
    """Solve for the steady state of the Kalman filter.

    Parameters
    ----------
    system : LinearSystem
        Of one run, with constant ``Phi, Q, H, R, S``; of `z` only the number of rows matters.

    Raises
    ------
    UsageError
        The system changes in time or has runs.
    DataError
        There is none: a mode that does not die out is not seen, or one on the unit circle is not driven by noise, so
        that the gain goes to zero; the message names the eigenvalue.
    """
    from scipy.linalg import solve_discrete_are

    arrays = {"Phi": system.Phi, "Q": system.Q, "H": system.H, "R": system.R, "S": system.S}
    for name, a in arrays.items():
        if a is not None and (a.ndim > 3 or len(a) > 1):
            raise UsageError(
                f"steady_state: {name} has shape {a.shape}, expected one matrix with a time axis of length 1"
            )
    Phi, Q, H, R = system.Phi[0], system.Q[0], system.H[0], system.R[0]
    S = np.zeros((system.states, system.rows)) if system.S is None else system.S[0]
    _check_modes(Phi, Q, H)
    # Of the predicted covariance; z at k carries the noise of the interval before it, hence the terms of S.
    noise = R + H @ S + S.T @ H.T
    try:
        P = solve_discrete_are(Phi.T, H.T, Q, noise, s=Phi @ S)
    except np.linalg.LinAlgError as error:
        raise DataError(f"steady_state: the Riccati equation has no solution that settles ({error})") from None
    P = symmetric(P)
    cross, W = P @ H.T + S, H @ P @ H.T + noise
    gain = np.linalg.solve(W, cross.T).T
    after = P - gain @ cross.T
    missed = np.abs(np.diag(Phi @ after @ Phi.T + Q - P))
    step = Phi - gain @ H @ Phi
    poles = np.linalg.eigvals(step)
    poles = poles[np.argsort(-np.abs(poles))]
    if np.any(missed > SOLVED * np.diag(P)) or not np.abs(poles[0]) < 1.0:
        raise DataError(
            f"steady_state: the Riccati equation is not solved to better than {np.max(missed / np.diag(P)):.1g}, slowest pole "
            f"{np.abs(poles[0]):.9g}; bring the states to like sizes by other units"
        )
    return SteadyState(gain, symmetric(after), P, W, poles)


def _check_modes(Phi: Array, Q: Array, H: Array) -> None:
    """Test of Popov, Belevitch and Hautus for the modes that do not die out."""
    values, right, left = _modes(Phi)
    for i, value in enumerate(values):
        if abs(value) < 1.0 - 1e-12:
            continue
        v, u = right[:, i], left[:, i]
        if np.linalg.norm(H @ v) <= UNSEEN * np.linalg.norm(np.abs(H) @ np.abs(v)):
            raise DataError(
                f"steady_state: there is none, as the measurements do not see the mode with eigenvalue {_number(value)}, "
                "which does not die out; its variance grows or stays at P0"
            )
        reach = np.sqrt(np.maximum(np.real(np.conj(u) @ Q @ u), 0.0))
        if abs(value) < 1.0 + 1e-12 and reach <= UNSEEN * (np.abs(u) @ np.sqrt(np.diag(Q))):
            raise DataError(
                f"steady_state: there is none with a gain, as no process noise reaches the mode with eigenvalue "
                f"{_number(value)}: it becomes known ever better and its gain goes to zero; give it some noise or leave it out"
            )


def _modes(Phi: Array) -> tuple[Any, Any, Any]:
    from scipy.linalg import eig

    values, left, right = eig(Phi, left=True, right=True)
    return values, right, left


def _number(value: complex) -> str:
    return f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g}{value.imag:+.6g}i"
