"""Undamped error oscillations of a mechanisation at rest: Schuler, Foucault, 24 h, and the free vertical channel."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import assert_lines
from truenorth.core.attitude import dcm_from_rotation_vector
from truenorth.core.earth import EARTH_RATE, FLATTENING, SEMI_MAJOR, earth_rate_n, normal_gravity, radii
from truenorth.records import ImuRecord
from truenorth.state.state import State
from truenorth.state.track import Track
from truenorth.strapdown.level import mechanise


def at_rest(
    lat: float, hours: float, T: float = 1.0, eps=(0.0, 0.0, 0.0), v_n=(0.0, 0.0, 0.0), phi=(0.0, 0.0, 0.0)
) -> Track:
    """A level IMU on the fixed-height base, with gyro bias `eps` and initial errors `v_n` and `phi` (E, N, U)."""
    count = round(hours * 3600 / T)
    dtheta = np.tile(T * (earth_rate_n(lat) + eps), (count, 1))
    dvel = np.tile([0, 0, T * normal_gravity(lat, 0.0)], (count, 1))
    record = ImuRecord(T * np.arange(1, count + 1), dtheta, dvel, "increments")
    C_nb = dcm_from_rotation_vector(-np.array(phi))  # C_hat = (I - [phi x]) C
    return mechanise(record, State.at(C_nb, lat, v_n=v_n), altitude="fixed")


def test_schuler_period_at_the_equator():
    """A velocity error along north: ``dL = dv/(R w) sin wt`` with ``w = sqrt(g/R_M)`` (84.3 min there).

    At the equator the tilt cancels the latitude error, ``phi_E = -dL``, so that neither earth rate nor azimuth enters.
    """
    R_M = radii(0.0)[0]
    w = np.sqrt(normal_gravity(0.0, 0.0) / R_M)
    assert 2 * np.pi / w / 60 == pytest.approx(84.3, abs=0.05)
    out = at_rest(0.0, hours=4.5, v_n=(0.0, 0.1, 0.0))
    expected = 0.1 / (R_M * w) * np.sin(w * out.time)
    np.testing.assert_allclose(out.position[:, 0], expected, rtol=0, atol=1e-4 * expected.max())
    np.testing.assert_allclose(out.v_n[:, 1], 0.1 * np.cos(w * out.time), rtol=0, atol=1e-5)
    # phi_E = -dL: the third row of C_hat = I - [phi x] holds phi_E as C[2, 1] = -phi_E.
    np.testing.assert_allclose(out.C_nb[:, 2, 1], out.position[:, 0], rtol=0, atol=1e-4 * expected.max())


@pytest.mark.parametrize("lat", [0.7, -0.7])
def test_foucault_turns_the_schuler_swing(lat):
    """As a pendulum's: its plane turns by ``w_ie sin L``, clockwise in the north, the other way in the south."""
    out = at_rest(lat, hours=16.0, v_n=(0.0, 0.1, 0.0))
    v = out.v_n[:, 0] + 1j * out.v_n[:, 1]
    swing = 5060
    turns = []
    for k in range(len(v) // swing):
        part = v[k * swing : (k + 1) * swing]
        turns.append(0.5 * np.angle(np.sum(part**2)))  # twice the direction of the plane
    rate = np.polyfit(swing * np.arange(len(turns)), np.unwrap(turns, period=np.pi), 1)[0]
    assert rate == pytest.approx(-EARTH_RATE * np.sin(lat), rel=0.02)


def test_lines_of_the_undamped_spectrum():
    """In latitude, under a north gyro bias and a velocity error: a constant, 24 h, and Schuler split by Foucault.

    Fitted at the frequencies of theory they leave .3 %; without any one of them a third stays.
    """
    lat = 0.7
    out = at_rest(lat, hours=72.0, T=4.0, eps=(0.0, 2e-8, 0.0), v_n=(0.0, 1.0, 0.0))
    R = np.mean(radii(lat))
    foucault = EARTH_RATE * np.sin(lat)
    swing = np.sqrt(normal_gravity(lat, 0.0) / R + foucault**2)  # of a pendulum on a turning table
    lines = {"24 h": EARTH_RATE, "slow": swing - foucault, "fast": swing + foucault}
    dL = out.position[:, 0] - lat
    assert_lines(out.time, dL, lines, left=0.003, without=0.3)


def test_free_vertical_channel_diverges_as_it_must():
    """``dh = dh0 cosh(t/tau)``: tau from the gradient of normal gravity, which is the root of R/2g to about 1 %."""
    lat, start = 0.7, 1.0
    count = 6000
    dtheta = np.tile(0.1 * earth_rate_n(lat), (count, 1))
    dvel = np.tile([0, 0, 0.1 * normal_gravity(lat, 0.0)], (count, 1))
    record = ImuRecord(0.1 * np.arange(1, count + 1), dtheta, dvel, "increments")
    true = State.at(np.eye(3), lat)
    off, on = (mechanise(record, replace(true, alt=alt), altitude="free").position[:, 2] for alt in (start, 0.0))
    h = 10.0
    gradient = (normal_gravity(lat, -h) - normal_gravity(lat, h)) / (2 * h)
    assert np.sqrt(1 / gradient) == pytest.approx(np.sqrt(SEMI_MAJOR / (2 * 9.8)), rel=4 * FLATTENING)
    growth = np.cosh(np.sqrt(gradient) * record.time) - 1
    np.testing.assert_allclose(off - on - start, growth, rtol=0, atol=4e-3 * growth[-1])
    assert growth[-1] > 0.5
