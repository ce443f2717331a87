"""What no log can show: faults after which the data are those of another, sound log, and why.

A fault is here only with a derivation; all others that pass in silence are defects.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np

from truenorth.alignment.check import check_means
from truenorth.alignment.fine import CoarseStart
from truenorth.alignment.result import Alignment
from truenorth.alignment.swaying import sway_align
from truenorth.alignment.task import make_task
from truenorth.coarse.inertial import oba
from truenorth.errors.staying import StaticModel, mean_velocity
from truenorth.filters.gains import through
from truenorth.records import ImuRecord
from truenorth.strapdown.inertial import integrate

LEVEL = (
    "on a level base at rest gyros show two things: the earth's rate along the vertical, and the length of its part along north. "
    "Both stay as they are"
)

ON_A_SIDE = (
    "an IMU that lies on another side has the same gravity. Without a specification, a gyro bias explains what the earth's rate "
    "contradicts, and heading is refused"
)

RATIO = "twice the logarithm of the likelihood ratio, the fault known exactly"
BY_LIKELIHOOD = (
    f"measured, trial by trial: the aiding measurements prefer the true sensors by less than 25 ({RATIO}). By Neyman and Pearson "
    "no test does better. A test that has to search sensor, axis, shape, moment and size in some hundred ways would raise more "
    "than one false alarm in a thousand sound logs"
)
BY_STAYING = (
    f"measured, trial by trial, through the filter of the answer: a base that stays prefers the sound log by less than 25 "
    f"({RATIO}). A gyro's scale does not count here: the log shows it (`alignment/gyro_matrix.py`), though a motion fitted to the "
    "spoilt log may take it up"
)
BY_MEANS = (
    "measured, trial by trial: the mean rates at rest prefer the sound log by less than 25 (twice the logarithm of the likelihood "
    "ratio, by the biases of the specification). They show the earth's rate along the vertical, and the length of its part along "
    "north. Of an axis that points about east, a scale error k turns heading by k times its angle from east. It changes the length "
    "by k times the square of that angle only"
)
BY_LATENCY = (
    f"measured, trial by trial: the master's measurements prefer gyros of one moment by less than 25 ({RATIO}). Gyros that are "
    "late by d turn heading by d times the rate while a turn lasts. Straight flight shows a master by velocity no heading, so that "
    "only one turn against another parts it from a delay of the slave, which is not known either. By attitude as well, a delay of "
    "milliseconds is less than the scatter of the master's attitudes"
)
BY_SIGN = (
    f"measured, trial by trial: the master's velocities prefer the gyro of the right sign by less than 25 ({RATIO}). In level "
    "flight gyros about level axes see the earth's rate alone, up to 15 deg/h. The wrong sign is an error of twice as much that "
    "changes with the course. Over legs of half a minute it moves a velocity by 0.2 m/s, as an unknown tilt and bias do"
)
LEAST_RATIO = 25.0
ON_THE_MOVE = ("odometer", "gnss", "transfer", "attitude", "navigate")
AXES = ("gyro axes turned", "gyro askew")  # a vehicle that turns about its vertical alone hardly shows them
# Faults that act as motion does: on the move only the aiding measurements speak of them.
LIKE_MOTION = (
    *(f"{sensor} {what}" for sensor in ("gyro", "accel") for what in ("bias step", "bias ramp", "warming up", "scale")),
    "gyros feel force",
    "specification ten times too good",
    "wrong arm",
    "slowly spoofed",
)


# A turn that lags is another heading while it lasts; straight and level flight shows a master by velocity no heading.
LATE = ("late gyros", "gyros late by a filter")
SIGNS = ("gyro sign",)
SHOWN_BY_SWAY = "gyro scale"  # by alignment.gyro_matrix, from .2 % on: what passes in silence is a defect
LIKE_HEADING = ("gyro scale", *AXES)  # that act on a base at rest as another heading does, to first order


class Unseen(NamedTuple):
    """A fault that the data of a procedure cannot show."""

    procedures: tuple[str, ...]
    fault: str
    size: str  # regular expression of the drawn sizes that it is true of
    why: str


REST = ("still", "unspecified")
UNSEEN: tuple[Unseen, ...] = (
    Unseen(REST, "gyro axes exchanged", "yxz", LEVEL),
    Unseen(REST, "gyro sign", "[xy] ", LEVEL),
    Unseen(REST, "half a turn", "", LEVEL),
    Unseen(("unspecified",), "accel axes exchanged", "(?!yxz)", ON_A_SIDE),
    Unseen(("unspecified",), "accel sign", "z ", ON_A_SIDE),
    Unseen(("rotary",), "zero of the outer angle", "", "it defines the body's axes: heading is as far off as the zero"),
)


def unseen(procedure: str, fault: str, size: str, ratio: float | None = None) -> str | None:
    """Why this fault cannot be seen, or None.

    Parameters
    ----------
    ratio : float, optional
        Twice the logarithm of the likelihood ratio by which the measurements prefer what is true over what is assumed.
    """
    measured = ratio is not None and ratio < LEAST_RATIO
    if measured and procedure in REST and fault in LIKE_HEADING:
        return f"what gyros at rest see prefers the sound log by {ratio:.1f} only"
    if procedure == "swaying" and fault == SHOWN_BY_SWAY:
        return None
    seldom = fault in LIKE_MOTION or (procedure in ON_THE_MOVE and fault in AXES)
    if measured and procedure not in REST and seldom:
        return f"the measurements prefer the true sensors by {ratio:.1f} only"
    if measured and procedure in ("transfer", "attitude") and fault in LATE:
        return f"the master's measurements prefer gyros of one moment by {ratio:.1f} only"
    if measured and procedure == "transfer" and fault in SIGNS:
        return f"the master's velocities prefer the gyro of the right sign by {ratio:.1f} only"
    known = next((u for u in UNSEEN if procedure in u.procedures and fault == u.fault and re.match(u.size, size)), None)
    return None if known is None else known.why


def misfit_at_rest(inputs: dict[str, Any], answer: Alignment) -> float:
    """Squares by which the mean rates at rest miss the earth's, in sigmas of the biases that the answer takes for given."""
    task = make_task(inputs["record"], inputs["place"], None)
    check = check_means(task.means, inputs["place"].lat, task.gravity)
    variance = float(np.max(answer.gyro_bias_prior)) ** 2 + check.rate_noise**2
    return float(np.sum(check.rate_residual**2 / variance))


def ratio_on_sway(spoilt: ImuRecord, sound: ImuRecord, answer: Alignment) -> float:
    """Twice the logarithm of the likelihood ratio by which a base that sways and stays prefers the sound log.

    Both logs go through the filter of the spoilt one: by how much less the squares of the innovations are without the fault.
    """
    task = make_task(spoilt, answer.position, None)
    lat, alt = task.position.lat, task.position.alt
    C_n0_i = oba(integrate(task.record, task.interval), lat, alt, history=False).C_n0_i
    P = task.bias_prior(answer.imu, C_n0_i.T)
    fine = sway_align(
        CoarseStart(task.record, C_n0_i, task.position, StaticModel.of(answer.imu), P, task.interval, np.empty(0, int))
    )
    made, true = (mean_velocity(integrate(log, task.interval), fine.C_n0_i, lat, alt) for log in (task.record, sound))
    seen = through(fine.gains, (made - true)[..., None])[0]
    L = np.linalg.cholesky(fine.estimates.innovation_covariance)
    fault = np.linalg.solve(L, seen)
    white = np.linalg.solve(L, fine.estimates.innovation[..., None])
    return float(np.sum(fault * (2.0 * white - fault)))
