"""What a record itself says against its use: faults of sampling and range, units, and gyros that contradict gravity."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.alternation import alternation_evidence
from truenorth.quality.codes import codes_evidence
from truenorth.quality.force_line import line_evidence
from truenorth.quality.held import sampled_findings
from truenorth.quality.hum import hum_evidence, moving_hum_evidence
from truenorth.quality.plausibility import unit_findings
from truenorth.quality.quantum import quantum_evidence
from truenorth.quality.regimes import MotionSummary
from truenorth.quality.rolled_over import rolled_over_evidence
from truenorth.quality.sampling import Finding, check_sampling
from truenorth.quality.spikes import spikes_evidence
from truenorth.quality.tilt import check_tilt
from truenorth.quality.vibration import vibration_evidence
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Effect, Evidence, contradiction, note

Array = NDArray[np.float64]

# Findings that make any answer wrong, whatever the base does; and those that do so where it turns.
ALWAYS = ("saturated", "constant_channel", "rows_again", "gyro_unit", "accel_unit", "no_gravity")
TURNING = ("repeated_rows", "frozen")
QUIET = ("still", "disturbed")


def record_evidence(
    record: ImuRecord,
    motion: MotionSummary,
    C_sb: Callable[[Array], Array] | None = None,
    *,
    sound: bool = False,
    imu: ImuSpec | None = None,
    right: ImuRecord | None = None,
) -> list[Evidence]:
    """Evidence of a record on a base that stays where it is.

    Parameters
    ----------
    motion : MotionSummary
        Of the same record.
    C_sb : callable, optional
        Attitude (K, 3, 3) of the base in the IMU at times (s): of an IMU that turns on it.
    sound : bool
        Whether clock, logging and range are known to be without fault, and the units and axes of the gyros.
    imu : ImuSpec, optional
        Whose accelerometers' biases pass for gravity that turns where the IMU does.
    right : ImuRecord, optional
        The same record without the errors of its sensors that an encoder shows: poor gyros turn by degrees in seconds.
    """
    found = [] if sound else sampling_evidence(record, turns=motion.overall not in QUIET)
    doubts = unit_findings(record, motion, gyros=not sound)
    quiet = motion.overall in QUIET  # elsewhere an arm makes gravity swing as if the gyros counted in another unit
    codes = {*ALWAYS} - (set() if quiet else {"gyro_unit"})
    found += [_error(doubt) for doubt in doubts if doubt.code in codes and doubt.severity == "error"]
    # What is no unit may be a push, but not of a base that stays; and no accelerometer has a bias of that size.
    found += [_error(doubt) for doubt in doubts if doubt.code == "accel_level"]
    if quiet:  # its attitude is a mean, not integrated to the last row
        return found
    found += vibration_evidence(record)
    accel_bias = 0.0 if imu is None else math.sqrt(float(imu.bias_variance[3:].max()))
    tilt = check_tilt(right or record, C_sb, accel_bias)
    return found if tilt is None else found + tilt.evidence()


def staying_evidence(record: ImuRecord, lat: float, imu: ImuSpec | None = None) -> list[Evidence]:
    """Evidence of the values of a base that stays at a latitude (rad), by what they do to means.

    `imu`: whose bandwidths say what the accelerometers show of a turn.
    """
    checks = (quantum_evidence, codes_evidence, spikes_evidence)
    return [item for check in checks for item in check(record, lat)] + hum_evidence(record, lat, imu)


def moving_evidence(record: ImuRecord) -> list[Evidence]:
    """Evidence of a record on the move; of noise for a while see :func:`truenorth.estimate.rivals.noise_evidence`."""
    found = vibration_evidence(record) + sampling_evidence(record, turns=True)
    return found + codes_evidence(record) + line_evidence(record) + moving_hum_evidence(record)


def sampling_evidence(record: ImuRecord, *, turns: bool) -> list[Evidence]:
    """Evidence of faults of clock, logging and range; `turns`: whether the base turns."""
    _, findings = check_sampling(record)
    found = [*alternation_evidence(record), *rolled_over_evidence(record)]
    found += [note(f"record.{taken.code}", text=taken.message) for taken in sampled_findings(record)]
    for finding in findings:
        serious = finding.severity == "error" or (finding.code in TURNING and finding.severity != "note")
        # What an increment counts is lost where another is written in its place; a rate at rest is held without harm.
        lost = finding.code == "repeated_rows" and finding.severity == "warning" and record.kind == "increments"
        if finding.code in ALWAYS or (turns and serious) or lost:
            found.append(_error(finding))
        elif finding.code == "jitter":
            found.append(_jitter(record, finding))
        elif finding.severity != "note":
            found.append(note(f"record.{finding.code}", urgent=finding.code == "no_noise", text=finding.message))
    return found


def _jitter(record: ImuRecord, finding: Finding) -> Evidence:
    """The turn, and the gain of velocity, within the time by which the stamp of the answer's epoch may be off.

    Of increments gravity counts in the gain: it is taken off over the time that the stamps say.
    """
    increments = record.kind == "increments"
    unit = record.interval if increments else 1.0
    w, a = (
        _size(record.gyro) / unit,
        _size(record.accel if increments else record.accel - record.accel.mean(axis=0)) / unit,
    )
    effect = Effect(heading=w * record.jitter, level=w * record.jitter, velocity=a * record.jitter)
    return Evidence("record.jitter", {"text": finding.message}, "known", effect)


def _size(values: Array) -> float:
    """RMS of the norm of vectors (N, 3)."""
    return math.sqrt(float(np.mean(np.sum(values**2, axis=1))))


def _error(finding: Finding) -> Evidence:
    return contradiction(f"record.{finding.code}", text=finding.message)
