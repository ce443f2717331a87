"""Likely mistakes of units and axes, seen from gravity, the earth's rate, and their agreement with each other.

A claim is made only where the data leave no other reading: gravity is 9.8 m/s^2 everywhere on earth, and its
direction in body axes turns as ``du/dt = -w x u`` whatever the mounting, so turning data show the gyros' unit
and axes; data at rest show the gyros' unit only if the gyros resolve the earth's rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE
from truenorth.core.turning import AGREES, Turning, fit_turning
from truenorth.core.units import STANDARD_GRAVITY as G
from truenorth.quality.regimes import MotionSummary
from truenorth.quality.sampling import Finding
from truenorth.quality.signals import even_rates
from truenorth.records import ImuRecord
from truenorth.records.one_pass import passed
from truenorth.state.limits import limit

Array = NDArray[np.float64]

DEG = np.pi / 180.0
UP_LIMIT = np.radians(60.0)  # tilt of z from up beyond which the axes are doubtful
ONE_DIRECTION = 0.8  # of the median specific force: the median vector's length where the base keeps its tilt
# A cheap gyro's bias imitates any rate: a unit is named only where, converted, the noise is a gyrocompass's.
GYROCOMPASS_NOISE = 0.03 * np.pi / 180.0 / 60.0  # rad/sqrt(s), norm of three axes: 0.03 deg/sqrt(h)
AXES = "xyz"


def check_plausibility(
    record: ImuRecord, motion: MotionSummary, lat: float | None = None
) -> tuple[Turning, list[Finding]]:
    """Look for mistakes of units and axes.

    Parameters
    ----------
    motion : MotionSummary
        Of the same record.
    lat : float, rad, optional
        Latitude; lets the earth's rate be checked by its vertical part too.

    Returns
    -------
    turning : Turning
    findings : list of Finding
    """
    findings: list[Finding] = []
    if _force_level(record, findings):
        _up_axis(record, findings)
    return _gyros(record, motion, lat, findings), findings


def unit_findings(record: ImuRecord, motion: MotionSummary, *, gyros: bool = True) -> list[Finding]:
    """What :func:`check_plausibility` finds of units and, where asked, of the gyros; which axis points up is left to it."""
    findings: list[Finding] = []
    _force_level(record, findings)
    if gyros:
        _gyros(record, motion, None, findings)
    return findings


def _gyros(record: ImuRecord, motion: MotionSummary, lat: float | None, findings: list[Finding]) -> Turning:
    turning = fit_turning(*even_rates(record))
    if not _gyro_against_gravity(turning, findings):
        _gyro_against_earth(record, motion, lat, findings)
    return turning


# ----------------------------------------------------------------------------------------- accelerometers


def _force_level(record: ImuRecord, findings: list[Finding]) -> bool:
    """Judge the accelerometers' unit by the size of the median specific force."""
    dt = record.interval
    unit = dt if record.kind == "increments" else 1.0
    # Where all of them are near gravity the median is.
    if all(abs(np.sqrt(extreme) / unit / G - 1.0) < limit("gravity") for extreme in passed(record).force):
        return True
    level = float(np.median(np.linalg.norm(record.accel, axis=1))) / unit
    if abs(level / G - 1.0) < limit("gravity"):
        return True
    readings = [
        (1.0 / G, "in g", "`units` with accel in g, or multiply by 9.80665"),
        (1000.0 / G, "in mg", "`units` with accel in mg, or multiply by 0.00980665"),
        (100.0, "in cm/s^2", "divide by 100"),
        (1e6 / G, "in ug", "`units` with accel in ug, or multiply by 9.80665e-6"),
        (G, "multiplied by 9.80665 twice", "remove one conversion"),
    ]
    if record.kind == "rates":
        readings.append((dt, "velocity increments of one row, not rates", "read them as increments (dvel_x ..)"))
        readings.append((dt / G, "velocity increments in g s", "read them as increments, multiplied by 9.80665"))
    else:
        readings.append((1.0 / dt, "specific force, not increments", "read them as rates (accel_x ..)"))
        readings.append((1.0 / (dt * G), "specific force in g, not increments", "read them as rates in g"))
        readings.append((dt, "multiplied by the interval twice", "remove one conversion"))
    found = f"the accelerometers show {level:.4g} m/s^2 (median of the norm); expected about 9.8"
    distance = np.abs([level / (G * factor) - 1.0 for factor, _, _ in readings])
    likely = [readings[i] for i in np.argsort(distance) if distance[i] < limit("gravity") / 2.0]
    if likely:
        looks = "; or ".join(f"the values look {what}: {remedy}" for _, what, remedy in likely)
        findings.append(Finding("error", "accel_unit", f"{found}; {looks}"))
        return False
    if level < 1e-3:
        text = f"{found}: gravity is missing; a free-falling or gravity-compensated output cannot be used"
        findings.append(Finding("error", "no_gravity", text))
    else:
        text = f"{found}: unit, range or scale factor are wrong, or the base accelerates throughout"
        findings.append(Finding("warning", "accel_level", text))
    return False


