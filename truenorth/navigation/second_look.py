"""What the data say of clocks, lever arms, scales and mountings that were taken for known: a second look with them left open."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Role
from truenorth.core.errors import DataError
from truenorth.state.mounting import FALSE_REJECTION, Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

SMALL = 10.0  # times its prior: a scale or angle beyond is none that a small-angle model finds
CLEAR = 6.0  # sigmas from which a contradiction is told
LONG_ARM = 10.0  # m: longer than on most vehicles, to be told where the data do not show it
LEAST_FIXES = 60
LAGS = 5
WHITE, LEAST_CORRELATION = (
    4.0,
    0.05,
)  # sigmas, and least mean correlation over so many lags, from which fixes are not white
MOST_CONTRADICTED = 0.2  # of a sensor's measurements
KNOWN_ARM = 0.2  # of an arm, the sigma up to which the data show it
SMALLER = {"centimetres": 1e-2, "millimetres": 1e-3}
AXES = ("right", "forward", "up")


@dataclass(frozen=True)
class _Open:
    """A property that is left open: its sigma's place in :class:`Mounting`, prior, and the least that is worth a word."""

    sigma: str
    prior: float
    least: float


OPEN: dict[Role, _Open] = {
    "lag": _Open("latency_sigma", 0.3, 0.01),  # s
    "lever arm": _Open("lever_arm_sigma", 3.0, 0.5),  # m
    "scale": _Open("scale_sigma", 0.05, 0.01),
    "mounting": _Open("angle_sigma", math.radians(3.0), math.radians(0.5)),
}
SMALL_ANGLES: tuple[Role, ...] = ("scale", "mounting")
SENSORS: dict[str, tuple[str, str, tuple[Role, ...]]] = {
    "gnss": ("GNSS", "--lever-arm", ("lag", "lever arm")),
    "odometer": ("odometer", "--wheel-arm", ("lag", "lever arm", "scale", "mounting")),
    "velocity": ("velocity log", "--wheel-arm", ("lag", "lever arm", "scale", "mounting")),
}


def second_look(run: Callable[[Mapping[str, Mounting]], Track], mounting: Mapping[str, Mounting]) -> list[str]:
    """Warnings about what the data contradict, and about long arms that they do not show.

    Parameters
    ----------
    run : callable
        Navigates with the sensors so mounted.
    mounting : mapping
        How they are said to sit, by the sensor's name.
    """
    try:
        track = run({name: _loosened(name, m) for name, m in mounting.items()})
    except DataError:  # the measurements fit no track at all, which the first pass has told
        return []
    if _contradicted(track) > MOST_CONTRADICTED:  # figures of a model that does not hold are not worth telling
        return []
    words = []
    for key, (name, option, roles) in SENSORS.items():
        given = mounting[key]
        if any(_beyond(track, name, role) for role in SMALL_ANGLES):
            words.append(
                f"warning: --{key} fits no small scale error and mounting angle: check its axes and unit, the IMU's axes (--axes), "
                "and --mounting"
            )
            continue
        for role in roles:
            where = track.layout.slice_of(f"{name} {role}")
            if where is None or getattr(given, OPEN[role].sigma) > 0.0:
                continue
            value, sigma = track.sensors[-1, where], track.sigma[-1, where]
            if np.any((np.abs(value) > CLEAR * sigma) & (np.abs(value) > OPEN[role].least)):
                words.append(f"warning: {_contradiction(role, key, option, given, value, sigma)}")
            elif role == "lever arm" and np.linalg.norm(given.lever_arm) > LONG_ARM:
                arm = given.lever_arm
                if math.sqrt(arm**2 @ sigma**2 / (arm @ arm)) > KNOWN_ARM * np.linalg.norm(arm):
                    words.append(
                        f"warning: the lever arm {option} is {np.linalg.norm(arm):.0f} m long, and the data do not show whether it "
                        "is: metres are expected"
                    )
    return words


def _contradicted(track: Track) -> float:
    """Largest share of a sensor's measurements whose innovations no sound one has."""
    from scipy.special import chdtri

    shares = [0.0]
    for r in track.residuals:
        there = r.rows > 0
        if there.any():
            shares.append(float(np.mean(r.nis[there] > chdtri(r.rows[there], FALSE_REJECTION))))
    return max(shares)


