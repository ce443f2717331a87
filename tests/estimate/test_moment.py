"""Which delay is the likeliest, where two are compared by the rows that both have used."""

import numpy as np
import pytest

from truenorth.estimate import moment
from truenorth.estimate.moment import Moment, _best
from truenorth.state.mounting import Mounting


def moments(delays):
    return [Moment(Mounting(latency=delay), None) for delay in delays]


def test_the_likeliest_by_any_of_them(monkeypatch):
    found, likely = moments([-0.1, 0.0, 0.1, 0.2]), {-0.1: 3.0, 0.0: 1.0, 0.1: 9.0, 0.2: 4.0}
    monkeypatch.setattr(
        moment, "_ratio", lambda one, other, given: likely[other.antenna.latency] - likely[one.antenna.latency]
    )
    best, ratios = _best(found, Mounting(latency=0.02))
    assert best is found[2]
    np.testing.assert_allclose(ratios, [-6.0, -8.0, 0.0, -5.0])


@pytest.mark.parametrize("given", [0.0, 0.1, 0.2])
def test_three_that_are_likelier_than_each_other_all_round(monkeypatch, given):
    """An alignment of a log whose forces are 82 % too large went round among them for ever."""
    found = moments([0.0, 0.1, 0.2])

    def ratio(one, other, _):
        i, k = (round(10.0 * each.antenna.latency) for each in (one, other))
        return {0: 0.0, 1: 5.0, 2: -5.0}[(k - i) % 3]

    monkeypatch.setattr(moment, "_ratio", ratio)
    best, ratios = _best(found, Mounting(latency=given))
    assert any(best is one for one in found)
    assert max(ratios) == 0.0