def _up_axis(record: ImuRecord, findings: list[Finding]) -> None:
    """Specific force at rest points up; with RFU axes that is +z. A log turned through many tilts has no such direction."""
    mean = np.array([np.median(a) for a in record.accel.T])
    if np.linalg.norm(mean) < ONE_DIRECTION * np.median(np.sqrt(np.einsum("ki,ki->k", record.accel, record.accel))):
        return
    up = mean / np.linalg.norm(mean)
    axis = int(np.argmax(np.abs(up)))
    if up[2] > np.cos(UP_LIMIT):
        return
    share = f"the specific force points along ({up[0]:+.2f}, {up[1]:+.2f}, {up[2]:+.2f})"
    if up[2] < -np.cos(UP_LIMIT):
        findings.append(
            Finding(
                "error",
                "axes_down",
                f"{share}: z points down; expected up (x right, y forward, z up): if the axes are forward, right, "
                "down use `axes` FRD; if the log holds gravity instead of specific force, change the "
                "accelerometers' sign; an IMU mounted upside down needs its own `axes`",
            )
        )
    elif abs(up[axis]) > np.cos(UP_LIMIT / 2.0):
        name = ("+" if up[axis] > 0 else "-") + AXES[axis]
        findings.append(
            Finding(
                "warning",
                "axes_up",
                f"{share}: {name} points up; expected +z (x right, y forward, z up): give the mounting with "
                "`axes`, unless the IMU really stands on its side",
            )
        )
    else:
        findings.append(
            Finding(
                "warning",
                "axes_tilted",
                f"{share}, {np.degrees(np.arccos(up[2])):.0f} deg from z; expected z up: give the mounting with "
                "`axes`, unless the IMU really is tilted so far",
            )
        )


# -------------------------------------------------------------------------------- gyros against gravity


def _gyro_against_gravity(turning: Turning, findings: list[Finding]) -> bool:
    """Judge unit and axes of the gyros by the turning; True where that was possible."""
    if not np.isfinite(turning.best_agreement) or turning.best_agreement < AGREES:
        return False
    unexplained = max(0.05, limit("other reading") * (1.0 - turning.best_agreement))
    # Below its axis an IMU feels the base lean the other way: the arm counts.
    if 1.0 - max(turning.agreement, turning.arm_unscaled) > unexplained:
        findings.append(
            Finding(
                "error",
                "gyro_axes",
                f"the gyros explain {100 * turning.agreement:.0f} % of how gravity turns in the accelerometers, with "
                f"their columns x y z read as {turning.best_axes} {100 * turning.best_agreement:.0f} %: {_remedy(turning)}",
            )
        )
        return True
    off = min(abs(scale - 1.0) for scale in (turning.scale, turning.arm_scale)) >= limit("scale by tilt")
    # Better than an arm alone explains it.
    far_better = 1.0 - turning.arm_unscaled > limit("other reading") * (1.0 - turning.arm_agreement)
    if turning.agreement < AGREES or not (off and far_better):
        return turning.agreement >= AGREES
    scale = turning.arm_scale
    found = f"the gyros turn {scale:.3g} times as far as gravity in the accelerometers; expected 1"
    readings = [(1.0 / DEG, "in deg/s"), (3600.0 / DEG, "in deg/h"), (1000.0, "in mrad/s")]
    for factor, unit in readings:
        if abs(scale / factor - 1.0) < 0.1:
            text = f"{found}: the values look {unit}, not rad/s; use `units`, or convert them"
            findings.append(Finding("error", "gyro_unit", text))
            return True
    severity, code = ("error", "gyro_unit") if not 0.5 < scale < 2.0 else ("warning", "gyro_scale")
    text = f"{found}: unit (increments read as rates?) or scale factor of the gyros are wrong"
    findings.append(Finding(severity, code, text))  # type: ignore[arg-type]
    return True


