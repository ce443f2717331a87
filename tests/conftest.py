"""What holds for all tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from tests.sizes import compiled_only

# Files that take the most time, longest first: no worker begins one of them when the others are done.
LONGEST = [
    "papers/test_static",
    "alignment/test_published",
    "documents/test_long_commands",
    "alignment/test_in_motion",
    "campaign/test_faults",
    "damping/test_navigation",
    "live/test_moving",
    "live/test_hostile",
    "core/test_compiled",
    "campaign/test_run",
    "campaign/test_kills",
    "filters/test_particle",
    "filters/test_nonlinear",
    "filters/test_noise_estimation",
    "alignment/test_positions",
    "alignment/test_transfer",
    "test_cli",
    "alignment/test_laws",
    "live/test_kinds",
    "papers/test_damping",
    "estimate/test_long",
    "estimate/test_chunks",
    "papers/test_odometer",
    "navigation/test_cli",
    "physics/test_strapdown",
    "estimate/test_run",
    "figures/test_simulation",
    "damping/test_dynamics",
    "quality/test_regimes",
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
    """Where no slow test is asked for, no size of a filter is compiled but those of `truenorth warm`."""
    if session.config.option.markexpr == "not slow":
        compiled_only()
