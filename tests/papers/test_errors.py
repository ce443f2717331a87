"""Errors of attitude that all papers share: sigmas and NEES of a covariance, runs together, when a heading is found."""

import numpy as np
import pytest

from truenorth.papers.errors import AttitudeErrors, level, near_from
from truenorth.papers.table import ARCMIN, Table


def test_of_a_covariance():
    """NEES over 3 of errors that are one sigma off along each axis is 1, whatever the axes."""
    axes, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))
    sizes = np.array([1e-4, 2e-4, 3e-3])
    found = AttitudeErrors.of(np.tile(axes @ sizes, (4, 1)), np.tile(axes * sizes**2 @ axes.T, (4, 1, 1)))
    np.testing.assert_allclose(found.nees, np.ones(4))
    np.testing.assert_allclose(found.sigma[0], np.sqrt(np.diag(axes * sizes**2 @ axes.T)))


def test_what_a_method_does_not_say_is_not_in_the_table():
    """Sigmas and NEES stand there where all runs have them."""
    phi = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]]) * ARCMIN
    runs = [AttitudeErrors.with_sigma(one) for one in phi]
    table = Table()
    table.attitude("a", "silent", AttitudeErrors.together(runs))
    table.attitude("a", "filter", AttitudeErrors.of(phi, np.tile(np.eye(3) * ARCMIN**2, (2, 1, 1))))
    assert {f.statistic for f in table.figures if f.method == "silent"} == {"rms", "max"}
    assert table.number_of("a filter heading sigma") == pytest.approx(1.0)
    assert table.number_of("a filter nees mean") == pytest.approx(14.0 / 3.0)
    np.testing.assert_allclose(level(phi) / ARCMIN, np.sqrt([2.5, 6.5]))


def test_when_a_heading_is_found():
    """Found at once, at 3 s, after a relapse at 4 s, and never."""
    phi_u = np.array([[0.5] * 4, [2.0, 2.0, 0.5, 0.5], [2.0, 0.5, -2.0, 0.5], [0.5, 0.5, 0.5, 2.0]])
    np.testing.assert_array_equal(near_from(phi_u, 1.0, np.arange(1.0, 5.0)), [0.0, 3.0, 4.0, np.inf])
