"""The shortest time of a call: what the machine can do when nothing else disturbs it."""

from __future__ import annotations

import time
from collections.abc import Callable


def best(call: Callable[[], object], repeats: int) -> float:
    """Shortest time over repeats, s; the first call compiles and does not count."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)
