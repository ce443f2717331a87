"""Alignment on the move against sensors with errors that the model may leave out: late, jittering, noisier than they say.

A car or an underwater vehicle whose speeds, turns and course are drawn in each run. The IMU is industrial where GNSS aids (its
heading is by motion), of navigation grade where the odometer alone does.

What nobody says of a wheel or a receiver is assumed: a wheel that slips by .1 m/s to each side, mounting and scale to be found,
fixes that wander. A world without such errors has errors smaller than sigma allows for. So those rows stand twice: the second time
all that is assumed is drawn from what is assumed of it (``errors as assumed``), and sigma has to be right.

Run: ``python -m benchmarks.honesty.moving --runs 20``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.honesty.harness import Case, Log, main, place
from truenorth.aiding.aids import WHEEL
from truenorth.aiding.sensors import ODOMETER_SIGMA
from truenorth.alignment.in_motion import align_in_motion
from truenorth.alignment.in_motion_task import LATENCY_SIGMA, VELOCITY_FLOOR
from truenorth.alignment.result import Alignment
from truenorth.records import GnssRecord, VelocityRecord

GOOD = ("aligned", "level_only", "not_converged")


def drive(rng: np.random.Generator, fastest: float, rate: float, climb: float = 0.0) -> dict[str, Any]:
    """A stop, then legs of drawn length, speed and turns (deg/s, either way)."""
    speed = fastest * rng.uniform(0.5, 1.0)
    legs: list[dict[str, Any]] = [{"kind": "straight", "duration": f"{rng.uniform(5.0, 25.0):.1f} s"}]
    legs.append({"kind": "accelerate", "to": f"{speed:.2f} m/s", "acceleration": f"{0.1 * fastest:.2f} m/s^2"})
    for _ in range(6):
        angle = rng.choice([-1.0, 1.0]) * rng.uniform(30.0, 120.0)
        legs.append({"kind": "straight", "duration": f"{rng.uniform(5.0, 20.0):.1f} s"})
        legs.append({"kind": "turn", "angle": f"{angle:.1f} deg", "rate": f"{rate * rng.uniform(0.6, 1.0):.2f} deg/s"})
        before, speed = speed, fastest * rng.uniform(0.4, 1.0)
        if f"{speed:.2f}" != f"{before:.2f}":
            legs.append({"kind": "accelerate", "to": f"{speed:.2f} m/s", "acceleration": f"{0.1 * fastest:.2f} m/s^2"})
        if climb:
            slope = climb * rng.uniform(-1.0, 1.0)
            legs.append({"kind": "climb", "slope": f"{slope:.2f} deg", "duration": f"{rng.uniform(5.0, 15.0):.1f} s"})
    legs.append({"kind": "straight", "duration": "300 s"})
    return {"kind": "legs", "heading": f"{rng.uniform(0.0, 360.0):.2f} deg", "legs": legs}


def vehicle(
    imu: str, gnss: Mapping[str, Any] | None, odometer: Mapping[str, Any] | None = None, car: bool = True
) -> Callable[[np.random.Generator], Mapping[str, Any]]:
    """A car, or an underwater vehicle, with these sensors."""

    def scenario(rng: np.random.Generator) -> Mapping[str, Any]:
        tones = {
            name: [{"amplitude": f"{0.2 * rng.uniform(0.3, 1.0):.3f} deg", "period": f"{rng.uniform(0.8, 3.0):.2f} s"}]
            for name in ("roll", "pitch")
        }
        found: dict[str, Any] = {
            "duration": "240 s",
            "rate": "100 Hz",
            "position": place(rng),
            "motion": drive(rng, 15.0, 12.0, 3.0) if car else drive(rng, 4.0, 6.0, 5.0),
            "disturbances": [{"kind": "sway", "tones": tones}],
            "imu": imu,
        }
        if gnss is not None:
            found["gnss"] = {"rate": "1 Hz", **gnss}
        if odometer is not None:
            found["odometer"] = dict(odometer)
        return found

    return scenario


def askew(rng: np.random.Generator) -> Mapping[str, Any]:
    """S-turns, the IMU askew in the vehicle by about a degree, the wheel's scale 2 % off."""
    mounting = [f"{1.5 * rng.standard_normal():.3f} deg", f"{rng.standard_normal():.3f} deg"]
    s_turns = {"kind": "s_turn", "angle": "40 deg", "rate": "8 deg/s", "times": 8, "bank": "flat"}
    legs: list[dict[str, Any]] = [{"kind": "straight", "duration": f"{rng.uniform(10.0, 40.0):.0f} s"}]
    legs += [{"kind": "accelerate", "to": "12 m/s", "acceleration": "1 m/s^2"}, s_turns]
    return {
        "duration": "300 s",
        "rate": "100 Hz",
        "position": place(rng),
        "motion": {
            "kind": "legs",
            "heading": f"{rng.uniform(0.0, 360.0):.2f} deg",
            "legs": [*legs, {"kind": "straight", "duration": "300 s"}],
        },
        "imu": "navigation",
        "odometer": {"scale": f"{2.0 * rng.standard_normal():.3f} %", "mounting": mounting, "noise": "0.02 m/s"},
    }


