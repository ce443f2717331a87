"""Passes over one log: what each of them shows of the aids before the next, and the track of the last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import Aid, Gnss
from truenorth.alignment.in_motion_learnt import differs
from truenorth.core.errors import DataError
from truenorth.estimate.latency import counted_between, delay_notes, delays_found, rate_evidence, rates_found
from truenorth.estimate.moment import as_unsure, likeliest_moment, quickness, tells_until
from truenorth.estimate.moments import explained_by_two, velocities_apart
from truenorth.estimate.other_clocks import best_clock, clock_ratio
from truenorth.navigation.given import ungated
from truenorth.navigation.hidden_slow import smoothed_as_unsure
from truenorth.navigation.plan import Plan
from truenorth.navigation.second_look import ALL_QUICK, SENSORS, as_found
from truenorth.navigation.under_way import fitted_under_way
from truenorth.quality.absolute import known_as_fixes, with_open_arm
from truenorth.quality.aid_noise import LOUD, WHEEL, changed, noise_factors, noise_notes
from truenorth.quality.slow_aids import FIXES, SPEEDS, slow_errors, under_way
from truenorth.quality.stamps import scattered, stamp_notes, stamp_scatter
from truenorth.quality.swing import (
    UNSEEN_ARM,
    is_swung_late,
    meant_part,
    quick_part,
    shown_arm,
    swing,
    unseen_swing,
    with_unseen_arm,
)
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.mounting import Mounting
from truenorth.state.track import Track

Array = NDArray[np.float64]

NOISE_PASSES = 4
OF_ANY_PHASE = 2.0**0.5  # of a swing: what is predicted and what another phase of it shows count, both
LEAST_UNSEEN = 0.3  # of a swing that a filter lost a track by
MOST_DELAYS = 8  # passes that begin with a delay found by the one before


def filtered(plan: Plan, given: dict[str, Any], smooth: bool) -> tuple[Plan, dict[str, Any], Track, list[Evidence]]:
    """The plan with slow errors of aids that innovations show, aids as late as found, the track, and what is to be said."""
    asked = given
    track = plan.run(plan.sources(given), smooth=smooth)
    plan, given, track, said = _of_the_shake(plan, given, track, smooth)
    first = plan, track
    plan, track = _with_late_swing(plan, given, track, smooth)
    plan, track = _with_swing_apart(plan, given, track, smooth)
    plan, track = _not_lost(plan, given, track, smooth)
    if lost(track):
        plan, track = with_scattered_stamps(plan, given, track, smooth)
    plan, track = _as_noisy(plan, given, track, smooth)
    said += noise_notes(plan.factors)
    plan, given, track, unsure = _on_another_clock(plan, first, given, track, smooth)
    said += unsure
    later = delayed(plan, given, track)
    if later is not given:
        given = later
        track = plan.run(plan.sources(given), smooth=smooth)
    plan, given, track = _all_shown(plan, given, track, smooth)
    for _ in range(2):  # what is noise hides a delay
        given, track = _of_two_moments(plan, given, track, smooth)
        as_it_was = plan
        plan, track = _with_unseen_swing(plan, given, track, smooth)
        if plan is as_it_was:
            break
    as_it_was = plan
    plan, track = _with_swing_apart(plan, given, track, smooth)  # as late as it is now
    if plan is not as_it_was:
        plan, track = _with_unseen_swing(plan, given, track, smooth)
    plan, track = with_scattered_stamps(plan, given, track, smooth)
    said += stamp_notes(plan.stamps)
    plan, track, lasting = with_slow_errors(plan, given, track, smooth)
    said += lasting
    receiver = given.get(Gnss.key)
    track = as_unsure(smoothed_as_unsure(plan, given, track) if smooth else track, plan.delay_spread)
    if isinstance(receiver, Gnss):
        said_of = None if receiver.mounting is None else receiver.mounting.bias_sigma
        fixes = next((source for source in plan.sources(given) if source.name == FIXES), None)
        track = known_as_fixes(track, receiver.record, said_of, plan.slow.get(FIXES), fixes)
        track = with_open_arm(track, quick_swing(plan, given)[0])
        if receiver.mounting is not None and receiver.mounting.velocities is not None:
            said += delay_notes(delays_found(track, {SENSORS[Gnss.key][0]: receiver.mounting}))
        if receiver.mounting is not None:
            said += rate_evidence(rates_found(track, receiver.mounting), track, plan.record)
    for key, (name, _) in SENSORS.items():
        if given.get(key) is asked.get(key):
            continue
        track = counted_between(track, name, given[key].mounting, asked[key].mounting)
    return plan, given, track, said


def with_slow_errors(
    plan: Plan, given: Mapping[str, Any], track: Track, smooth: bool = False
) -> tuple[Plan, Track, list[Evidence]]:
    """The plan with errors of its aids that last, as far as innovations show them, its track, and what is to be said of them."""
    said: list[Evidence] = []
    for _ in range(2):  # one sensor's may hide another's
        slow, shown = slow_errors(under_way(track), plan.sources(given))
        if not slow:
            slow, shown = slow_errors(track, plan.sources(given))
        if not slow:
            break
        plan = replace(plan, slow={**plan.slow, **slow})
        said += shown
        track = plan.run(plan.sources(given), smooth=smooth)
    receiver = given.get(Gnss.key)
    if isinstance(receiver, Gnss) and plan.slow.keys() & {FIXES, SPEEDS}:
        plan, more = fitted_under_way(plan, given, receiver, track)
        said += more
        track = plan.run(plan.sources(given), smooth=smooth)
    return plan, track, said


def _with_late_swing(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[Plan, Track]:
    """The plan whose receiver shows its antenna's slow swing as late as all else, where the log speaks for it; else the same ones.

    First of all: a ship hardly pushes, and of a swell on a mast that no delay explains the filter loses its track. On rough ground
    alone what little a slow part has of the quick swing looks like a delay, many times that of the receiver.
    """
    later = replace(plan, late=True)
    if not any(source.name == SPEEDS and is_swung_late(source) for source in plan.sources(given)):
        return plan, track
    try:
        other = later.run(later.sources(given), smooth=smooth)
    except DataError:  # the filter broke down
        return plan, track
    return (later, other) if explained_by_two(other, track) else (plan, track)


def _of_the_shake(
    plan: Plan, given: dict[str, Any], track: Track, smooth: bool
) -> tuple[Plan, dict[str, Any], Track, list[Evidence]]:
    """The plan, aids and track with the moment that a receiver shows of an antenna that shakes; else the same ones."""
    receiver = given.get(Gnss.key)
    if not isinstance(receiver, Gnss) or not (antenna := receiver.mounting):
        return plan, given, track, []
    if (quick := quickness(antenna, plan.record, track)) == 0.0:
        return plan, given, track, []
    shaken, open_ = replace(plan, shaken=True), ungated(given)
    short = replace(shaken, record=plan.record.between(None, tells_until(track)))

    def run(other: Mounting) -> Track:
        return short.run(short.sources({**open_, Gnss.key: receiver.mounted(replace(other, gate=0.0))}))

    best = likeliest_moment(run, lambda other, _: run(other), antenna, quick)
    if not best.shown:
        return plan, given, track, []
    shaken, later = replace(shaken, delay_spread=best.spread), {**given, Gnss.key: receiver.mounted(best.antenna)}
    try:
        return shaken, later, shaken.run(shaken.sources(later), smooth=smooth), [*best.evidence]
    except DataError:  # the filter broke down
        return plan, given, track, []


def _with_swing_apart(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[Plan, Track]:
    """The plan whose receiver does not show its antenna's swing, where the log speaks for it, and its track; else the same ones.

    First of all: of a swing that is taken for motion the filter makes delays, and loses the track. And once delays are found: of a
    swing of another moment no part is shown.
    """
    apart, aiding = replace(plan, swings=True), plan.sources(given)
    both = (with_unseen_arm(aiding, plan.record, plan.askew, known=known) for known in (False, True))
    if all(one.states.keys() == two.states.keys() for one, two in zip(*both, strict=True)):
        return plan, track
    try:
        other = apart.run(aiding, smooth=smooth)
    except DataError:  # the filter broke down
        return plan, track
    return (apart, other) if explained_by_two(other, track) else (plan, track)


def quick_swing(plan: Plan, given: Mapping[str, Aid]) -> Array:
    """(2, 3) parts of an antenna's arm: shown by what its receiver may filter, all where there are no velocities; lost in means."""
    times = [source.time for source in plan.sources(given) if source.name == SPEEDS]
    if not times or not len(times[0]):
        return ALL_QUICK
    return np.stack([quick_part(plan.record, times[0]), meant_part(plan.record, times[0])])


