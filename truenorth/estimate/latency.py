"""How late a sensor is and how far away, as a track has found it: what a further pass over the log begins with.

A delay acts as its first derivative as long as it is short against manoeuvres, and of a sensor on an arm against the tremble of the
vehicle: .08 s of an antenna that the road swings at two hertz are a radian of its phase, and look like gyros that are early. So a
pass ends with the delay that it has found, and the next one begins with it.

At a steady speed ``v`` an arm forward and a delay are one: only ``l - v tau`` is seen. How it is parted, their priors say. Arms of
which nobody spoke have many sizes, delays have few: where an arm is found beyond its prior, that was too narrow, and the delay has
taken what it could not hold. The next pass then has a wider arm, and the delay as it was.

The clocks of a receiver and an IMU run at two rates: of quartz, 10 to 100 ppm apart, .04 to .4 s in an hour. So the delay of a
receiver has a rate, which is a state too, and a pass begins with the rate that the one before has found. A rate that is found
beyond its prior is that of a poorer clock, and the next pass has a wider prior, as of an arm.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import VEHICLE_ARM
from truenorth.quality.swing import VELOCITIES
from truenorth.records import ImuRecord
from truenorth.state.evidence import Effect, Evidence, Figure, note
from truenorth.state.limits import is_estimated
from truenorth.state.mounting import LONGEST_ARM, Mounting
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

LEAST_DELAY = 0.01  # s: a shorter one acts as its derivative, even of an antenna that the road swings at some hertz
LONG_ARM = (
    2.0  # sigmas of a prior, from which an arm that nobody has said shows a larger vehicle, a rate a poorer clock
)
WIDER = 10.0  # times the prior of such a rate: quartz, ceramic resonators, oscillators of a chip without either
WORST_CLOCK = 1e-2
CLOCK_DIGITS = 6  # of a stamp, s
WEAK = 0.3  # of a prior, below which it has a tenth of the say
CONTRADICTED = 5.0  # sigmas of a prior, from which it is wrong itself
SETTLED = 0.3  # of its sigma, by which a rate that is apart may still move
SHOWN_DELAY = 3.0  # sigmas from which a delay is worth a word, or a pass
SAID_DELAY = 0.02  # s, from which it is worth a word


def delay_of(track: Track, name: str) -> tuple[float, float, float] | None:
    """Delay of a sensor as found beyond the assumed one, its sigma, and its prior, s."""
    where = track.layout.slice_of(f"{name} lag")
    if where is None:
        return None
    prior = dict(zip(track.layout.names, track.layout.priors, strict=True))[f"{name} lag"][0]
    return float(track.sensors[-1, where.start]), float(track.sigma[-1, where.start]), prior


def rate_of(track: Track, name: str) -> tuple[float, float, float] | None:
    """By how much a sensor's delay grows beyond the assumed rate, its sigma, and its prior, s/s."""
    where = track.layout.slice_of(f"{name} lag")
    if where is None or where.stop - where.start < 2:
        return None
    prior = dict(zip(track.layout.names, track.layout.priors, strict=True))[f"{name} lag"][1]
    return float(track.sensors[-1, where.stop - 1]), float(track.sigma[-1, where.stop - 1]), prior


def best_rate(track: Track) -> tuple[float, float, float] | None:
    """What a track has found of how a receiver's clock runs, by its places or its velocities, whichever show it better."""
    found = [rate for name in ("GNSS", VELOCITIES) if (rate := rate_of(track, name)) is not None]
    return min(found, key=lambda rate: rate[1], default=None)


def as_late_as_found(mounting: Mounting, track: Track, name: str) -> Mounting:
    """The mounting of a sensor with the delay that a track has found; the same object where that is too short to matter."""
    if name == "GNSS" and (rate := best_rate(track)) is not None:
        running = _running_as_found(mounting, track, rate)
        if running is not mounting:
            return running
    later = _more(track, name)
    if later != 0.0:
        mounting = replace(mounting, latency=mounting.latency + later)
    if mounting.velocities is not None and (later := _more(track, VELOCITIES)) != 0.0:
        own = mounting.velocities
        mounting = replace(mounting, velocities=own._replace(latency=own.latency + later))
    return mounting


