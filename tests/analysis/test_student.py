"""Student's t distribution against the tables and SciPy's."""

import math

import pytest
from scipy.special import ndtri, stdtr, stdtrit

from truenorth.analysis.student import as_normal, below, student_limit, tail

FREEDOM = (0.5, 1, 2, 3.3, 9, 30, 100, 999, 1000, 1e4, 1e7, 1e12)


@pytest.mark.parametrize(("dof", "table"), [(1, 12.706), (4, 2.776), (30, 2.042)])
def test_the_limit_of_students_t_is_that_of_the_tables(dof, table):
    assert student_limit(0.05, dof) == pytest.approx(table, abs=5e-4)
    assert as_normal(student_limit(0.05, dof), dof) == pytest.approx(1.95996, abs=1e-5)


def test_without_a_degree_of_freedom_nothing_is_beyond_the_limit():
    assert student_limit(0.05, 0) == math.inf


@pytest.mark.parametrize("dof", FREEDOM)
@pytest.mark.parametrize("t", [0.0, 1e-3, 0.7, 1.0, 2.0, 5.0, 12.0])
def test_tail_and_normal_are_as_scipy_has_them(dof, t):
    chance = stdtr(dof, -t)
    assert tail(t, dof) == pytest.approx(chance, rel=1e-9)
    assert below(-t, dof) == pytest.approx(chance, rel=1e-9)
    assert below(t, dof) == pytest.approx(1.0 - chance, rel=1e-12)
    assert as_normal(-t, dof) == pytest.approx(-ndtri(chance), rel=1e-10, abs=1e-12)


@pytest.mark.parametrize("dof", [dof for dof in FREEDOM if dof >= 1])
@pytest.mark.parametrize("chance", [0.9, 0.05, 1e-3, 1e-6, 1e-9])
def test_limit_is_as_scipy_has_it(dof, chance):
    assert student_limit(chance, dof) == pytest.approx(-stdtrit(dof, 0.5 * chance), rel=1e-9)


def test_what_is_known_well_is_normal():
    assert as_normal(-3.0, math.inf) == 3.0
    assert as_normal(100.0, 1000.0) < 100.0
