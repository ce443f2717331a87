"""What can go wrong, as exceptions that carry the program's exit code.

Every message says what was found, what was expected and what to do; for a file also its name, row and column.
"""

from __future__ import annotations

import math
from collections.abc import Mapping


class TruenorthError(Exception):
    """Base of all errors that Truenorth raises on purpose."""

    exit_code = 1


class UsageError(TruenorthError, ValueError):
    """The call itself is wrong: an option, a unit, a latitude of 95 degrees."""

    exit_code = 2


class DataError(TruenorthError, ValueError):
    """The data are wrong: a missing column, text in a number, time going back."""

    exit_code = 3


class AlignmentError(TruenorthError):
    """The data are sound, but cannot be aligned at all (too short to have an answer of any kind)."""

    exit_code = 4


def expect_positive(where: str, values: Mapping[str, float]) -> None:
    """Refuse values that are not positive and finite.

    Raises
    ------
    UsageError
        The first of them, by its name and where it stands.
    """
    for name, value in values.items():
        if not 0.0 < value < math.inf:
            raise UsageError(f"{where}: {name} is {value:g}; expected a positive number")
