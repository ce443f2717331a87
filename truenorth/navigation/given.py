"""The aids of a navigation as they are given: which there are, how they sit, and how height is kept with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from truenorth.aiding.aids import ANTENNA, Aid, Barometer, Gnss, Odometer, VelocityLog
from truenorth.aiding.fixes import Fixes
from truenorth.aiding.source import Aiding
from truenorth.alignment.unsaid import unsaid_evidence
from truenorth.core.errors import UsageError
from truenorth.estimate.memory import EITHER, IN_BODY, OVER_GROUND
from truenorth.navigation.curve import seen_in_body, shows_body_velocity, shows_stops_alone
from truenorth.navigation.result import Altitude
from truenorth.records import GnssRecord, Late
from truenorth.records.specs import ImuSpec
from truenorth.records.stale import without_stale
from truenorth.state.evidence import Evidence, note, notes
from truenorth.state.layout import ANTENNA_ARM
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start

AIDS = (Gnss, Odometer, VelocityLog, Barometer)
OF_ATTITUDE = ("attitude", "magnetometer")  # keys of aids that show no velocity


def by_key(aid: Aid | Sequence[Aid]) -> dict[str, Any]:
    """The aids in the order in which their measurements are taken, without fixes that are written again."""
    aids: Sequence[Aid] = aid if isinstance(aid, list | tuple) else (aid,)
    for a in aids:
        if not isinstance(a, Aid):
            raise UsageError(
                f"aid {type(a).__name__} is not for navigation; expected {', '.join(k.__name__ for k in AIDS)}, or an object "
                "with key, record and sources"
            )
    found = {a.key: replace(a, record=without_stale(a.record)) if isinstance(a, Gnss) else a for a in aids}
    if len(found) < len(aids):
        raise UsageError(f"aid holds two of one kind: {', '.join(a.key for a in aids)}; expected one of each")
    order = [kind.key for kind in AIDS]
    return dict(sorted(found.items(), key=lambda item: order.index(item[0]) if item[0] in order else len(order)))


def with_rows(given: Mapping[str, Any], rows: GnssRecord | None) -> list[Any]:
    """The aids with these rows of the receiver. On another clock they are not as late as an alignment has found."""
    if rows is None or rows is (receiver := given[Gnss.key]).record:
        return list(given.values())
    return [*({**given, Gnss.key: Gnss(rows, receiver.mounting or receiver.usual)}).values()]


def late_as_found(antenna: Mounting, begin: Start) -> Mounting:
    """An antenna whose receiver is as late as an alignment on the move has found it, which is estimated on."""
    if begin.gnss_delay is None:
        return antenna
    late, sigma = begin.gnss_delay
    own, drift = begin.gnss_velocity_delay, begin.gnss_drift
    return replace(antenna, latency=late, latency_sigma=sigma, velocities=own, drift=drift)


def arm_as_begun(begin: Start, antenna: Mounting | None) -> Start:
    """The start with what an alignment knows of an antenna's arm, if nothing is said of that here either."""
    return begin.without(ANTENNA_ARM) if antenna is not None and antenna.lever_arm.any() else begin


def mountings_found(begin: Start) -> dict[str, Mounting]:
    """How an alignment on the move has found the sensors to be mounted, by the keys of their aids."""
    found = {} if begin.wheel is None else {Odometer.key: begin.wheel}
    return found if begin.gnss_delay is None else found | {Gnss.key: late_as_found(ANTENNA, begin)}


def taken_over(given: dict[str, Any], begin: Start) -> list[Evidence]:
    """What of an alignment on the move holds for the aids, which are mounted so where nothing else is said, or else as is usual."""
    said = []
    for key, found in mountings_found(begin).items():
        if not isinstance(aid := given.get(key), Odometer | Gnss):
            continue
        if aid.mounting is None:
            aid = given[key] = aid.mounted(found)
        if _says_the_same(key, aid.mounting or found, found):
            said.append(note("odometer.taken_over" if key == Odometer.key else "gnss.delay_taken_over"))
    for key, aid in given.items():
        if isinstance(aid, AIDS) and aid.mounting is None:
            given[key] = aid.mounted(aid.usual)
    return said


def said_to_sit(given: Mapping[str, Any], begin: Start) -> list[str]:
    """Keys of aids of which somebody has said how they sit, other than an alignment has found it.

    Two antennas of which nothing is said lie one ahead of the other.
    """
    found = mountings_found(begin)
    mounted = {key: m for key, a in given.items() if (m := getattr(a, "mounting", None)) is not None}
    said = [key for key, m in mounted.items() if key not in found or not _says_the_same(key, m, found[key])]
    return [key for key in given if key == Gnss.key or key in said]


def _says_the_same(key: str, given: Mounting, found: Mounting) -> bool:
    """Whether a mounting has what an alignment has found, whatever else is said of it."""
    if key == Gnss.key:
        own, other = ((m.latency, m.latency_sigma, m.velocities, m.drift) for m in (given, found))
        return own == other
    return given.scale_sigma == found.scale_sigma and bool(np.all(given.C_mb == found.C_mb))


