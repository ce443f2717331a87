"""A vehicle under way at steady speed whose log is given as one of a base at rest, and the reverse: rests that must pass.

An underwater vehicle: any course, .5 to 5 m/s, small vibration or a slow roll. Steady speed towards north or south turns
heading and leaves nothing to see: ``v_N / (R w_ie cos L)``. Towards the east it shows as a rate along north, and is refused.

Run: ``python -m benchmarks.honesty.underway --runs 40``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.honesty.harness import Case, Log, main, place
from truenorth.alignment import align
from truenorth.alignment.result import Alignment

REFUSED = ("inconsistent",)


def _tones(rng: np.random.Generator, size: float) -> dict[str, Any]:
    tone = lambda: {"amplitude": f"{size * rng.uniform(0.3, 1.0):.5f} deg", "period": f"{rng.uniform(3.0, 12.0):.3f} s"}  # noqa: E731
    return {name: [tone(), tone()] for name in ("roll", "pitch", "heading")}


def underwater(size: float, imu: str = "navigation") -> Any:
    """At steady speed; its attitude sways by about this, deg."""

    def scenario(rng: np.random.Generator) -> Mapping[str, Any]:
        found: dict[str, Any] = {
            "duration": f"{rng.uniform(200.0, 600.0):.0f} s",
            "rate": "50 Hz",
            "position": place(rng),
            "motion": {
                "kind": "legs",
                "heading": f"{rng.uniform(0.0, 360.0):.3f} deg",
                "speed": f"{0.5 * 10.0 ** rng.random():.3f} m/s",
                "legs": [{"kind": "straight", "duration": "700 s"}],
            },
            "imu": imu,
        }
        if size:
            found["disturbances"] = [{"kind": "sway", "tones": _tones(rng, size)}]
        return found

    return scenario


def rest(size: float, imu: str = "navigation") -> Any:
    """The same at rest."""

    def scenario(rng: np.random.Generator) -> Mapping[str, Any]:
        moving = dict(underwater(size, imu)(rng))
        motion = {"kind": "rest", "heading": moving["motion"]["heading"]}
        return moving | {"motion": motion}

    return scenario


def by(imu: Any) -> Any:
    def call(log: Log) -> Alignment:
        return align(log.record, log.position, imu)

    return call


CASES = tuple(
    Case(f"{name}, sway {size:g} deg, {imu}", make(size, imu), by(imu), left_out=make is underwater)
    for imu in ("navigation",)
    for size in (0.0, 0.02, 0.5)
    for name, make in (("under way as rest", underwater), ("rest", rest))
)

if __name__ == "__main__":
    main(CASES)
