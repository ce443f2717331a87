"""`align_rotary`: attitude of the body that carries an IMU on an indexer (a rotary SINS).

The IMU's own attitude is found as that of any IMU on a base that sways: in the inertial frame its turning is motion like any
other, and it turns the biases about, so that they average out or can be estimated. The encoder ties the IMU to the body, at the
epoch of the answer and wherever the body's lever arm moves the IMU; between its rows the gyros carry its angles.

Without an encoder the angles can be read from the gyros where the body is still: it turns with the earth alone, and what the
gyros show besides that is the indexer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.alignment.accel_scale import accel_scale_evidence
from truenorth.alignment.answer import answer_of
from truenorth.alignment.assumptions import FADING, reason, refuse
from truenorth.alignment.bad_stretches import bad_stretches
from truenorth.alignment.coarse_sensors import calibrated, matrix_evidence, shown_biases
from truenorth.alignment.encoder_angles import CarriedAngles, angles_at, carried_angles, orders, reading
from truenorth.alignment.encoder_turns import base_turns
from truenorth.alignment.fine import ARM_PRIOR, CoarseStart, FineAlignment
from truenorth.alignment.gyro_matrix import gyro_matrix_evidence
from truenorth.alignment.late_encoder import NOT_LATE, coarse_delay, late_effect, late_evidence, left_of
from truenorth.alignment.late_gyro import late_gyro_evidence
from truenorth.alignment.late_gyros import late_gyros_evidence
from truenorth.alignment.procedure import HEADING_LIMIT
from truenorth.alignment.published import factor_share, faded_align, turned_arm_velocity
from truenorth.alignment.put_right import aligned_anew
from truenorth.alignment.result import Alignment
from truenorth.alignment.rivals import rival_evidence
from truenorth.alignment.signatures import what_begins
from truenorth.alignment.swaying import Mount, SwayAlignment, sway_align, swinging, usual_sway
from truenorth.alignment.task import Task, bridged, make_task, noise_in
from truenorth.alignment.turning import infer_turning
from truenorth.alignment.verdict import base_speed, claimed, grown, judged, model_evidence
from truenorth.coarse import oba
from truenorth.core.attitude import dcm_from_rotation_vector, misalignment
from truenorth.core.earth import EARTH_RATE
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.indexing import C_bs_from_angles
from truenorth.core.position import Position
from truenorth.errors.staying import StaticModel
from truenorth.quality.codes import codes_evidence
from truenorth.quality.encoder import encoder_evidence
from truenorth.quality.encoder_delay import Delay, delay_of
from truenorth.quality.encoder_errors import error_evidence
from truenorth.quality.encoder_jumps import jump_evidence
from truenorth.quality.encoder_slips import slip_of
from truenorth.quality.hum import hum_evidence
from truenorth.quality.record_evidence import record_evidence
from truenorth.records import EncoderRecord, ImuRecord
from truenorth.records.specified import corrected
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Effect, Evidence, notes
from truenorth.state.limits import limit
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

Array = NDArray[np.float64]

SHORTEST = 60.0  # s: below that sway cannot be separated from tilt
KNOWN_ARM = 0.1  # m, one sigma along each axis of an arm that was measured
OFFSET = 0.01  # m, one sigma along each of its axes: of an IMU from the axes of its indexer
INDEXER_METHODS = ("auto", "swaying", *FADING)
BLIND = 0.3  # of the earth's level rate: a gyro's bias of more may turn a coarse heading by 20 deg and more
HEADINGS = 6  # all round
AGAIN = 3  # times that a log is aligned: its encoder as stamped, less the delay that shows, and less what is left of it
OFF_AXIS = math.radians(0.5)  # of a body that is said to be still, and an indexer of two axes


def align_rotary(
    record: ImuRecord,
    encoder: EncoderRecord | None,
    position: Position,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
    *,
    axes: Sequence[str] = ("z", "x"),
    lever_arm: ArrayLike | None = None,
    angle_sigma: float = 0.0,
    offset_sigma: float = OFFSET,
    latency_sigma: float = 0.0,
    at: float | None = None,
    method: str = "auto",
    heading_limit: float = HEADING_LIMIT,
    progress: Callable[[str], None] | None = None,
) -> Alignment:
    """Find pitch, roll and true heading of a body that carries an IMU on an indexer, still or swaying.

    Parameters
    ----------
    record : ImuRecord
        Of the IMU, its own axes; at angles of zero they are the body's (RFU).
    encoder : EncoderRecord or None
        Angles of the indexer, over the whole record. None: the body is still, its axes are the IMU's at the record's beginning.
    imu : ImuSpec, str, path or mapping, optional
        Specification, a preset's name, or a YAML file; left out, it is what is usual of sensors with the noise that the log shows.
    axes : sequence of {"x", "y", "z"}
        Of the indexer, the outermost first.
    lever_arm : (3,) array, m, optional
        From the body's centre of rotation to the IMU, body axes; estimated where it is left out.
    method : str
        ``auto`` or ``swaying``; or a published filter of this base, which takes the arm as known (none where it is left out):
        ``kf``, ``sakf``, ``makf``, ``imakf``.
    angle_sigma : float, rad
        One-sigma error of the indexer itself: zero of each axis' angle, and what its axes are off by from those of the body. The
        IMU's attitude is found without them; that of the body has them in full, about each axis, however long the log is.
    offset_sigma : float, m
        One sigma, along each of its axes, of how far the IMU sits from the axes of the indexer, about which it swings in every
        slew; estimated. 0: on them.
    latency_sigma : float, s
        One sigma of what the encoder is late or early by. A delay that shows, where an axis starts, stops or turns back, is taken
        off without it; where the axes turn at one rate none shows, and the attitude of the body has this one.
    at, heading_limit, progress
        As in :func:`truenorth.align`.

    Returns
    -------
    Alignment
        Attitude of the body; biases along the IMU's axes.

    Raises
    ------
    UsageError
        An unknown method, axes that do not fit the angles, a lever arm that is not three finite numbers, a negative sigma.
    DataError
        The encoder's log does not cover the record, or a body without encoder that is not still.
    AlignmentError
        Too short a record.
    """
    tell = progress or (lambda stage: None)
    _must_make_sense(method, angle_sigma=angle_sigma, offset_sigma=offset_sigma, latency_sigma=latency_sigma)
    given = None if imu is None else noise_in(record, imu_spec(imu))
    record = bridged(corrected(record, given))
    if record.duration < SHORTEST:
        raise AlignmentError(
            f"{record.source}: {record.duration:.1f} s; a base that may sway needs {SHORTEST:g} s at least: record longer"
        )
    task = make_task(record, position, at)
    rows = np.array([task.epoch.row])
    coarse = integrate(record, task.interval, rows_at=rows)
    C_n0_i = oba(coarse, position.lat, position.alt, history=False).C_n0_i
    own = method if method in FADING else "swaying"
    tell(f"aligning: {own}")
    asked = _Asked(record, encoder, position, given, axes, lever_arm, angle_sigma, offset_sigma, latency_sigma, own)
    carried = None if encoder is None else carried_angles(encoder, record, axes)
    taken = NOT_LATE if carried is None else coarse_delay(carried)
    for _ in range(AGAIN):
        if encoder is not None and taken.size:
            carried = carried_angles(encoder, record, axes, taken.size)
        answer, evidence, late = _aligned(asked, task, coarse, C_n0_i, carried, taken)
        if late is None:
            break
        taken = late
    return judged(answer, evidence, heading_limit)


class _Asked(NamedTuple):
    """What is given."""

    record: ImuRecord
    encoder: EncoderRecord | None
    position: Position
    given: ImuSpec | None
    axes: Sequence[str]
    lever_arm: ArrayLike | None
    angle_sigma: float
    offset_sigma: float
    latency_sigma: float
    own: str


def _aligned(
    asked: _Asked, task: Task, coarse: InertialIntegrals, C_n0_i: Array, carried: CarriedAngles | None, taken: Delay
) -> tuple[Alignment, list[Evidence], Delay | None]:
    """The answer by an encoder whose delay is taken off, what is seen, and the delay to take off instead, if any."""
    record, encoder, position, given, axes, lever_arm, angle_sigma, offset_sigma, latency_sigma, own = asked
    rows, biases, late = np.array([task.epoch.row]), None, None
    if carried is None:
        mount = Mount(np.zeros(3), offset_sigma)  # along the IMU's axes
    else:
        C_sb = np.swapaxes(C_bs_from_angles(axes, angles_at(carried.record, coarse.start + coarse.time, axes)), -1, -2)
        mount = Mount(*_arm(lever_arm), C_sb, offset_sigma)
        biases = partial(shown_biases, task, C_n0_i, C_sb)
    spec = infer_turning(task, biases) if given is None else given
    model, P_bias = StaticModel.of(spec), np.diag(spec.bias_variance)
    start = calibrated(CoarseStart(record, C_n0_i, position, model, P_bias, task.interval, rows), mount, _turned(spec))
    if own in FADING:
        arm = _arm_velocity(record, encoder, axes, mount.arm, task.interval, taken.size)
        fine, unsure = faded_align(start, own, arm), 0.0
    else:
        fine, unsure = _from_headings(start, mount, spec, position.lat)
    source = "inferred from the noise of the log" if given is None else f"specification {spec.name!r}"
    answer = answer_of(task, fine, spec, source, P_bias, sways=True)

    if carried is None:
        C_sb_at = _still_body(task, fine, axes)
        how = "angles from the gyros of a still body"
    else:
        C_sb_at = C_bs_from_angles(axes, angles_at(carried.record, [task.epoch.time], axes))[0].T
        angle_sigma = math.hypot(angle_sigma, carried.sigma(task.epoch.time))
        how = f"angles of {len(axes)} axes from {carried.record.source}"
    if answer.history is not None and mount.C_sb is not None:
        answer = replace(answer, history=replace(answer.history, C_nb=answer.history.C_nb @ mount.C_sb[1:]))
    why = "the base may sway: its own motion is fitted to the log"
    if own in FADING:
        arm_is = "of length zero, as none is given" if lever_arm is None else "as given"
        why = f"{reason(own, factor_share(fine))}; the lever arm is {arm_is}"
    answer = replace(
        answer,
        C_nb=answer.C_nb @ C_sb_at,
        method=own,
        method_reason=f"the IMU turns on an indexer ({how}), {why}",
    )
    answer = grown(answer, Effect(heading=math.hypot(angle_sigma, unsure), level=angle_sigma))
    evidence = _of_encoder(start, encoder, axes, task, spec, taken.size)
    if carried is not None:
        seen, rest = _of_angles(fine, record, carried, axes, task, spec, angle_sigma)
        effect = late_effect(carried, axes, task.epoch.time, answer.C_nb)
        answer = grown(answer, effect.times(left_of(taken, rest, latency_sigma)))
        of_delay, late = late_evidence(rest, effect, claimed(answer), taken)
        evidence += seen + of_delay
    evidence += _of_filter(answer, fine, spec, task, given=given is not None)
    if isinstance(fine, SwayAlignment):
        anew = aligned_anew(fine, start, mount, _turned(spec))
        evidence += late_gyro_evidence(fine, record, anew)
        evidence += gyro_matrix_evidence(fine, record, spec, anew, evidence)
    return answer, evidence, late


def _must_make_sense(method: str, *, angle_sigma: float, offset_sigma: float, latency_sigma: float) -> None:
    if method not in INDEXER_METHODS:
        refuse(method, INDEXER_METHODS)
    if not 0.0 <= angle_sigma < math.inf:
        raise UsageError(f"angle_sigma is {angle_sigma}; expected no negative angle, rad")
    if not 0.0 <= offset_sigma < math.inf:
        raise UsageError(f"offset_sigma is {offset_sigma}; expected no negative length, m")
    if not 0.0 <= latency_sigma < math.inf:
        raise UsageError(f"latency_sigma is {latency_sigma}; expected no negative time, s")


def _from_headings(start: CoarseStart, mount: Mount, spec: ImuSpec, lat: float) -> tuple[FineAlignment, float]:
    """The likeliest fine alignment, and how far another one of a like likelihood is off in heading, rad.

    Gyros with a bias of the earth's rate show no coarse heading: turned about by the indexer they find it, but from a heading that
    is too far off a wrong one (likelihood ratio 166, 131 deg). So the fit begins at headings all round. Whether the base swings on
    lines is asked of the likeliest alone: a swing is the base's, from whatever heading it was looked for.
    """
    turned = _turned(spec)
    if math.sqrt(float(spec.bias_variance[:3].max())) < BLIND * EARTH_RATE * math.cos(lat):
        return sway_align(start, mount, turned), 0.0
    starts = [
        start._replace(C_n0_i=dcm_from_rotation_vector([0.0, 0.0, h]) @ start.C_n0_i)
        for h in np.linspace(0.0, 2.0 * math.pi, HEADINGS, endpoint=False)
    ]
    found = [usual_sway(each, mount, turned) for each in starts]
    likely = np.array([2.0 * float(fine.estimates.log_likelihood) for fine in found])
    best = int(np.argmax(likely))
    level = [fine.misalignment_at(np.eye(3), 0.0)[0] for fine in found]
    off = [abs(float(misalignment(C, level[best])[2])) for C in level]
    unsure = max(x for x, ratio in zip(off, likely[best] - likely, strict=True) if ratio < limit("rival"))
    return swinging(found[best], starts[best], mount, turned), unsure


def _of_filter(answer: Alignment, fine: FineAlignment, spec: ImuSpec, task: Task, *, given: bool) -> list[Evidence]:
    """What the innovations say; `given`: whether somebody has given the specification."""
    drift, steps, hemisphere = what_begins(fine, spec, task.position, given=given)
    evidence = model_evidence(drift, settled=fine.settled)
    evidence += base_speed(answer) + steps + bad_stretches(fine, task.record) + hemisphere
    if isinstance(fine, SwayAlignment):
        evidence += late_gyros_evidence(fine, fine.late, task.record) + accel_scale_evidence(fine, spec)
        evidence += rival_evidence(fine, task.position)
    return evidence


def _of_encoder(
    start: CoarseStart, encoder: EncoderRecord | None, axes: Sequence[str], task: Task, spec: ImuSpec, late: float
) -> list[Evidence]:
    """What the encoder's angles and the record say against each other."""
    record = start.record
    if encoder is None:
        return record_evidence(record, task.motion, imu=spec)
    gyro_bias = math.sqrt(float(spec.bias_variance[:3].max()))
    readings = {name: reading(encoder, axes, order, late) for name, order in orders(len(axes)).items()}
    found = encoder_evidence(record, given := readings.pop("given"), readings, gyro_bias)
    found += record_evidence(record, task.motion, given, imu=spec, right=start.right_record())
    found += matrix_evidence(start, spec)
    found += codes_evidence(record, task.position.lat) + hum_evidence(record, task.position.lat, spec)
    return found + notes(encoder.notes)


