"""From an alignment to the start of navigation: its attitude, biases and covariance, and how they are correlated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.unsaid import as_usual
from truenorth.coarse.analytic import static_jacobian
from truenorth.core.earth import DEFLECTION, normal_gravity
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.json_file import read_object
from truenorth.core.paths import as_path
from truenorth.core.position import Position
from truenorth.errors.axes import axis_sigma, standing
from truenorth.navigation.handover import Handover
from truenorth.quality.swing import VELOCITIES
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.layout import ACCEL_AXES, BA, BG, GYRO_AXES, PHI, STATES
from truenorth.state.mounting import Clock, Drift, Mounting
from truenorth.state.prior import WholeBiases, positive, prior_covariance
from truenorth.state.state import Start, State

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.alignment.moving import Moving
    from truenorth.alignment.transfer_result import Transfer

Array = NDArray[np.float64]

LEAST_VELOCITY_SIGMA = 1e-3  # m/s
SUMMARY = "summary.json"


def start_of(start: Any, imu: ImuSpec | str | None) -> tuple[Start, ImuSpec, str]:
    """Where navigation begins, the specification, and where that comes from; arguments as for :func:`truenorth.navigate`."""
    spec = None if imu is None else as_usual(imu_spec(imu))
    if isinstance(start, Start):
        if spec is None:
            raise UsageError(
                "a start without a specification of the IMU; expected imu='navigation', a file or an ImuSpec"
            )
        return start, spec, spec.name
    if isinstance(start, (str, PathLike)):
        begin, own, _ = read_start(start)
        where = own.name
    elif not hasattr(start, "imu_source"):
        raise UsageError(
            f"start is a {type(start).__name__}; expected an Alignment, a Start or the folder of an alignment"
        )
    else:
        own, where = start.imu, start.imu_source
        begin = start_from_alignment(start)
    return begin, spec or own, where if spec is None else spec.name


def start_from_alignment(alignment: Alignment) -> Start:
    """Where and how an alignment says the vehicle stands, at rest but for the base's own motion.

    Raises
    ------
    AlignmentError
        The alignment has no heading that may be used.
    """
    if not alignment.heading_known:
        raise AlignmentError(
            f"{alignment.source}: the alignment is {alignment.status!r}, its heading may not be used; navigation needs one: "
            "align longer, with a better IMU, or from motion"
        )
    moving = alignment.moving or alignment.transfer
    if moving is not None:
        start = moving_start(
            alignment.time,
            alignment.C_nb,
            moving.v_n,
            moving.P,
            alignment.gyro_bias,
            _acting(alignment, moving),
            alignment.position,
            alignment.imu,
            moving.known,
            moving.force,
        )
        if alignment.moving is None:
            return replace(start, within=True)
        return _with_sensors(start, alignment.moving.summary())
    joint, averaged = alignment.handover, alignment.duration
    if joint is None:
        averaged = 0.0  # its biases and their sigmas are those of the epoch
        joint = _by_static_limits(
            alignment.C_nb,
            alignment.phi_covariance,
            alignment.phi_floor,
            alignment.gyro_bias_sigma,
            alignment.accel_bias,
            alignment.accel_bias_sigma,
            alignment.position,
            alignment.imu,
        )
    return _start(
        alignment.time,
        alignment.gyro_bias,
        joint,
        alignment.position,
        alignment.imu,
        alignment.disturbance,
        averaged,
    )


def _acting(alignment: Alignment, moving: Moving | Transfer) -> Array:
    """What acts as the accelerometers' bias: navigation goes on with it."""
    return alignment.accel_bias if moving.acting_bias is None else moving.acting_bias


