"""How many runs a statistical test draws: few in every call of the tests, all where the slow ones run."""

import pytest

FEW = 8


def few_and_all(runs, few=FEW):
    """Parametrize `runs`: the bands of such a test follow from it."""
    return pytest.mark.parametrize("runs", [few, pytest.param(runs, marks=pytest.mark.slow)])