def _of_angles(
    fine: FineAlignment,
    record: ImuRecord,
    carried: CarriedAngles,
    axes: Sequence[str],
    task: Task,
    spec: ImuSpec,
    angle_sigma: float,
) -> tuple[list[Evidence], Delay | None]:
    """Errors of the encoder's angles, by the gyros and by how the base turns; and its delay."""
    found = jump_evidence(carried.time, carried.by_gyros, carried.turned, carried.steps)
    turns = base_turns(fine, record, carried, axes, task.position.lat, spec)
    if turns is None:
        return found, None
    slip = slip_of(turns)
    if slip is not None and not found:
        found.append(slip.evidence())
    times = 1.0
    if len(axes) == 2:
        outer, inner = np.abs(turns.angles[-1] - turns.angles[0])
        times = outer / inner if inner > 2.0 * math.pi else 1.0  # of what comes back a delay is no zero
    found += error_evidence(turns, None if slip is None else slip.turns, times, angle_sigma)
    return found, delay_of(turns, slip)


def _arm_velocity(
    record: ImuRecord, encoder: EncoderRecord | None, axes: Sequence[str], arm: Array, interval: float, late: float
) -> Array | None:
    """What a known arm makes of the velocity; None where there is none."""
    if encoder is None or not np.any(arm):
        return None
    return turned_arm_velocity(record, reading(encoder, axes, np.eye(len(axes)), late), arm, interval)


