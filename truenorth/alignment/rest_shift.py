"""Stops at which the gyros show another rate than at the others: a bias that has changed, or a turn on the spot.

A vehicle that stands, and whose IMU is as quiet as at its other stops, may turn evenly on the spot; no rest is taken there. Or the
bias has changed since: by the warmth of an engine, or since another filter has corrected the rates before they were written. The
biases of that filter move with its own innovations: those of a UAV of 2 kg (University of Minnesota, Thor, flight 75) by .8 deg/s
while it taxied, and the heading after it was 20 deg off. Neither rate nor speed tells a change from a turn. So what a change would
do to heading is counted, from the last usual stop on. Between usual stops it was a turn.
"""

from __future__ import annotations

import math

import numpy as np

from truenorth.navigation.stops import seconds_at_rest, turned_in_stops
from truenorth.records import GnssRecord, ImuRecord, OdometerRecord, VelocityRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, Figure
from truenorth.state.track import Track

FEWEST = 3  # seconds of one such stop
EVEN = 0.3  # of the rate, by which its seconds may differ: a vehicle that turns begins and ends
ONE_STOP = 15.0  # s between such seconds: of those in between a noisy receiver did not say that it stands
LIKELY = 4.0  # sigmas of a gyro's bias, by which two of its values may differ: a faster rate is a turn


def shift_evidence(
    record: ImuRecord, spec: ImuSpec, track: Track, *logs: OdometerRecord | GnssRecord | VelocityRecord | None
) -> list[Evidence]:
    """Stops of another rate, and how far a change of biases between stops turns the heading at the end of a log.

    Parameters
    ----------
    record : ImuRecord
    spec : ImuSpec
        Of the IMU: its biases are the measure of a change.
    track : Track
        Of the log: it says which axis is up.
    *logs : records
        That show when it stands: of a wheel, a receiver, a velocity log, in this order.
    """
    at, off = turned_in_stops(record, *logs) if any(log is not None for log in logs) else (np.empty(0), np.empty(0))
    if not at.size:
        return []
    rest = np.sort(np.concatenate(seconds_at_rest(record, *logs)))  # type: ignore[arg-type]  # in its order
    end = float(track.time[-1])
    found: list[Evidence] = []
    most = LIKELY * math.sqrt(2.0) * float(np.sqrt(spec.bias_variance[:3]).max())
    for rows in np.split(np.arange(len(at)), np.flatnonzero(np.diff(at) > ONE_STOP) + 1):
        rate = np.median(off[rows], axis=0)
        size = float(np.linalg.norm(rate))
        steady = rows[np.linalg.norm(off[rows] - rate, axis=1) < EVEN * size]
        if len(steady) < FEWEST or len(steady) < 0.5 * len(rows) or not rest.size or size > most:
            continue
        first = float(at[rows[0]])
        before, after = rest[rest < first], rest[rest > at[rows[-1]]]
        if before.size and after.size:  # the usual rate is back: a turn, for no bias goes and comes back as it was
            continue
        up = track.C_nb[min(int(np.searchsorted(track.time, first)), len(track) - 1), 2]
        since = float(before[-1]) if before.size else float(at[rows[-1]])
        heading = min(abs(float(up @ rate)) * (end - since), math.pi)
        figures: dict[str, Figure] = {"time": first, "size": size, "seconds": len(rows), "heading": heading}
        found.append(Evidence("rest.shifts", figures, "known", Effect(heading=heading), ("raw_rates",)))
    return sorted(found, key=lambda item: -item.effect.heading)[:1]
