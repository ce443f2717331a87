"""Alignment of an IMU that turns in its log: on a turntable, without anybody's saying so.

Run: ``python -m benchmarks.honesty.turning --runs 20``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.honesty.harness import Case, Log, direction, main, place
from truenorth.alignment import align
from truenorth.alignment.result import Alignment

LEVEL = ("aligned", "level_only", "not_converged")


def _grade(rng: np.random.Generator) -> str:
    return "consumer" if rng.random() < 0.5 else "industrial"


def table(rng: np.random.Generator, imu: Any = None, most: float = 30.0) -> Mapping[str, Any]:
    """A turntable whose axis is vertical, the IMU tilted on it and off its axis: still first, then it turns on and on."""
    rate, still, turning = rng.uniform(5.0, most), rng.uniform(5.0, 60.0), rng.uniform(30.0, 120.0)
    tilt = {name: f"{rng.uniform(-3.0, 3.0):.3f} deg" for name in ("pitch", "roll")}
    first = rng.uniform(0.0, 360.0)
    last = first + rng.choice([-1.0, 1.0]) * rate * (turning + 20.0)
    holds = [
        {"duration": f"{still:.1f} s", "heading": f"{first:.3f} deg"} | tilt,
        {"duration": "10 s", "heading": f"{last:.3f} deg"} | tilt,
    ]
    return {
        "duration": f"{still + turning:.1f} s",
        "rate": "100 Hz",
        "position": place(rng),
        "motion": {"kind": "turntable", "positions": holds, "rate": f"{rate:.2f} deg/s"},
        "lever_arm": [f"{v:.3f} m" for v in 0.3 * rng.random() * direction(rng)],
        "imu": imu or _grade(rng),
    }


def spin(rng: np.random.Generator, imu: Any = None) -> Mapping[str, Any]:
    """A turntable whose axis is not vertical, and turns from the first sample on."""
    return {
        "duration": f"{rng.uniform(30.0, 150.0):.1f} s",
        "rate": "100 Hz",
        "position": place(rng),
        "motion": {"kind": "rest"} | {name: f"{rng.uniform(-3.0, 3.0):.3f} deg" for name in ("pitch", "roll")},
        "imu": imu or _grade(rng),
        "indexer": {"axes": [{"kind": "spin", "direction": "z", "rate": f"{rng.uniform(5.0, 30.0):.2f} deg/s"}]},
    }


def afloat(rng: np.random.Generator, imu: Any) -> Mapping[str, Any]:
    """An IMU that something spins on a base that sways: a mast that turns, of which nothing is said."""
    swing, rate = np.exp(rng.uniform(np.log((0.02, 0.5)), np.log((1.0, 25.0))))

    def tone() -> dict[str, str]:
        size, period = swing * rng.uniform(0.3, 1.0), rng.uniform(3.0, 12.0)
        return {
            "amplitude": f"{size:.4f} deg",
            "period": f"{period:.2f} s",
            "phase": f"{rng.uniform(0.0, 360.0):.1f} deg",
        }

    tones = {name: [tone()] for name in ("heading", "pitch", "roll")}
    return {
        "duration": f"{rng.uniform(100.0, 400.0):.1f} s",
        "rate": "100 Hz",
        "position": place(rng),
        "motion": {"kind": "sway", "heading": f"{rng.uniform(-180.0, 180.0):.1f} deg", "tones": tones},
        "imu": imu,
        "indexer": {"axes": [{"kind": "spin", "direction": "z", "rate": f"{rate:.2f} deg/s"}]},
    }


def by(imu: Any) -> Any:
    def call(log: Log) -> Alignment:
        return align(log.record, log.position, imu)

    return call


CASES = (
    Case(
        "turntable, consumer, specification given",
        lambda rng: table(rng, "consumer"),
        by("consumer"),
        LEVEL,
        of_imu=True,
    ),
    Case("turntable, industrial, given", lambda rng: table(rng, "industrial"), by("industrial"), LEVEL, of_imu=True),
    Case("turntable, low cost, no specification", table, by(None), LEVEL, of_imu=True),
    Case("tilted spin, consumer, given", lambda rng: spin(rng, "consumer"), by("consumer"), LEVEL, of_imu=True),
    Case("tilted spin, industrial, given", lambda rng: spin(rng, "industrial"), by("industrial"), LEVEL, of_imu=True),
    Case("tilted spin, low cost, no specification", spin, by(None), LEVEL, of_imu=True),
    Case("tilted spin, tactical, no specification", lambda rng: spin(rng, "tactical"), by(None), LEVEL, of_imu=True),
    Case(
        "spin on a ship, tactical, no specification", lambda rng: afloat(rng, "tactical"), by(None), LEVEL, of_imu=True
    ),
    Case("spin on a ship, tactical, given", lambda rng: afloat(rng, "tactical"), by("tactical"), LEVEL, of_imu=True),
    Case(
        "spin on a ship, industrial, given", lambda rng: afloat(rng, "industrial"), by("industrial"), LEVEL, of_imu=True
    ),
)

if __name__ == "__main__":
    main(CASES)