def angles_from_gyros(
    integrals: InertialIntegrals, C_n0_i: Array, lat: float, axes: Sequence[str]
) -> tuple[Array, float]:
    """Angles of an indexer of one or two axes on a still body, read from the gyros.

    Parameters
    ----------
    C_n0_i : (3, 3) array
        Attitude of the IMU at the beginning, which is the body's.
    lat : float, rad
    axes : sequence of {"x", "y", "z"}

    Returns
    -------
    angles : (K+1, A) array, rad
    off_axis : float, rad
        Largest turn that is not about these axes.
    """
    # The body stays as it is in n: C_n0_b(t) = C_n0_n(t) C_n0_i, and C_bs = C_b_n0 C_n0_i C_is.
    C_n0_b = earth_rotation(integrals.time, lat) @ C_n0_i
    C_bs = np.swapaxes(C_n0_b, 1, 2) @ C_n0_i @ integrals.C_ib
    if len(axes) == 1:
        i = "xyz".index(axes[0])
        j, k = (i + 1) % 3, (i + 2) % 3
        angles = np.unwrap(np.arctan2(C_bs[:, k, j], C_bs[:, j, j]))[:, None]
    else:
        outer, inner = ("xyz".index(axis) for axis in axes)
        # C_bs = R_outer(a) R_inner(b): the inner axis is turned by a alone, the outer one, seen from s, by b.
        third = 3 - outer - inner
        sign = 1.0 if (outer + 1) % 3 == inner else -1.0
        a = np.arctan2(sign * C_bs[:, third, inner], C_bs[:, inner, inner])
        b = np.arctan2(sign * C_bs[:, outer, third], C_bs[:, outer, outer])
        angles = np.unwrap(np.stack([a, b], axis=1), axis=0)
    again = C_bs_from_angles(axes, angles)
    cosine = (np.einsum("kij,kij->k", again, C_bs) - 1.0) / 2.0
    off = float(np.max(np.arccos(np.clip(cosine, -1.0, 1.0))))
    return angles, off


