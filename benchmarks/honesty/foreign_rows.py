"""Rows of the foreign world: alignment and navigation of vehicles that the library's own simulator does not know.

Run: ``python -m benchmarks.honesty.foreign_rows --runs 20``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.honesty import vehicles
from benchmarks.honesty.foreign import ARCSEC, E2, STEP, A, World, counted, exp, fixed, log, logged, sensed, world
from benchmarks.honesty.frame import Case, Outcome, main
from truenorth.aiding.aids import Gnss, Indexer
from truenorth.alignment import align
from truenorth.alignment.in_motion import align_in_motion
from truenorth.core.position import Position
from truenorth.navigation import Mounting, Start, navigate
from truenorth.records import EncoderRecord
from truenorth.records.specs import imu_spec
from truenorth.state.layout import BA, BG, DP, DV, PHI

DEG = vehicles.DEG
GOOD = ("aligned", "level_only", "not_converged")
Vehicle = Callable[[np.random.Generator, float], World]


def _found(answer: Any, true: World) -> Outcome:
    """Heading and level of an alignment over their sigmas."""
    C = true.at(answer.time)[2]
    phi = -log(answer.C_nb @ C.T)
    phi[:2] = answer.C_nb[:2] @ np.cross(answer.C_nb[2], C[2])  # level alone, whatever heading
    ratio = phi / np.sqrt(np.diag(answer.phi_covariance))
    known = {"heading": ratio[2:]} if answer.status == "aligned" else {}
    refused = "" if answer.status in GOOD else f"{answer.status}: {answer.reasons[0]}"
    said = f"{answer.status} {answer.method} {np.degrees(phi).round(4)} deg"
    return Outcome(known | {"level": ratio[:2]}, refused, said)


def aligned(vehicle: Vehicle, grade: str, length: float, by: str = "", given: bool = True, **more: Any) -> Any:
    """A run of alignment: on a base that stays, or by what aids; `given`: with the specification."""

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 9])
        true = vehicle(rng, length)
        record = sensed(rng, true, imu_spec(grade), 250.0 if vehicle is vehicles.multicopter else 100.0)
        lat, lon, alt = (true.place.mean(axis=0) if not by else true.place[0]).tolist()
        place = Position(lat, lon, alt)
        if not by:
            return _found(align(record, place, grade if given else None), true)
        aids: dict[str, Any] = {}
        if "gnss" in by:
            arm = np.array([0.3, -0.5, 1.2]) + 0.02 * rng.standard_normal(3)
            aids |= {
                "gnss": fixed(rng, true, arm, **more),
                "antenna": Mounting(lever_arm=np.array([0.3, -0.5, 1.2]), lever_arm_sigma=0.02, latency_sigma=0.03),
            }
        if "odometer" in by:
            aids["odometer"] = counted(rng, true)
        if "log" in by:
            aids["velocity"] = logged(rng, true)
        return _found(align_in_motion(record, grade, position=None if "gnss" in by else place, **aids), true)

    return run


def spun(rng: np.random.Generator, still: World) -> tuple[World, EncoderRecord]:
    """The same world for an IMU that an indexer spins about z and, on that, about x; and the angles."""
    angles = np.outer(still.time, rng.uniform([8.0, 2.0], [18.0, 6.0]) * DEG)
    zero = np.zeros(len(angles))
    outer, inner = (np.stack(v, axis=1) for v in ((zero, zero, angles[:, 0]), (angles[:, 1], zero, zero)))
    C = still.C @ exp(outer) @ exp(inner)
    rows = slice(None, None, round(0.01 / STEP))
    encoder = EncoderRecord(still.time[rows], ARCSEC * np.round(angles[rows] / ARCSEC))
    return world(rng, still.place[0], still.v, C, np.zeros_like(still.v), still.speed), encoder


def indexed(vehicle: Vehicle, grade: str, length: float, given: bool = True) -> Any:
    """A run of alignment of an IMU that spins on an indexer of two axes; `given`: with the specification."""

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 11])
        base = vehicle(rng, length)
        true, encoder = spun(rng, base)
        place = Position(*true.place.mean(axis=0).tolist())
        record = sensed(rng, true, imu_spec(grade))
        return _found(align(record, place, grade if given else None, aid=Indexer(encoder)), base)

    return run


def navigated(vehicle: Vehicle, grade: str, length: float, **more: Any) -> Any:
    """A run of navigation with GNSS, from a start that is off as its covariance says."""

    def run(seed: int, number: int) -> Outcome:
        rng = np.random.default_rng([seed, number, 10])
        true, spec = vehicle(rng, length), imu_spec(grade)
        record = sensed(rng, true, spec, 250.0 if vehicle is vehicles.multicopter else 100.0)
        arm = np.array([0.3, -0.5, 1.2])
        gnss = fixed(rng, true, arm, **more)
        sigma = np.concatenate([np.array([0.2, 0.2, 2.0]) * DEG, np.repeat([0.05, 2.0], 3), np.zeros(6)])
        x = sigma * rng.standard_normal(15)
        sigma[BG], sigma[BA] = spec.gyro_bias, spec.accel_bias
        begin = float(record.time[0]) if record.kind == "rates" else 0.0
        place, v, C = true.at(begin)
        place = place + x[DP][[1, 0, 2]] / _metres(place)
        zero = np.zeros(3)
        start = Start(begin, exp(-x[PHI]) @ C, v + x[DV], *place.tolist(), zero, zero, np.diag(sigma**2))
        result = navigate(record, start, aid=Gnss(gnss, Mounting(lever_arm=arm, latency_sigma=0.03)), imu=spec)
        k = [int(np.argmin(np.abs(result.time - length * part))) for part in (0.25, 0.5, 0.75, 1.0)]
        place, v, C = true.at(result.time[k])
        s = result.track.sigma[k]
        phi = -log(result.C_nb[k] @ np.swapaxes(C, 1, 2)) / s[:, PHI]
        dp = ((result.position[k] - place) * _metres(place))[:, [1, 0, 2]] / s[:, DP]
        bad = "" if result.status == "navigated" else f"{result.status}: {result.reasons[0]}"
        ratios = {
            "heading": phi[:, 2],
            "level": phi[:, :2],
            "velocity": (result.v_n[k] - v) / s[:, DV],
            "position": dp,
        }
        return Outcome(ratios, bad, f"sigma {np.degrees(s[-1, PHI]).round(3)} deg, {s[-1, DP].round(2)} m")

    return run


def _metres(place: Any) -> Any:
    """(..., 3) metres of a radian of latitude and of longitude, and of a metre."""
    lat, alt = place[..., 0], place[..., 2]
    s2 = np.sin(lat) ** 2
    R_N = A / np.sqrt(1.0 - E2 * s2)
    return np.stack([R_N * (1.0 - E2) / (1.0 - E2 * s2) + alt, (R_N + alt) * np.cos(lat), np.ones_like(lat)], axis=-1)


def moored(rng: np.random.Generator, length: float) -> World:
    """A ship that stays."""
    return vehicles.ship(rng, length, moored=True)


NAME = "foreign world"
CASES = (
    *(
        Case(NAME, f"still, {g}, car with people", aligned(vehicles.parked, g, 300.0))
        for g in ("navigation", "tactical", "industrial")
    ),
    *(Case(NAME, f"swaying, {g}, ship moored", aligned(moored, g, 400.0)) for g in ("navigation", "tactical")),
    Case(NAME, "swaying, tactical, ship moored, no specification", aligned(moored, "tactical", 300.0, given=False)),
    *(
        Case(NAME, f"swaying, {g}, buoy, no specification", aligned(vehicles.buoy, g, 300.0, given=False))
        for g in ("navigation", "tactical", "consumer")
    ),
    Case(NAME, "swaying, tactical, buoy", aligned(vehicles.buoy, "tactical", 300.0)),
    *(
        Case(NAME, f"swaying, {g}, {v.__name__}, no specification", aligned(v, g, 300.0, given=False))
        for v, g in ((vehicles.raft, "tactical"), (vehicles.gondola, "tactical"), (vehicles.gondola, "consumer"))
    ),
    Case(NAME, "swaying, tactical, raft", aligned(vehicles.raft, "tactical", 300.0)),
    Case(NAME, "on an indexer, industrial, ship moored", indexed(moored, "industrial", 400.0)),
    Case(
        NAME, "on an indexer, tactical, ship moored, no specification", indexed(moored, "tactical", 400.0, given=False)
    ),
    *(
        Case(NAME, f"by GNSS, {g}, {v.__name__}", aligned(v, g, 200.0, "gnss"))
        for v, g in (
            (vehicles.car, "industrial"),
            (vehicles.car, "tactical"),
            (vehicles.tractor, "industrial"),
            (vehicles.tractor, "tactical"),
            (vehicles.aircraft, "industrial"),
            (vehicles.multicopter, "industrial"),
            (vehicles.multicopter, "consumer"),
            (vehicles.ship, "tactical"),
        )
    ),
    Case(NAME, "by GNSS, industrial, car, multipath", aligned(vehicles.car, "industrial", 200.0, "gnss", jumps=3)),
    *(
        Case(NAME, f"by odometer, {g}, {v.__name__}", aligned(v, g, 240.0, "odometer"))
        for v, g in (
            (vehicles.car, "navigation"),
            (vehicles.tractor, "navigation"),
            (vehicles.lorry, "navigation"),
            (vehicles.car, "tactical"),
            (vehicles.lorry, "tactical"),
        )
    ),
    Case(NAME, "by odometer and GNSS, industrial, car", aligned(vehicles.car, "industrial", 200.0, "odometer, gnss")),
    Case(NAME, "by Doppler log, navigation, diver", aligned(vehicles.diver, "navigation", 300.0, "log")),
    *(
        Case(NAME, f"navigation, GNSS, {g}, {v.__name__}", navigated(v, g, 240.0))
        for v, g in (
            (vehicles.car, "industrial"),
            (vehicles.car, "tactical"),
            (vehicles.tractor, "consumer"),
            (vehicles.tractor, "industrial"),
            (vehicles.aircraft, "industrial"),
            (vehicles.aircraft, "tactical"),
            (vehicles.multicopter, "consumer"),
            (vehicles.ship, "industrial"),
            (vehicles.ship, "navigation"),
        )
    ),
    Case(
        NAME,
        "navigation, GNSS, consumer, multicopter, fixes with an error that stays",
        navigated(vehicles.multicopter, "consumer", 240.0, stays=True),
    ),
    Case(
        NAME,
        "navigation, GNSS, industrial, aircraft, stamps that scatter by 0.15 s",
        navigated(vehicles.aircraft, "industrial", 240.0, scatter=0.15),
    ),
    Case(NAME, "navigation, GNSS, industrial, car, multipath", navigated(vehicles.car, "industrial", 240.0, jumps=3)),
)

if __name__ == "__main__":
    main(CASES)
