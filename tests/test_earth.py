"""WGS-84: published values, the potential that gravity is the gradient of, and geometry done another way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from truenorth.core import earth
from truenorth.core.compiled import compiled

latitudes = st.floats(-1.55, 1.55)
SEMI_MINOR = earth.SEMI_MAJOR * (1 - earth.FLATTENING)


def ecef(lat, lon, alt):
    _, R_N = earth.radii(lat)
    return np.array(
        [
            (R_N + alt) * np.cos(lat) * np.cos(lon),
            (R_N + alt) * np.cos(lat) * np.sin(lon),
            (R_N * (1 - earth.ECCENTRICITY_SQUARED) + alt) * np.sin(lat),
        ]
    )


def test_published_constants():
    """NIMA TR8350.2, tables 3.3 and 3.4."""
    assert pytest.approx(6356752.3142, abs=1e-4) == SEMI_MINOR
    assert pytest.approx(6.69437999014e-3, abs=1e-14) == earth.ECCENTRICITY_SQUARED
    assert earth.normal_gravity(np.pi / 2, 0.0) == pytest.approx(9.8321849378, abs=1e-10)  # at the pole
    assert earth.normal_gravity(0.0, 0.0) == 9.7803253359
    m = earth.EARTH_RATE**2 * earth.SEMI_MAJOR**2 * SEMI_MINOR / earth.GM
    assert pytest.approx(m, rel=1e-10) == earth.CENTRIFUGAL_RATIO


def test_mean_gravity_over_the_ellipsoid():
    """Table 3.4: 9.7976432222 m/s^2, weighted by area."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    lat = nodes * np.pi / 2
    R_M, R_N = earth.radii(lat)
    area = weights * R_M * R_N * np.cos(lat)
    assert np.sum(area * earth.normal_gravity(lat, 0.0)) / np.sum(area) == pytest.approx(9.7976432222, abs=1e-9)


def potential_gradient(lat, alt):
    """Gradient of the exact normal potential in ellipsoidal coordinates (Heiskanen and Moritz), inward, numerically."""
    E2 = earth.SEMI_MAJOR**2 - SEMI_MINOR**2
    E = np.sqrt(E2)

    def potential(x, z):
        r2 = x * x + z * z - E2
        u = np.sqrt(0.5 * (r2 + np.sqrt(r2 * r2 + 4 * E2 * z * z)))
        sin_beta2 = (z / u) ** 2

        def q(u):
            return 0.5 * ((1 + 3 * u * u / E2) * np.arctan(E / u) - 3 * u / E)

        w2a2 = (earth.EARTH_RATE * earth.SEMI_MAJOR) ** 2
        return (
            earth.GM / E * np.arctan(E / u)
            + 0.5 * w2a2 * q(u) / q(SEMI_MINOR) * (sin_beta2 - 1 / 3)
            + 0.5 * (earth.EARTH_RATE * x) ** 2
        )

    def at(height):
        x, _, z = ecef(lat, 0.0, height)
        return potential(x, z)

    return -(at(alt + 100.0) - at(alt - 100.0)) / 200.0


@pytest.mark.parametrize("lat", [0.0, 0.5, -0.9, 1.4])
def test_height_against_the_exact_potential(lat):
    """To what the series leaves out, f^2 x, f x^2 and x^3 with x = h/a: .2 ug at 8 km; dropping f or m costs 5 ug."""
    for alt in (0.0, 1000.0, 8000.0):
        x, f = alt / earth.SEMI_MAJOR, earth.FLATTENING
        left_out = 9.8 * x * (10 * f * f + 10 * f * x + 5 * x * x)
        rounding = 1e-7  # of the difference of potentials
        assert earth.normal_gravity(lat, alt) == pytest.approx(potential_gradient(lat, alt), abs=left_out + rounding)


