"""May this answer be used? The status, and the reasons in words and figures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.check import LogCheck
from truenorth.alignment.drift import Drift
from truenorth.alignment.result import Alignment, Status
from truenorth.core.earth import EARTH_RATE, normal_gravity
from truenorth.core.units import DEG_PER_HOUR, MICRO_G, significant

Array = NDArray[np.float64]

OUTLIER = 5.0  # sigmas by which a checkable component may miss its specification
NEAR_POLE = 0.1  # cosine of the latitude (84 deg) from which the place, not the gyro, is what hides north
LEVEL_LIMIT = np.radians(3.0)  # a tilt less certain than this is no level


@dataclass(frozen=True)
class Circumstances:
    """What the verdict needs besides the answer.

    Attributes
    ----------
    heading_limit : float, rad
        Largest one-sigma heading error the user can use.
    check : LogCheck
    moves_from : float or None, s
        When the base begins to go somewhere.
    settled : bool
        Whether re-linearisation came to rest.
    drift : Drift or None
        What the test for a base that leaves says.
    """

    heading_limit: float
    check: LogCheck
    moves_from: float | None = None
    settled: bool = True
    drift: Drift | None = None


def judge(answer: Alignment, around: Circumstances) -> tuple[Status, tuple[str, ...]]:
    """Status and reasons of an answer."""
    contradictions = _contradictions(answer, around)
    if contradictions:
        return "inconsistent", tuple(contradictions)
    level = float(np.sqrt(np.max(np.linalg.eigvalsh(answer.phi_covariance[:2, :2]))))
    if level > LEVEL_LIMIT:
        return "not_converged", (
            f"level is known to {np.degrees(level):.2f} deg only; {np.degrees(LEVEL_LIMIT):.0f} deg is the most that "
            "passes for level: record longer, or with less motion",
        )
    sigma, floor = _azimuth_sigmas(answer)
    limit = around.heading_limit
    good_level = f"level is known to {np.degrees(level) * 60:.2f} arcmin (one sigma)"
    if sigma <= limit:
        reasons = [
            f"heading is known to {_angle(sigma)} (one sigma); {_angle(floor)} of it is sensor bias, which waiting does not improve"
        ]
        if answer.pays_until is not None and np.isfinite(answer.pays_until):
            reasons.append(_waiting(answer))
        if answer.near_vertical:
            reasons.append("pitch is near +-90 deg: heading and roll are told only together (see the combination)")
        return "aligned", tuple(reasons)

    horizontal = EARTH_RATE * np.cos(answer.position.lat)
    bias = float(np.max(answer.gyro_bias_prior))
    if floor > limit:
        if bias / EARTH_RATE < limit and np.cos(answer.position.lat) < NEAR_POLE:
            return "not_observable", (
                f"at latitude {np.degrees(answer.position.lat):.3f} deg the earth turns by {horizontal / DEG_PER_HOUR:.3f} deg/h "
                f"about the horizontal; gyro biases of {significant(bias / DEG_PER_HOUR)} deg/h hide true north there",
                good_level,
            )
        return "level_only", (
            f"gyro bias can be {significant(bias / DEG_PER_HOUR)} deg/h ({answer.imu_source}); a heading within "
            f"{np.degrees(limit):g} deg at latitude {np.degrees(answer.position.lat):.1f} deg needs "
            f"{horizontal * np.tan(min(limit, 1.0)) / DEG_PER_HOUR:.2g} deg/h or better: heading is refused",
            good_level,
        )
    more = (
        "" if answer.pays_until is None else f"; about {answer.pays_until:.0f} s in all would bring it near its floor"
    )
    return "not_converged", (
        f"heading is known to {_angle(sigma)} only after {answer.duration:.0f} s, {_angle(limit)} is wanted; sensor bias "
        f"would allow {_angle(floor)}{more}: record longer",
        good_level,
    )


def _contradictions(answer: Alignment, around: Circumstances) -> list[str]:
    found = []
    if around.moves_from is not None:
        found.append(
            f"the base does not stay where it is: it moves from {around.moves_from:.1f} s on; align a part in which it "
            f"stands (--to {around.moves_from:.0f})"
        )
    check = around.check
    bias = float(np.max(answer.gyro_bias_prior))
    names = ("north", "up")
    for name, residual, noise in zip(names, check.rate_residual, check.rate_noise, strict=True):
        if abs(residual) > OUTLIER * np.hypot(bias, noise):
            found.append(
                f"the gyros' mean rate along {name} misses the earth's by {significant(residual / DEG_PER_HOUR)} deg/h, where the "
                f"specification ({answer.imu_source}) allows {significant(bias / DEG_PER_HOUR)} deg/h: check --lat, the "
                "units, and the specification"
            )
    # A scale factor error multiplies gravity: along the vertical it is a bias like any other.
    accel = float(
        np.hypot(
            np.max(answer.accel_bias_prior),
            answer.imu.accel_scale_factor * float(normal_gravity(answer.position.lat, answer.position.alt)),
        )
    )
    if abs(check.force_residual) > OUTLIER * np.hypot(accel, check.force_noise):
        found.append(
            f"the mean specific force misses gravity by {check.force_residual / MICRO_G:.0f} ug, where the specification "
            f"({answer.imu_source}) allows {significant(accel / MICRO_G)} ug: check --alt, the units, and the specification"
        )
    if around.drift is not None and around.drift.found:
        found.append(str(around.drift))
    if not around.settled:
        found.append("re-linearisation did not come to rest: the log does not look like a base that stays where it is")
    return found


def _azimuth_sigmas(answer: Alignment) -> tuple[float, float]:
    """Sigma and floor of heading, or near the vertical of the combination that stands for it."""
    if answer.near_vertical:
        return answer.azimuth[2], float(np.sqrt(answer.phi_floor[2, 2]))
    return float(answer.euler_sigma[0]), float(answer.euler_sigma_floor[0])


def _angle(x: float) -> str:
    degrees = np.degrees(x)
    return f"{degrees:.2f} deg" if degrees >= 0.5 else f"{degrees * 60:.2f} arcmin"


def _waiting(answer: Alignment) -> str:
    assert answer.pays_until is not None
    if answer.pays_until <= answer.duration:
        return f"after {answer.pays_until:.0f} s more time stopped paying: the floor was the larger part"
    return f"more time pays until about {answer.pays_until:.0f} s; the log has {answer.duration:.0f} s"
