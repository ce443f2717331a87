"""What tests draw in every call, and what where the slow ones run: runs of a statistic, cases of one law."""

import pytest

FEW = 8


def some(few, more):
    """Of cases of one law: `few` in every call, `more` in `test-all`."""
    values = [case if isinstance(case, tuple) else (case,) for case in more]
    return [*few, *(pytest.param(*case, marks=pytest.mark.slow) for case in values)]


def few_and_all(runs, few=FEW):
    """Parametrize `runs`: the bands of such a test follow from it."""
    return pytest.mark.parametrize("runs", [few, pytest.param(runs, marks=pytest.mark.slow)])
