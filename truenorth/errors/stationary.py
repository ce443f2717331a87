"""Errors of an INS on a stationary base in the local level: ten states observed by velocity, eight by the accelerometers.

Ten states ``[phi (E, N, U), dv (E, N), eps (3), nabla (x, y)]`` in our signs (computed minus true):

    phi' = -w_ie x phi + [-dv_N, dv_E, dv_E tan L]/R - C eps
    dv'  = [-g phi_N, g phi_E] + 2 w_ie sin L [dv_N, -dv_E] + C nabla,    z = dv

They are those of :mod:`truenorth.errors.ins` at rest, without position. Eight states leave ``dv`` out, and with it the turning
of the level frame that a velocity error makes; they observe the level accelerometers themselves, ``z = [-g phi_N, g phi_E] + C
nabla``. The paper writes the gyro drift with the other sign, and leaves out ``dv_E tan L/R`` and the Coriolis force on ``dv``,
which an open loop, tens of m/s fast in the end, does feel.

Source: system 4, "Kalman filters for static alignment", its eq. 1-8; after I. Y. Bar-Itzhack, N. Berman, Control theoretic
approach to inertial navigation systems, J. Guid. Control Dyn. 11, 1988.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.errors.ins import error_dynamics
from truenorth.errors.walks import Walks
from truenorth.state.layout import STATES as INS_STATES

Array = NDArray[np.float64]

PHI, DV, BG, BA = slice(0, 3), slice(3, 5), slice(5, 8), slice(8, 10)
STATES = 10
OF_INS = np.array([0, 1, 2, 3, 4, 9, 10, 11, 12, 13])  # these states of the INS
KEPT = {10: np.arange(STATES), 8: np.delete(np.arange(STATES), DV)}  # states of the model of ten and of that of eight
NAMES = ("phi_E", "phi_N", "phi_U", "dv_E", "dv_N", "eps_x", "eps_y", "eps_z", "nabla_x", "nabla_y")
UNITS = ("rad",) * 3 + ("m/s",) * 2 + ("rad/s",) * 3 + ("m/s^2",) * 2
SERIES = 8  # terms of the exponential; the paper takes 6 to 10


def names_and_units(states: int) -> tuple[list[str], list[str]]:
    """Of the model of ten or of eight states."""
    return [NAMES[i] for i in KEPT[states]], [UNITS[i] for i in KEPT[states]]


@dataclass(frozen=True)
class StationaryModel:
    """The error model at a place."""

    lat: float  # rad
    alt: float = 0.0  # m
    walks: Walks = field(default_factory=Walks)  # of the sensors; its biases are constants
    complete: bool = True  # with the two terms that the paper's own model leaves out

    @property
    def gravity(self) -> float:
        """Normal gravity, m/s^2."""
        return float(normal_gravity(self.lat, self.alt))

    def dynamics(self, C_nb: Array | None = None) -> Array:
        """``F`` (10, 10) of the ten states, of a body that is turned about the vertical by ``C_nb`` (3, 3)."""
        C = np.eye(3) if C_nb is None else np.ascontiguousarray(C_nb, dtype=np.float64)
        axis, force = np.array([0.0, math.cos(self.lat), math.sin(self.lat)]), np.array([0.0, 0.0, self.gravity])
        whole = np.zeros((INS_STATES, INS_STATES))
        error_dynamics(C, force, np.zeros(3), axis, self.alt, True, True, whole)
        F = whole[np.ix_(OF_INS, OF_INS)]
        if not self.complete:
            F[PHI.stop - 1, DV] = F[DV, DV] = 0.0
        return F

    def accelerometer_rows(self, C_nb: Array | None = None) -> Array:
        """``H`` (2, 8) of the eight states: the level accelerometers."""
        return self.dynamics(C_nb)[DV, KEPT[8]]

    def discrete(
        self, interval: float, C_nb: Array | None = None, states: int = 10, terms: int = SERIES
    ) -> tuple[Array, Array]:
        """``Phi`` and ``Q`` (n, n) of an interval (s), with 10 or 8 states, by the truncated series of the exponential.

        Q by Van Loan's block matrix (C. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Autom.
        Control 23, 1978), in the same series.
        """
        n = states
        kept = KEPT[n]
        F = self.dynamics(C_nb)[np.ix_(kept, kept)]
        G = replace(self.walks, gyro_rate_walk=0.0, accel_rate_walk=0.0).density(STATES, PHI, DV, BG, BA)[kept]
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
