"""Networks give the damping they promise; the correction of an undamped INS is the damped loop; switching."""

import math

import numpy as np
import pytest

from tests.damping.marine_case import ideal_and_truth, paper_errors
from truenorth.core import earth
from truenorth.core.errors import UsageError
from truenorth.damping.course import linearised
from truenorth.damping.loop import Loop, Mode, eigenvalues, in_words, network_correction
from truenorth.damping.networks import NO_NETWORK, SCHULER_RATE, Network, first_order, second_order
from truenorth.errors.marine import DP, DV, MOTION, PHI, MarineModel
from truenorth.state.track import Track

QUIET = MarineModel(0.0, 0.0)
MADE = {"first": first_order, "second": second_order}


def still_course(lat, v=(0.0, 0.0), epochs=2):
    """A vehicle at a latitude (deg) with a velocity, as if it did not move on."""
    place = np.tile([math.radians(lat), 0.0, 0.0], (epochs, 1))
    return Track.of_motion(
        10.0 * np.arange(epochs), np.tile(np.eye(3), (epochs, 1, 1)), np.tile([*v, 0.0], (epochs, 1)), place
    )


@pytest.mark.parametrize("make", [first_order, second_order])
@pytest.mark.parametrize("damping", [0.1, 0.3, 0.5, 0.707, 0.9])
@pytest.mark.parametrize("stretch", [1.1, math.sqrt(2.0), 2.0])
def test_the_pendulum_has_the_damping_asked_for(make, damping, stretch):
    """Roots of ``s^2 + w_s^2 H(s)``: one pair at ``stretch w_s`` with the ratio, all to the left."""
    network = make(damping, stretch)
    roots = np.roots(
        np.polyadd(np.polymul([1, 0, 0], network.denominator), SCHULER_RATE**2 * np.array(network.numerator))
    )
    wanted = stretch * SCHULER_RATE * complex(-damping, math.sqrt(1.0 - damping**2))
    assert np.abs(roots - wanted).min() < 1e-6 * SCHULER_RATE
    assert roots.real.max() < 0
    assert network.response(0.0) == pytest.approx(1.0)
    if make is second_order:
        assert abs(network.response(1e3j)) == pytest.approx(1.0, abs=1e-4)


def test_the_state_space_form_is_the_network():
    for network in (first_order(0.3), second_order(0.7)):
        A, B, C, D = network.realised()
        for s in (1e-4j, 1e-3j, 0.1j):
            found = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
            assert found == pytest.approx(complex(network.response(s)))


@pytest.mark.parametrize("lat", [-60.0, 20.0, 45.78])
def test_undamped_modes(lat):
    """Schuler split by Foucault, 24 h, and longitude, which does not come back."""
    found = eigenvalues(still_course(lat), Loop(NO_NETWORK))
    assert [m.name for m in found] == ["schuler", "schuler", "earth", "still"]
    g, (R_M, R_N) = earth.normal_gravity(math.radians(lat), 0.0), earth.radii(math.radians(lat))
    w_s, foucault = math.sqrt(g / math.sqrt(R_M * R_N)), earth.EARTH_RATE * math.sin(math.radians(lat))
    rates = [m.eigenvalue.imag for m in found]
    assert rates[0] - rates[1] == pytest.approx(2 * abs(foucault), rel=0.02)
    assert 0.5 * (rates[0] + rates[1]) == pytest.approx(w_s, rel=2e-3)
    assert found[2].period / 3600 == pytest.approx(23.93, abs=0.02)
    assert all(abs(m.eigenvalue.real) < 1e-9 for m in found)


@pytest.mark.parametrize("lat", [-80.0, -45.0, 1.0, 60.0, 80.0])
@pytest.mark.parametrize("v", [(10.0, 8.0), (-10.0, 8.0), (10.0, -8.0)])
def test_damped_modes_everywhere(lat, v):
    for make in (first_order, second_order):
        modes = eigenvalues(still_course(lat, v), Loop(make(0.5), 0.5))
        for mode in modes:
            if mode.name == "schuler":
                assert 0.35 < mode.damping < 0.6
            elif mode.name == "earth":
                assert 0.3 < mode.damping < 0.7
            elif mode.name == "network":
                assert mode.eigenvalue.real < 0
            else:
                assert abs(mode.eigenvalue.real) < 0.1 * earth.EARTH_RATE  # position itself is not damped


def undamped(hours):
    """A ship's truth, its model, the errors at the start, and what they become in a free INS: those of the motion, its course."""
    _, truth = ideal_and_truth(hours=hours)
    x = paper_errors()
    F, Phi = linearised(truth, QUIET)
    free = [x]
    for step in Phi:
        free.append(step @ free[-1])
    free = np.array(free)[:, MOTION]
    v = truth.v_n.copy()
    v[:, :2] += free[:, DV]
    return truth, F, x, free, Track.of_motion(truth.time, truth.C_nb, v, truth.position)


