"""IMUs with every term that a specification may have: noise, biases, axes, g-sensitivity, temperature, lags, steps, places.

The specification is given, as it is drawn from. Procedures and motions are those of the campaign of faults.

Run: ``python -m benchmarks.honesty.specified --runs 20``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.honesty.frame import Case, Outcome, main
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.records.spec_keys import ENTRIES
from truenorth.records.specs import field_of, imu_spec

EVERY = Path(__file__).parents[2] / "examples" / "imu_every_term.yaml"
GOOD = ("aligned", "level_only", "not_converged", "navigated")
# of the errors of `EVERY`, whose gyros are of 1 deg/h
GRADES = {"tactical": 1.0, "navigation": 0.02}
PLAIN = ("bandwidth", "filter_order", "latency", "range", "positions")


def graded(times: float) -> Any:
    """The specification with errors so many times as large; what no better sensor has less of stays."""
    spec = imu_spec(str(EVERY))
    more = {
        field_of(group, key): times * getattr(spec, field_of(group, key))
        for group, key in ENTRIES
        if group in ("gyro", "accel") and key not in PLAIN
    }
    return replace(spec, **more).to_mapping()


def every_term(procedure: str, grade: str) -> Any:
    """A run: motion and errors drawn anew."""
    bench = BENCHES[procedure]

    def scenario(rng: np.random.Generator) -> Any:
        return dict(bench.scenario(rng)) | {"imu": graded(GRADES[grade])}

    drawn = replace(bench, scenario=scenario)

    def run(seed: int, number: int) -> Outcome:
        inputs, truth = drawn.draw(seed, number)
        answer = drawn.align(inputs)
        refused = "" if answer.status in GOOD else f"{answer.status}: {answer.reasons[0]}"
        return Outcome(misses(answer, truth), refused, answer.status)

    return run


CASES = tuple(
    Case("every term of a specification", f"{procedure}, {grade}", every_term(procedure, grade))
    for procedure in ("still", "swaying", "rotary", "gnss", "odometer", "transfer", "attitude", "navigate")
    for grade in GRADES
)

if __name__ == "__main__":
    main(CASES, __doc__)