def _start(
    time: float,
    gyro_bias: Array,
    joint: Handover,
    position: Position,
    spec: ImuSpec,
    disturbance: Array,
    averaged: float,
) -> Start:
    motion = np.where(np.isfinite(disturbance), disturbance, 0.0)
    P = prior_covariance(dv=np.hypot(motion, LEAST_VELOCITY_SIGMA), dp=position.sigma)
    joined = [*range(STATES)[PHI], *range(STATES)[BG], *range(STATES)[BA]]
    P[np.ix_(joined, joined)] = joint.P
    slow = spec.bias_variance - spec.constant_variance
    whole = WholeBiases(np.maximum(joint.prior - slow, 0.0), averaged)
    lat, lon, alt = position.lat, position.lon, position.alt
    return Start(
        time, joint.C_nb, np.zeros(3), lat, lon, alt, gyro_bias, joint.accel_bias, positive(P), whole, plumb=DEFLECTION
    )


def _by_static_limits(
    C_nb: Array,
    phi_covariance: Array,
    phi_floor: Array,
    gyro_bias_sigma: Array,
    accel_bias: Array,
    accel_bias_sigma: Array,
    position: Position,
    spec: ImuSpec,
) -> Handover:
    """Of an alignment that has no joint covariance: one that took no biases, or turned.

    Tilt and accelerometer bias of an alignment at rest cancel each other, and so do heading and east gyro bias: without
    their correlation navigation would seem far worse than it is. The biases' part of the misalignment's covariance (its
    floor) is given by the static limits; where the alignment got below them (a turning IMU), the correlation is less.

    Where heading is given, and has no floor of its own, a tilt turns the forward axis about the vertical: by its part along
    that axis times the tangent of pitch. That goes with the accelerometers' biases as the tilt does. Else a filter that stands,
    and weighs a tilt against its bias, seems to see its heading: phones that set off with a pitch of 3 deg were up to 15 sigmas
    off.
    """
    g = float(normal_gravity(position.lat, position.alt))
    eps = np.diag(gyro_bias_sigma**2)
    # What acts as an accelerometer bias as long as the vehicle stays level: also scale factor, misalignment, deflection.
    acting = spec.acting_variance(g * C_nb[2])
    nabla = np.diag(accel_bias_sigma**2 + acting)
    prior = spec.bias_variance + np.concatenate([np.zeros(3), acting])
    nabla += C_nb.T @ np.diag([1.0, 1.0, 0.0]) @ C_nb * (DEFLECTION * g) ** 2
    J = static_jacobian(position.lat, g)
    X = np.hstack([J[:, 3:] @ C_nb @ eps, J[:, :3] @ C_nb @ nabla])
    said = np.diag(J[:, 3:] @ C_nb @ eps @ C_nb.T @ J[:, 3:].T + J[:, :3] @ C_nb @ nabla @ C_nb.T @ J[:, :3].T)
    X *= np.sqrt(np.minimum(1.0, np.diag(phi_floor) / np.maximum(said, 1e-30)))[:, None]
    if phi_floor[2, 2] == 0.0:
        X[2] = np.linalg.solve(phi_covariance[:2, :2], phi_covariance[:2, 2]) @ X[:2]
    P = np.block([[phi_covariance, X], [X.T, np.block([[eps, np.zeros((3, 3))], [np.zeros((3, 3)), nabla]])]])
    return Handover(C_nb, accel_bias, P, prior)


def moving_start(
    time: float,
    C_nb: Array,
    v_n: Array,
    P: Array,
    gyro_bias: Array,
    accel_bias: Array,
    position: Position,
    spec: ImuSpec,
    known: Mapping[str, Array],
    force: Array,
) -> Start:
    """Of an alignment on the move, which knows velocity and how all errors are correlated."""
    constant = spec.constant_variance
    constant[3:] += spec.acting_variance(force)  # scale factors and misalignments under gravity are a part of the bias
    whole = WholeBiases(constant)
    state = State(time, C_nb, v_n, position.lat, position.lon, position.alt, gyro_bias, accel_bias)
    return replace(Start.of(state, positive(np.asarray(P))), whole=whole, known=known, force=force)


