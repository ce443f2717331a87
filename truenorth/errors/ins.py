"""Error model of an INS that moves over the earth: the phi-angle model, written once, in any level frame.

States, errors computed minus true (15 and what a specification adds):

| slice | state | unit |
| --- | --- | --- |
| PHI | misalignment phi, ``C_nb_hat = (I - [phi x]) C_nb`` | rad |
| DV | velocity error | m/s |
| DP | position error: east, north, up displacement | m |
| BG | what is left of the gyro bias: measured minus true | rad/s |
| BA | what is left of the accelerometer bias: measured minus true | m/s^2 |

The level frame either points north (ENU) or is carried on without turning about the vertical (*wander*), which has no
singularity at the poles. The earth's axis ``a`` in that frame, ``(0, cos L, sin L)`` in ENU, says how the frame lies. With
the curvature ``T``, by which a displacement turns the frame (``dtheta = T dp``, ``w_en = T v``):

    phi' = -w_in x phi + dw_ie + dw_en - C eps,        dw_ie = w_ie x T dp,   dw_en = T dv + D dp
    dv'  = f x phi - (2 w_ie + w_en) x dv + v x (2 dw_ie + dw_en) + dg + C nabla
    dp'  = dv - w_en x dp + T dp x v

``D dp`` is the change of curvature and convergence between the two places. Position is in metres, so that a position error
has one meaning at every latitude: ``dp_N = (R_M + h) dL``, ``dp_E = (R_N + h) cos L dlon``. In the wander frame the axes
at the true position are those of the computed one carried over in parallel; the two models differ by the convergence of
the meridians, ``phi_U(north) = phi_U(wander) + tan L dp_E/(R_N + h)``.

Sources: D. Goshen-Meskin, I. Bar-Itzhack, "Unified approach to inertial navigation system error modeling", J. Guid.
Control Dyn. 15 (1992) (phi angle, computer frame); P. Groves, "Principles of GNSS, Inertial, and Multisensor
Integrated Navigation Systems", 2nd ed. (2013), sec. 14.2 (Schuler, transport-rate terms); P. Savage, *Strapdown
Analytics*, 2nd ed. (2007), sec. 12 (wander frame). Neglected: how the radii of the ellipsoid change from the true to the
computed place (1/300 of a term that is itself small), and the deflection of the vertical.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core import earth
from truenorth.core.attitude import cross
from truenorth.core.compiled import borrowing, compiled
from truenorth.core.linalg import four_rows_within, transpose_block
from truenorth.strapdown.wander import curvature

Array = NDArray[np.float64]


# The same for kernels, which take numbers.
_PHI, _DV, _DP, _BG, _BA = 0, 3, 6, 9, 12
TURN_TIME = 10.0  # s, for which a turn goes on about one axis: so long its scale and misalignment errors are alike
DYNAMIC = 9  # states whose errors drive each other; those behind them are sensors' and run by themselves
_W = earth.EARTH_RATE
_normal_gravity_at = compiled(earth.normal_gravity_at)


@borrowing
def error_dynamics(C: Any, f: Any, v: Any, axis: Any, alt: float, north: bool, fixed_altitude: bool, F: Any) -> None:
    """Fill in ``F`` of ``x' = F x + w`` for the 15 states; the sensors' own rows (9 and on) are left as they are.

    Parameters
    ----------
    C : (3, 3) array
        Body to level frame.
    f : (3,) array, m/s^2
        Specific force in the level frame.
    v : (3,) array, m/s
    axis : (3,) array
        The earth's axis in the level frame: (0, cos L, sin L) in ENU.
    alt : float, m
    north : bool
        The frame points north (ENU); else it does not turn about the vertical.
    fixed_altitude : bool
        Height held and vertical velocity zero: their errors stay as they are.
    F : (N, N) array, N >= 15
    """
    Kxx, Kxy, Kyy = curvature(axis, alt)
    vE, vN, vU = v[0], v[1], v[2]
    tE = 0.0  # w_en about up for a velocity along x: tan L/(R_N + h)
    if north:
        tE = axis[2] / axis[1] * Kxx
    wen = (-(Kxy * vE + Kyy * vN), Kxx * vE + Kxy * vN, tE * vE)
    wie = (_W * axis[0], _W * axis[1], _W * axis[2])
    coriolis = (2.0 * wie[0] + wen[0], 2.0 * wie[1] + wen[1], 2.0 * wie[2] + wen[2])
    for j in range(3):
        e = (1.0 * (j == 0), 1.0 * (j == 1), 1.0 * (j == 2))
        # Columns of T and D.
        if j == 0:
            t = (-Kxy, Kxx, tE)
        elif j == 1:
            t = (-Kyy, Kxy, 0.0)
        else:
            t = (0.0, 0.0, 0.0)
        if j == 2:
            KvE, KvN = wen[1], -wen[0]
            d = (Kxy * KvE + Kyy * KvN, -(Kxx * KvE + Kxy * KvN), -tE * Kxx * vE)
        elif not north:
            d = (0.0, 0.0, wen[0] * t[1] - wen[1] * t[0])
        elif j == 1:
            d = (0.0, 0.0, vE * Kxx * Kyy / (axis[1] * axis[1]))
        else:
            d = (0.0, 0.0, 0.0)

        a = cross((wie[0] + wen[0], wie[1] + wen[1], wie[2] + wen[2]), e)
        b = cross((f[0], f[1], f[2]), e)
        c = cross(coriolis, e)
        g = cross((vE, vN, vU), t)
        h = cross(wie, t)
        m = cross((vE, vN, vU), (2.0 * h[0] + d[0], 2.0 * h[1] + d[1], 2.0 * h[2] + d[2]))
        n = cross(wen, e)
        for i in range(3):
            F[_PHI + i, _PHI + j] = -a[i]
            F[_PHI + i, _DV + j] = t[i]
            F[_PHI + i, _DP + j] = h[i] + d[i]
            F[_PHI + i, _BG + j] = -C[i, j]
            F[_DV + i, _PHI + j] = b[i]
            F[_DV + i, _DV + j] = g[i] - c[i]
            F[_DV + i, _DP + j] = m[i]
            F[_DV + i, _BA + j] = C[i, j]
            F[_DP + i, _DV + j] = e[i]
            F[_DP + i, _DP + j] = -g[i] - n[i]
    # Gravity falls with height, and grows towards the poles (d sin L = a_h K dp).
    s2 = axis[2] * axis[2]
    F[_DV + 2, _DP + 2] += 0.005 * (_normal_gravity_at(s2, alt - 100.0) - _normal_gravity_at(s2, alt + 100.0))
    slope = 2.0 * axis[2] * 500.0 * (_normal_gravity_at(s2 - 1e-3, alt) - _normal_gravity_at(s2 + 1e-3, alt))
    F[_DV + 2, _DP] += slope * (axis[0] * Kxx + axis[1] * Kxy)
    F[_DV + 2, _DP + 1] += slope * (axis[0] * Kxy + axis[1] * Kyy)
    if fixed_altitude:
        for j in range(_BA + 3):
            F[_DV + 2, j] = 0.0
            F[_DP + 2, j] = 0.0


@borrowing
def couple_sensors(C: Any, at: Any, fixed_altitude: bool, F: Any) -> None:
    """Fill in the columns by which slow biases act as gyro and accelerometer errors.

    Parameters
    ----------
    C : (3, 3) array
        Body to level frame.
    at : array of int
        First state of the slow gyro and accelerometer bias; -1: none. What follows them is for measurements.
    fixed_altitude : bool
        Vertical velocity is zero: nothing drives it.
    F : (N, N) array
    """
    for i in range(3):
        for j in range(3):
            if at[0] >= 0:
                F[_PHI + i, at[0] + j] = -C[i, j]
            if at[1] >= 0 and not (fixed_altitude and i == 2):
                F[_DV + i, at[1] + j] = C[i, j]


@borrowing
def transition(size: Any, F: Any, decay: Any, T: float, Phi: Any, Phi_t: Any) -> None:
    """``Phi = I + F T + (F T)^2/2`` of the first nine states, exact exponentials of the others', and its transpose.

    Parameters
    ----------
    size : tuple
        See :mod:`truenorth.core.linalg`.
    F : (N, N) array
        Rows 9 and on hold zeros: those states only decay.
    decay : (n,) array, 1/s
    T : float, s
    Phi, Phi_t : (N, N) arrays
        Filled in; zero beyond the states.
    """
    half, n = 0.5 * T * T, len(decay)
    used = 4 * ((n + 3) // 4)
    for i in range(0, DYNAMIC, 4):  # three rows more, of zeros
        four_rows_within(DYNAMIC, F, F, None, i, 0, used, Phi)
    for i in range(DYNAMIC):
        for j in range(used):
            Phi[i, j] = F[i, j] * T + half * Phi[i, j]
        Phi[i, i] += 1.0
    for j in range(DYNAMIC, n):  # the sensors' own decay, which stands on the diagonal of their rows
        if decay[j] != 0.0:
            for i in range(DYNAMIC):
                Phi[i, j] -= half * F[i, j] * decay[j]
    for i in range(0, DYNAMIC, 4):
        for j in range(0, used, 4):
            transpose_block(Phi, i, j, Phi_t)
    for i in range(DYNAMIC, n):
        Phi[i, i] = math.exp(-decay[i] * T) if decay[i] != 0.0 else 1.0
        Phi_t[i, i] = Phi[i, i]