@pytest.mark.slow
@pytest.mark.parametrize("make", [first_order, second_order])
@pytest.mark.parametrize("azimuth", [0.0, 0.5])
def test_the_correction_is_the_loop(make, azimuth):
    """Undamped errors less the correction obey the damped loop's own equation, its reference being in error."""
    truth, F, x, free, course = undamped(hours=24.0)
    error = np.array([-0.3, 0.2])
    loop = Loop(make(0.5), azimuth)
    corrected = free - network_correction(course, loop, truth.v_n[:, :2] + error)

    # The loop itself, at steps a tenth as long.
    M, N = loop.matrices(F, truth.position[1:, 0], np.ones(len(F)))
    n = M.shape[1]
    u = np.zeros(n)
    u[MOTION] = x[MOTION]
    drive = np.zeros((len(F), n))
    drive[:, MOTION] = F[:, MOTION, 7:] @ x[7:]
    drive += N @ error
    h = truth.interval
    damped = [u]
    for k in range(len(F)):
        A = np.zeros((n + 1, n + 1))
        A[:n, :n], A[:n, n] = h * M[k], h * drive[k]
        term, E = np.eye(n + 1), np.eye(n + 1)
        for i in range(1, 9):
            term = term @ A / i
            E = E + term
        u = E[:n, :n] @ u + E[:n, n]
        damped.append(u)
    damped = np.array(damped)[:, MOTION]
    size = np.abs(damped).max(axis=0)
    assert np.all(np.abs(corrected - damped).max(axis=0) < 0.01 * size)  # measured velocity is held for 10 s


def swing(**options):
    """Greatest velocity error (m/s) in four hours after a switch at 2.5 h, and four hours of undamped before it."""
    truth, _, _, free, course = undamped(hours=8.0)
    switch = 900
    x0 = free[switch] if options.pop("corrected", False) else None
    reference = truth.v_n[:, :2] if options.pop("external", False) else None
    d = free - network_correction(course, Loop(second_order()), reference, start=9000.0, x0=x0, **options)
    return np.abs(d[switch : switch + 1440, DV]).max(), np.abs(free[:, DV]).max()


def test_switching():
    """A cold internal network takes the ship's own speed for an error; a warm one, ramped in, does not; corrected is best."""
    cold, undamped = swing(warm=False)
    ramped, _ = swing(ramp=3600.0)
    corrected, _ = swing(external=True, corrected=True, warm=False)
    assert cold > 2.0 * undamped
    assert ramped < 1.05 * undamped
    assert corrected < 0.3 * undamped


@pytest.mark.slow
def test_a_constant_reference_error_ends_in_the_latitude():
    """With azimuth damping, ``R dL = 2 zeta_U c_N/w_ie`` in either hemisphere, and heading is free of it."""
    for lat in (50.0, -50.0):
        course = still_course(lat, epochs=30000)
        x = network_correction(course, Loop(second_order(), 0.7), course.v_n[:, :2] + np.array([0.0, -0.3]))
        assert -x[-1, DP.start + 1] == pytest.approx(2.0 * 0.7 * -0.3 / earth.EARTH_RATE, rel=0.01)
        assert abs(x[-1, PHI.stop - 1]) < 1e-7


def test_a_silent_reference_coasts():
    """No measurement at all: no correction."""
    course = still_course(45.0, epochs=500)
    x = network_correction(course, Loop(second_order(), 0.5), np.full((500, 2), np.nan))
    np.testing.assert_array_equal(x, 0.0)


def test_what_is_refused():
    with pytest.raises(UsageError, match=r"damping ratio 1\.5"):
        first_order(1.5)
    with pytest.raises(UsageError, match=r"stretch 0\.5"):
        second_order(0.5, 0.5)
    with pytest.raises(UsageError, match="tilts the platform"):
        Network((1.0, 2.0), (1.0, 1.0))
    with pytest.raises(UsageError, match="left half plane"):
        Network((1.0, -1.0), (1.0, -1.0))
    with pytest.raises(UsageError, match="needs a reference velocity"):
        network_correction(still_course(45.0), Loop(second_order(), 0.5))
    with pytest.raises(UsageError, match="below 85 deg"):
        network_correction(still_course(87.0), Loop(second_order(), 0.5), np.zeros((2, 2)))


def test_a_double_pole_that_rounding_splits_does_not_oscillate():
    """Two equal time constants come out as a pair 1e15 s long."""
    rate = -1.0 / 300.0
    said = in_words([Mode("filter", complex(rate, 6e-15)), Mode("filter", complex(rate, 2e-3))])
    assert said == "5.0 min time constant, 52.4 min with ratio 0.86"