def force_at_rest(start: Start) -> Array:
    """(3,) m/s^2, body axes; on what differs from it the accelerometers' axes act: as the IMU stands, or as they were estimated."""
    return start.force if ACCEL_AXES in start.known else standing(start.C_nb)


def acting_at_rest(start: Start, spec: ImuSpec) -> tuple[Array, Array]:
    """That force, and the variance of what it makes of scale factors and misalignments by a specification, (m/s^2)^2."""
    force = force_at_rest(start)
    return force, spec.acting_variance(force)


def of_poorer(start: Start, spec: ImuSpec, other: ImuSpec) -> Start:
    """The start as another IMU would leave it: attitude, biases and axes known as many times worse, correlated as they are."""
    biases = _times(spec.bias_variance, other.bias_variance) ** 0.5
    of_axes = dict(zip((GYRO_AXES, ACCEL_AXES), map(_times, axis_sigma(spec), axis_sigma(other)), strict=True))
    attitude = np.full(3, biases.max())
    times = np.concatenate(
        [attitude, np.ones(6), biases, *(of_axes.get(name, np.ones(len(x))) for name, x in start.known.items())]
    )
    whole = None if start.whole is None else replace(start.whole, constant=biases**2 * start.whole.constant)
    return replace(start, P=times[:, None] * start.P * times, whole=whole)


def _times(known: Array, other: Array) -> Array:
    """By how many times the other is larger; what is nothing stays so."""
    return np.where(known > 0.0, other / np.where(known > 0.0, known, 1.0), 1.0)


def _with_sensors(start: Start, summary: Mapping[str, Any]) -> Start:
    """The start with what an alignment on the move has found of its sensors: how the odometer sits, how late both are."""
    own = _found_delay(summary, VELOCITIES)
    return replace(
        start,
        wheel=_found_wheel(summary),
        gnss_delay=_found_delay(summary, "GNSS"),
        gnss_velocity_delay=None if own is None else Clock(*own),
        gnss_drift=_found_drift(summary, start.time),
    )


def _found_drift(summary: Mapping[str, Any], time: float) -> Drift | None:
    """How an alignment on the move, at a time, has found the receiver's clock to run; None: as quartz clocks do."""
    rates = summary.get("delays_grow_ppm", {}).values()
    best = min(((1e-6 * float(rate), 1e-6 * float(sigma)) for rate, sigma in rates), key=lambda r: r[1], default=None)
    return None if best is None else Drift(*best, time)


def _found_delay(summary: Mapping[str, Any], sensor: str) -> tuple[float, float] | None:
    """By how much an alignment on the move has found a sensor's stamps late, and one sigma; None: it has not."""
    delay = summary.get("delays_s", {}).get(sensor)
    return None if delay is None else (float(delay[0]), float(delay[1]))


def _found_wheel(summary: Mapping[str, Any]) -> Mounting | None:
    """How an alignment on the move says the odometer sits and counts; None: it had none.

    The scale's prior holds all of the error found, not only what is left of it: an odometer is taken as it counts. What the
    alignment knows of heading and the mounting's yaw together is left out.
    """
    if "odometer_scale" not in summary:
        return None
    late, sigma = _found_delay(summary, "odometer") or (0.0, 0.0)
    return Mounting(
        lever_arm=np.array(summary["wheel_arm_m"], dtype=np.float64),
        lever_arm_sigma=float(max(summary["wheel_arm_sigma_m"])),
        C_mb=np.array(summary["mounting_C_mb"], dtype=np.float64),
        angle_sigma=math.radians(max(summary["mounting_sigma_deg"])),
        scale_sigma=math.hypot(summary["odometer_scale"], summary["odometer_scale_sigma"]),
        latency=late,
        latency_sigma=sigma,
    )


