"""Lines that are put in are found; what a record cannot show is not named. Modes under a filter's gain."""

import numpy as np
import pytest

from tests.damping.test_networks import still_course
from truenorth.core.errors import UsageError
from truenorth.damping import Filter, carried_prior, earth_line, filter_modes, schuler_lines, spectrum
from truenorth.damping.filters import run_filters
from truenorth.errors.marine import MarineModel

DAY = 86400.0


def test_two_lines_that_turn_in_opposite_senses():
    t = 10.0 * np.arange(17280)
    v = 1.5 * np.exp(2j * np.pi * t / (89.1 * 60)) + 0.7 * np.exp(-2j * np.pi * t / (80.2 * 60) + 1j) + 3.0
    fast, slow = schuler_lines(np.stack([v.real, v.imag], axis=1), 10.0)
    assert fast / 60 == pytest.approx(80.2, abs=0.3)
    assert slow / 60 == pytest.approx(89.1, abs=0.3)
    found = spectrum(v, 10.0)
    for period, amplitude in ((89.1, 1.5), (-80.2, 0.7)):
        near = np.argmin(np.abs(found.frequency - 1.0 / (60 * period)))
        assert found.amplitude[near] == pytest.approx(amplitude, rel=0.03)


def test_a_real_signal_and_a_gap():
    t = np.arange(6000.0)
    x = 2.0 * np.cos(2 * np.pi * t / 300.0) + 0.01 * t
    x[1000:1020] = np.nan
    found = spectrum(x, 1.0)
    peak = np.argmax(found.amplitude)
    assert 1.0 / found.frequency[peak] == pytest.approx(300.0, rel=0.01)
    assert found.amplitude[peak] == pytest.approx(2.0, rel=0.03)
    with pytest.raises(UsageError, match="eight at least"):
        spectrum(np.arange(5.0), 1.0)


def test_the_24_hour_line():
    t = 60.0 * np.arange(2880)
    found = earth_line(0.3 * np.sin(2 * np.pi * t / (23.4 * 3600) + 0.4) + 1.0 + 1e-6 * t, 60.0)
    assert found[0] / 3600 == pytest.approx(23.4, abs=0.06)
    assert found[1] == pytest.approx(0.3, rel=0.02)


def test_too_short_a_record_tells_no_line():
    assert np.isnan(schuler_lines(np.ones((100, 2)), 10.0)).all()
    assert np.isnan(earth_line(np.ones(2000), 60.0)).all()


def test_modes_of_a_filter():
    """All decay under filter 1's gain, and the biases' own memory of 300 s is among the modes."""
    course = still_course(45.0, epochs=8000)
    model = MarineModel.of_paper()
    P0 = carried_prior(course, 0, model, np.diag([1.0, 1.0, 1e3, 1e3, *[1e-3] * 3, *[1e-3] * 3, *[5e-8] * 3]) ** 2)
    kind = Filter(model, P0, 0.05)
    found = run_filters(course, course.v_n[:, :2], start=0, kinds={"filter1": kind})["filter1"]
    modes = filter_modes(course, kind, found.P)
    rates = [m.eigenvalue.real for m in modes]
    assert max(rates) < 0.0
    assert min(abs(rate + 1.0 / 300.0) for rate in rates) < 1e-5
    assert all(m.name == "filter" for m in modes)
