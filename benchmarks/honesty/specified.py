"""IMUs with every term that a specification may have: noise, biases, axes, g-sensitivity, temperature, lags, steps, places.

The specification is given, as it is drawn from. Procedures and motions are those of the campaign of faults. The plumb line is
deflected as sigma of an alignment allows for; a slave is levelled by its master.

Run: ``python -m benchmarks.honesty.specified --runs 20``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.honesty.frame import Case, Outcome, main
from truenorth.alignment.result import Alignment
from truenorth.alignment.task import deflection_covariance
from truenorth.campaign.fault_benches import BENCHES, misses
from truenorth.core.earth import normal_gravity
from truenorth.records.spec_keys import ENTRIES
from truenorth.records.specs import field_of, imu_spec

Array = NDArray[np.float64]

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
        off = misses(answer, truth)
        if isinstance(answer, Alignment) and answer.transfer is None:  # a slave is levelled by its master
            off = _by_the_plumb_line(off, answer, np.random.default_rng([seed, number, 1]))
        return Outcome(off, refused, answer.status)

    return run


def _by_the_plumb_line(off: dict[str, Array], answer: Alignment, rng: np.random.Generator) -> dict[str, Array]:
    """The misses of an IMU that levels itself by a plumb line that is deflected; the simulator's is straight."""
    here = answer.position
    drawn = rng.multivariate_normal(
        np.zeros(3), deflection_covariance(here.lat, float(normal_gravity(here.lat, here.alt)))
    )
    more = drawn / np.sqrt(np.diag(answer.phi_covariance))
    return {name: x + more[{"level": slice(2), "heading": slice(2, 3)}[name]] for name, x in off.items()}


CASES = tuple(
    Case("every term of a specification", f"{procedure}, {grade}", every_term(procedure, grade))
    for procedure in ("still", "swaying", "rotary", "gnss", "odometer", "transfer", "attitude", "navigate")
    for grade in GRADES
)

if __name__ == "__main__":
    main(CASES, __doc__)
