"""What the data say of clocks, lever arms, scales and mountings that were taken for known: a second look with them left open."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.source import Role
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core.errors import DataError
from truenorth.estimate.latency import mounting_found
from truenorth.estimate.rivals import moved
from truenorth.quality.swing import unseen_arm
from truenorth.state.evidence import Effect, Evidence, Figure, note
from truenorth.state.layout import ANTENNA_ARM
from truenorth.state.limits import limit
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

LONG_ARM = 10.0  # m: longer than on most vehicles, worth a word where the data do not show it
KNOWN_ARM = 0.2  # of an arm, the sigma up to which the data show it
SMALLER = {"centimetres": 1e-2, "millimetres": 1e-3}
AXES = ("right", "forward", "up")
LEAST_ANTENNA = 0.1  # m, of an antenna's arm, worth a word: places are known to as much
ALL_QUICK = np.array([[1.0] * 3, [0.0] * 3])


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
SENSORS: dict[str, tuple[str, tuple[Role, ...]]] = {
    "gnss": ("GNSS", ("lag", "lever arm")),
    "odometer": ("odometer", ("lag", "lever arm", "scale", "mounting")),
    "velocity": ("velocity log", ("lag", "lever arm", "scale", "mounting")),
}


def looser(run: Callable[[Mapping[str, Mounting]], Track], mounting: Mapping[str, Mounting]) -> Track | None:
    """The track with clocks, arms, scales and mountings left open; None: no figure of it is worth a thing.

    Parameters
    ----------
    run : callable
        Navigates with the sensors so mounted.
    mounting : mapping
        How they are said to sit, by the sensor's name.
    """
    try:
        track = run({name: _loosened(name, m) for name, m in mounting.items()})
    except DataError:  # the measurements fit no track at all, which the first pass has shown
        return None
    return None if _contradicted(track) > limit("rejected") else track  # a model that does not hold


def second_look(
    track: Track | None, first: Track, mounting: Mapping[str, Mounting], quick: Array = ALL_QUICK
) -> list[Evidence]:
    """What the data contradict of clocks, arms, scales and mountings, and long arms that they do not show.

    The effect is by how much the track with all of them left open differs from the first one.

    Parameters
    ----------
    track : Track or None
        With all of them left open (:func:`looser`).
    first : Track
        With the sensors mounted as they are said to be.
    mounting : mapping
        How they are said to sit, by the sensor's name.
    quick : (2, 3) array
        Parts of the antenna's arm that a receiver may filter (:func:`truenorth.quality.swing.quick_part`, `meant_part`).
    """
    if track is None:
        return []
    against, found = [], []
    for key, (name, roles) in SENSORS.items():
        given = mounting[key]
        if any(_beyond(track, name, role) for role in SMALL_ANGLES):
            found.append(note("second_look.misfit", "sensor_axes", "imu_axes", "mounting", urgent=True, name=name))
            continue
        for role in roles:
            where = track.layout.slice_of(f"{name} {role}")
            said = getattr(given, OPEN[role].sigma)
            if where is None or (said > 0.0 and role != "lever arm"):
                continue
            value, sigma = track.sensors[-1, where], np.hypot(track.sigma[-1, where], said)
            least = OPEN[role].least
            if role == "lever arm" and key == "gnss":
                sigma, least = np.hypot(_arm_sigma(track, given, quick), said), LEAST_ANTENNA
            size = np.where(np.abs(value) > least, np.abs(value) / sigma, 0.0)
            if np.any(size > limit("misfit")):
                item = _contradiction(role, name, key, given, value, sigma)
                against.append(replace(item, urgent=bool(np.any(size > limit("clear misfit")))))
            elif role == "lever arm" and said == 0.0 and np.linalg.norm(given.lever_arm) > LONG_ARM:
                arm = given.lever_arm
                length = float(np.linalg.norm(arm))
                if math.sqrt(arm**2 @ sigma**2 / (arm @ arm)) > KNOWN_ARM * length:
                    found.append(note("second_look.long_arm", f"arm.{key}", urgent=True, name=name, length=length))
    if not against:
        return found
    whole = moved(first, track)
    share = Effect(*(size / math.sqrt(len(against)) for _, size in whole.items()))
    return [replace(item, kind="known" if item.urgent else "hint", effect=share) for item in against] + found


def wrong_antenna(track: Track | None, given: Mounting, quick: Array) -> Evidence | None:
    """That an antenna cannot sit where it is said to, as a track with its arm left open shows; None where it can.

    The text says where it seems to be. There is no effect: that is of a track whose arm is estimated.
    """
    where = None if track is None else track.layout.slice_of(ANTENNA_ARM)
    if track is None or where is None:
        return None
    value, sigma = track.sensors[-1, where], _arm_sigma(track, given, quick)
    if not np.any((np.abs(value) > LEAST_ANTENNA) & (np.abs(value) > limit("misfit") * sigma)):
        return None
    return _contradiction("lever arm", SENSORS["gnss"][0], "gnss", given, value, sigma)


def _arm_sigma(track: Track, given: Mounting, quick: Array) -> Array:
    """(3,) m, of an antenna's arm: what is quick of the swing, its receiver filters as nobody knows, up to that either way.

    It may take means, whatever part of the swing seems to be left out: to those the arm that was said is shorter.
    """
    where = track.layout.slice_of(ANTENNA_ARM)
    shorter = np.maximum(-np.sign(track.sensors[-1, where]) * given.lever_arm, 0.0)
    filters = np.maximum(quick[0] * np.abs(unseen_arm(track)[0]), quick[1] * shorter) / math.sqrt(3.0)
    return np.asarray(np.hypot(track.sigma[-1, where], filters))


def _contradicted(track: Track) -> float:
    """Largest share of a sensor's measurements whose innovations no sound one has."""
    shares = [0.0]
    for r in track.residuals:
        there = r.rows > 0
        if there.any():
            limits = np.array([chi_square_limit(limit("gate"), dof) for dof in range(int(r.rows.max()) + 1)])
            shares.append(float(np.mean(r.nis[there] > limits[r.rows[there]])))
    return max(shares)


