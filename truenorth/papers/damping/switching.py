"""Switching a network in: abruptly, warmed and ramped, and with what a Kalman filter knows taken off first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.course import errors_of
from truenorth.damping.loop import network_correction
from truenorth.errors.marine import DV
from truenorth.papers.damping.methods import NETWORK, SWITCH, Case
from truenorth.papers.damping.truth import HOUR, Voyage

Array = NDArray[np.float64]

WAYS = {
    "cold": "internal, abrupt, network cold",
    "warm": "internal, abrupt, network warm",
    "ramped": "internal, warm, ramped in over 1 h",
    "external": "external, abrupt, cold",
    "corrected": "external, filter 1's estimate taken off",
}
SETTLED = 1.0 * HOUR  # filter 1 listens for so long before the corrected switch


def switches(voyage: Voyage, case: Case, reference: Array) -> dict[str, Array]:
    """(K+1, 2) velocity error after each way of switching, an hour after filter 1 was switched on."""
    at = SWITCH + SETTLED
    begin = round(SWITCH / case.course.interval)
    known = case.estimates["filter1"].x[round(SETTLED / case.course.interval), :7]
    free = errors_of(case.course, voyage.truth)
    assert begin + round(SETTLED / case.course.interval) < len(free)

    def left(reference: Array | None, **options: object) -> Array:
        x = network_correction(case.course, NETWORK, reference, start=at, **options)  # type: ignore[arg-type]
        return np.asarray((free - x)[:, DV])

    return {
        "cold": left(None, warm=False),
        "warm": left(None),
        "ramped": left(None, ramp=HOUR),
        "external": left(reference, warm=False),
        "corrected": left(reference, warm=False, x0=known),
    }


def overshoot(case: Case, found: dict[str, Array]) -> dict[str, float]:
    """Greatest velocity error (m/s) in the three hours after the switch."""
    at = round((SWITCH + SETTLED) / case.course.interval)
    after = slice(at + 1, at + round(3.0 * HOUR / case.course.interval))
    return {name: float(np.linalg.norm(v[after], axis=1).max()) for name, v in found.items()}
