"""What a record itself says against its use: faults of sampling and range, units, and gyros that contradict gravity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.plausibility import check_plausibility
from truenorth.quality.regimes import MotionSummary
from truenorth.quality.sampling import Finding, check_sampling
from truenorth.quality.tilt import check_tilt
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence, contradiction, note

Array = NDArray[np.float64]

# Findings that make any answer wrong, whatever the base does; and those that do so where it turns.
ALWAYS = ("saturated", "constant_channel", "gyro_unit", "accel_unit", "no_gravity")
TURNING = ("repeated_rows", "frozen")
QUIET = ("still", "disturbed")


def record_evidence(
    record: ImuRecord, motion: MotionSummary, C_sb: Callable[[Array], Array] | None = None
) -> list[Evidence]:
    """Evidence of a record on a base that stays where it is.

    Parameters
    ----------
    motion : MotionSummary
        Of the same record.
    C_sb : callable, optional
        Attitude (K, 3, 3) of the base in the IMU at times (s): of an IMU that turns on it.
    """
    found = sampling_evidence(record, turns=motion.overall not in QUIET)
    _, doubts = check_plausibility(record, motion)
    quiet = motion.overall in QUIET  # elsewhere an arm makes gravity swing as if the gyros counted in another unit
    codes = {*ALWAYS} - (set() if quiet else {"gyro_unit"})
    found += [_error(doubt) for doubt in doubts if doubt.code in codes and doubt.severity == "error"]
    if quiet:
        return found
    tilt = check_tilt(record, C_sb)
    return found if tilt is None else found + tilt.evidence()


def sampling_evidence(record: ImuRecord, *, turns: bool) -> list[Evidence]:
    """Evidence of faults of clock, logging and range; `turns`: whether the base turns."""
    _, findings = check_sampling(record)
    found = []
    for finding in findings:
        if finding.code in ALWAYS or (turns and finding.code in TURNING and finding.severity != "note"):
            found.append(_error(finding))
        elif finding.severity == "warning":
            found.append(note(f"record.{finding.code}", text=finding.message))
    return found


def _error(finding: Finding) -> Evidence:
    return contradiction(f"record.{finding.code}", text=finding.message)
