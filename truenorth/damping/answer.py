"""From what a damping method found to the answer: corrected track, residuals, the drift of the log, spectra."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.bands import Bands
from truenorth.damping.filters import Estimate
from truenorth.damping.fix_rows import Weighed
from truenorth.damping.log_arm import Arm
from truenorth.damping.reference import Reference
from truenorth.damping.result import LogHistory
from truenorth.damping.spectrum import Spectrum, schuler_lines, spectrum
from truenorth.damping.switching import Switching
from truenorth.errors.group import Group
from truenorth.errors.log import LogErrors
from truenorth.errors.marine import BA, BG, MOTION, OF_INS, STATES
from truenorth.state import layout as ins
from truenorth.state.evidence import Evidence, note
from truenorth.state.layout import ACCEL_AXES, GYRO_AXES
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]

LEVELLED = "levelled velocity log"  # its residuals, east and north
SHORTEST = 16  # epochs of a spectrum
LEVEL = OF_INS[MOTION]


class LogOn(NamedTuple):
    """A speed log on a course: what it says, what it may be wrong by, whether the INS has turned it, its arm if sought."""

    reference: Reference | None
    errors: LogErrors
    turned: bool
    arm: Arm | None


class Found(NamedTuple):
    """Errors (K+1, 7), their bands from the switch on, the filter's estimate where it is one, switches, fixes."""

    x: Array
    bands: Bands | None
    estimate: Estimate | None
    switching: Switching | None
    fixes: Weighed | None = None


def switched(found: Switching, time: Array) -> Evidence:
    """How often, for how long, and the worst reason for it."""
    first = next(s for s in found.switches if not s.damped)
    count = sum(not s.damped for s in found.switches)
    share = float(np.mean(found.mu == 0.0) * (time[-1] - time[0]))
    return note(
        "damping.switched", count=count, undamped=share / 60.0, time=first.time, leak=first.leak, allowed=first.allowed
    )


def history_of(course: Track, estimate: Estimate | None, groups: Sequence[Group]) -> LogHistory | None:
    """What the filter found of the log and the plumb line, epoch by epoch; None where no filter ran."""
    if estimate is None:
        return None
    groups = [group for group in groups if group.name not in (GYRO_AXES, ACCEL_AXES)]  # the last
    names = tuple(group.name for group in groups for _ in group.prior)
    units = tuple(group.unit for group in groups for _ in group.prior)
    time = course.time[estimate.start :]
    own = slice(STATES, STATES + len(names))
    return LogHistory(time, names, units, estimate.x[:, own], estimate.sigma[:, own])


def residuals_of(course: Track, log: LogOn, damped: Track, found: Found, start: int) -> list[Residuals]:
    """What INS and log differ by: innovations of the augmented filter, else what is left after the correction."""
    if log.reference is None:
        return []
    estimate = found.estimate
    if found.bands is not None:
        off, sigma = (damped.v_n[start:, :2] - log.reference.velocity[start:]), found.bands.residual
        used = np.ones(len(off), dtype=bool)
    elif estimate is not None and estimate.innovation is not None and estimate.innovation_sigma is not None:
        off, sigma = estimate.innovation, estimate.innovation_sigma
        used = ~(estimate.used == 0.0).any(axis=1)
    else:
        return []
    there = np.flatnonzero(np.isfinite(off).all(axis=1))
    time = course.time[start:][there]
    e, s = (np.column_stack([a[there], np.full(len(there), np.nan)]) for a in (off, sigma))
    nis = np.nansum((e / s) ** 2, axis=1)
    return [Residuals(LEVELLED, time, e, s, nis, used[there], 0, time, np.zeros(len(there), dtype=bool))]


def even(track: Track) -> Track:
    """The track without a last epoch that comes too early."""
    steps = np.diff(track.time)
    if len(steps) > 1 and abs(steps[-1] - steps[0]) > 0.01 * steps[0]:
        return track[:-1]
    return track


def corrected(damped: Track, found: Found, start: int) -> Track:
    """A track whose errors are taken off, with the bands that are left; correlations are not given.

    The bands take the place of the covariances that they come from: of two days at 1 Hz these are 1 GB.
    """
    P, sensors, estimate = damped.P, damped.sensors.copy(), found.estimate
    if not P.flags.writeable:
        P = P.copy()
    variance = np.einsum("kii->ki", P)[start:].copy()
    if found.bands is not None:
        sigma = found.bands.errors
    else:
        assert estimate is not None  # one of the two
        sigma = estimate.sigma[:, MOTION]
        for own, there in ((BG, ins.BG), (BA, ins.BA)):
            sensors[start:, there] += estimate.x[:, own]
            variance[:, there] = estimate.sigma[:, own] ** 2
    variance[:, LEVEL] = sigma**2
    P[start:] = 0.0
    np.einsum("kii->ki", P)[start:] = variance
    return replace(damped, P=P, sensors=sensors)


def spectrum_of(v: Array, interval: float) -> Spectrum | None:
    """Of a complex velocity; None of too short a one."""
    there = np.isfinite(v).all(axis=1)
    return spectrum(v[:, 0] + 1j * v[:, 1], interval) if there.sum() >= SHORTEST else None


def lines_of(v: Array, interval: float) -> tuple[float, float]:
    """Periods of its two Schuler lines, s; NaN of no velocity."""
    return schuler_lines(v, interval) if np.isfinite(v).any() else (np.nan, np.nan)
