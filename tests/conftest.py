"""What holds for all tests."""

from __future__ import annotations

from hypothesis import settings

# Time on the wall counts what else the machine does; the first example of a property may compile its kernels.
settings.register_profile("truenorth", deadline=None)
settings.load_profile("truenorth")
