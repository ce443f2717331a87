"""The shortest time of a call: what the machine can do when nothing else disturbs it; and where its table stands in the docs."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

DOCUMENT = Path(__file__).parents[1] / "docs/performance.md"


def best(call: Callable[[], object], repeats: int) -> float:
    """Shortest time over repeats, s; the first call compiles and does not count."""
    call()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def write_between(marks: tuple[str, str], lines: list[str]) -> None:
    """Put lines between two marks of docs/performance.md."""
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(marks[0])
    after = rest.partition(marks[1])[2]
    DOCUMENT.write_text("\n".join([before + marks[0], *lines, marks[1] + after]), encoding="utf-8")
