"""How late a sensor is and how far away, as a track has found it: what a further pass over the log begins with.

A delay acts as its first derivative as long as it is short against manoeuvres, and of a sensor on an arm against the tremble of the
vehicle: .08 s of an antenna that the road swings at two hertz are a radian of its phase, and look like gyros that are early. So a
pass ends with the delay that it has found, and the next one begins with it.

At a steady speed ``v`` an arm forward and a delay are one: only ``l - v tau`` is seen. How it is parted, their priors say. Arms of
which nobody spoke have many sizes, delays have few: where an arm is found beyond its prior, that was too narrow, and the delay has
taken what it could not hold. The next pass then has a wider arm, and the delay as it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import VEHICLE_ARM
from truenorth.quality.swing import VELOCITIES
from truenorth.state.evidence import Evidence, note
from truenorth.state.limits import is_estimated
from truenorth.state.mounting import LONGEST_ARM, Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

LEAST_DELAY = 0.01  # s: a shorter one acts as its derivative, even of an antenna that the road swings at some hertz
LONG_ARM = 2.0  # sigmas of its prior, from which an arm that nobody has said shows a larger vehicle
SHOWN_DELAY = 3.0  # sigmas from which a delay is worth a word, or a pass
SAID_DELAY = 0.02  # s, from which it is worth a word


def delay_of(track: Track, name: str) -> tuple[float, float, float] | None:
    """Delay of a sensor as found beyond the assumed one, its sigma, and its prior, s."""
    where = track.layout.slice_of(f"{name} lag")
    if where is None:
        return None
    prior = dict(zip(track.layout.names, track.layout.priors, strict=True))[f"{name} lag"][0]
    return float(track.sensors[-1, where.start]), float(track.sigma[-1, where.start]), prior


def as_late_as_found(mounting: Mounting, track: Track, name: str) -> Mounting:
    """The mounting of a sensor with the delay that a track has found; the same object where that is too short to matter."""
    later = _more(track, name)
    if later != 0.0:
        mounting = replace(mounting, latency=mounting.latency + later)
    if mounting.velocities is not None and (later := _more(track, VELOCITIES)) != 0.0:
        own = mounting.velocities
        mounting = replace(mounting, velocities=own._replace(latency=own.latency + later))
    return mounting


def _more(track: Track, name: str) -> float:
    """By how much later (s) a sensor was found than assumed; 0 where that is too short to matter."""
    late = delay_of(track, name)
    return 0.0 if late is None or abs(late[0]) <= max(LEAST_DELAY, SHOWN_DELAY * late[1]) else late[0]


def as_long_as_found(mounting: Mounting, track: Track, name: str) -> Mounting:
    """The mounting of a sensor of whose arm nothing was said, its prior as wide as a track has found it; or the same object."""
    where = track.layout.slice_of(f"{name} lever arm")
    if where is None or mounting.lever_arm_sigma < VEHICLE_ARM:
        return mounting
    longest = float(np.abs(track.sensors[-1, where]).max())
    if longest <= LONG_ARM * mounting.lever_arm_sigma:
        return mounting
    return replace(mounting, lever_arm_sigma=min(longest, LONGEST_ARM))


def mounting_found(mounting: Mounting, track: Track, name: str) -> Mounting:
    """The mounting of a sensor with the length or the delay that a track has found; the same object where nothing changes."""
    longer = as_long_as_found(mounting, track, name)
    return longer if longer is not mounting else as_late_as_found(mounting, track, name)


def latencies(name: str, mounting: Mounting) -> dict[str, float]:
    """How late a sensor is said to be, s, by the names of its delays; a receiver's velocities may have their own."""
    said = {name: mounting.latency}
    return said | {VELOCITIES: mounting.of_velocities.latency} if name == "GNSS" else said


def delays_found(track: Track, sensors: Mapping[str, Mounting]) -> dict[str, tuple[float, float]]:
    """Whole delays (s) and their sigmas, by name, of sensors by name: those that were left open and that the data show."""
    return {
        delay: (late + found[0], found[1])
        for name, mounting in sensors.items()
        for delay, late in latencies(name, mounting).items()
        if (found := delay_of(track, delay)) is not None and is_estimated(found[1], found[2])
    }


def delay_notes(delays: Mapping[str, tuple[float, float]]) -> list[Evidence]:
    """How late sensors were found to be, for the reader: it is in sigma already."""
    return [
        note(f"delay.{'late' if delay > 0.0 else 'early'}", name=name, size=abs(delay), sigma=sigma)
        for name, (delay, sigma) in delays.items()
        if abs(delay) > max(SHOWN_DELAY * sigma, SAID_DELAY)
    ]


def counted_from(track: Track, name: str, before: float) -> Track:
    """The track with a sensor's delay counted from another latency, `before` (s) less than the one it was run with."""
    return _added(track, f"{name} lag", np.array([before]))


def counted_whole(track: Track, name: str, mounting: Mounting) -> Track:
    """The track with a sensor's delays and lever arm as they are, not as what they are beyond those that were said."""
    for delay, late in latencies(name, mounting).items():
        track = counted_from(track, delay, late)
    return _added(track, f"{name} lever arm", mounting.lever_arm)


def _added(track: Track, group: str, known: Array) -> Track:
    where = track.layout.slice_of(group)
    if where is None or not known.any():
        return track
    sensors = track.sensors.copy()
    sensors[:, where] += known
    return replace(track, sensors=sensors)
