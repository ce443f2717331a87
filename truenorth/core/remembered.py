"""What was found in a record, remembered while it is asked for again: checks that build on one another pass over it once."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar
from weakref import ref

R = TypeVar("R")
T = TypeVar("T")
P = ParamSpec("P")


def remembered(function: Callable[Concatenate[R, P], T]) -> Callable[Concatenate[R, P], T]:
    """Give the answer for the last record (and the same numbers) again, as long as that record lives.

    Parameters
    ----------
    function : callable
        Of one record, which never changes, and of numbers by their places. Nobody writes to its answer, either.
    """
    last: tuple[Callable[[], Any], tuple[Any, ...], T] | None = None

    @wraps(function)
    def answer(record: R, *args: P.args, **kwargs: P.kwargs) -> T:
        nonlocal last
        kept = last
        if kept is not None and kept[0]() is record and kept[1] == args and not kwargs:
            return kept[2]
        found = function(record, *args, **kwargs)
        if not kwargs:
            last = ref(record), args, found
        return found

    return answer
