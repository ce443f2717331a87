"""Coarse alignment in the inertial frame: gravity's turn with the earth, seen through the gyros.

The gyros carry frame ``i`` on whatever the base does; integrated specific force in ``i`` against integrated gravity in
``n0`` gives the constant rotation between them, and a base's bounded motion averages out in the integral.

``dual_vector``  two intervals and TRIAD, on velocity or on its integral (position);
``oba``          optimisation-based alignment: the q-method over all intervals, recursively.

Sources: Qin et al. (2005); Wu et al. (2011); see :mod:`truenorth.strapdown.inertial`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.coarse.wahba import davenport_matrices, davenport_of, error_gain, rotation_from_davenport, triad
from truenorth.core.attitude import skew
from truenorth.strapdown.inertial import InertialIntegrals, gravity_position, gravity_velocity

Array = NDArray[np.float64]
Form = Literal["velocity", "position"]
FIRST_PART = 0.4  # of the window: the first vector's end (50 s of 120 s in the paper's scenario)
SEARCH_STEP = np.radians(0.5)


@dataclass(frozen=True)
class CoarseAttitude:
    """A coarse attitude and the way errors of the integrals enter it.

    Attributes
    ----------
    C_n0_i : (3, 3) array
    velocity_gain, position_gain : (K+1, 3, 3) arrays
        ``phi = sum_k (G_v[k] dV[k] + G_p[k] dP[k])`` for errors of integrated velocity and position in ``n0``.
    C_history : (K+1, 3, 3) array or None
        The attitude as known at each epoch (recursive methods).
    """

    C_n0_i: Array
    velocity_gain: Array
    position_gain: Array
    C_history: Array | None = None


def dual_vector(integrals: InertialIntegrals, lat: float, alt: float, form: Form = "velocity") -> CoarseAttitude:
    """TRIAD on the integral up to .4 of the window and on the whole one.

    Parameters
    ----------
    integrals : InertialIntegrals
    lat, alt : float, rad and m
    form : {"velocity", "position"}
        Integrated velocity, or its second integral (smoother, slower).
    """
    last = len(integrals.time) - 1
    rows = np.array([max(1, round(FIRST_PART * last)), last])
    b, r = _vectors(integrals, lat, alt, form)
    # The later, longer vector is the trusted one.
    C = triad(b[rows[1]], b[rows[0]], r[rows[1]], r[rows[0]])
    gain = np.zeros((last + 1, 3, 3))
    gain[rows[::-1]] = _triad_gain(r[rows[1]], r[rows[0]])
    return _as_coarse(C, gain, form)


def oba(
    integrals: InertialIntegrals,
    lat: float,
    alt: float,
    form: Form = "velocity",
    *,
    history: bool = True,
    gains: bool = True,
) -> CoarseAttitude:
    """Optimisation-based alignment: the q-method over the intervals from ``t_k/2`` to ``t_k``, for all k.

    Intervals do not begin at 0, as in the usual form: the base's velocity at that one instant would be in all of
    them and would not average out. Each epoch adds one K matrix, so the running sum gives the attitude at any time.

    Parameters
    ----------
    integrals : InertialIntegrals
    lat, alt : float, rad and m
    form : {"velocity", "position"}
    history : bool
        Whether the attitude of each epoch is wanted.
    gains : bool
        Whether it is wanted how errors enter; without it the gains are of no epoch, (0, 3, 3).

    Returns
    -------
    CoarseAttitude
        With its history, where that is wanted.
    """
    b, r = _vectors(integrals, lat, alt, form)
    ends = np.arange(1, len(b))
    starts = ends // 2
    db, dr = b[1:] - b.take(starts, axis=0), r[1:] - r.take(starts, axis=0)
    weights = np.ones(len(ends))
    K = np.cumsum(davenport_matrices(db, dr, weights), axis=0) if history else davenport_of(dr.T @ db)[None]
    found = rotation_from_davenport(K)
    if not gains:
        return _as_coarse(found[-1], np.zeros((0, 3, 3)), form)
    pair_gain = error_gain(dr, weights)
    gain = np.zeros((len(b), 3, 3))
    np.add.at(gain, ends, pair_gain)
    np.add.at(gain, starts, -pair_gain)
    return _as_coarse(found[-1], gain, form, np.concatenate([found[:1], found]) if history else None)


def estimate_latitude(integrals: InertialIntegrals, alt: float = 0.0) -> float:
    """Latitude (rad) that makes the turn of gravity fit best; its uncertainty: :func:`latitude_gain`.

    Gravity's direction draws a cone about the pole with half angle 90 deg - L. How fast it moves shows ``|L|``; which
    way its track bends, by ``(w_ie t)^2 sin(2L)/4``, shows the hemisphere: .1 mrad after 300 s, so that gyros that
    wander by more than that can return the latitude of the other one.
    """
    from scipy.optimize import minimize_scalar

    b = _half_intervals(integrals.velocity)
    b = b / np.linalg.norm(b, axis=1, keepdims=True)

    def loss(lat: float) -> float:
        r = _half_intervals(-gravity_velocity(integrals.time, lat, alt))
        r = r / np.linalg.norm(r, axis=1, keepdims=True)
        # Wahba's loss of unit vectors is 2 (J - lambda_max), and lambda_max the largest eigenvalue of K.
        return float(len(b) - np.linalg.eigvalsh(davenport_of(r.T @ b))[-1])

    grid = np.arange(-np.pi / 2 + SEARCH_STEP, np.pi / 2, SEARCH_STEP)
    best = grid[int(np.argmin([loss(lat) for lat in grid]))]
    low, high = best - SEARCH_STEP, min(best + SEARCH_STEP, np.pi / 2)
    return float(minimize_scalar(loss, bounds=(low, high), method="bounded", options={"xatol": 1e-9}).x)


def latitude_gain(integrals: InertialIntegrals, lat: float, alt: float) -> Array:
    """How errors of integrated velocity enter the latitude, (K+1, 3): ``dL = sum_k G[k] . dV[k]``.

    Least squares for ``[phi, dL]`` on ``delta_j = -r_j x phi + (dr_j/dL) dL`` with directions only.
    """
    step = 1e-5
    v = {s: _half_intervals(-gravity_velocity(integrals.time, lat + s * step, alt)) for s in (-1, 0, 1)}
    length = np.linalg.norm(v[0], axis=1, keepdims=True)
    unit = {s: x / np.linalg.norm(x, axis=1, keepdims=True) for s, x in v.items()}
    slope = (unit[1] - unit[-1]) / (2 * step)
    A = np.concatenate([-skew(unit[0]), slope[:, :, None]], axis=2)  # (J, 3, 4)
    normal = np.einsum("jab,jac->bc", A, A)
    pair = np.einsum("b,jab->ja", np.linalg.inv(normal)[3], A) / length
    gain = np.zeros((len(integrals.time), 3))
    ends = np.arange(1, len(gain))
    np.add.at(gain, ends, pair)
    np.add.at(gain, ends // 2, -pair)
    return gain


def _vectors(integrals: InertialIntegrals, lat: float, alt: float, form: Form) -> tuple[Array, Array]:
    """Integrated specific force in ``i``, and what it is in ``n0`` on a base at rest: minus integrated gravity."""
    if form == "velocity":
        return integrals.velocity, -gravity_velocity(integrals.time, lat, alt)
    return integrals.position, -gravity_position(integrals.time, lat, alt)


def _half_intervals(v: Array) -> Array:
    ends = np.arange(1, len(v))
    return v[ends] - v[ends // 2]


def _triad_gain(r1: Array, r2: Array) -> Array:
    """``phi = G_1 delta_1 + G_2 delta_2`` of TRIAD: two components from the first vector, the turn about it from the second."""
    u = r1 / np.linalg.norm(r1)
    normal = np.cross(r1, r2)
    n2 = float(normal @ normal)
    # Of C_hat = (I - [phi x]) C, u x delta_1 / |r1| turns the first vector back onto r1 ...
    G1 = skew(u) / np.linalg.norm(r1)
    # ... and about u the second one, as moved by delta_2 and by that turn, comes back into the plane: the
    # component of delta_2 + r2 x phi along the plane's normal vanishes.
    along = np.outer(u, normal) * np.linalg.norm(r1) / n2
    G2 = along
    return np.stack([G1 + along @ skew(r2) @ G1, G2])


def _as_coarse(C: Array, gain: Array, form: Form, history: Array | None = None) -> CoarseAttitude:
    nothing = np.zeros_like(gain)
    pair = (gain, nothing) if form == "velocity" else (nothing, gain)
    return CoarseAttitude(C, *pair, history)
