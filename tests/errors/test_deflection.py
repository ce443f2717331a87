"""Deflection of the vertical in the covariance of an INS that has levelled itself."""

from __future__ import annotations

import numpy as np
import pytest

from truenorth.coarse.analytic import static_jacobian
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.earth import DEFLECTION, normal_gravity
from truenorth.errors.deflection import Deflection, at_rest
from truenorth.state.layout import BA, PHI, STATES

OWN = slice(STATES, STATES + 2)


def levelled(lat: float, alt: float, C_nb: np.ndarray) -> np.ndarray:
    """Tilt that cancels the accelerometer biases but for 1e-9 rad, a deflection among them, as alignments hand it over."""
    g = float(normal_gravity(lat, alt))
    J = static_jacobian(lat, g)[:, :3]
    acting = np.diag(np.full(3, 5e-4**2)) + C_nb[:2].T @ C_nb[:2] * (DEFLECTION * g) ** 2
    both = np.vstack([J @ C_nb, np.eye(3)])
    P = np.eye(STATES + 2) * 1e-18
    joined = [*range(STATES + 2)[PHI], *range(STATES + 2)[BA]]
    P[np.ix_(joined, joined)] += both @ acting @ both.T
    P[OWN, OWN] = np.eye(2) * Deflection().sigma ** 2
    return P


@pytest.mark.parametrize(("lat", "alt"), [(0.0, 0.0), (0.8, 100.0), (-1.3, 3000.0)])
def test_taken_out_as_it_was_put_in(lat, alt):
    """What is left is a covariance, whatever the gravity of the place; its accelerometer biases hold no deflection any more."""
    C_nb = dcm_from_euler(0.7, 0.02, -0.01)
    P = at_rest(levelled(lat, alt, C_nb), STATES, C_nb, lat, alt, DEFLECTION)
    sigma = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(sigma, sigma))[0] > 0.0
    np.testing.assert_allclose(sigma[BA], 5e-4, rtol=1e-6)
    # A tilt by the plumb line is that of the deflection: phi_E = -xi_N, phi_N = xi_E.
    np.testing.assert_allclose(
        P[PHI, OWN][:2], Deflection().sigma ** 2 * np.array([[0.0, -1.0], [1.0, 0.0]]), rtol=1e-6, atol=1e-16
    )