def _remedy(turning: Turning) -> str:
    """What mends gyros whose axes do not go with the accelerometers'."""
    holds = turning.best_axes.split()
    columns = {axis[1]: (name, axis[0]) for name, axis in zip(AXES, holds)}
    wrong = [axis for axis in AXES if columns[axis] != (axis, "+")]
    named = ", ".join(f"gyro_{axis}={columns[axis][1].replace('+', '')}<column {columns[axis][0]}>" for axis in wrong)
    if holds == ["-x", "-y", "-z"]:
        return (
            "the axes are a left-handed set: say where they point, such as axes FLD for forward, left, down; or all three gyros "
            f"have the wrong sign: columns {named}"
        )
    what = "exchanged" if any(columns[axis][0] != axis for axis in AXES) else "of the wrong sign"
    return f"gyro axes are {what} against the accelerometers': columns {named}; or check the wiring"


# ------------------------------------------------------------------------------ gyros against the earth


def _gyro_against_earth(record: ImuRecord, motion: MotionSummary, lat: float | None, findings: list[Finding]) -> None:
    """Judge the gyros' unit on a still base by the earth's rate, where they resolve it."""
    rest = motion.longest("still", "disturbed")
    if rest is None or rest.duration < 30.0:
        return
    # Bounded motion cancels in the mean: its sigma is the noise's plus the wander over the stretch.
    inside = (motion.time > rest.start) & (motion.time <= rest.stop)
    seconds = int(np.count_nonzero(inside))
    mean = motion.rate[inside].mean(axis=0) + motion.rate_bias
    size = float(np.linalg.norm(mean))
    noise = float(np.linalg.norm(motion.angle_noise)) / np.sqrt(seconds)
    sigma = np.hypot(noise, float(np.sqrt(np.mean(motion.wander[inside] ** 2))) * 4.0 / seconds)
    if size == 0.0 or sigma > limit("rate seen") * size:
        return
    found = f"at rest the gyros show {size:.4g} rad/s, that is {size / EARTH_RATE:.4g} times the earth's rate"
    dt = record.interval
    readings = [(1.0 / DEG, "in deg/s, not rad/s"), (3600.0 / DEG, "in deg/h, not rad/s")]
    if record.kind == "rates":
        readings.append((dt, "angle increments of one row, not rates"))
        readings.append((dt / DEG, "angle increments in deg"))
    else:
        readings.append((1.0 / dt, "rates, not increments"))
        readings.append((1.0 / (dt * DEG), "rates in deg/s, not increments in rad"))
    if abs(size / EARTH_RATE - 1.0) < 0.2:
        _vertical_earth_rate(record, motion, mean, sigma, inside, lat, findings)
        return
    sharp = sigma < limit("unit by the rate") * size
    for factor, what in readings:
        quiet = np.linalg.norm(motion.angle_noise) < GYROCOMPASS_NOISE * factor
        if sharp and quiet and abs(size / (EARTH_RATE * factor) - 1.0) < 0.03:
            text = f"{found}: the values may be {what}; check `units` (a bias of that size would look the same)"
            findings.append(Finding("warning", "gyro_unit", text))
            return


def _vertical_earth_rate(
    record: ImuRecord,
    motion: MotionSummary,
    mean: Array,
    sigma: float,
    inside: NDArray[np.bool_],
    lat: float | None,
    findings: list[Finding],
) -> None:
    """Compare the vertical part of the mean rate with ``w_ie sin(lat)``."""
    up, force = motion.specific_force[inside].mean(axis=0), np.linalg.norm(motion.specific_force[inside], axis=1)
    if np.linalg.norm(up) <= ONE_DIRECTION * np.median(force):
        return  # no vertical: the base turned over, or its accelerometers show nothing
    vertical = float(mean @ up / np.linalg.norm(up))
    horizontal = float(np.sqrt(max(0.0, float(mean @ mean) - vertical**2)))
    apparent = float(np.degrees(np.arctan2(vertical, horizontal)))
    uncertain = float(np.degrees(sigma / np.linalg.norm(mean)))
    text = f"the gyros resolve the earth's rate; with gravity they show the latitude {apparent:.2f} deg"
    if lat is None or abs(apparent - np.degrees(lat)) < max(5.0, 3.0 * uncertain):
        findings.append(Finding("note", "earth_rate", text))
        return
    findings.append(
        Finding(
            "warning",
            "latitude",
            f"{text} (sigma {uncertain:.2g} deg without bias); expected {np.degrees(lat):.2f} deg: check the "
            "latitude and its sign, the axes, and the gyro bias",
        )
    )
