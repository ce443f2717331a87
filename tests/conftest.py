"""What holds for all tests."""

from __future__ import annotations

import gc
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.sizes import compiled_only
from truenorth.cli import GARBAGE
from truenorth.core.language import in_language

# Modules and thousands of tests are no garbage: Python would look through them again and again while it collects the tests,
# and as often in each test. A twentieth of the time.
gc.disable()

# A shell that runs the tests in the background lets them ignore interrupts, and programs that they start inherit that.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Files that take the most time, longest first: no worker begins one of them when the others are done.
LONGEST = [
    "formats/test_corpus",
    "documents/test_documents",
    "quality/test_one_sign",
    "live/test_lasting",
    "fuzz/test_listed",
    "test_import",
    "test_cli",
    "navigation/test_departure",
    "campaign/test_run",
    "test_messages",
    "quality/test_inspection",
    "navigation/test_navigate",
    "live/test_gaps",
    "formats/test_second_reading",
    "documents/test_commands",
    "formats/test_field_logs",
]

# Time on the wall counts what else the machine does; the first example of a property may compile its kernels.
settings.register_profile("truenorth", deadline=None)
settings.load_profile("truenorth")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first; the order within a file stays."""
    root = Path(__file__).parent
    order = {root / f"{name}.py": place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path, len(order)))


def pytest_collection_finish(session: pytest.Session) -> None:
    """Where no slow test is asked for, no size of a filter is compiled but those of `truenorth warm`.

    Garbage is looked for from here on.
    """
    if session.config.option.markexpr == "not slow":
        compiled_only()
    gc.freeze()
    gc.set_threshold(*GARBAGE)  # as the program does
    gc.enable()


@pytest.fixture(autouse=True)
def english() -> Iterator[None]:
    """A test that runs the program in another language leaves it at its end, as the program does."""
    with in_language("en"):
        yield


@pytest.fixture
def without_gyro_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    """Alignments do not ask whether a matrix of the gyros explains their log: the search takes most of the time of some.

    For tests of what else an alignment sees of a log that is spoilt. That question only adds evidence, so that what is refused
    without it is refused with. A sound log has to pass it: tests of those do without this.
    """
    from truenorth.alignment import procedure, rotary

    for module in (procedure, rotary):
        monkeypatch.setattr(module, "gyro_matrix_evidence", lambda *_: [])
