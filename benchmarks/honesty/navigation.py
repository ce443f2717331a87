"""Navigation, free and aided, with errors that a model may leave out: the plumb line's deflection, a current, a log's own errors.

Run: ``python -m benchmarks.honesty.navigation --runs 20``.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.honesty.frame import Case, Outcome, main
from benchmarks.honesty.voyage import HOUR, PLUMB, Voyage, voyage
from truenorth.aiding.aids import Gnss, VelocityLog
from truenorth.core.earth import radii
from truenorth.errors.deflection import Deflection
from truenorth.errors.log import LogErrors
from truenorth.navigation import Mounting
from truenorth.records import GnssRecord

NONE = Deflection(0.0)
LOG = LogErrors(drift=0.5, drift_time=3.0 * HOUR, scale=0.005, mounting=math.radians(0.3), bias=0.1)


def current(hours: float) -> LogErrors:
    """All errors of a log, the current's time given."""
    return replace(LOG, drift_time=hours * HOUR)


def fixes(ship: Voyage, every: float = 60.0) -> Gnss:
    """Positions with 3 m of white noise."""
    k = np.arange(0, len(ship.truth.time), round(every / ship.truth.interval))[1:]
    lat, lon, alt = ship.truth.position[k].T
    R_M, R_N = radii(lat)
    e, n, u = 3.0 * ship.rng.standard_normal((3, len(k)))
    sigma = np.full((len(k), 3), 3.0)
    record = GnssRecord(ship.truth.time[k], lat + n / R_M, lon + e / (R_N * np.cos(lat)), alt + u, position_sigma=sigma)
    return Gnss(record, Mounting(bias_sigma=0.0))


def navigated(true: Deflection, assumed: Deflection, aided: str = "", hours: float = 12.0) -> Any:
    """A run: free, or aided by GNSS, with a plumb line that is deflected."""

    def run(seed: int, number: int) -> Outcome:
        ship = voyage(seed, number, hours=hours, turns=bool(aided), plumb=true)
        aid = [fixes(ship)] if aided else []
        result = ship.navigated(aid, deflection=assumed, check_clocks=False)
        return ship.outcome(result, tuple(hours * share for share in (0.4, 0.6, 0.8, 1.0)))

    return run


def fixed(seed: int, number: int) -> Outcome:
    """A run: free for 30 h, two places and azimuths from outside."""
    ship = voyage(seed, number)
    result = ship.navigated(ship.fixes(), check_clocks=False)
    return ship.outcome(result, drifts=True)


def with_log(true: LogErrors, assumed: LogErrors | None) -> Any:
    """A run aided by a speed log in body axes."""

    def run(seed: int, number: int) -> Outcome:
        ship = voyage(seed, number, hours=12.0)
        aid = VelocityLog(ship.log(true, "body"), Mounting(noise=0.05 / math.sqrt(ship.truth.interval)), assumed)
        result = ship.navigated(aid, check_clocks=False)
        return ship.outcome(result, (3.0, 6.0, 9.0, 12.0))

    return run


CASES = (
    Case("navigation, free", "plumb line straight", navigated(NONE, NONE)),
    Case("navigation, free", "plumb line straight, deflection assumed", navigated(NONE, PLUMB)),
    Case("navigation, free", "deflection 6 arcsec over 20 km, not modelled", navigated(PLUMB, NONE), left_out=True),
    Case("navigation, free", "deflection 6 arcsec over 20 km", navigated(PLUMB, PLUMB)),
    Case("navigation, GNSS", "plumb line straight", navigated(NONE, NONE, "gnss", 6.0)),
    Case("navigation, GNSS", "plumb line straight, deflection assumed", navigated(NONE, PLUMB, "gnss", 6.0)),
    Case(
        "navigation, GNSS",
        "deflection 6 arcsec over 20 km, not modelled",
        navigated(PLUMB, NONE, "gnss", 6.0),
        left_out=True,
    ),
    Case("navigation, GNSS", "deflection 6 arcsec over 20 km", navigated(PLUMB, PLUMB, "gnss", 6.0)),
    Case("navigation, fixes", "place and azimuth at 10 and 20 h", fixed),
    Case("navigation, speed log", "current, scale, mounting, bias", with_log(LOG, LOG)),
    *(
        Case(
            "navigation, speed log",
            f"current .5 m/s, {h:g} h, and the others; nothing said",
            with_log(current(h), None),
        )
        for h in (1.0, 12.0)
    ),
    Case("navigation, speed log", "none of them", with_log(LogErrors(), LogErrors())),
)

if __name__ == "__main__":
    main(CASES)