def said_of(given: Mapping[str, Any], spec: ImuSpec) -> list[Evidence]:
    """What the readers of the aids' logs have to say of them, and what a specification does not name."""
    return [item for a in given.values() for item in notes(getattr(a.record, "notes", ()))] + [*unsaid_evidence(spec)]


def late_rows(given: Mapping[str, Any]) -> dict[str, Late]:
    """Of the aids whose logs have rows that came late."""
    late = {key: getattr(a.record, "late", None) for key, a in given.items()}
    return {key: found for key, found in late.items() if found is not None and found.rows}


def kind_of_log(given: Mapping[str, Any]) -> list[Evidence]:
    """What is taken for possible of a velocity log of which nothing is said."""
    log = given.get(VelocityLog.key)
    return log.unsaid if isinstance(log, VelocityLog) else []


def record_of(given: Mapping[str, Aid], kind: type[Any]) -> Any:
    """The record of the aid of a kind; None where there is none."""
    return next((a.record for a in given.values() if isinstance(a, kind)), None)


def logs_of_speed(given: Mapping[str, Aid]) -> tuple[Any, Any, Any]:
    """Records that show when a vehicle stands: of its wheel, its receiver, its velocity log; None where there is none."""
    wheel, receiver, log = (record_of(given, kind) for kind in (Odometer, Gnss, VelocityLog))
    return wheel, receiver, log


def mounted_as(given: Mapping[str, Any], mountings: Mapping[str, Mounting]) -> dict[str, Any]:
    """The aids with other mountings."""
    return {key: a.mounted(mountings[key]) if isinstance(a, AIDS) else a for key, a in given.items()}


def looked_at(given: Mapping[str, Any]) -> dict[str, Mounting]:
    """Mountings that a second look can open."""
    found = {kind.key: kind.usual for kind in AIDS}
    return found | {key: a.mounting for key, a in given.items() if getattr(a, "mounting", None) is not None}


def ungated(given: Mapping[str, Any]) -> dict[str, Any]:
    """The aids without gates: what is wrong rejects the rows that would show what is right."""
    return mounted_as(given, {key: replace(mounting, gate=0.0) for key, mounting in looked_at(given).items()})


def kept_altitude(wanted: str | None, given: Mapping[str, Aid]) -> tuple[Altitude, list[Evidence]]:
    """How height is kept with these aids, and what is to be said of it.

    Raises
    ------
    UsageError
        What is wanted, no aid measures.
    """
    gnss = record_of(given, Gnss)
    heights = gnss is not None and bool(np.isfinite(gnss.alt).any())
    if wanted is not None and wanted not in get_args(Altitude):
        raise UsageError(f"altitude {wanted!r}; expected one of {', '.join(get_args(Altitude))}")
    if wanted == "baro" and "baro" not in given:
        raise UsageError("altitude 'baro' without a barometer's record; expected an aid `Barometer(record)`")
    if wanted == "gnss" and not heights:
        raise UsageError("altitude 'gnss' without heights of GNSS; expected an aid `Gnss(record)` with heights")
    if wanted is not None:
        return wanted, []  # type: ignore[return-value]  # one of the four
    if heights:
        return "gnss", []
    if "baro" in given:
        return "baro", []
    if _shows_climb(given):
        return "free", [note("height.free")]
    return "fixed", [note("height.fixed", "height_sensor")]


def _shows_climb(given: Mapping[str, Aid]) -> bool:
    """Whether an aid shows the vertical velocity.

    A receiver's velocities do with their component up, and so does a log. Of a log along the hull's level axes alone, height left
    free would grow e-fold in 9.5 minutes: by hundreds of metres on ships, and with it all else.
    """
    gnss, log = record_of(given, Gnss), record_of(given, VelocityLog)
    rows = [None if gnss is None else gnss.v_n, None if log is None else log.velocity]
    if any(v is not None and np.isfinite(v[:, 2]).any() for v in rows):
        return True
    return bool(given.keys() - {Gnss.key, VelocityLog.key, Fixes.key, *OF_ATTITUDE})


def fed_back(aiding: Sequence[Aiding]) -> int:
    """How corrections are fed back with these measurements.

    The biases of cheap gyros turn a heading by tens of degrees before turns have shown them. A correction as large, taken off
    attitude and velocity each by itself, leaves errors between which the covariance knows no correlation: of consumer IMUs on
    ships the level was 1.3 to 1.5 sigmas off, RMS, 7.7 at the worst of 40; so 1.1 and 4.4. Where velocity is seen in the
    body alone, the filter then seems to see the heading: industrial IMUs with a log were 8.6 sigmas off, RMS.

    Where both are seen, one fix does not make the ground known for good: before and after it velocity is known in the body. So the
    covariance says at each correction which of the two is known better.

    Stops alone show velocity in either, and nothing of heading: a velocity that has drifted to 5 m/s by the next stop, and is not
    seen in the body, seems to turn with it. Of 60 drives 18 were up to 42 sigmas off on the way.
    """
    if seen_in_body(aiding) or shows_stops_alone(aiding):
        return IN_BODY
    return EITHER if shows_body_velocity(aiding) else OVER_GROUND
