"""Procedures that faults are tried on: a sound simulated log with its truth, drawn anew for each run, and how to align it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import WHEEL as ON_WHEEL
from truenorth.aiding.aids import Gnss, Indexer, Master, Odometer
from truenorth.alignment import align
from truenorth.alignment.in_motion_task import usual_antenna
from truenorth.alignment.result import Alignment
from truenorth.alignment.transfer import ON_MASTER
from truenorth.core.attitude import dcm_from_rotation_vector, rotation_vector_from_dcm
from truenorth.core.position import METRES_PER_RADIAN, Position, eastward
from truenorth.navigation import navigate
from truenorth.navigation.result import Navigation
from truenorth.simulation.scenario import Scenario, read_scenario
from truenorth.state.mounting import Mounting
from truenorth.state.prior import prior_covariance
from truenorth.state.state import Start

Array = NDArray[np.float64]
Inputs = dict[str, Any]
Truth = Callable[[float], Any]  # motion states of the body at a time

DRIVE = [
    {"kind": "straight", "duration": "15 s"},
    {"kind": "accelerate", "to": "14 m/s", "acceleration": "1.5 m/s^2"},
    {"kind": "turn", "angle": "90 deg", "rate": "9 deg/s"},
    {"kind": "straight", "duration": "25 s"},
    {"kind": "accelerate", "to": "6 m/s", "acceleration": "1.5 m/s^2"},
    {"kind": "turn", "angle": "-120 deg", "rate": "12 deg/s"},
    {"kind": "accelerate", "to": "14 m/s", "acceleration": "1.2 m/s^2"},
    {"kind": "turn", "angle": "60 deg", "rate": "8 deg/s"},
    {"kind": "straight", "duration": "40 s"},
]
SHAKE = [{"kind": "vibration", "sines": [{"frequency": "12 Hz", "acceleration": ["5 mg", "5 mg", "8 mg"]}]}]
WHEEL = {"rate": "10 Hz", "output": "speed", "noise": "0.02 m/s", "scale_sigma": "1 %", "mounting_sigma": "0.5 deg"}
STAYING = ("still", "unspecified", "swaying", "rotary")
RECEIVER = {"rate": "1 Hz", "position_noise": "1 m", "velocity_noise": "0.05 m/s"}


@dataclass(frozen=True)
class Bench:
    """One procedure."""

    name: str
    scenario: Callable[[np.random.Generator], Mapping[str, Any]]  # draws one
    align: Callable[[Inputs], Alignment | Navigation]  # inputs to an alignment or a navigation
    sits: Callable[[Inputs], Mounting] | None = None  # what is said of how the aid sits
    turns: bool = False  # whether the angles of that mounting count

    def draw(self, seed: int, run: int) -> tuple[Inputs, Truth]:
        """A sound log of its own motion and errors, and its truth."""
        rng = np.random.default_rng([seed, run])
        built = read_scenario(dict(self.scenario(rng)))
        simulated = built.simulate(seed=seed, run=run)
        record = simulated.record
        body = built.build_motion(seed, run)
        begin = body.states(np.array(float(record.time[0] - record.interval)))
        place = Position(float(begin.lat), float(begin.lon), float(begin.alt))
        inputs: Inputs = {"record": record, "place": place, "imu": built.imu_spec}
        inputs |= {key: aid.record for key, aid in _aiding(built, seed, run).items()}
        if self.name == "navigate":
            inputs["start"] = _start(rng, begin, simulated, built)
        if self.name in STAYING:
            inputs["attitude"] = lambda time: body.states(np.asarray(time)).C_nb
        if self.name == "unspecified":
            del inputs["imu"]
        if self.sits is not None:
            inputs["mounting"] = self.sits(inputs)
            inputs |= {"turned": inputs["mounting"]} if self.turns else {}
        return inputs, lambda time: body.states(np.array(time))


def _aiding(built: Scenario, seed: int, run: int) -> dict[str, Any]:
    return built.simulate_aiding(seed=seed, run=run)


def _start(rng: np.random.Generator, at: Any, simulated: Any, built: Scenario) -> Start:
    """Drawn about the truth with the sigmas that it claims."""
    spec = built.imu_spec
    P = prior_covariance((3e-4, 3e-4, 3e-3), 0.02, 1.0, spec.bias_variance)
    off = np.sqrt(np.diag(P)) * rng.standard_normal(15)
    return Start(
        time=float(simulated.record.time[0] - simulated.record.interval),
        C_nb=dcm_from_rotation_vector(-off[:3]) @ at.C_nb,
        v_n=at.v_n + off[3:6],
        lat=float(at.lat) + off[7] / METRES_PER_RADIAN,
        lon=float(at.lon) + off[6] / (METRES_PER_RADIAN * math.cos(float(at.lat))),
        alt=float(at.alt) + off[8],
        gyro_bias=np.zeros(3),
        accel_bias=np.zeros(3),
        P=P,
    )


def _base(rng: np.random.Generator, name: str, duration: float, imu: str) -> dict[str, Any]:
    lat = rng.choice([-1.0, 1.0]) * rng.uniform(15.0, 60.0)
    return {
        "name": name,
        "duration": f"{duration:g} s",
        "rate": "50 Hz",
        "position": {"lat": f"{lat:.4f} deg", "lon": f"{rng.uniform(-180.0, 180.0):.4f} deg"},
        "imu": imu,
    }


def _still(rng: np.random.Generator) -> dict[str, Any]:
    return _base(rng, "still", 240.0, "navigation") | {
        "motion": {"kind": "rest", "heading": f"{rng.uniform(0.0, 360.0):.3f} deg"},
    }


def _tone(rng: np.random.Generator, low: float, high: float, unit: str, shift: float) -> dict[str, Any]:
    period, phase = rng.uniform(5.0, 9.0) + shift, rng.uniform(0.0, 360.0)
    return {
        "amplitude": f"{rng.uniform(low, high):.4f} {unit}",
        "period": f"{period:.3f} s",
        "phase": f"{phase:.2f} deg",
    }


def _sway(rng: np.random.Generator) -> dict[str, Any]:
    heading = f"{rng.uniform(0.0, 360.0):.3f} deg"
    tones = {"heading": [_tone(rng, 1.0, 4.0, "deg", 3.0)], "pitch": [_tone(rng, 1.5, 5.0, "deg", 0.0)]}
    tones |= {"roll": [_tone(rng, 3.0, 8.0, "deg", 1.0)], "up": [_tone(rng, 0.05, 0.4, "m", 1.5)]}
    tones |= {"east": [_tone(rng, 0.01, 0.05, "m", 0.5)], "north": [_tone(rng, 0.01, 0.05, "m", 0.2)]}
    return {"kind": "sway", "heading": heading, "tones": tones}


def _swaying(rng: np.random.Generator) -> dict[str, Any]:
    arm = [f"{x:.2f} m" for x in rng.uniform(-8.0, 8.0, 3)]
    return _base(rng, "swaying", 240.0, "navigation") | {"motion": _sway(rng), "lever_arm": arm}


def _rotary(rng: np.random.Generator) -> dict[str, Any]:
    axes = [
        {"kind": "spin", "direction": "z", "rate": f"{rng.uniform(8.0, 18.0):.2f} deg/s"},
        {"kind": "spin", "direction": "x", "rate": f"{rng.uniform(2.0, 6.0):.2f} deg/s"},
    ]
    indexer = {"axes": axes, "encoder": {"resolution": "1 arcsec"}}
    return _swaying(rng) | {"name": "rotary", "indexer": indexer}


def _drive(rng: np.random.Generator, imu: str) -> dict[str, Any]:
    heading = f"{rng.uniform(0.0, 360.0):.3f} deg"
    base = _base(rng, "drive", 160.0, imu)
    return base | {"motion": {"kind": "legs", "heading": heading, "legs": DRIVE}, "disturbances": SHAKE}


def _flight(rng: np.random.Generator) -> dict[str, Any]:
    legs = [
        {"kind": "straight", "duration": f"{rng.uniform(30.0, 40.0):.1f} s"},
        {"kind": "turn", "angle": "90 deg", "rate": "3 deg/s", "onset": "0.5 s"},
        {"kind": "straight", "duration": "20 s"},
        {"kind": "turn", "angle": "-60 deg", "rate": "3 deg/s", "onset": "0.5 s"},
        {"kind": "straight", "duration": "30 s"},
    ]
    heading = f"{rng.uniform(0.0, 360.0):.3f} deg"
    imu = {
        "name": "slave",
        "gyro": {"bias": "1 deg/h", "random_walk": "0.05 deg/sqrt(h)"},
        "accel": {"bias": "50 ug", "random_walk": "10 ug/sqrt(Hz)"},
    }
    master = {"rate": "10 Hz", "latency": "30 ms", "lever_arm": ["1 m", "0.1 m", "0.2 m"], "velocity_noise": "0.2 m/s"}
    base = _base(rng, "flight", 120.0, "tactical")
    base["position"]["alt"] = "3000 m"
    return base | {
        "imu": imu,
        "motion": {"kind": "legs", "heading": heading, "speed": "120 m/s", "legs": legs},
        "master": master,
    }


def _unspecified(rng: np.random.Generator) -> dict[str, Any]:
    """At rest, of an IMU of which nothing is said: its biases over a decade."""
    bias = math.exp(rng.uniform(math.log(0.02), math.log(0.3)))
    gyro = {"bias": f"{bias:.4f} deg/h", "random_walk": f"{0.05 * bias:.5f} deg/sqrt(h)"}
    accel = {"bias": f"{2000.0 * bias:.1f} ug", "random_walk": f"{500.0 * bias:.1f} ug/sqrt(Hz)"}
    return _still(rng) | {"name": "unspecified", "imu": {"name": "drawn", "gyro": gyro, "accel": accel}}


def _at_rest(i: Inputs) -> Alignment:
    return align(i["record"], i["place"], i.get("imu"))


def _turned_about(i: Inputs) -> Alignment:
    arm = i["mounting"].lever_arm if i["mounting"].lever_arm.any() else None
    return align(i["record"], i["place"], i["imu"], aid=Indexer(i["encoder"], lever_arm=arm))


def _on_wheels(i: Inputs) -> Alignment:
    return align(i["record"], i["place"], i["imu"], aid=Odometer(i["odometer"], i["mounting"]))


def _by_gnss(i: Inputs) -> Alignment:
    return align(i["record"], i["place"], i["imu"], aid=Gnss(i["gnss"], i["mounting"]))


def _onward(i: Inputs) -> Navigation:
    return navigate(i["record"], i["start"], imu=i["imu"], aid=Gnss(i["gnss"], i["mounting"]))


def _velocity(i: Inputs) -> Alignment:
    return align(i["record"], imu=i["imu"], aid=[Master(i["master"], i["mounting"], matching="velocity")])


def _attitude(i: Inputs) -> Alignment:
    return align(i["record"], imu=i["imu"], aid=[Master(i["master"], i["mounting"], matching="both")])


BENCHES: dict[str, Bench] = {
    bench.name: bench
    for bench in (
        Bench("still", _still, _at_rest),
        Bench("unspecified", _unspecified, _at_rest),
        Bench("swaying", _swaying, _at_rest),
        Bench("rotary", _rotary, _turned_about, lambda i: Mounting()),
        Bench(
            "odometer",
            lambda rng: _drive(rng, "navigation") | {"odometer": WHEEL},
            _on_wheels,
            lambda i: ON_WHEEL,
            turns=True,
        ),
        Bench(
            "gnss",
            lambda rng: _drive(rng, "tactical") | {"gnss": RECEIVER},
            _by_gnss,
            lambda i: usual_antenna(i["gnss"]),
        ),
        Bench("transfer", _flight, _velocity, lambda i: ON_MASTER),
        Bench("attitude", _flight, _attitude, lambda i: ON_MASTER, turns=True),
        Bench(
            "navigate",
            lambda rng: _drive(rng, "tactical") | {"gnss": RECEIVER},
            _onward,
            lambda i: Mounting(),
        ),
    )
}


def misses(answer: Alignment | Navigation, truth: Truth) -> dict[str, Array]:
    """Errors of what the answer gives, in its own sigmas: of each output its components, with their signs."""
    if isinstance(answer, Navigation):
        track = answer.track
        at = truth(float(track.time[-1]))
        phi = -rotation_vector_from_dcm(track.C_nb[-1] @ at.C_nb.T)
        lat, lon, alt = track.position[-1]
        east = float(eastward(lon, float(at.lon)))
        dp = [east * METRES_PER_RADIAN * math.cos(lat), (lat - float(at.lat)) * METRES_PER_RADIAN, alt - float(at.alt)]
        off = np.concatenate([phi, track.v_n[-1] - at.v_n, dp]) / np.maximum(track.sigma[-1, :9], 1e-12)
        off[[5, 8]] = 0.0 if answer.altitude == "fixed" else off[[5, 8]]
        return {"level": off[:2], "heading": off[2:3], "velocity": off[3:6], "position": off[6:]}
    at = truth(answer.time)
    off = -rotation_vector_from_dcm(answer.C_nb @ at.C_nb.T) / np.sqrt(np.diag(answer.phi_covariance))
    return {"level": off[:2]} | ({"heading": off[2:]} if answer.heading_known else {})
