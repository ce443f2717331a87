"""Bands of a log that is sparse or falls silent: at rows that come between the epochs of the covariances, and without any."""

from dataclasses import replace

import numpy as np
import pytest

from tests.damping.marine_case import fix_rows, ideal_and_truth
from tests.damping.test_filters import SIGMA, WALKS, reference
from truenorth.damping.bands import filter_bands, network_bands
from truenorth.damping.filters import Filter, run_filters
from truenorth.damping.fix_rows import Weighed
from truenorth.damping.loop import Loop, network_correction
from truenorth.damping.networks import NO_NETWORK, second_order
from truenorth.errors.log import LogErrors
from truenorth.errors.marine import DP, DV, PHI, MarineModel

STEP = 10  # epochs between the covariances of a course of 1 Hz
FIRST = 3  # epoch of the log's first row: no covariance stands there
SILENT = slice(600, 1200)  # epochs
SETTLED = 300  # epoch from which the errors grow little within a step


@pytest.fixture(scope="module")
def course():
    return ideal_and_truth(interval=1.0, hours=0.5)[1]


def sparse(course, silence=slice(0, 0)):
    """Epochs without a row, of a log with one in ten."""
    absent = np.arange(len(course)) % STEP != FIRST
    absent[silence] = True
    return absent


@pytest.fixture(scope="module")
def whole():
    model = MarineModel(**WALKS, groups=LogErrors(0.3, 3600.0).groups())
    return Filter(model, model.prior(np.diag(SIGMA**2)), 0.05)


@pytest.mark.parametrize("silence", [slice(0, 0), SILENT])
def test_bands_of_a_filter_by_a_sparse_log_are_its_own(course, silence):
    """The covariance of truth and filter together gives back the filter's, where their models are one.

    A row counts at the end of its step, from which the errors have no time to grow: while level is unsure that is a
    quarter, later less than a tenth.
    """
    bands, own = alike(course, Filter(MarineModel(**WALKS), np.diag(SIGMA**2), 0.05), sparse(course, silence))
    assert np.all(bands[1:] > 0.75 * own[1:])


def alike(course, kind, absent):
    """Sigmas of a filter by its bands and by itself, which are one once it has settled."""
    rows = reference(course, 0.0)
    rows[absent] = np.nan
    own = run_filters(course, rows, start=0, kinds={"one": kind})["one"].sigma[:, :7]
    bands = filter_bands(course, kind, kind, absent=absent).errors
    np.testing.assert_allclose(bands[SETTLED::STEP], own[SETTLED::STEP], rtol=0.1)
    assert np.all(bands[SETTLED:] > 0.9 * own[SETTLED:])
    return bands, own


def test_a_network_without_rows_is_an_undamped_ins(course, whole):
    """Of all errors; the log's own do not enter."""
    mu, never = np.ones(len(course)), np.ones(len(course), dtype=bool)
    bands = network_bands(course, Loop(second_order(0.5)), whole, mu, log=True, absent=never)
    free = network_bands(course, Loop(NO_NETWORK), whole, mu, log=False)
    np.testing.assert_allclose(bands.errors[::STEP], free.errors[::STEP], rtol=1e-9)


def test_a_network_takes_the_noise_of_the_rows_that_there_are(course, whole):
    """One row in ten is worth ten of which each is a root of ten as noisy."""
    mu, loop = np.ones(len(course)), Loop(second_order(0.5))
    few = network_bands(course, loop, whole, mu, log=True, absent=sparse(course))
    many = network_bands(course, loop, Filter(whole.model, whole.P0, np.sqrt(10.0) * whole.sigma), mu, log=True)
    np.testing.assert_allclose(few.errors[::STEP], many.errors[::STEP], rtol=1e-9)
    # Between covariances: the larger of both ends where a step has few rows, else between them.
    ends = np.stack([many.errors[:-STEP:STEP], many.errors[STEP::STEP]])
    np.testing.assert_allclose(few.errors[4:-1:STEP], ends.max(axis=0), rtol=1e-9)
    np.testing.assert_allclose(many.errors[4:-1:STEP], 0.6 * ends[0] + 0.4 * ends[1], rtol=1e-9)


