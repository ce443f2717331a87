"""The paper's 12-state filter of a rotary SINS, its fine alignment: errors along an inertial frame, observed by sampled velocity.

States as those of :mod:`truenorth.errors.staying`, misalignment and velocity error along the paper's inertial frame i (the
earth's axes at the start), biases along the IMU's axes; errors computed minus true:

    phi' = -C_i_s eps,   dV' = -g_i x phi + C_i_s nabla,   z = dV + the base's own velocity

The measurement is the velocity of one instant, one state a row, as multiple fading factors need it; they act axis by axis, which
is why the axes are the paper's.

Source: "Rotary SINS self-alignment under dynamic disturbance", eqs. 29-35. Its (26) stands for ``I - [phi x]``, and the velocity
that the lever arm makes at the lower limit is subtracted in (29), which the paper leaves out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.position import Position
from truenorth.errors.staying import DV, PHI, STATES, sampled_system, sampled_velocity
from truenorth.estimate.staying import StayingLog
from truenorth.filters import LinearSystem

Array = NDArray[np.float64]


class RotaryLog(StayingLog):
    """A log about a nominal attitude, its errors along the paper's inertial frame.

    Parameters
    ----------
    record, C_n0_i, position, noise, prior, interval
        As of :class:`truenorth.estimate.staying.StayingLog`; of the prior, phi and dv are along i.
    arm_velocity : (K+1, 3) array, m/s
        That the lever arm makes, in the IMU's frame at the start.
    base_velocity : float, m/s
        One sigma of the base's velocity, which the filter takes for white.
    keep_first : bool
        Leave the arm's velocity at the start in, as the paper does.
    """

    def __init__(
        self,
        record: Any,
        C_n0_i: Array,
        position: Position,
        *rest: Any,
        arm_velocity: Array,
        base_velocity: float,
        keep_first: bool = False,
    ) -> None:
        super().__init__(record, C_n0_i, position, *rest)
        self.arm = arm_velocity[1:] - (0.0 if keep_first else arm_velocity[0])
        self.base_velocity = base_velocity
        C_in = earth_axes(position.lat).T
        self.turn = np.eye(STATES)  # from axes n0 to i
        self.turn[PHI, PHI] = self.turn[DV, DV] = C_in

    def linearise(self) -> LinearSystem:
        """The system of the errors that are left."""
        core, turn = super().linearise(), self.turn
        velocity = sampled_velocity(self.integrals, self.C_n0_i, self.position.lat, self.position.alt)[1:]
        z = (velocity - self.arm @ self.C_n0_i.T) @ turn[DV, DV].T
        Q = turn @ core.Q @ turn.T
        core = replace(core, Phi=turn @ core.Phi @ turn.T, Q=0.5 * (Q + np.swapaxes(Q, 1, 2)))
        return sampled_system(core, z, self.base_velocity**2)

    def correct(self, x: Array) -> None:
        """As of the base class; the errors along i."""
        super().correct(self.turn.T @ x)


def earth_axes(lat: float) -> Array:
    """``C_ne`` (3, 3) as the paper has it: the earth's x axis in the meridian of the place, z along its own axis."""
    s, c = np.sin(lat), np.cos(lat)
    return np.array([[0.0, 1.0, 0.0], [-s, 0.0, c], [c, 0.0, s]])
