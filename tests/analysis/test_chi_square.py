"""Limits of chi-square variables against SciPy's."""

import pytest
from scipy.special import chdtrc, chdtri

from truenorth.analysis.chi_square import chi_square_limit, tail


@pytest.mark.parametrize("dof", [1, 2, 3, 4, 7, 12, 39, 300, 4001])
@pytest.mark.parametrize("chance", [0.999, 0.5, 0.05, 1e-3, 1e-6, 1e-12, 1e-30])
def test_limits_are_as_scipy_has_them(dof, chance):
    limit = chi_square_limit(chance, dof)
    assert limit == pytest.approx(chdtri(dof, chance), rel=1e-11)
    assert tail(limit, dof) == pytest.approx(chdtrc(dof, limit), rel=1e-11)


def test_what_is_certain_has_no_limit():
    assert chi_square_limit(0.05, 0) == 0.0
    assert chi_square_limit(1.0, 3) == 0.0
    assert tail(0.0, 3) == 1.0