@pytest.mark.parametrize("stands", [True, False])
def test_bands_of_a_filter_with_fixes_are_its_own(course, stands):
    """Places and an azimuth, two in one step, and one at an epoch of the covariances: they come down at a fix as its own do."""
    z, size = np.full((len(course), 3), np.nan), np.ones((len(course), 3))
    z[[700, 905, 907], :2], size[[700, 905, 907], :2] = 0.0, np.array([50.0, 20.0, 30.0])[:, None]
    z[1203, 2], size[1203, 2] = 0.0, 1e-4
    absent = sparse(course) if stands else np.ones(len(course), dtype=bool)
    kind = Filter(MarineModel(**WALKS), np.diag(SIGMA**2), 0.05, fixes=fix_rows(course, z, size))
    _, own = alike(course, kind, absent)
    assert np.all(own[700, DP] < 0.7 * own[699, DP])
    assert np.all(own[910, DP] < 0.7 * own[900, DP])
    assert own[1210, PHI][2] < 0.9 * own[1200, PHI][2]


def test_a_fix_is_as_good_as_its_sigma_by_every_reading_of_the_log(course, whole):
    """A drift that the filter takes to be faster than it is changes what it makes of the log, not where a sharp fix leaves it."""
    z, size = np.full((len(course), 3), np.nan), np.full((len(course), 3), 0.5)
    z[900, :2] = 0.0
    fast = MarineModel(**WALKS, groups=LogErrors(0.3, 600.0).groups())
    kind = Filter(fast, fast.prior(np.diag(SIGMA**2)), 0.05, fixes=fix_rows(course, z, size))
    bands = filter_bands(course, whole, kind, absent=sparse(course)).errors[:, DP]
    without = filter_bands(course, whole, replace(kind, fixes=None), absent=sparse(course)).errors[:, DP]
    np.testing.assert_allclose(bands[:890], without[:890], rtol=1e-12)
    assert np.all(without[900] > 5.0)
    np.testing.assert_allclose(bands[900], 0.5, rtol=0.02)
    assert np.all(bands[891:900] >= bands[890])
    assert np.all(bands[901:] < without[901:])


def test_place_and_heading_of_a_network_begin_anew_with_a_fix(course, whole):
    """At its own epoch, within a step of the covariances: nothing before it is touched, what it shows is as good as the fix."""
    z, size = np.full((len(course), 3), np.nan), np.ones((len(course), 3))
    z[903, :2], size[903, :2] = [80.0, -60.0], 50.0
    z[905, 2], size[905, 2] = 5e-4, 1e-4
    fixes = replace(fix_rows(course, z, size), anew=True)
    mu, loop, options = np.ones(len(course)), Loop(second_order(0.5)), {"start": float(course.time[0])}
    bands, alone = (network_bands(course, loop, whole, mu, log=True, fixes=each).errors for each in (fixes, None))
    np.testing.assert_array_equal(bands[:901], alone[:901])
    np.testing.assert_allclose(bands[910, DP], 50.0, rtol=1e-9)
    np.testing.assert_allclose(bands[910, PHI][2], 1e-4, rtol=1e-9)
    np.testing.assert_array_equal(bands[910, DV], alone[910, DV])
    weighed, shown = Weighed(fixes.expected(bands)), reference(course, 0.0)
    x, free = (network_correction(course, loop, shown, fixes=each, **options) for each in (weighed, None))
    np.testing.assert_allclose(x[:903], free[:903], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(x[903, DP], [80.0, -60.0], atol=0.05)
    np.testing.assert_allclose(x[905, PHI][2], 5e-4, atol=1e-8)
    assert weighed.used.all()