def _still_body(task: Task, fine: FineAlignment, axes: Sequence[str]) -> Array:
    """``C_sb`` at the epoch of a body that is still: back to its attitude at the record's beginning."""
    lat = task.position.lat
    C_n0_i = fine.misalignment_at(np.eye(3), 0.0)[0]
    _, off = angles_from_gyros(fine.integrals, C_n0_i, lat, axes)
    if off > OFF_AXIS:
        raise DataError(
            f"{task.record.source}: the gyros show turns of {np.degrees(off):.2f} deg that are not about the axes "
            f"{','.join(axes)}; angles can be read from the gyros where the body is still and the axes are these: give the "
            "encoder's log"
        )
    C_n0_s = fine.misalignment_at(task.epoch.attitude(fine.integrals.C_ib_at[0]), task.epoch.elapsed)[0]
    C_n0_b = earth_rotation(task.epoch.elapsed, lat) @ C_n0_i
    return np.asarray(C_n0_s.T @ C_n0_b)


def _arm(given: ArrayLike | None) -> tuple[Array, float]:
    if given is None:
        return np.zeros(3), ARM_PRIOR
    arm = np.asarray(given, dtype=np.float64)
    if arm.shape != (3,) or not np.all(np.isfinite(arm)):
        raise UsageError(f"lever arm {given!r}; expected three numbers (right, forward, up), m")
    return arm, KNOWN_ARM


def _turned(spec: ImuSpec) -> ImuSpec | None:
    """The specification, where it knows of scale factors or misalignments, which turns bring to light."""
    sigmas = (spec.gyro_scale_factor, spec.gyro_misalignment, spec.accel_scale_factor, spec.accel_misalignment)
    return spec if any(sigmas) else None