def cheap(imu: str) -> Callable[[np.random.Generator], Mapping[str, Any]]:
    """The same S-turns with an IMU whose gyros hide the earth's rate: no heading, and level as turns tell it."""
    return lambda rng: {**askew(rng), "imu": imu}


def as_assumed(
    scenario: Callable[[np.random.Generator], Mapping[str, Any]],
) -> Callable[[np.random.Generator], Mapping[str, Any]]:
    """The same world with a wheel whose scale, mounting and arm are drawn from what is assumed of one of which nothing is said.

    What slides neither sideways nor upwards is the point of the vehicle above its wheel, along axes that the IMU's are turned
    from: a velocity in three axes, at that arm and in those axes.
    """

    def drawn(rng: np.random.Generator) -> Mapping[str, Any]:
        found = {key: value for key, value in scenario(rng).items() if key != "odometer"}
        arm = [f"{WHEEL.lever_arm_sigma * x:.3f} m" for x in rng.standard_normal(3)]
        pitch, yaw = np.degrees(WHEEL.angle_sigma) * rng.standard_normal(2)
        wheel = {
            "rate": "10 Hz",
            "scale": f"{100.0 * WHEEL.scale_sigma * rng.standard_normal():.3f} %",
            "misalignment": [f"{pitch:.3f} deg", "0 deg", f"{yaw:.3f} deg"],
            "lever_arm": arm,
        }
        return found | {"velocity_log": wheel}

    return drawn


FIXES = {"position_noise": "2 m", "velocity_noise": "0.05 m/s"}
WANDERING = FIXES | {"position_drift": "2 m", "correlation_time": "60 s"}


def by(
    imu: str,
    change: Callable[[GnssRecord, np.random.Generator], GnssRecord] | None = None,
    noise: float | None = None,
) -> Any:
    """Aligned with what the log has; `change` spoils the fixes, `noise` (m/s, forward) is that of a wheel in three axes."""

    def call(log: Log) -> Alignment:
        gnss, odometer, velocity = (log.aiding.get(name) for name in ("gnss", "odometer", "velocity_log"))
        rng = np.random.default_rng([*log.numbers, 2])
        if gnss is not None and change is not None:
            gnss = change(gnss, rng)
        position = log.start if gnss is None else None
        aids: dict[str, Any] = {"odometer": odometer}
        if velocity is not None and noise is not None:
            aids = {"velocity": slipping(velocity, noise, rng)}
        wheel = WHEEL if odometer is not None or velocity is not None else None
        return align_in_motion(log.record, imu, gnss=gnss, position=position, wheel=wheel, **aids)

    return call


def slipping(wheel: VelocityRecord, noise: float, rng: np.random.Generator) -> VelocityRecord:
    """A wheel as the aligner takes it: late or early, it slips by what is assumed, and has such noise forward, m/s.

    A log of three axes says what a wheel's rows stand for: the constraint is measured, and its noise drawn.
    """
    sigma = np.tile([WHEEL.slip, noise, WHEEL.slip], (len(wheel), 1))
    measured = wheel.velocity + sigma * rng.standard_normal(sigma.shape)
    time = wheel.time + WHEEL.latency_sigma * rng.standard_normal()
    return VelocityRecord(time, measured, "body", sigma, wheel.source)


def places_only(gnss: GnssRecord, rng: np.random.Generator) -> GnssRecord:
    """Without velocities."""
    return replace(gnss, v_n=None, velocity_sigma=None)


def boasting_places(gnss: GnssRecord, rng: np.random.Generator) -> GnssRecord:
    """Without velocities; what it says of its places is that of their white part, and as much is taken for what wanders."""
    assert gnss.position_sigma is not None
    return replace(gnss, v_n=None, velocity_sigma=None, position_sigma=gnss.position_sigma / math.sqrt(2.0))


