"""The paper's 12-state error model of a rotary SINS in an inertial frame, observed by sampled velocity.

States ``[dV (3), phi (3), eps (3), nabla (3)]``; dV and phi along the inertial frame i (the earth at the start), biases along
the IMU's axes; errors computed minus true:

    dV' = -g_i x phi + C_i_s nabla,   phi' = -C_i_s eps,   z = dV + the base's own velocity

The same errors as those of :mod:`truenorth.models.static`, from which transition and noise are taken, in other axes and order; but
the measurement is the velocity of one instant, with H = [I 0 0 0], one state a row, as multiple fading factors need it.

Source: "Rotary SINS self-alignment under dynamic disturbance", eqs. 29-35. Its (26) stands for ``I - [phi x]``, and the velocity
that the lever arm makes at the lower limit is subtracted in (29), which the paper leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.filters import LinearSystem
from truenorth.models import static
from truenorth.models.static import STATES, StaticModel
from truenorth.strapdown.inertial import InertialIntegrals, gravity_velocity

Array = NDArray[np.float64]

DV, PHI, BG, BA = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)


@dataclass(frozen=True)
class RotaryModel:
    """The model's noise."""

    walks: StaticModel  # of the sensors
    base_velocity: float  # m/s; one sigma of the base's velocity, which the model takes for white

    def linearise(
        self,
        integrals: InertialIntegrals,
        C_i_s0: Array,
        lat: float,
        alt: float,
        P0: Array,
        arm_velocity: Array,
        keep_first: bool = False,
    ) -> LinearSystem:
        """Stack the model over the K intervals of a log.

        Parameters
        ----------
        integrals : InertialIntegrals
            Of the IMU.
        C_i_s0 : (3, 3) array
            Its nominal attitude at the start.
        lat, alt : float, rad and m
        P0 : (12, 12) array
        arm_velocity : (K+1, 3) array, m/s
            That the lever arm makes, in the IMU's frame at the start.
        keep_first : bool
            Leave its value at the start in, as the paper does.
        """
        C_ne = earth_axes(lat)
        system = self.walks.linearise(integrals, C_ne @ C_i_s0, lat, alt, np.eye(STATES), np.ones(3))
        # From [phi, dv, eps, nabla] in n0 to [dV, phi, eps, nabla] in i.
        T = np.zeros((STATES, STATES))
        T[DV, static.DV] = T[PHI, static.PHI] = C_ne.T
        T[BG, static.BG] = T[BA, static.BA] = np.eye(3)
        Q = T @ system.Q @ T.T
        moved = arm_velocity[1:] - (0.0 if keep_first else arm_velocity[0])
        z = (integrals.velocity[1:] - moved) @ C_i_s0.T + gravity_velocity(integrals.time[1:], lat, alt) @ C_ne
        H = np.zeros((1, 3, STATES))
        H[0, :, DV] = np.eye(3)
        return LinearSystem(
            Phi=T @ system.Phi @ T.T,
            Q=0.5 * (Q + np.swapaxes(Q, 1, 2)),
            H=H,
            R=self.base_velocity**2 * np.eye(3)[None],
            z=z,
            x0=np.zeros(STATES),
            P0=P0,
        )


def earth_axes(lat: float) -> Array:
    """``C_ne`` (3, 3) as the paper has it: the earth's x axis in the meridian of the place, z along its own axis."""
    s, c = np.sin(lat), np.cos(lat)
    return np.array([[0.0, 1.0, 0.0], [-s, 0.0, c], [c, 0.0, s]])
