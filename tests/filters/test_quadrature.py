"""Quadrature rules: the polynomials they integrate exactly, by the moments of the normal distribution."""

from itertools import product
from math import prod

import numpy as np
import pytest
from numpy.testing import assert_allclose

from truenorth.core.errors import UsageError
from truenorth.filters.quadrature import cubature_rule, gauss_hermite_rule, unscented_rule


def moment(power: int) -> float:
    """``E x^power`` of a standard normal: (power - 1)!! or 0."""
    return float(prod(range(power - 1, 0, -2))) if power % 2 == 0 else 0.0


def by_rule(rule, powers) -> float:
    return float(rule.mean @ np.prod(rule.nodes ** np.array(powers), axis=1))


@pytest.mark.parametrize("order", [2, 3, 4, 5, 7, 9])
@pytest.mark.parametrize("dimensions", [1, 2])
def test_gauss_hermite_integrates_polynomials_up_to_its_degree(order, dimensions):
    rule = gauss_hermite_rule(dimensions, order)
    assert rule.nodes.shape == (order**dimensions, dimensions)
    for powers in product(range(2 * order), repeat=dimensions):
        exact = prod(moment(n) for n in powers)
        scale = by_rule(rule._replace(nodes=np.abs(rule.nodes)), powers)
        assert_allclose(by_rule(rule, powers), exact, rtol=1e-12, atol=1e-12 * scale)
    # And not beyond: the next even power falls short by order!, its Hermite polynomial's norm.
    assert by_rule(rule, (2 * order, *[0] * (dimensions - 1))) < moment(2 * order) * (1.0 - 1e-6)


@pytest.mark.parametrize("dimensions", [1, 3, 6])
@pytest.mark.parametrize(
    "make",
    [
        cubature_rule,
        lambda d: unscented_rule(d, alpha=1.0, beta=2.0, kappa=3.0 - d),
        lambda d: unscented_rule(d, alpha=0.5, beta=0.0, kappa=1.0),
    ],
)
def test_other_rules_are_of_third_degree(make, dimensions):
    rule = make(dimensions)
    for weights in (rule.mean, rule.covariance):
        same = rule._replace(mean=weights)
        for powers in product(range(4), repeat=dimensions):
            if 0 < sum(powers) < 4:
                assert_allclose(by_rule(same, powers), prod(moment(n) for n in powers), atol=1e-12)
    assert_allclose(rule.mean.sum(), 1.0, rtol=1e-13)


def test_kappa_matches_the_fourth_moment_and_beta_adds_to_the_mean_node():
    rule = unscented_rule(2, alpha=1.0, beta=2.0, kappa=1.0)
    assert_allclose(by_rule(rule, (4, 0)), 3.0)
    assert np.all(rule.nodes[0] == 0.0)
    assert_allclose(rule.covariance - rule.mean, [2.0, 0, 0, 0, 0])
    assert_allclose(rule.mean[0], 1.0 / 3.0)


def test_the_first_node_is_nearest_to_the_mean():
    for rule in (gauss_hermite_rule(2, 5), gauss_hermite_rule(3, 2), cubature_rule(4)):
        norms = np.linalg.norm(rule.nodes, axis=1)
        assert norms[0] == norms.min()


def test_no_dimension_is_refused():
    for make in (cubature_rule, lambda d: gauss_hermite_rule(d, 3)):
        with pytest.raises(UsageError, match="dimensions is 0"):
            make(0)