def assumed_fixes(gnss: GnssRecord, rng: np.random.Generator) -> GnssRecord:
    """A receiver of which nothing is said, as it is assumed: late or early, fixes that wander, velocities with the floor as noise.

    What it says of its places is that of their white part, and as much is taken for what wanders.
    """
    assert gnss.v_n is not None
    assert gnss.position_sigma is not None
    v_n = gnss.v_n + VELOCITY_FLOOR * rng.standard_normal(gnss.v_n.shape)
    time = gnss.time + LATENCY_SIGMA * rng.standard_normal()
    return replace(gnss, time=time, v_n=v_n, position_sigma=gnss.position_sigma / math.sqrt(2.0))


def jittering(gnss: GnssRecord, rng: np.random.Generator) -> GnssRecord:
    """Stamped when they arrived, .1 to .5 s late."""
    time = gnss.time + np.clip(0.3 + 0.1 * rng.standard_normal(len(gnss)), 0.1, 0.5)
    return replace(gnss, time=time)


def boasting(gnss: GnssRecord, rng: np.random.Generator) -> GnssRecord:
    """Whose sigmas are three times too small."""
    assert gnss.position_sigma is not None
    assert gnss.velocity_sigma is not None
    return replace(gnss, position_sigma=gnss.position_sigma / 3.0, velocity_sigma=gnss.velocity_sigma / 3.0)


ODOMETER = {"noise": "0.02 m/s", "scale_sigma": "1 %"}
NOISY = vehicle("navigation", None, {"noise": "0.3 m/s"})
QUIET = vehicle("navigation", None, ODOMETER)
CASES = (
    Case("odometer, S-turns, IMU askew, scale 2 %", askew, by("navigation"), GOOD),
    Case(
        "odometer, S-turns, errors as assumed",
        as_assumed(askew),
        by("navigation", noise=ODOMETER_SIGMA),
        GOOD,
    ),
    *(
        Case(f"odometer, S-turns, {imu} IMU{how}", world(cheap(imu)), by(imu, noise=noise), GOOD)
        for imu in ("industrial", "consumer")
        for how, world, noise in (("", lambda same: same, None), (", errors as assumed", as_assumed, ODOMETER_SIGMA))
    ),
    Case("odometer noisier than usual (.3 m/s)", NOISY, by("navigation"), GOOD),
    Case(
        "odometer noisier than usual (.3 m/s), errors as assumed",
        as_assumed(QUIET),
        by("navigation", noise=0.3),
        GOOD,
    ),
    Case("GNSS, car", vehicle("industrial", FIXES), by("industrial"), GOOD),
    Case("GNSS, car, errors as assumed", vehicle("industrial", WANDERING), by("industrial", assumed_fixes), GOOD),
    Case("GNSS, positions wander by 2 m", vehicle("industrial", WANDERING), by("industrial"), GOOD),
    Case("GNSS late by 1 s, car", vehicle("industrial", FIXES | {"latency": "1 s"}), by("industrial"), GOOD),
    Case(
        "GNSS late by 1 s, underwater", vehicle("tactical", FIXES | {"latency": "1 s"}, car=False), by("tactical"), GOOD
    ),
    Case(
        "GNSS, underwater, errors as assumed",
        vehicle("tactical", WANDERING, car=False),
        by("tactical", assumed_fixes),
        GOOD,
    ),
    Case("GNSS stamps late by .1 to .5 s, drawn", vehicle("industrial", FIXES), by("industrial", jittering), GOOD),
    Case("GNSS with positions only", vehicle("industrial", FIXES), by("industrial", places_only), GOOD),
    Case(
        "GNSS with positions only, errors as assumed",
        vehicle("industrial", WANDERING),
        by("industrial", boasting_places),
        GOOD,
    ),
    Case("GNSS says sigmas three times too small", vehicle("industrial", FIXES), by("industrial", boasting), GOOD),
    Case("GNSS and odometer", vehicle("industrial", WANDERING, ODOMETER), by("industrial"), GOOD),
    Case(
        "GNSS and odometer, errors as assumed",
        as_assumed(vehicle("industrial", WANDERING, ODOMETER)),
        by("industrial", noise=ODOMETER_SIGMA),
        GOOD,
    ),
    # of a wrong class of IMU what is said must be right, and it may be refused
    Case("IMU industrial, given as tactical", vehicle("industrial", FIXES), by("tactical"), GOOD, flagged=True),
    Case("IMU consumer, given as industrial", vehicle("consumer", FIXES), by("industrial"), GOOD, flagged=True),
)

if __name__ == "__main__":
    main(CASES)
