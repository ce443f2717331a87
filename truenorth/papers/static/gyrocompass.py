"""The classical gyrocompass loop: an INS levelled and turned north by its own velocity, with fixed gains.

The level frame is torqued so that a velocity of a base that stays dies away. Linearised, with the earth's horizontal rate
``wc``, the north channel is

    dv_N' = g phi_E - k1 dv_N,   phi_E' = -wc phi_U - (k2/g) dv_N,   phi_U' = (k3/(g wc)) dv_N

with the characteristic polynomial ``s^3 + k1 s^2 + k2 s + k3``; the east channel levels with ``s^2 + c1 s + c2``. All poles are
put at ``-1/tau``; tau is short to begin with, so that any azimuth is caught, and long later, so that noise is averaged.

Source: D. H. Titterton, J. L. Weston, Strapdown Inertial Navigation Technology, 2nd ed., 2004, section 10.5; C. Broxmeyer,
Inertial Navigation Systems, 1964, chapter 8.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE, earth_rate_n, normal_gravity

Array = NDArray[np.float64]

# Time constant of all poles, s, and until when it is used, as a part of the whole.
SCHEDULE = ((8.0, 0.25), (20.0, 0.6), (35.0, 1.0))


def gyrocompass_loop(dtheta: Array, dvel: Array, interval: float, C_nb: Array, lat: float, alt: float) -> Array:
    """Run the loop over the logs of many runs.

    Parameters
    ----------
    dtheta, dvel : (runs, K, 3) arrays, rad and m/s
        Increments of a base that stays.
    interval : float, s
    C_nb : (runs, 3, 3) array
        Attitude to begin with: level to some degrees, any azimuth.
    lat, alt : float, rad and m

    Returns
    -------
    (runs, 3, 3) array
        ``C_nb`` at the end.
    """
    g, wc = float(normal_gravity(lat, alt)), EARTH_RATE * math.cos(lat)
    earth = np.asarray(earth_rate_n(lat))
    count = dtheta.shape[1]
    limits = [count * part for _, part in SCHEDULE]
    v = np.zeros((len(C_nb), 2))
    for k in range(count):
        s = 1.0 / SCHEDULE[int(np.searchsorted(limits, k, "right"))][0]
        torque = np.stack([-3 * s**2 / g * v[:, 1], s**2 / g * v[:, 0], s**3 / (g * wc) * v[:, 1]], axis=1)
        half = dcm_from_rotation_vector(dtheta[:, k] / 2)
        force = (C_nb @ half @ dvel[:, k, :, None])[:, :2, 0]
        damping = v * [2 * s, 3 * s] * interval
        C_nb = dcm_from_rotation_vector(-(earth + torque) * interval) @ C_nb @ half @ half
        v = v + force - damping
    return C_nb