@given(latitudes, st.floats(-3, 3), st.floats(-100, 10000), st.tuples(*[st.floats(-300, 300)] * 3))
def test_transport_rate_is_the_turn_of_the_local_level_frame(lat, lon, alt, v):
    """Move in ECEF for a short time; the east, north and up axes there and here differ by the transport rate."""

    def C_en(lat, lon):
        s, c, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
        return np.array([[-sl, -s * cl, c * cl], [cl, -s * sl, c * sl], [0, c, s]])

    v = np.array(v)
    R_M, R_N = earth.radii(lat)
    rates = np.array([v[1] / (R_M + alt), v[0] / ((R_N + alt) * np.cos(lat)), v[2]])
    h = 1e-3
    after, before = (np.array([lat, lon, alt]) + s * h * rates for s in (1, -1))
    np.testing.assert_allclose(C_en(lat, lon).T @ (ecef(*after) - ecef(*before)) / (2 * h), v, atol=2e-5, rtol=1e-7)
    S = C_en(lat, lon).T @ (C_en(*after[:2]) - C_en(*before[:2])) / (2 * h)
    turn = np.array([S[2, 1], S[0, 2], S[1, 0]])
    np.testing.assert_allclose(earth.transport_rate_n(lat, alt, v), turn, atol=1e-12, rtol=1e-6)


@given(latitudes)
def test_earth_rate_points_to_the_pole(lat):
    w = earth.earth_rate_n(lat)
    assert np.linalg.norm(w) == pytest.approx(earth.EARTH_RATE, rel=1e-14)
    np.testing.assert_allclose(w / earth.EARTH_RATE, [0.0, np.cos(lat), np.sin(lat)], atol=1e-15)
    g = earth.gravity_n(lat, 10.0)
    np.testing.assert_array_equal(g, [0, 0, -earth.normal_gravity(lat, 10.0)])


def test_arrays_are_the_scalars_and_kernels_the_same_bits_to_rounding():
    lat, alt = np.linspace(-1.5, 1.5, 7), np.linspace(0, 9000, 7)
    v = np.arange(21.0).reshape(7, 3)
    gravity, radii = compiled(earth.normal_gravity_at), compiled(earth.radii_at)
    for k in range(7):
        assert earth.normal_gravity(lat, alt)[k] == pytest.approx(earth.normal_gravity(lat[k], alt[k]), rel=1e-15)
        s2 = np.sin(lat[k]) ** 2
        assert gravity(s2, alt[k]) == pytest.approx(earth.normal_gravity(lat[k], alt[k]), rel=1e-15)
        assert radii(s2) == pytest.approx(earth.radii(lat[k]), rel=1e-15)
        for many, one in (
            (earth.earth_rate_n(lat), earth.earth_rate_n(lat[k])),
            (earth.transport_rate_n(lat, alt, v), earth.transport_rate_n(lat[k], alt[k], v[k])),
            (earth.gravity_n(lat, alt), earth.gravity_n(lat[k], alt[k])),
        ):
            np.testing.assert_allclose(many[k], one, rtol=1e-15)


@given(latitudes, st.floats(-3.1, 3.1), st.floats(-10e3, 1000e3))
def test_earth_fixed_and_back(lat, lon, alt):
    place = earth.ecef_from_geodetic(lat, lon, alt)
    np.testing.assert_allclose(place, ecef(lat, lon, alt), rtol=1e-15)
    again = earth.geodetic_from_ecef(place)
    np.testing.assert_allclose(again[:2], [lat, lon], atol=3e-15)
    assert again[2] == pytest.approx(alt, abs=1e-8)


@given(latitudes, st.floats(-3.1, 3.1))
def test_axes_are_the_derivatives_of_the_place(lat, lon):
    R_M, R_N = earth.radii(lat)
    h = 1e-4
    step = [(0, h / (R_N * np.cos(lat)), 0), (h / R_M, 0, 0), (0, 0, h)]
    moved = [ecef(lat + a, lon + b, c) - ecef(lat - a, lon - b, -c) for a, b, c in step]
    np.testing.assert_allclose(np.array(moved).T / (2 * h), earth.ecef_axes(lat, lon), atol=1e-4)
