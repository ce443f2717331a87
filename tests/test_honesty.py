"""The matrix of mismatch: its marks, and (slow) every case of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.honesty.__main__ import CASES
from benchmarks.honesty.frame import Case, Line, Outcome, as_markdown, run_case
from truenorth.core.errors import DataError

RUNS = 8


def drawn(factor, refuse=0.0):
    """A case whose errors are so many times their sigma, and of which a share is refused."""

    def run(seed, number):
        rng = np.random.default_rng([seed, number])
        if rng.random() < refuse:
            raise DataError("no")
        return Outcome({"heading": factor * rng.standard_normal(2)})

    return Case("drawn", "errors", run)


def test_marks():
    assert run_case(drawn(1.0), 1, 200).mark == "ok"
    assert run_case(drawn(1.5), 1, 200).mark in ("small", "defect")
    assert run_case(drawn(0.5), 1, 200).mark == "large"
    assert run_case(drawn(6.0), 1, 200).mark == "defect"
    line = run_case(drawn(1.0, refuse=0.5), 1, 50)
    assert line.mark == "refused"
    assert 10 < len(line.refused) < 40
    one = Line(drawn(1.0), 20, {"heading": 1.1}, (), 2.0, 0, 0.1)
    assert one.mark == "ok"  # by chance of twenty runs
    assert "| drawn | errors | 20 | heading 1.10 | 0 | 2.0 | ok |" in as_markdown([one])
    assert math.isfinite(one.seconds)
    assert Line(drawn(1.0), 8, {"heading": 1.1}, ("no",), 2.0, 0, 0.1).mark == "ok"  # one may be chance
    assert Line(drawn(1.0), 8, {"heading": 1.1}, ("no", "no"), 2.0, 0, 0.1).mark == "refused"
    few = Line(drawn(1.0), 8, {"heading": 1.8}, (), 2.5, 0, 0.1, {"heading": 3})
    assert few.mark == "ok"  # three of eight runs showed it
    assert replace(few, shown={}).mark == "small"
    assert Line(drawn(1.0), 1, {}, ("no",), 0.0, 0, 0.1).mark == "refused"  # all of one is no chance
    assert Line(drawn(1.0), 20, {"heading": 1.1}, ("no",) * 3, 2.0, 0, 0.1).mark == "refused"
    to_flag = replace(drawn(1.0), flagged=True)
    assert Line(to_flag, 8, {"heading": 1.1}, ("no",) * 8, 0.0, 0, 0.1).mark == "flagged"
    assert Line(to_flag, 8, {"heading": 1.1}, ("no",) * 7, 4.2, 0, 0.1).mark == "defect"
    assert Line(to_flag, 8, {"heading": 2.9}, (), 3.9, 0, 0.1).mark == "small"


def test_every_case_has_a_name_of_its_own():
    names = [(case.procedure, case.name) for case in CASES]
    assert len(set(names)) == len(names)
    assert len({case.procedure for case in CASES}) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("case", [c for c in CASES if not c.left_out], ids=lambda c: f"{c.procedure}: {c.name}")
def test_sigma_is_honest(case):
    """No run beyond four sigmas with a good status, no sigma that is too small, few refusals; eight worlds each."""
    line = run_case(case, 7, RUNS)
    print(as_markdown([line]).splitlines()[-1])  # shown with -rP
    assert line.mark in ("ok", "large", "flagged"), line.cells()