def read_start(folder: str | PathLike[str]) -> tuple[Start, ImuSpec, str]:
    """The start, the IMU's specification and the log's name that an alignment's folder holds.

    Raises
    ------
    DataError
        No summary.json in it, one of something else, or one that lacks what navigation needs.
    AlignmentError
        The alignment has no heading that may be used.
    """
    path = as_path(folder, "start")
    path = path / SUMMARY if path.is_dir() else path
    try:
        s = read_object(path)
    except DataError as error:
        raise DataError(f"{error}; expected the folder of a saved alignment") from None
    if missing := [name for name in ALIGNED if name not in s]:
        raise DataError(
            f"{path}: this is no alignment of ours, it has no {missing[0]}; expected the folder of a saved alignment: write the "
            "alignment again"
        )
    if s.get("heading_deg") is None:
        raise AlignmentError(
            f"{path}: the alignment is {s.get('status')!r}, it holds no heading that may be used; navigation needs one: align "
            "longer, with a better IMU, or from motion"
        )
    try:
        n = s["navigation"]
        numbers = {key: np.array(n[key], dtype=np.float64) for key in ARRAYS}
        position = Position.from_degrees(
            s["lat_deg"],
            s["lon_deg"],
            s["alt_m"],
            horizontal_sigma=n["horizontal_sigma_m"],
            vertical_sigma=n["vertical_sigma_m"],
        )
        spec = imu_spec(n["imu"])
        disturbance = np.array([math.nan if v is None else v for v in s["disturbance_m_s"]])
        if "P" in n:
            v_n, P = _finite(n["v_n"]), _finite(n["P"])
            biases = numbers["gyro_bias"], numbers["accel_bias"]
            known = {str(name): _finite(values) for name, values in n.get("known", {}).items()}
            force = _finite(n.get("force", standing()))
            begin = float(s["time_s"]), numbers["C_nb"], v_n, P, *biases, position, spec, known, force
            within = s["method"].startswith("transfer")
            start = replace(_with_sensors(moving_start(*begin), s), within=within)
        else:
            gyro_bias, averaged = numbers.pop("gyro_bias"), 0.0
            if "handover" in n:
                averaged = float(s["duration_s"])
                joint = Handover(**{key: _finite(n["handover"][key]) for key in JOINT})
            else:
                joint = _by_static_limits(**numbers, position=position, spec=spec)
            start = _start(float(s["time_s"]), gyro_bias, joint, position, spec, disturbance, averaged)
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise DataError(
            f"{path}: {error!r} is missing or not as expected; write the alignment again with this version of Truenorth"
        ) from None
    return start, spec, str(s.get("source", ""))


def _finite(numbers: Any) -> Array:
    found = np.array(numbers, dtype=np.float64)
    if not np.isfinite(found).all():
        raise ValueError("a number that is not finite")
    return found


ALIGNED = ("status", "method", "heading_deg", "pitch_deg")  # in the summary of any alignment of ours
ARRAYS = (
    "C_nb",
    "phi_covariance",
    "phi_floor",
    "gyro_bias",
    "gyro_bias_sigma",
    "accel_bias",
    "accel_bias_sigma",
)
JOINT = ("C_nb", "accel_bias", "P", "prior")


def navigation_block(alignment: Alignment) -> dict[str, Any]:
    """What navigation needs of an alignment beyond its summary, SI, ready for JSON."""
    block: dict[str, Any] = {name: getattr(alignment, name).tolist() for name in ARRAYS}
    block["horizontal_sigma_m"] = alignment.position.horizontal_sigma
    block["vertical_sigma_m"] = alignment.position.vertical_sigma
    block["imu"] = alignment.imu.to_mapping()
    if alignment.handover is not None:
        block["handover"] = {name: getattr(alignment.handover, name).tolist() for name in JOINT}
    moving = alignment.moving or alignment.transfer
    if moving is not None:
        block |= {"v_n": moving.v_n.tolist(), "P": moving.P.tolist(), "force": moving.force.tolist()}
        block["accel_bias"] = _acting(alignment, moving).tolist()
        block["known"] = {name: values.tolist() for name, values in moving.known.items()}
    return block