def _running_as_found(mounting: Mounting, track: Track, rate: tuple[float, float, float]) -> Mounting:
    """The mounting of a receiver whose clock runs as a track has found it (rate, sigma, prior), or may run further apart."""
    value, sigma, prior = rate
    if abs(value) > LONG_ARM * prior and prior < WORST_CLOCK:
        return replace(mounting, drift=mounting.clock._replace(rate_sigma=min(WIDER * prior, WORST_CLOCK)))
    begin, end = float(track.time[0]), float(track.time[-1])
    if abs(value) * (end - begin) <= LEAST_DELAY:
        return mounting
    if abs(value) > SHOWN_DELAY * sigma:
        return as_it_runs(mounting, track)
    apart = mounting.clock.rate != 0.0 and sigma < WEAK * prior and abs(mounting.clock.rate + value) < 3.0 * WORST_CLOCK
    return _at_another_rate(mounting, value, begin) if apart and abs(value) > SETTLED * sigma else mounting


def _at_another_rate(mounting: Mounting, rate: float, begin: float) -> Mounting:
    """The mounting of a receiver whose clock runs apart by more, as late as it was said to be when the log begins.

    Measurements are nearer to linear about it, and what is known of the delay itself still counts once.
    """
    grown = mounting.late_at(begin) - mounting.latency
    own = mounting.velocities
    if own is not None:
        own = own._replace(latency=own.latency + grown)
    drift = mounting.clock._replace(rate=mounting.clock.rate + rate, since=begin)
    return replace(mounting, latency=mounting.latency + grown, velocities=own, drift=drift)


def as_it_runs(mounting: Mounting, track: Track) -> Mounting:
    """The mounting of a receiver as late as a track has found it, and its delay growing so: that at the track's end is as found."""
    rate = 0.0 if (found_rate := best_rate(track)) is None else found_rate[0]
    end, drift = float(track.time[-1]), mounting.clock
    grown = mounting.late_at(end) - mounting.latency
    found = {name: 0.0 if (late := delay_of(track, name)) is None else late[0] for name in ("GNSS", VELOCITIES)}
    own = mounting.velocities
    if own is not None:
        own = own._replace(latency=own.latency + grown + found[VELOCITIES])
    drift = drift._replace(rate=drift.rate + rate, since=end)
    return replace(mounting, latency=mounting.latency + grown + found["GNSS"], velocities=own, drift=drift)


def _more(track: Track, name: str) -> float:
    """By how much later (s) a sensor was found than assumed; 0 where that is too short to matter, or not known by the log.

    The next pass has the prior about what is found here. Of a delay that the log does not show far better than the prior, that
    would be a guess about a guess, and passes go on from one to the next (-1.2, -2.9, -4.3 s of a robot's, with 0 +- .2).
    """
    late = delay_of(track, name)
    if late is None or abs(late[0]) <= max(LEAST_DELAY, SHOWN_DELAY * late[1]):
        return 0.0
    if late[1] > WEAK * late[2] and abs(late[0]) < CONTRADICTED * late[2]:
        return 0.0
    return late[0]


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


def as_stamped(residuals: Iterable[Residuals], antenna: Mounting, wheel: Mounting | None = None) -> list[Residuals]:
    """Residuals with the stamps of their logs, which the latency of a sensor has moved."""
    own = replace(antenna, latency=antenna.of_velocities.latency)
    sensors = {"GNSS position": antenna, VELOCITIES: own}
    if wheel is not None:
        sensors |= {"odometer": wheel, "velocity log": wheel}

    def stamps(r: Residuals) -> Array:
        at = sensors[r.name].stamped(r.stamp) if r.name in sensors else r.stamp
        return np.round(at, CLOCK_DIGITS)

    return [replace(r, stamp=stamps(r)) for r in residuals]


def latencies(name: str, mounting: Mounting, time: Any) -> dict[str, Any]:
    """How late a sensor is said to be at a time, s, by the names of its delays; a receiver's velocities may have their own."""
    late = mounting.late_at(time)
    said = {name: late}
    return said | {VELOCITIES: late + mounting.of_velocities.latency - mounting.latency} if name == "GNSS" else said


