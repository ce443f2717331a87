"""Level of a vehicle whose heading nothing tells: by gravity, as well as accelerometers show it, and no better.

A tilt and a bias of the accelerometers, ``phi_E = -nabla_N / g`` and ``phi_N = nabla_E / g``, part only where the body turns
between the two. A filter that does not know its heading turns the body in its own mind: with each correction of heading the
columns of the biases turn against those of the tilt, and that passes for knowledge. Consumer IMUs that stood, or went straight at a
steady speed, knew their level to .4 deg where 1.8 are known, and were up to 13 of these off. So the last pass holds
biases across the vertical, and what they do to level is in its covariance, with the correlations that navigation goes on with.
Where the log speaks against it, since the vehicle has turned, it is not taken.

A wheel or a Doppler log alone shows velocity along the body's axes: a tilt turns it, ``dv = v x phi``, upwards above all, and the
way with it, ``dp = int dv dt``. Fixes show both in n.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from truenorth.alignment.in_motion_task import MovingTask
from truenorth.core.attitude import skew
from truenorth.core.earth import normal_gravity
from truenorth.errors.axes import standing
from truenorth.state.layout import BA, DP, DV, PHI
from truenorth.state.track import Track

Array = NDArray[np.float64]

TILTS = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # phi by biases along east, north, up, by g


def with_level_biases(task: MovingTask, track: Track) -> Track:
    """A track that held them, with what they may be in its covariance."""
    variance = task.spec.bias_variance[3:] + task.spec.acting_variance(standing())
    up = track.C_nb[:, 2, :]
    across = np.eye(3) - up[:, :, None] * up[:, None, :]
    N = np.zeros((*track.P.shape[:2], 3))
    N[:, PHI] = TILTS @ track.C_nb / normal_gravity(task.position.lat, task.position.alt)
    N[:, BA] = np.eye(3)
    N = N @ across
    if task.gnss is None and not task.more:
        N[:, DV] = skew(track.v_n) @ N[:, PHI]
        N[:, DP] = cumulative_trapezoid(N[:, DV], track.time, axis=0, initial=0.0)
    return replace(track, P=track.P + (N * variance) @ np.swapaxes(N, 1, 2))
