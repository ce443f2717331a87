"""What was found in a record, remembered while it is asked for again: checks that build on one another pass over it once."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar
from weakref import ref

R = TypeVar("R")
T = TypeVar("T")


def remembered(function: Callable[[R], T]) -> Callable[[R], T]:
    """Give the answer for the last record again, as long as that record lives.

    Parameters
    ----------
    function : callable
        Of one record, which never changes. Nobody writes to its answer, either.
    """
    last: tuple[Callable[[], Any], T] | None = None

    @wraps(function)
    def answer(record: R) -> T:
        nonlocal last
        kept = last
        if kept is not None and kept[0]() is record:
            return kept[1]
        found = function(record)
        last = ref(record), found
        return found

    return answer