def delays_found(track: Track, sensors: Mapping[str, Mounting]) -> dict[str, tuple[float, float]]:
    """Whole delays (s) and their sigmas, by name, of sensors by name: those that were left open and that the data show."""
    return {
        delay: (late + found[0], found[1])
        for name, mounting in sensors.items()
        for delay, late in latencies(name, mounting, float(track.time[-1])).items()
        if (found := delay_of(track, delay)) is not None and is_estimated(found[1], found[2])
    }


def rates_found(track: Track, antenna: Mounting) -> dict[str, tuple[float, float]]:
    """By how much a receiver's delays grow (s/s) and sigmas, by name, where the data show it."""
    return {
        delay: (antenna.clock.rate + found[0], found[1])
        for delay in ("GNSS", VELOCITIES)
        if (found := rate_of(track, delay)) is not None and is_estimated(found[1], found[2])
    }


def rate_evidence(rates: Mapping[str, tuple[float, float]], track: Track, record: ImuRecord) -> list[Evidence]:
    """That a receiver's clock and the IMU's run apart: delays are in sigma, velocities are metres in a second of the IMU's.

    Gyros that say rates say angles by seconds of the IMU, too: of a turn a part as large is missing.
    """
    best = min(rates.values(), key=lambda rate: rate[1], default=(0.0, 0.0))
    if abs(best[0]) <= SHOWN_DELAY * best[1]:
        return []
    key = "clock.runs_fast" if best[0] < 0.0 else "clock.runs_slow"
    dv = abs(best[0]) * float(np.linalg.norm(track.v_n, axis=1).max())
    headings = np.unwrap(np.arctan2(track.C_nb[:, 0, 1], track.C_nb[:, 1, 1]))
    turned = float(np.ptp(headings)) if record.kind == "rates" else 0.0
    figures: dict[str, Figure] = {"name": "GNSS", "size": 1e6 * abs(best[0]), "sigma": 1e6 * best[1]}
    return [Evidence(key, figures, kind="hint", effect=Effect(heading=abs(best[0]) * turned, velocity=dv))]


def delay_notes(delays: Mapping[str, tuple[float, float]]) -> list[Evidence]:
    """How late sensors were found to be, for the reader: it is in sigma already."""
    return [
        note(f"delay.{'late' if delay > 0.0 else 'early'}", name=name, size=abs(delay), sigma=sigma)
        for name, (delay, sigma) in delays.items()
        if abs(delay) > max(SHOWN_DELAY * sigma, SAID_DELAY)
    ]


def counted_from(track: Track, name: str, before: Any, rate: float = 0.0) -> Track:
    """The track with a sensor's delay counted from another latency, `before` (s) less than the one it was run with.

    Parameters
    ----------
    before : float or (K,) array, s
    rate : float, s/s
        By which that one grows.
    """
    late = np.broadcast_to(np.asarray(before, dtype=np.float64), track.time.shape)
    return _added(track, f"{name} lag", np.stack([late, np.full_like(late, rate)], axis=1))


def counted_between(track: Track, name: str, mounting: Mounting, before: Mounting) -> Track:
    """The track with a sensor's delays counted from those of another mounting than that it was run with."""
    said = latencies(name, before, track.time)
    for delay, late in latencies(name, mounting, track.time).items():
        track = counted_from(track, delay, late - said[delay], mounting.clock.rate - before.clock.rate)
    return track


def counted_whole(track: Track, name: str, mounting: Mounting) -> Track:
    """The track with a sensor's delays and lever arm as they are, not as what they are beyond those that were said."""
    for delay, late in latencies(name, mounting, track.time).items():
        track = counted_from(track, delay, late, mounting.clock.rate)
    return _added(track, f"{name} lever arm", mounting.lever_arm)


def _added(track: Track, group: str, known: Array) -> Track:
    """The track with what is known (.., m) of a group's states on top of them; of as many as it has."""
    where = track.layout.slice_of(group)
    if where is None or not known.any():
        return track
    sensors = track.sensors.copy()
    sensors[:, where] += known[..., : where.stop - where.start]
    return replace(track, sensors=sensors)
