"""Models of few states run in the size that `warm` compiles: padding changes no bit, and a size takes half a minute to compile."""

import pytest

from truenorth.core.linalg import SMALL, padded
from truenorth.estimate import run

COMPILED = 2 * SMALL  # rows


@pytest.fixture(autouse=True)
def size_that_is_compiled(monkeypatch):
    monkeypatch.setattr(run, "padded", lambda n: padded(max(n, COMPILED)))
