"""MATLAB files are read by forks of one process that has loaded SciPy, not by a process each: .3 s a file."""

from __future__ import annotations

import pytest

from tests.forked import Reader
from truenorth.formats import mat


@pytest.fixture(scope="session")
def reader():
    found = Reader()
    yield found
    found.close()


@pytest.fixture(autouse=True)
def forked(request, reader, monkeypatch):
    """Not for a test that asks for the `program` itself."""
    if "program" not in request.fixturenames:
        monkeypatch.setattr(mat, "subprocess", reader)


@pytest.fixture
def program():
    """The reader is started anew for each file, as users have it."""