def _beyond(track: Track, name: str, role: Role) -> bool:
    where = track.layout.slice_of(f"{name} {role}")
    return where is not None and bool(np.any(np.abs(track.sensors[-1, where]) > SMALL * OPEN[role].prior))


def slow_errors(track: Track, antenna: Mounting) -> list[str]:
    """A warning where innovations of GNSS positions hang together from row to row, though they are taken for white noise.

    Of white ones the mean correlation over the first lags is zero, to one over the root of the number of products; a
    receiver's multipath and atmosphere last for minutes, and the filter then believes their mean.
    """
    fixes = [r for r in track.residuals if r.name == "GNSS position"]
    if antenna.bias_sigma > 0.0 or not fixes:
        return []
    used = fixes[0].innovation[fixes[0].used & (fixes[0].rows > 0)]
    if len(used) < LEAST_FIXES:
        return []
    used = used[:, np.isfinite(used).all(axis=0)]
    squares = np.sum(used**2, axis=0)
    alike = np.stack([np.sum(used[lag:] * used[:-lag], axis=0) for lag in range(1, LAGS + 1)])
    correlation = float(np.mean(alike / squares))
    if correlation < max(LEAST_CORRELATION, WHITE / math.sqrt(LAGS * used.size)):
        return []
    wander = math.sqrt(max(float(np.mean(alike)) / len(used), 0.0))  # the filter has followed them: it is more
    return [
        f"warning: errors of the GNSS positions hang together from fix to fix (correlation {correlation:.2f}), they wander by "
        f"{wander:.2g} m or more: the sigma of position is too small; say by how much and how long, such as --gnss-drift "
        f"{2 * wander:.2g},60 (m, s)"
    ]


def _loosened(name: str, mounting: Mounting) -> Mounting:
    """What is taken for known left open, and no measurement rejected."""
    if name not in SENSORS:
        return mounting
    open_: dict[str, Any] = {
        OPEN[role].sigma: getattr(mounting, OPEN[role].sigma) or OPEN[role].prior for role in SENSORS[name][2]
    }
    return replace(mounting, gate=0.0, **open_)


def _contradiction(role: Role, key: str, option: str, given: Mounting, value: Array, sigma: Array) -> str:
    if role == "lag":
        late = "late" if value[0] > 0 else "early"
        return (
            f"the clock of --{key} seems {abs(value[0]):.3f} ± {sigma[0]:.3f} s {late}: try --offset {-value[0]:.3f}, or let it be "
            "estimated"
        )
    if role == "lever arm":
        arm = given.lever_arm + value
        told = ", ".join(f"{axis} {v:+.2f} ± {s:.2f} m" for axis, v, s in zip(AXES, arm, sigma))
        return f"the lever arm of --{key} seems to be {told}, not {_plain(given.lever_arm)}: {_advice(arm, sigma, given, option)}"
    if role == "scale":
        return f"--{key} seems to count {100 * value[0]:+.2f} ± {100 * sigma[0]:.2f} %: try --estimate scale"
    told = ", ".join(
        f"{name} {math.degrees(v):+.2f} ± {math.degrees(s):.2f} deg" for name, v, s in zip("xz", value, sigma)
    )
    return f"the IMU seems turned against the vehicle of --{key}, about {told}: give --mounting, or try --estimate mounting"


def _advice(arm: Array, sigma: Array, given: Mounting, option: str) -> str:
    """What to do about an arm that the data contradict."""
    shown = sigma < 0.5 * OPEN["lever arm"].prior
    told = given.lever_arm[shown]
    length = float(np.linalg.norm(told))
    for unit, factor in SMALLER.items():
        if length > LONG_ARM and np.linalg.norm(arm[shown] - factor * told) < 0.05 * length:
            return f"were {unit} handed in? {option} is in metres"
    axle = ", to the axle that nothing steers" if option == "--wheel-arm" else ""
    return f"check {option} (metres{axle})"


def _plain(arm: Array) -> str:
    return ",".join(f"{x:.4g}" for x in arm)