def lost(track: Track) -> bool:
    """Whether the gates of a track keep out more of a sensor's rows than chance and some jumps do."""
    return max((r.rejected / max(len(r.time), 1) for r in track.residuals), default=0.0) > limit("rejected")


def _not_lost(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[Plan, Track]:
    """The plan with all of an antenna's swing as noise, and its track, where that keeps a track that is lost; else the same ones.

    Of a swing that the receiver shows late, or filtered, no state knows the phase, and gates keep out what would show how late it
    is. How much of it is noise is learnt once delays are found (:func:`_with_unseen_swing`).
    """
    receiver = given.get(Gnss.key)
    if (
        not lost(track)
        or not isinstance(receiver, Gnss)
        or not (antenna := receiver.mounting)
        or antenna.latency_sigma == 0.0
    ):
        return plan, track
    other = _with_swing(plan, given, track, np.hypot(antenna.lever_arm, antenna.lever_arm_sigma), OF_ANY_PHASE)
    try:
        quiet = other.run(other.sources(given), smooth=smooth)
    except DataError:  # the filter broke down
        return plan, track
    return (other, quiet) if explained_by_two(quiet, track) else (plan, track)


def _all_shown(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[Plan, dict[str, Any], Track]:
    """The plan without a swing as noise, its delays and its track, where they explain the log as well; else what was given.

    Of an arm that is known: the swing was late, and with the noise the delay is found too coarsely to end it.
    """
    receiver = given.get(Gnss.key)
    if (
        not plan.unseen
        or not isinstance(receiver, Gnss)
        or not (antenna := receiver.mounting)
        or antenna.lever_arm_sigma > 0.0
    ):
        return plan, given, track
    shown = replace(plan, unseen=0.0, swung={})
    try:
        later = delayed(shown, given, shown.run(shown.sources(ungated(given))))
        quiet = shown.run(shown.sources(later), smooth=smooth)
    except DataError:  # the filter broke down
        return plan, given, track
    return (plan, given, track) if lost(quiet) or explained_by_two(track, quiet) else (shown, later, quiet)


def _with_unseen_swing(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[Plan, Track]:
    """The plan with as much of an antenna's swing as noise as innovations show now, and its track, once a part of it is unseen.

    A filter shows less of a swing the quicker it is, and the states have one part for all that is quick of a rate: what is left of
    tones that are shown otherwise is noise, not the scale of a gyro. Of a track that was lost without it some is noise always.
    """
    receiver = given.get(Gnss.key)
    if (
        not (plan.unseen or UNSEEN_ARM in track.layout.names)
        or not isinstance(receiver, Gnss)
        or not (antenna := receiver.mounting)
        or antenna.latency_sigma == 0.0
    ):
        return plan, track
    least = LEAST_UNSEEN if plan.unseen else 0.0
    for _ in range(NOISE_PASSES):
        arm = shown_arm(track, antenna.lever_arm)
        share = max(unseen_swing(track, plan.record, arm, plan.unseen), least)
        if not differs(plan.unseen, share):
            break
        plan = _with_swing(plan, given, track, arm, share)
        track = plan.run(plan.sources(given), smooth=smooth)
    return plan, track


def _with_swing(plan: Plan, given: dict[str, Any], track: Track, arm: Array, share: float) -> Plan:
    """The plan with a share of the swing of an antenna on an arm in the noise of its velocities."""
    fixes = [source for source in plan.sources(given) if source.name == SPEEDS]
    added = {source.name: share * swing(track, plan.record, arm, source.time) for source in fixes}
    return replace(plan, unseen=share, swung=added)


def with_scattered_stamps(
    plan: Plan, given: Mapping[str, Any], track: Track, smooth: bool = False
) -> tuple[Plan, Track]:
    """The plan whose receiver's stamps scatter as innovations show, and its track, where the log speaks for it; else the same ones.

    Gates keep out the rows that would show it: a track that is lost is looked at without.
    """
    for _ in range(NOISE_PASSES):
        aiding = [source for source in plan.sources(given) if source.name in (FIXES, SPEEDS)]
        try:
            seen = plan.run(plan.sources(ungated(given))) if lost(track) else track
            sigma = stamp_scatter(seen, aiding, plan.stamps)
            # What explains a log is kept: with it, less is left to be explained.
            if sigma == 0.0 or not differs(plan.stamps, sigma):
                break
            other = replace(plan, stamps=sigma, stamped=scattered(aiding, seen, sigma))
            quiet = other.run(other.sources(given), smooth=smooth)
        except DataError:  # the filter broke down
            break
        if plan.stamps == 0.0 and not explained_by_two(quiet, track):
            break
        plan, track = other, quiet
    return plan, track


def _on_another_clock(
    plan: Plan, first: tuple[Plan, Track], given: dict[str, Any], track: Track, smooth: bool
) -> tuple[Plan, dict[str, Any], Track, list[Evidence]]:
    """The plan, aids and track on a receiver's clock that runs far apart from the IMU's, where the log says so; else the same.

    A swing that is shown late takes up a part of what a clock does: so the first pass, that has no such swing, is asked as well,
    and the likelier of the two is gone on with.
    """
    receiver = given.get(Gnss.key)
    if not isinstance(receiver, Gnss) or receiver.mounting is None:
        return plan, given, track, []
    antenna = receiver.mounting

    def asked(of: Plan, seen: Track) -> tuple[Mounting | None, Track, list[Evidence]]:
        def run(other: Mounting) -> Track:
            return of.run(of.sources({**given, Gnss.key: receiver.mounted(other)}), smooth=smooth)

        best, unsure = best_clock(run, antenna, seen)
        return (None, seen, unsure) if best is None else (best.antenna, best.track, unsure)

    clock, found, unsure = asked(plan, track)
    if plan.late:
        other, fitted_by, _ = asked(*first)
        if other is not None and clock_ratio(found, fitted_by, clock or antenna, other) > 0.0:
            plan, clock, found, unsure = first[0], other, fitted_by, []
    return plan, given if clock is None else {**given, Gnss.key: receiver.mounted(clock)}, found, unsure


def _of_two_moments(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[dict[str, Any], Track]:
    """The aids with a delay of the receiver's velocities alone, where the log speaks for it, and the track; else the same ones."""
    receiver = given.get(Gnss.key)
    if not isinstance(receiver, Gnss) or receiver.mounting is None:
        return given, track
    antenna = velocities_apart(receiver.mounting, receiver.record)
    if antenna is receiver.mounting:
        return given, track
    apart = {**given, Gnss.key: receiver.mounted(antenna)}
    try:
        two = plan.run(plan.sources(apart))
        if not explained_by_two(two, track, delays=True):
            return given, track
        apart = delayed(plan, apart, two)
        return apart, plan.run(plan.sources(apart), smooth=smooth)
    except DataError:  # the filter broke down: they are of one moment
        return given, track


def _as_noisy(plan: Plan, given: dict[str, Any], track: Track, smooth: bool) -> tuple[Plan, Track]:
    """The plan with a wheel as noisy as its innovations show, and its track; the same ones where it is as noisy as it says.

    The first pass counts rows far out, or its gate rejects half of a noisy wheel's; the next ones see what is left. Receivers say
    how noisy they are, and what is slow in that is looked at by itself.
    """
    for number in range(NOISE_PASSES):
        asked = [source for source in plan.sources(given) if source.name == WHEEL]
        wheel = noise_factors(track, asked, plan.factors, tails=number == 0)
        if number == 0 and all(float(factor.max()) <= LOUD for factor in wheel.values()):
            return plan, track
        if not changed(plan.factors, wheel):
            break
        plan = replace(plan, factors=wheel)
        track = plan.run(plan.sources(given), smooth=smooth)
    return plan, track


def delayed(plan: Plan, given: dict[str, Any], track: Track) -> dict[str, Any]:
    """The aids as late as passes over the log have found them, one after the other; the same mapping where none is late."""
    found = given
    for _ in range(MOST_DELAYS):
        later = as_found(found, track)
        if later is found:
            break
        found = later
        track = plan.run(plan.sources(ungated(found)))
    return found
