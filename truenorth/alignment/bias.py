"""What acts as a bias, and what of it is one.

On a base that stays, a scale factor error of the accelerometers is a bias (it always multiplies gravity), and so is a
misalignment; an error of latitude looks like a gyro bias, one of height like an accelerometer bias. The filter estimates
their sum; what it shows of the bias proper is less.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import gravity_of_place
from truenorth.core.position import Position
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]


def bias_prior(spec: ImuSpec, C_n_b: Array, position: Position, lat_rate: Array, gravity: float) -> Array:
    """Prior covariance of the sum, (6, 6).

    Parameters
    ----------
    C_n_b : (3, 3) array
        ``v_b = C_n_b v_n``, about; heading does not matter.
    position : Position
        With its uncertainty: a latitude error ``dL`` gives the INS a wrong earth rate, ``dL dw_ie/dL`` in n; an error of
        height a wrong gravity.
    lat_rate : (3,) array
        ``dw_ie_n/dL``, rad/s a radian.
    gravity : float, m/s^2
    """
    P = np.diag(spec.bias_variance)
    rate = C_n_b @ lat_rate * position.lat_sigma
    P[:3, :3] += np.outer(rate, rate)
    slope = gravity_of_place(position.lat, position.alt + 1.0) - gravity
    up = C_n_b @ np.array([0.0, 0.0, 1.0])
    P[3:, 3:] += np.outer(up, up) * (slope * position.vertical_sigma) ** 2
    P[3:, 3:] += np.diag(spec.acting_variance(gravity * up))
    return P


def true_bias(total: Array, variance: Array, prior: Array, proper: Array) -> tuple[Array, Array]:
    """The accelerometer bias proper, and its sigma, of an estimate of the sum.

    Of two independent Gaussian terms with variances `proper` and ``prior - proper`` whose sum is known to be `total` with
    posterior variance `variance`: their share of the sum, and what the share leaves open.

    Parameters
    ----------
    total, variance : (..., 3) arrays
    prior, proper : (3,) arrays

    Returns
    -------
    bias, sigma : (..., 3) arrays
    """
    # Of no bias at all none is proper.
    share = np.divide(proper, prior, out=np.zeros_like(prior), where=prior > 0.0)
    return share * total, np.sqrt(share * (prior - proper) + share**2 * variance)