def _beyond(track: Track, name: str, role: Role) -> bool:
    where = track.layout.slice_of(f"{name} {role}")
    return where is not None and bool(
        np.any(np.abs(track.sensors[-1, where]) > limit("small angles") * OPEN[role].prior)
    )


def on_any_clock(mounting: Mounting) -> Mounting:
    """The same sensor, its clock left open where it was taken for known, as late all the time."""
    if mounting.latency_sigma > 0.0:
        return mounting
    return replace(mounting, latency_sigma=OPEN["lag"].prior, drift=mounting.clock)


def as_found(given: dict[str, Any], track: Track) -> dict[str, Any]:
    """The aids as late as a track has found them, where that was left open; the same mapping where nothing has changed."""
    found = {}
    for key, (name, _) in SENSORS.items():
        mounting = getattr(given.get(key), "mounting", None)
        if mounting is not None and (later := mounting_found(mounting, track, name)) is not mounting:
            found[key] = given[key].mounted(later)
    return given | found if found else given


def _loosened(name: str, mounting: Mounting) -> Mounting:
    """What is taken for known left open, and no measurement rejected."""
    if name not in SENSORS:
        return mounting
    open_: dict[str, Any] = {
        OPEN[role].sigma: getattr(mounting, OPEN[role].sigma) or OPEN[role].prior for role in SENSORS[name][1]
    }
    return replace(mounting, gate=0.0, drift=mounting.clock, **open_)


def _contradiction(role: Role, name: str, key: str, given: Mounting, value: Array, sigma: Array) -> Evidence:
    """What the data say of one property, without its effect."""
    if role == "lag":
        return wrong_lag(name, key, given, float(value[0]), float(sigma[0]))
    if role == "lever arm":
        arm = given.lever_arm + value
        figures: dict[str, Figure] = {"name": name, "given": ",".join(f"{x:.4g}" for x in given.lever_arm)}
        for axis, v, s in zip(AXES, arm, sigma, strict=True):
            figures |= {axis: float(v), f"{axis}_sigma": float(s)}
        unit = _smaller_unit(arm, sigma, given)
        remedies = (f"arm.{key}",) if unit is None else ("arm_unit", f"arm.{key}")
        return Evidence("second_look.arm", figures | {"unit": unit or ""}, remedies=remedies, urgent=True)
    if role == "scale":
        figures = {"name": name, "scale": float(value[0]), "sigma": float(sigma[0])}
        return Evidence("second_look.scale", figures, remedies=("estimate.scale",), urgent=True)
    figures = {"name": name}
    for axis, v, s in zip("xz", value, sigma, strict=True):
        figures |= {axis: float(v), f"{axis}_sigma": float(s)}
    return Evidence("second_look.mounting", figures, remedies=("mounting", "estimate.mounting"), urgent=True)


def wrong_lag(name: str, key: str, given: Mounting, found: float, sigma: float) -> Evidence:
    """That a sensor's clock is off by `found` (s, behind the latency given), without its effect."""
    figures: dict[str, Figure] = {"name": name, "sensor": key, "size": abs(found), "sigma": sigma}
    if found > 0.0 and key == "gnss":  # of a receiver that is late, its latency; the lag is what is left of it
        more: dict[str, Figure] = {"latency": given.latency + found}
        return Evidence("second_look.late", figures | more, remedies=("latency", "estimate.lag"), urgent=True)
    late = "late" if found > 0.0 else "early"
    return Evidence(
        f"second_look.{late}", figures | {"offset": -found}, remedies=("offset", "estimate.lag"), urgent=True
    )


def _smaller_unit(arm: Array, sigma: Array, given: Mounting) -> str | None:
    """The unit in which an arm that the data contradict was probably given."""
    shown = sigma < 0.5 * OPEN["lever arm"].prior
    said = given.lever_arm[shown]
    length = float(np.linalg.norm(said))
    for unit, factor in SMALLER.items():
        if length > LONG_ARM and np.linalg.norm(arm[shown] - factor * said) < 0.05 * length:
            return unit
    return None
