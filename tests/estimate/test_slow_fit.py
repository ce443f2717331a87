"""A receiver's noise and slow errors by the likelihood of its innovations: found as they were drawn, and in sigma as they are."""

from types import SimpleNamespace

import numpy as np
import pytest

from truenorth.aiding.source import Aiding, state
from truenorth.errors.group import Group
from truenorth.estimate.slow_fit import bounded_misfit, fitted, lowest
from truenorth.quality.absolute import known_as_fixes
from truenorth.quality.slow_aids import FIXES, SPEEDS, Lasting
from truenorth.records import GnssRecord
from truenorth.state.layout import Layout
from truenorth.state.track import Residuals, Track

ROWS = 900
TIME = np.arange(float(ROWS))
SAID = {FIXES: 2.0, SPEEDS: 0.08}


def coloured(rng, white, size, time):
    """White noise and a Gauss-Markov error, (ROWS, 3)."""
    keep, x = np.exp(-1.0 / time), np.empty((ROWS, 3))
    x[0] = size * rng.standard_normal(3)
    for k in range(1, ROWS):
        x[k] = keep * x[k - 1] + size * np.sqrt(1.0 - keep**2) * rng.standard_normal(3)
    return x + white * rng.standard_normal((ROWS, 3))


def innovations(name, e, lasting):
    """Of a filter that knows where it is, and of the receiver what it is given: exact."""
    said = SAID[name]
    a = np.exp(-1.0 / lasting.group.correlation_time)
    P0 = lasting.group.sigma**2
    b, P, R = np.zeros(3), P0.copy(), (lasting.white * said) ** 2
    z, sigma = np.empty_like(e), np.empty_like(e)
    for k in range(ROWS):
        S = P + R
        z[k], sigma[k] = e[k] - b, np.sqrt(S)
        b, P = a * (b + P / S * z[k]), a**2 * (P - P**2 / S) + (1.0 - a**2) * P0
    there = np.ones(ROWS, bool)
    return Residuals(name, TIME, z, sigma, np.sum((z / sigma) ** 2, axis=1), there, 0, TIME, ~there)


def found_in(errors, slow, said=True):
    """Slow errors fitted to these errors of a receiver."""
    unit = {FIXES: "position", SPEEDS: "velocity"}
    sources = [Aiding(n, unit[n], TIME, np.zeros((ROWS, 3)), np.full((ROWS, 3), SAID[n])) for n in errors]
    silent = Lasting(Group("none", np.full(3, 1e-9), 1.0))

    def run(other):
        return SimpleNamespace(residuals=[innovations(n, e, other.get(n, silent)) for n, e in errors.items()])

    return fitted(run, slow, sources, said=said)


@pytest.mark.slow
def test_noise_and_slow_errors_are_found_as_they_were_drawn():
    """Of 900 fixes: noise to 5 %, what lasts for a minute is seen some fifteen times on three axes."""
    rng = np.random.default_rng(3)
    errors = {FIXES: coloured(rng, 0.4, 1.9, 60.0), SPEEDS: coloured(rng, 0.06, 0.03, 5.0)}
    begun = {FIXES: Lasting(Group("GNSS bias", np.full(3, 1.0), 60.0))}
    found, said = found_in(errors, begun)
    assert found[FIXES].white * SAID[FIXES] == pytest.approx(0.4, rel=0.1)
    assert found[FIXES].group.sigma[0] == pytest.approx(1.9, rel=0.3)
    assert found[FIXES].group.correlation_time == pytest.approx(60.0, rel=0.6)
    assert found[SPEEDS].white * SAID[SPEEDS] == pytest.approx(0.06, rel=0.1)
    assert found[SPEEDS].group.sigma[0] == pytest.approx(0.03, rel=0.2)
    assert found[SPEEDS].group.correlation_time == pytest.approx(5.0, rel=0.5)
    assert [item.figures["name"] for item in said] == [SPEEDS]  # of places it was said when they were seen


@pytest.mark.slow
def test_velocities_without_colour_get_none_that_matters():
    rng = np.random.default_rng(4)
    errors = {FIXES: coloured(rng, 0.4, 1.9, 60.0), SPEEDS: 0.08 * rng.standard_normal((ROWS, 3))}
    found, said = found_in(errors, {FIXES: Lasting(Group("GNSS bias", np.full(3, 1.0), 60.0))})
    assert found[SPEEDS].group.sigma[0] < 0.2 * 0.08
    assert said == []


def test_what_the_user_says_of_slow_errors_is_left_as_it_is():
    said = state("GNSS", "bias", np.full(3, 1.0), 60.0)
    source = Aiding(FIXES, "position", TIME, np.zeros((ROWS, 3)), np.full((ROWS, 3), 2.0), states=said)
    assert fitted(None, {}, [source], said=True) == ({}, [])


def test_an_outlier_costs_what_the_gate_allows():
    rng = np.random.default_rng(5)
    e = coloured(rng, 2.0, 1e-6, 1.0)
    lasting = Lasting(Group("none", np.full(3, 1e-9), 1.0))
    before = bounded_misfit([innovations(FIXES, e, lasting)])
    e[100] += 500.0
    e[200] += 50.0
    assert 0.0 < bounded_misfit([innovations(FIXES, e, lasting)]) - before < 2 * 22.0


def test_the_lowest_point_is_found_and_nothing_worse_is_taken():
    middle = np.array([[0.3, -0.8], [1.1, 0.2]])
    np.testing.assert_allclose(
        lowest(lambda x: float(np.sum(20.0 * (x - middle) ** 2)), np.zeros((2, 2))), middle, atol=1e-6
    )
    np.testing.assert_array_equal(lowest(lambda x: float(np.any(x != 0.0)), np.zeros((1, 3))), np.zeros((1, 3)))


@pytest.mark.parametrize(
    ("white", "size", "expected"),
    [
        (0.3, 0.6, np.sqrt(0.5**2 + (1.0 - 0.3**2 - 0.6**2) * 4.0)),  # what is neither noise nor wanders can stay
        (0.6, 0.9, 0.5),  # all that was said has been seen
        (0.5, 2.0, 4.0),  # it says too little: nothing is known of what stays
    ],
)
def test_position_is_known_as_well_as_innovations_leave_it(white, size, expected):
    rows = np.ones(4)
    record = GnssRecord(TIME[:4], 0.7 * rows, 0.1 * rows, 5.0 * rows, position_sigma=np.full((4, 3), 2.0))
    P = np.zeros((1, 9, 9))
    P[0, range(6, 9), range(6, 9)] = 0.5**2
    three = np.zeros((1, 3))
    track = Track(np.zeros(1), np.eye(3)[None], three, three, np.zeros((1, 9)), P, Layout(), ())
    shown = Lasting(Group("GNSS bias", np.full(3, size * 2.0), 60.0), white)
    known = known_as_fixes(track, record, None, shown)
    np.testing.assert_allclose(np.sqrt(np.diagonal(known.P[0])[6:9]), expected)
