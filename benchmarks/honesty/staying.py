"""Alignment of a base that stays (still, swaying, on an indexer) with errors that real sensors have.

Run: ``python -m benchmarks.honesty.staying --runs 20``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.honesty.harness import Case, Log, direction, main, place
from truenorth.alignment import align
from truenorth.alignment.inference import ACCEL_WIDTH, GYRO_WIDTH, usual
from truenorth.alignment.result import Alignment
from truenorth.alignment.rotary import align_rotary
from truenorth.records.specs import PRESETS, ImuSpec, imu_spec

UNSCALED = {
    "gyro": {"bias": "0.01 deg/h", "random_walk": "0.001 deg/sqrt(h)", "bias_instability": "0.001 deg/h"},
    "accel": {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)", "bias_instability": "5 ug"},
}


def _rest(rng: np.random.Generator) -> dict[str, str]:
    return {
        "kind": "rest",
        "heading": f"{rng.uniform(0.0, 360.0):.3f} deg",
        "pitch": f"{rng.uniform(-3.0, 3.0):.3f} deg",
        "roll": f"{rng.uniform(-3.0, 3.0):.3f} deg",
    }


def _sway(rng: np.random.Generator, angles: tuple[float, ...], periods: tuple[float, ...]) -> dict[str, Any]:
    names = ("roll", "pitch", "heading")
    tones = {
        name: [{"amplitude": f"{a} deg", "period": f"{T * rng.uniform(0.95, 1.05):.4f} s"}]
        for name, a, T in zip(names, angles, periods, strict=True)
    }
    return {"kind": "sway", "heading": f"{rng.uniform(0.0, 360.0):.3f} deg", "tones": tones}


def rotary_scheme(rng: np.random.Generator) -> Mapping[str, Any]:
    """Eight positions, slews of 10 deg/s, all errors of a navigation grade IMU."""
    return {
        "duration": "600 s",
        "position": place(rng),
        "motion": _rest(rng),
        "imu": "navigation",
        "indexer": {"scheme": "8", "dwell": "60 s", "encoder": {"resolution": "1 arcsec"}},
    }


def rotary_spin(imu: Any) -> Any:
    """Spin about x with 15 deg/s and about z with 6 deg/s."""
    return lambda rng: {
        "duration": "600 s",
        "position": place(rng),
        "motion": _rest(rng),
        "imu": imu,
        "indexer": {
            "axes": [
                {"kind": "spin", "direction": "x", "rate": "15 deg/s"},
                {"kind": "spin", "direction": "z", "rate": "6 deg/s"},
            ],
            "encoder": {"resolution": "1 arcsec"},
        },
    }


def rotary_off(rng: np.random.Generator) -> Mapping[str, Any]:
    """Eight positions, the zeros of the encoder off by 20 arcsec, its disc out of centre by 5."""
    made = dict(rotary_scheme(rng))
    encoder = {"resolution": "1 arcsec", "offset": "20 arcsec", "eccentricity": "5 arcsec"}
    return made | {"indexer": {**made["indexer"], "encoder": encoder}}


def ship(rng: np.random.Generator) -> Mapping[str, Any]:
    """A ship at 20 deg S, the IMU 14 m from its centre, without an indexer."""
    return {
        "duration": "600 s",
        "position": {"lat": "-20 deg", "lon": "10 deg"},
        "motion": _sway(rng, (8.0, 4.0, 6.0), (11.0, 7.0, 5.0)),
        "lever_arm": [f"{v:.3f} m" for v in 14.0 * direction(rng)],
        "imu": "navigation",
    }


def gentle(rng: np.random.Generator) -> Mapping[str, Any]:
    """A tactical IMU that sways by a degree."""
    return {
        "duration": "300 s",
        "position": place(rng),
        "motion": _sway(rng, (1.0, 0.7, 0.5), (7.0, 6.0, 9.0)),
        "imu": "tactical",
    }


def _imu(gyro: str) -> dict[str, Any]:
    return {
        "gyro": {"bias": gyro, "random_walk": "0.005 deg/sqrt(h)"},
        "accel": {"bias": "50 ug", "random_walk": "20 ug/sqrt(Hz)"},
    }


def still(gyro: str) -> Any:
    """A base at rest whose IMU's specification nobody gives."""

    def scenario(rng: np.random.Generator) -> Mapping[str, Any]:
        return {
            "duration": "300 s",
            "rate": "50 Hz",
            "position": place(rng),
            "motion": _rest(rng),
            "imu": _imu(gyro),
        }

    return scenario


def usual_still(rng: np.random.Generator) -> Mapping[str, Any]:
    """A base at rest whose IMU is drawn from what is taken for usual where nobody gives a specification.

    A random walk between navigation and industrial grade; biases from a population whose width is usual of such a walk, to the
    factors that the inference allows for, and no better than is ever assumed.
    """
    best, grade = imu_spec("navigation"), rng.random()
    values: dict[str, float] = {}
    for sensor, width in (("gyro", GYRO_WIDTH), ("accel", ACCEL_WIDTH)):
        least, most = (getattr(imu_spec(name), f"{sensor}_random_walk") for name in ("navigation", "industrial"))
        walk = least * (most / least) ** grade
        size = usual(sensor, "bias", walk) * math.exp(width * rng.standard_normal())
        values[f"{sensor}_random_walk"] = walk
        values[f"{sensor}_bias"] = max(size, getattr(best, f"{sensor}_bias"))
    return still("0 deg/h")(rng) | {"imu": ImuSpec(name="usual", **values).to_mapping()}


