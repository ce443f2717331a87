"""The earth's rate where nobody knows north: its level part as two states of an INS on a base that stays.

Levelled by convention to some heading, an INS takes the earth's level rate off in a wrong direction. What is left is a rate w that
stays as it is in ``n0``, as gyro biases would that do not turn with the body:

    phi' = -C_n0_b eps - w,   |w| <= 2 w_ie cos L

It is linear in w, where the same in heading goes round a circle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.staying import DV, PHI, gravity_force, grown, local_axes
from truenorth.filters import LinearSystem
from truenorth.strapdown.inertial import InertialIntegrals

Array = NDArray[np.float64]

LEVEL_RATE = 2


def with_level_rate(system: LinearSystem, integrals: InertialIntegrals, lat: float, alt: float) -> LinearSystem:
    """A system of :meth:`truenorth.errors.staying.StaticModel.linearise` with the level rate (E, N), rad/s, as two more states."""
    T = integrals.intervals[:, None, None]
    n = system.states
    bigger = grown(system, n + LEVEL_RATE)
    rate, level = slice(n, n + LEVEL_RATE), np.eye(3)[:, :LEVEL_RATE]
    f, f_late = gravity_force(integrals.time, lat, alt)
    bigger["Phi"][:, rate, rate] = np.eye(LEVEL_RATE)
    bigger["Phi"][:, PHI, rate] = -T * level
    bigger["Phi"][:, DV, rate] = -T * (f_late @ level)
    bigger["H"][:, :, rate] = -(T**2) / 6 * (local_axes(integrals.time, lat) @ f @ level)
    return system.with_made(**bigger)
