"""The matrix of mismatch: every procedure, each error on and off, in one table with marks.

Run: ``python -m benchmarks.honesty --runs 20 --markdown``; ``--only damping`` for a part, ``--page docs/honesty.md`` puts the rows
into the page. The worlds are drawn from seed and run.
"""

from __future__ import annotations

from benchmarks.honesty import (
    circling,
    damping,
    driving,
    fixes,
    foreign_rows,
    masts,
    moving,
    navigation,
    sailing,
    specified,
    staying,
    transfer,
    turning,
    underway,
)
from benchmarks.honesty.frame import main
from benchmarks.honesty.harness import framed

CASES = (
    *framed("base that stays", staying.CASES),
    *framed("turning sensor", turning.CASES),
    *framed("vehicle or base", underway.CASES),
    *framed("on the move", moving.CASES),
    *transfer.CASES,
    *damping.CASES,
    *navigation.CASES,
    *circling.CASES,
    *driving.CASES,
    *fixes.CASES,
    *masts.CASES,
    *foreign_rows.CASES,
    *sailing.CASES,
    *specified.CASES,
)

if __name__ == "__main__":
    main(CASES, __doc__)
