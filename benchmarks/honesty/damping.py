"""Damping of a free INS at sea with errors of the log that a model may leave out.

Run: ``python -m benchmarks.honesty.damping --runs 20``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from benchmarks.honesty.frame import Case, Outcome, main
from benchmarks.honesty.voyage import HOUR, SPEC, scaled, voyage
from truenorth.aiding.aids import VelocityLog
from truenorth.damping.options import Damper
from truenorth.errors.log import LogErrors
from truenorth.records.specs import ImuSpec

BODY = LogErrors(scale=0.005, mounting=math.radians(0.3), bias=0.1)


def damped(
    method: str,
    true: LogErrors,
    assumed: Any = None,
    frame: str = "navigation",
    spec: ImuSpec = SPEC,
    fixed: bool = False,
) -> Any:
    """A run of a method: a log with errors drawn from `true`, taken for `assumed`; None: as it is by default."""

    def run(seed: int, number: int) -> Outcome:
        ship = voyage(seed, number, spec=spec)
        aid = [VelocityLog(ship.log(true, frame), errors=assumed), *([ship.fixes()] if fixed else [])]
        result = ship.navigated(aid, imu=spec, damping=Damper(method), output=8.0)
        return ship.outcome(result, drifts=fixed)

    return run


def switched(seed: int, number: int) -> Outcome:
    """Internal damping in hard turns, switched; its RMS of velocity, undamped and always damped compared."""
    ship = voyage(seed, number)
    none, on, found = (
        ship.navigated(damping=damper, output=8.0)
        for damper in (Damper("none"), Damper("internal", switching=False), Damper("internal"))
    )
    sizes = (ship.velocity_error(result) for result in (none, on, found))
    words = "undamped {:.2f}, always damped {:.2f}, switched {:.2f} m/s".format(*sizes)
    return replace(ship.outcome(found), said=words)


def current(hours: float) -> LogErrors:
    """Half a metre a second for so many hours."""
    return LogErrors(drift=0.5, drift_time=hours * HOUR)


CONSTANT = LogErrors(drift=0.3, drift_time=math.inf)
CASES = (
    *(
        Case("damping augmented", f"current .5 m/s, {h:g} h, nothing said", damped("augmented", current(h)))
        for h in (1.0, 3.0, 12.0)
    ),
    *(
        Case("damping augmented", f"current .5 m/s, {h:g} h, said", damped("augmented", current(h), current(h)))
        for h in (1.0, 3.0, 12.0)
    ),
    Case("damping augmented", "body log: scale, mounting, bias; nothing said", damped("augmented", BODY, None, "body")),
    Case(
        "damping augmented",
        "body log: current .5 m/s, 3 h, scale, mounting, bias; nothing said",
        damped("augmented", replace(BODY, drift=0.5, drift_time=3.0 * HOUR), None, "body"),
    ),
    Case("damping augmented", "body log: scale, mounting, bias; said", damped("augmented", BODY, BODY, "body")),
    Case("damping augmented", "constant error .3 m/s, nothing said", damped("augmented", CONSTANT)),
    *(
        Case(f"damping {method}", name, damped(method, true))
        for method in ("external", "kalman", "double")
        for name, true in (("constant error .3 m/s", CONSTANT), ("current .5 m/s, 3 h", current(3.0)))
    ),
    *(
        Case(f"damping {method}", "fixes at 10 and 20 h; current .5 m/s, 3 h", damped(method, current(3.0), fixed=True))
        for method in ("augmented", "kalman", "double", "external", "internal")
    ),
    Case("damping double", "IMU five times worse", damped("double", CONSTANT, CONSTANT, spec=scaled(5.0))),
    Case("damping double", "IMU five times better", damped("double", CONSTANT, CONSTANT, spec=scaled(0.2))),
    Case("damping internal", "hard turns, switched", switched),
)

if __name__ == "__main__":
    main(CASES)
