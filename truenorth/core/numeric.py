"""What passes for one real number: a number of Python or NumPy, and no text, no masked value, no array of several."""

from __future__ import annotations

from numbers import Real
from typing import Any


def is_number(value: Any) -> bool:
    """Whether a value is one real number; a masked value, which NumPy makes NaN with a warning, is none."""
    if isinstance(value, Real):
        return True
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    return kind != "" and kind in "fiu" and getattr(value, "shape", None) == () and not is_masked(value)


def is_masked(value: Any) -> bool:
    """Whether a value is a single one that its array masks."""
    return getattr(value, "shape", None) == () and bool(getattr(value, "mask", False))
