"""Charts of an alignment: bands without outlines, a heading only where there is one, numbers without exponents."""

import numpy as np
import pytest

from truenorth.core.units import significant
from truenorth.figures.convergence import Course
from truenorth.report.charts import _convergence, _sigmas

T = np.arange(20.0)
ANGLES = [Course(name, 0.1 / (1 + T), 0.2 / (1 + T), np.full(20, 0.005)) for name in ("heading", "pitch", "roll")]


@pytest.mark.parametrize("known", [True, False])
def test_a_refused_heading_is_not_drawn(known):
    figure = _convergence(T, ANGLES, known)
    assert ("heading" in {trace.name for trace in figure.data}) == known
    bands = [trace for trace in figure.data if trace.fill == "toself"]
    assert len(bands) == (6 if known else 4)
    assert {trace.mode for trace in bands} == {"none"}


def test_sigmas_are_drawn_over_the_logarithm_of_time():
    figure = _sigmas(T, ANGLES)
    assert figure.layout.xaxis.type == "log"
    assert all(trace.x.min() > 0 for trace in figure.data)


def test_numbers_for_people_have_no_exponent():
    assert [significant(x) for x in (1000.0, 0.0123456, 123456.0)] == ["1000", "0.0123", "123000"]
