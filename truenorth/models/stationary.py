"""Errors of an INS on a stationary base in the local level: ten states observed by velocity, eight by the accelerometers.

Ten states ``[phi (E, N, U), eps (3), nabla (x, y), dv (E, N)]`` in our signs (computed minus true):

    phi' = -w_ie x phi + [-dv_N, dv_E, dv_E tan L]/R - C eps
    dv'  = [-g phi_N, g phi_E] + 2 w_ie sin L [dv_N, -dv_E] + C nabla,    z = dv

Eight states leave ``dv`` out, and with it the turning of the level frame that a velocity error makes; they observe the level
accelerometers themselves, ``z = [-g phi_N, g phi_E] + C nabla``. The paper writes the gyro drift with the other sign, and
leaves out ``dv_E tan L/R`` and the Coriolis force on ``dv``, which an open loop, tens of m/s fast in the end, does feel.

Source: system 4, "Kalman filters for static alignment", its eq. 1-8; after I. Y. Bar-Itzhack, N. Berman, Control theoretic
approach to inertial navigation systems, J. Guid. Control Dyn. 11, 1988.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE, normal_gravity, radii

Array = NDArray[np.float64]

PHI, BG, BA, DV = slice(0, 3), slice(3, 6), slice(6, 8), slice(8, 10)
NAMES = ("phi_E", "phi_N", "phi_U", "eps_x", "eps_y", "eps_z", "nabla_x", "nabla_y", "dv_E", "dv_N")
STATE_UNITS = ("rad",) * 3 + ("rad/s",) * 3 + ("m/s^2",) * 2 + ("m/s",) * 2
SERIES = 8  # terms of the exponential; the paper takes 6 to 10


@dataclass(frozen=True)
class StationaryModel:
    """The error model at a place."""

    lat: float  # rad
    alt: float = 0.0  # m
    gyro_random_walk: float = 0.0  # rad/sqrt(s)
    accel_random_walk: float = 0.0  # m/s/sqrt(s)
    complete: bool = True  # with the two terms that the paper's own model leaves out

    @property
    def gravity(self) -> float:
        """Normal gravity, m/s^2."""
        return float(normal_gravity(self.lat, self.alt))

    def dynamics(self, C_nb: Array | None = None) -> Array:
        """``F`` (10, 10) of the ten states, of a body that is turned about the vertical by ``C_nb`` (3, 3)."""
        C = np.eye(3) if C_nb is None else C_nb
        ws, wc = EARTH_RATE * math.sin(self.lat), EARTH_RATE * math.cos(self.lat)
        F = np.zeros((10, 10))
        F[PHI, PHI] = [[0, ws, -wc], [-ws, 0, 0], [wc, 0, 0]]  # -[w_ie x]
        R_M, R_N = (R + self.alt for R in radii(self.lat))
        F[0, 9], F[1, 8] = -1 / R_M, 1 / R_N
        if self.complete:
            F[2, 8] = math.tan(self.lat) / R_N
            F[8, 9], F[9, 8] = 2 * ws, -2 * ws
        F[PHI, BG] = -C
        F[8, 1], F[9, 0] = -self.gravity, self.gravity
        F[DV, BA] = C[:2, :2]
        return F

    def accelerometer_rows(self, C_nb: Array | None = None) -> Array:
        """``H`` (2, 8) of the eight states: the level accelerometers."""
        return self.dynamics(C_nb)[DV, :8]

    def discrete(
        self, interval: float, C_nb: Array | None = None, states: int = 10, terms: int = SERIES
    ) -> tuple[Array, Array]:
        """``Phi`` and ``Q`` (n, n) of an interval (s), with 10 or 8 states, by the truncated series of the exponential.

        Q by Van Loan's block matrix (C. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Autom.
        Control 23, 1978), in the same series.
        """
        n = states
        F = self.dynamics(C_nb)[:n, :n]
        G = np.zeros(n)
        G[PHI] = self.gyro_random_walk**2
        if n == 10:
            G[DV] = self.accel_random_walk**2
        block = np.block([[-F, np.diag(G)], [np.zeros((n, n)), F.T]]) * interval
        power, total = np.eye(2 * n), np.eye(2 * n)
        for k in range(1, terms + 1):
            power = power @ block / k
            total = total + power
        Phi = total[n:, n:].T
        Q = Phi @ total[:n, n:]
        return Phi, 0.5 * (Q + Q.T)

    def limits(self, gyro_bias: float, accel_bias: float) -> tuple[float, float]:
        """What no stationary alignment in one position beats: one-sigma of level and heading, rad.

        ``phi_E = -nabla_N/g``, ``phi_U = -eps_E/(w_ie cos L) + phi_N tan L`` with ``phi_N = nabla_E/g``.
        """
        level = accel_bias / self.gravity
        return level, math.hypot(gyro_bias / (EARTH_RATE * math.cos(self.lat)), level * math.tan(self.lat))
