"""Memory that is free goes back to the system."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any


@cache
def _trim() -> Any:
    try:
        return ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # another C library than GNU's
        return None


def give_back() -> None:
    """Let the C library give back what it keeps for later; nothing where it cannot.

    What a thread has freed between blocks that are in use stays in the process otherwise, and the next large piece of work takes
    new memory besides.
    """
    trim = _trim()
    if trim is not None:
        trim(0)