def low_cost(rng: np.random.Generator) -> Mapping[str, Any]:
    """A consumer IMU at rest for a few minutes."""
    return {
        "duration": f"{rng.uniform(120.0, 300.0):.0f} s",
        "rate": "50 Hz",
        "position": place(rng),
        "motion": _rest(rng),
        "imu": "consumer" if rng.random() < 0.5 else "industrial",
    }


def offset(rng: np.random.Generator) -> Mapping[str, Any]:
    """A consumer IMU at rest whose gyros are off by .5 to 20 deg/s."""
    bias = 0.5 * 40.0 ** rng.random() * direction(rng)
    gyro = {"bias": [f"{v:.4f} deg/s" for v in bias]}
    return low_cost(rng) | {"imu": "consumer", "errors": {"gyro": gyro}}


def seconds(sways: bool) -> Any:
    """A log of 2 to 19 s, of any preset, at rest or on a base that sways by .05 to 3 deg."""

    def scenario(rng: np.random.Generator) -> Mapping[str, Any]:
        size = 0.05 * 60.0 ** rng.random()
        tones = _sway(rng, (size, 0.7 * size, 0.5 * size), tuple(rng.uniform(3.0, 10.0, 3)))
        return {
            "duration": f"{rng.uniform(2.0, 19.0):.1f} s",
            "position": place(rng),
            "motion": tones if sways else _rest(rng),
            "imu": str(rng.choice(list(PRESETS))),
        }

    return scenario


def middle_sway(*grades: str) -> Any:
    """A log of 20 to 60 s of a base that sways by .05 to 5 deg with three periods about each axis, the IMU .3 to 3 m off."""

    def scenario(rng: np.random.Generator) -> Mapping[str, Any]:
        size = 0.05 * 100.0 ** rng.random()
        tones = {
            name: [
                {"amplitude": f"{size * part * rng.uniform(0.3, 1.0)} deg", "period": f"{rng.uniform(3.0, 15.0)} s"}
                for _ in range(3)
            ]
            for name, part in (("roll", 1.0), ("pitch", 0.7), ("heading", 0.5))
        }
        return {
            "duration": f"{rng.uniform(20.0, 60.0):.1f} s",
            "position": place(rng),
            "lever_arm": [f"{a} m" for a in rng.uniform(-1.0, 1.0, 3) * rng.choice([0.3, 1.0, 3.0])],
            "motion": {"kind": "sway", "heading": f"{rng.uniform(0.0, 360.0):.3f} deg", "tones": tones},
            "imu": str(rng.choice(grades)),
        }

    return scenario


def _by_rotary(axes: tuple[str, ...], imu: Any = "navigation", angle_sigma: float = 0.0) -> Any:
    def call(log: Log) -> Alignment:
        return align_rotary(log.record, log.encoder, log.position, imu, axes=axes, angle_sigma=angle_sigma)

    return call


def _with(imu: Any) -> Any:
    def call(log: Log) -> Alignment:
        return align(log.record, log.position, imu)

    return call


# of seconds, and of what nobody has specified, a log may know no heading of 5 deg: it says so, and what it says is compared
BRIEF = ("aligned", "level_only", "not_converged")
CASES = (
    Case("rotary, eight positions, navigation grade", rotary_scheme, _by_rotary(("z", "x"))),
    Case("rotary, encoder off by 20 arcsec", rotary_off, _by_rotary(("z", "x"), angle_sigma=np.radians(20.0 / 3600.0))),
    Case("rotary, spin x 15 z 6 deg/s, navigation grade", rotary_spin("navigation"), _by_rotary(("x", "z"))),
    # one axis turns on and on: heading may have a rival, and is compared with a sigma that has it in
    Case("rotary, the same, tactical", rotary_spin("tactical"), _by_rotary(("x", "z"), "tactical"), BRIEF),
    Case("rotary, the same, no scale factors", rotary_spin(UNSCALED), _by_rotary(("x", "z"), UNSCALED)),
    Case("ship at 20 deg S, arm 14 m, auto", ship, _with("navigation")),
    Case("tactical, gentle sway, auto", gentle, _with("tactical"), ("aligned", "level_only", "not_converged")),
    Case("still, no specification, gyro bias .3 deg/h", still("0.3 deg/h"), _with(None), BRIEF),
    Case("still, no specification, gyro bias .05 deg/h", still("0.05 deg/h"), _with(None), BRIEF),
    Case(
        "still, no specification, biases as usual of the noise",
        usual_still,
        _with(None),
        ("aligned", "level_only", "not_converged", "not_observable"),
    ),
    Case("still, specification given, gyro bias .01 deg/h", still("0.01 deg/h"), _with(_imu("0.01 deg/h"))),
    # what a log says of its accelerometers alone may leave level unknown: that is no refusal, and its sigma is compared
    Case("low cost at rest, no specification", low_cost, _with(None), ("aligned", "level_only", "not_converged")),
    Case("gyros off by .5 to 20 deg/s at rest", offset, _with("consumer"), ("level_only",)),
    Case("seconds of rest, no specification", seconds(False), _with(None), BRIEF),
    Case("seconds of sway, no specification", seconds(True), _with(None), BRIEF),
    Case("20 to 60 s of sway, tactical", middle_sway("tactical"), _with("tactical"), BRIEF),
    Case("20 to 60 s of sway, industrial", middle_sway("industrial"), _with("industrial"), BRIEF),
    Case("20 to 60 s of sway, no specification", middle_sway(*PRESETS), _with(None), BRIEF),
)

if __name__ == "__main__":
    main(CASES)
