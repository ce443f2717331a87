"""The noise of a master's rows, fitted from pass to pass, comes to rest, and the passes with it."""

import math

import numpy as np
import pytest

from truenorth.alignment.transfer_passes import _Steps

TRUE = 0.5


def passes(fit, noise, count=8):
    """The noise of one kind of rows in passes, of which each fits it by the one before."""
    steps, found = _Steps(), [noise]
    for _ in range(count):
        found.append(steps.taken((found[-1], math.inf), (fit(found[-1]), math.inf))[0])
    return np.array(found)


@pytest.mark.parametrize("share", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("begin", [0.05, 1.0, 3.0])
def test_a_noise_that_goes_to_and_fro_comes_to_rest(share, begin):
    """Where the state has as much of an innovation as the noise, what is fitted is as far on the other side."""

    def fit(noise):
        return TRUE * (TRUE / noise) ** share

    found = passes(fit, begin)
    assert found[-1] == pytest.approx(TRUE, rel=0.05)
    assert np.all(np.abs(np.log(found[3:] / TRUE)) <= 0.5 * abs(math.log(begin / TRUE)))


def test_a_noise_that_comes_nearer_is_taken_as_it_is_fitted():
    """Neither from one side nor by small steps back is anything left out."""
    for power in (0.5, -0.3):
        found = passes(lambda noise, power=power: TRUE * (noise / TRUE) ** power, 2.0)
        np.testing.assert_allclose(found, TRUE * (2.0 / TRUE) ** (power ** np.arange(9.0)), rtol=1e-12)


def test_each_kind_of_row_has_steps_of_its_own():
    steps = _Steps()
    first = steps.taken((1.0, 0.01), (0.1, 0.005))
    second = steps.taken(first, (1.0, 0.0025))
    assert first == pytest.approx((0.1, 0.005))
    assert second == pytest.approx((math.sqrt(0.1), 0.0025))
    assert steps.taken((math.inf, 0.01), (math.inf, 0.01)) == (math.inf, 0.01)
