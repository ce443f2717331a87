"""The static model observed by the level accelerometers themselves: the velocity that the INS gains in each interval.

The same twelve states; the velocity error is no part of the measurement:

    z_k = dv_k - dv_{k-1} = int (-g_n0 x phi + C nabla + w_a) dt + (the base's own gain)

On a base that does not move beyond the noise of its accelerometers it tells what the velocity tells, and asks nothing of where
the velocity began; on one that does, the base's motion comes in differentiated, and the velocity form is the better.

Source: system 4, "Kalman filters for static alignment": its eight states compared with its ten.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.filters import LinearSystem
from truenorth.models.static import DV, QUIETEST_BASE, STATES
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, gravity_velocity

Array = NDArray[np.float64]
Form = Literal["velocity", "force"]


def gained_velocity(integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float) -> Array:
    """(K, 3) velocity that the INS gains in each interval in ``n0``, m/s; zero for a perfect one at rest."""
    return np.diff(integrals.velocity @ C_n0_i.T + gravity_velocity(integrals.time, lat, alt), axis=0)


def force_system(
    core: LinearSystem, integrals: InertialIntegrals, C_n0_i: Array, lat: float, alt: float
) -> LinearSystem:
    """A system of :meth:`truenorth.models.static.StaticModel.linearise` with the gained velocity as its measurement.

    Parameters
    ----------
    core : LinearSystem
        Its measurement is left out.
    integrals, C_n0_i, lat, alt
        That it was linearised with.

    Returns
    -------
    LinearSystem
        Whose R holds the variance of the quietest base only.
    """
    # z = J x_{k-1} + w_dv, and x_{k-1} = Phi^-1 (x_k - w): given by the state after the interval, as the filter has it.
    J = core.Phi[:, DV].copy()
    J[:, :, DV] -= np.eye(3)
    back = J @ np.linalg.inv(core.Phi)
    own = np.eye(STATES)[DV] - back
    middle = (integrals.time[1:] + integrals.time[:-1]) / 2
    C = np.swapaxes(earth_rotation(middle, lat), 1, 2)
    C_t = np.swapaxes(C, 1, 2)
    noise = C @ own @ core.Q @ np.swapaxes(own, 1, 2) @ C_t
    z = (C @ gained_velocity(integrals, C_n0_i, lat, alt)[..., None])[..., 0]
    return replace(
        core,
        H=C @ back,
        R=0.5 * (noise + np.swapaxes(noise, 1, 2)) + QUIETEST_BASE**2 * np.eye(3),
        S=core.Q @ np.swapaxes(own, 1, 2) @ C_t,
        z=z,
    )
