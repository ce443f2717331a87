"""Error states of one's own: gyros that take specific force for rate (g-sensitivity)."""

from typing import Any

import numpy as np

import truenorth as tn
from truenorth.errors import Group, columns
from truenorth.state.now import NOW_C, NOW_FORCE_W, matrix_of, vector_of


@columns
def turned_by_force(now: Any, figures: Any, first: int, assumed: Any, F: Any) -> None:
    """A rate error ``k_j f_j`` along each body axis: ``phi' = -C (k f_b)``."""
    C, f_w = matrix_of(now, NOW_C), vector_of(now, NOW_FORCE_W)
    for j in range(3):
        f = C[0, j] * f_w[0] + C[1, j] * f_w[1] + C[2, j] * f_w[2]
        for i in range(3):
            F[i, first + j] = -C[i, j] * f


def g_sensitivity(spec: tn.ImuSpec) -> Group:
    """Constants, of the size that the specification says; rad/s by m/s^2."""
    return Group("g-sensitivity", np.full(3, spec.gyro_g_sensitivity), acts=turned_by_force, unit="s/m")
