"""`align_transfer`: a slave IMU aligned against the solution of a master INS on the same vehicle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.aids import VEHICLE_ARM
from truenorth.aiding.matching import FIRST_NOISE, Matched, What, first_noise, matched
from truenorth.alignment.procedure import HEADING_LIMIT
from truenorth.alignment.result import Alignment
from truenorth.alignment.task import bridged, noise_in
from truenorth.alignment.transfer_answer import LastPass, assemble_transfer
from truenorth.alignment.transfer_axes import same_axes, slave_axes
from truenorth.alignment.transfer_bends import bending_evidence
from truenorth.alignment.transfer_drifts import delay_evidence, drifting_rivals
from truenorth.alignment.transfer_filter import TRANSLATIONS, Assumed, Matching, transfer_filter
from truenorth.alignment.transfer_passes import Found, found_in_passes
from truenorth.alignment.transfer_shaken import shaken_evidence
from truenorth.alignment.transfer_start import common_clock, hand_over, model_for, parted_clocks
from truenorth.alignment.transfer_together import as_said_together
from truenorth.core.attitude import dcm_from_euler
from truenorth.core.errors import AlignmentError, DataError, UsageError
from truenorth.core.position import Position
from truenorth.errors.master import DELAY, MasterErrors, TransferModel, own_errors
from truenorth.errors.master import master_errors as errors_of
from truenorth.estimate.poorer import BIASES, SLOW, poorer_rivals, poorer_tracks
from truenorth.estimate.rivals import Rival, likelihood_ratio, noise_evidence, wandering_evidence
from truenorth.estimate.sensor_delay import gyro_delay_evidence
from truenorth.estimate.spiked import spike_evidence
from truenorth.estimate.warming import warming_rivals
from truenorth.quality.gnss import master_evidence
from truenorth.quality.record_evidence import moving_evidence
from truenorth.quality.rounding import with_rounding
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.calibration import Calibration
from truenorth.records.flexure import FlexureSpec
from truenorth.records.specified import corrected
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.state.evidence import Evidence
from truenorth.state.limits import limit
from truenorth.state.mounting import Mounting
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

LEVER_ARM_SIGMA, DELAY_SIGMA, MOUNTING_SIGMA = 1.0, 0.05, math.radians(3.0)  # m, of an arm that is given; s, rad
# Of an IMU of whose place on the master's vehicle nothing is said.
ON_MASTER = Mounting(lever_arm_sigma=VEHICLE_ARM, angle_sigma=MOUNTING_SIGMA, latency_sigma=DELAY_SIGMA)
SHORTEST = 5.0  # s
USUAL, POORER = "industrial", "consumer"  # presets of a slave of which nothing is said
RIVAL_DELAY = 0.2  # s, one sigma of a master's delay where gyros may be late


def align_transfer(
    slave: ImuRecord,
    master: MasterRecord,
    imu: ImuSpec | str | PathLike[str] | dict[str, Any] | None = None,
    *,
    matching: What = "auto",
    lever_arm: Sequence[float] | None = None,
    lever_arm_sigma: float | None = None,
    delay: float = 0.0,
    delay_sigma: float = DELAY_SIGMA,
    mounting: Sequence[float] = (0.0, 0.0, 0.0),
    mounting_sigma: float = MOUNTING_SIGMA,
    flexure: FlexureSpec | None = None,
    master_errors: MasterErrors | str | None = None,
    velocity_noise: float | None = None,
    attitude_noise: float | None = None,
    position_noise: float | None = None,
    acceleration_noise: float | None = None,
    position: Position | None = None,
    heading: float | None = None,
    calibration: Calibration | None = None,
    heading_limit: float = HEADING_LIMIT,
    progress: Callable[[str], None] | None = None,
) -> Alignment:
    """Find attitude and biases of a slave IMU from a master INS on the same vehicle, with delay, lever arm and mounting.

    The known delay and lever arm are compensated first; what is left of them is estimated (see
    :mod:`truenorth.errors.master`). A master on another clock, or late by more than was said, is recognised by its motion.

    Parameters
    ----------
    slave : ImuRecord
        Body axes RFU.
    master : MasterRecord
        At any rate and times, rows may be missing; attitude or velocity or both, position where there is one.
    imu : ImuSpec, str, path or mapping, optional
        Specification of the slave. Left out, the preset "industrial", or "consumer" where biases are larger than that allows.
    matching : {"auto", "velocity", "attitude", "both", "position", "acceleration", "position+attitude", "acceleration+attitude"}
        What of the master is matched; velocity and attitude, as far as it gives them, when left out. Position is slower than
        velocity and bears a constant error of the master's velocity (the sigma of velocity is against the master then);
        acceleration needs its specific force and attitude.
    lever_arm : three floats, optional, m
        From the master to the slave, slave axes (right, forward, up); zero when left out.
    lever_arm_sigma : float, optional, m
        0: known, and not estimated. Left out, 1 m of an arm that is given, 5 m of one of which nothing is said: of more than 1 m
        only where the log shows it.
    delay, delay_sigma : float, s
        By which the master's stamps are late, and what that is uncertain by; 0: known.
    mounting : three floats, rad
        Heading, pitch and roll of the slave's axes seen from the master's.
    mounting_sigma : float, rad
        About each axis; 0: known.
    flexure : FlexureSpec, optional
        The slave's seat bends: second-order Gauss-Markov states, with attitude matching.
    master_errors : MasterErrors or {"navigation", "tactical"}, optional
        The master's own slow errors: sigma then is absolute, and `relative_sigma` that against the master. Left out, they are
        what its record says of them; where it says nothing, or with "none", the master is taken for the truth.
    velocity_noise, attitude_noise, position_noise, acceleration_noise : float, optional, m/s, rad, m and m/s^2
        White noise of the master's rows; fitted to the innovations when left out.
    position : Position, optional
        Where the master gives none.
    heading : float, rad, optional
        Of the slave at the start, where the master gives no attitude; its course when left out.
    calibration, heading_limit, progress
        As of :func:`truenorth.align`; the calibration is the slave's.

    Returns
    -------
    Alignment
        With `transfer`: delay, lever arm, mounting, each with sigma, and what the motion could not separate.

    Raises
    ------
    UsageError
        A matching that the master does not allow, a negative sigma, neither place nor heading.
    DataError
        Gaps in the slave's log; logs that have no time in common and whose motion does not bring them together.
    """
    tell = progress or (lambda stage: None)
    what = matched(matching, master)
    arm, lever_arm_sigma = _arm(lever_arm, lever_arm_sigma)
    angles = _three(mounting, "mounting", "radians: heading, pitch, roll of the slave seen from the master")
    _check_sigmas(lever_arm_sigma, delay, delay_sigma, mounting_sigma, heading_limit)
    if flexure is not None and master.C_nb is None:
        raise UsageError("flexure is seen by the master's attitude, which its log does not hold; leave it out")
    spec = imu_spec(USUAL if imu is None else imu)
    where = f"specification {spec.name}"
    record = slave
    slave = bridged(corrected(slave, spec, calibration))

    tell("comparing the clocks")
    C_mb = np.asarray(dcm_from_euler(*angles))
    if what.translation is None:
        lever_arm_sigma = 0.0  # attitude does not see it
    said = Assumed(arm, lever_arm_sigma, delay, delay_sigma, C_mb, mounting_sigma, heading)
    # Most arms of which nothing is said are a metre or two: by a wider one no delay would stand out of what the arm explains.
    usual = replace(said, lever_arm_sigma=min(lever_arm_sigma, LEVER_ARM_SIGMA))
    clock, notes = common_clock(slave, master, usual)
    said = replace(clock, lever_arm_sigma=lever_arm_sigma)
    errors = _errors(master, master_errors)
    given = {"velocity": velocity_noise, "position": position_noise, "acceleration": acceleration_noise}
    noise = first_noise(what, {**given, "attitude": attitude_noise})

    def by(said: Assumed, spec: ImuSpec, where: str) -> Alignment:
        seen = noise_in(record, with_rounding(spec, record)).with_coning_of(record)
        return _aligned(
            slave, master, seen, where, said, notes, what, flexure, errors, noise, position, heading_limit, tell
        )

    def of(spec: ImuSpec, where: str) -> Alignment:
        # Most arms of which nothing is said are a metre or two. Of a wide one the noise of a poor slave would part it from a delay.
        unsaid = said.lever_arm_sigma == VEHICLE_ARM
        answer = by(replace(said, lever_arm_sigma=LEVER_ARM_SIGMA) if unsaid else said, spec, where)
        if unsaid and any(item.key == "transfer.lever_arm" for item in answer.evidence):
            answer = by(said, spec, where)
        return answer

    answer = of(spec, where) if imu is not None else _of_usual_grade(of)
    return answer if position is None or master.lat is not None else _known_as_well_as(position, answer)


def _of_usual_grade(of: Callable[[ImuSpec, str], Alignment]) -> Alignment:
    """Of a slave of which nothing is said: the usual preset, or a poorer one that biases show; a master that jumps shows none."""
    answer = of(imu_spec(USUAL), f"preset {USUAL}, since none was given")
    beyond = any(item.key in ("bias.gyro", "bias.accel") for item in answer.evidence)
    if answer.status == "inconsistent" and beyond:
        with suppress(AlignmentError, DataError):  # it does not fit at all: what was found stays
            poorer = of(imu_spec(POORER), f"preset {POORER}, since none was given and the log speaks against {USUAL}")
            answer = answer if poorer.status == "inconsistent" else poorer
    return answer


def _aligned(
    slave: ImuRecord,
    master: MasterRecord,
    spec: ImuSpec,
    where: str,
    said: Assumed,
    notes: Sequence[str],
    what: Matched,
    flexure: FlexureSpec | None,
    errors: MasterErrors,
    first: tuple[tuple[float, float], list[bool]],
    position: Position | None,
    heading_limit: float,
    tell: Callable[[str], None],
) -> Alignment:
    """The alignment with what is said of clocks, arm and seat, by a specification and where that comes from."""
    axes = slave_axes(slave, master, spec, said, what)

    def through_passes(
        flexure: FlexureSpec | None,
    ) -> tuple[TransferModel, ImuRecord, Start, Found, Callable[..., Track]]:
        """Model, slave and start, what the passes found, and the filter about it, of a seat that bends so."""
        model = model_for(spec, said, what, flexure, errors, axes)
        handed = partial(hand_over, slave, master, model, spec, said, position=position, errors=errors)
        found = found_in_passes(slave, master, model, handed, said, *first, what.kind, tell)
        tell("aligning")
        part, start = handed(found.noise)
        _check_length(part, slave.source)
        along = partial(transfer_filter, assumed=said, linear=found.linear, nominal=found.nominal)
        run = partial(along, master=master, matching=Matching(*found.noise, what.kind, limit("master's gate")))
        return model, part, start, found, run

    def of_a_seat_that_bends(flexure: FlexureSpec) -> Track:
        model, part, start, _, run = through_passes(flexure)
        return run(part, model=model, start=start)

    model, part, start, found, run = through_passes(flexure)
    noise = found.noise
    track = run(part, model=model, start=start)

    def of_another_imu(other: ImuSpec) -> Track:
        """The same measurements of a slave by another specification, with the master's errors estimated."""
        axes = same_axes(other, said, model.groups)
        own = replace(model_for(other, said, what, flexure, errors, axes), considered=False)
        _, begun = hand_over(slave, master, own, other, said, noise, position=position, errors=errors)
        return run(part, model=own, start=begun)

    def of_another_master(drift: float) -> Track:
        """The same of a master whose heading drifts by so much, rad; its errors are estimated."""
        of = replace(errors, heading_drift=drift)
        own = replace(model_for(spec, said, what, flexure, of, model.axes), considered=False)
        _, begun = hand_over(slave, master, own, spec, said, noise, position=position, errors=of)
        return run(part, model=own, start=begun, nominal=found.nominal.with_states(own.states))

    seen = _seen(slave, master, errors, said)
    # A clock that steps leaves what the slave turns, too.
    if flexure is None and all(item.key != "transfer.clocks_part" for item in seen):
        seen = bending_evidence(part, master, track, model, said, of_a_seat_that_bends) + seen
    seen += _rivals(part, run, track, model, start, spec, said, of_another_imu, of_another_master)
    seen += shaken_evidence(run, track, part, master, model, start, said, found.linear, what)
    track = as_said_together(track, model, said, what.attitude)
    least = FIRST_NOISE[what.kind] if first[1][0] else noise[0]
    last = LastPass(part, master, model, said, start, what, noise, track, errors, least, found.left)
    return assemble_transfer(last, spec, where, (*notes, *master.notes), heading_limit, seen)


def _check_length(part: ImuRecord, source: str) -> None:
    """Enough in common with the master.

    Raises
    ------
    DataError
        Too little.
    """
    if part.duration < SHORTEST:
        raise DataError(
            f"{source}: {part.duration:.1f} s in common with the master; at least {SHORTEST:g} s are needed: check "
            "`mounting.latency` and the clocks"
        )


def _errors(master: MasterRecord, given: MasterErrors | str | None) -> MasterErrors:
    """The master's own slow errors: as given, or as its record says."""
    own = own_errors(master.attitude_sigma, master.velocity_sigma) if given is None else None
    return own or errors_of(given)


def _rivals(
    part: ImuRecord,
    run: Callable[..., Track],
    track: Track,
    model: TransferModel,
    start: Start,
    spec: ImuSpec,
    said: Assumed,
    of_another_imu: Callable[[ImuSpec], Track],
    of_another_master: Callable[[float], Track],
) -> list[Evidence]:
    """What else would explain the log; `run` with a slave, a model and a start, or the same of another IMU.

    A likelihood is that of innovations which are white. Those of a filter that considers the master's errors are not: the errors
    are in all of them alike. A rival that follows the master more closely has them in none, and is likelier however sound the
    slave is. So all are compared with these errors estimated.
    """

    def other(model: TransferModel) -> Track:
        return run(part, model=model, start=start)

    if model.master != MasterErrors():
        model = replace(model, considered=False)
        track = other(model)

    def of_another_course() -> list[Rival]:
        poorer = poorer_rivals(track, poorer_tracks(of_another_imu, track, spec, SLOW | BIASES))
        drifting = drifting_rivals(of_another_master, track, model)
        return warming_rivals(partial(run, model=model, start=start), track, part, spec) + poorer + drifting

    found = noise_evidence(other, track, model, part)
    found += wandering_evidence(other, track, model, spec, part.duration, warming=of_another_course)
    found += spike_evidence(partial(run, model=model, start=start), track, part)
    wide = _any_delay(start, model)

    def of_translation(track: Track) -> Track:
        """Attitudes alone do not part late gyros from an early master: what velocity or place say counts."""
        return replace(track, residuals=tuple(r for r in track.residuals if r.name in TRANSLATIONS))

    def shifted(record: ImuRecord) -> Track:
        return of_translation(run(record, model=model, start=wide))

    loose = run(part, model=model, start=wide)
    found += delay_evidence(track, loose, said, found)
    first, free = of_translation(track), of_translation(loose)
    # What a delay that is less known explains is no delay of the gyros.
    first = free if likelihood_ratio(first.residuals, free.residuals) > 0.0 else first
    return found + gyro_delay_evidence(shifted, first, part)


def _any_delay(start: Start, model: TransferModel) -> Start:
    """The start with a delay that is hardly known: gyros that are late were taken for a master that is early."""
    at = model.slice_of(DELAY)
    if at is None:
        return start
    P = start.P.copy()
    P[at, at] = max(float(P[at, at][0, 0]), RIVAL_DELAY**2)
    return replace(start, P=P)


def _known_as_well_as(position: Position, answer: Alignment) -> Alignment:
    """The answer with the uncertainty of a place that the caller gave."""
    sigmas = {"horizontal_sigma": position.horizontal_sigma, "vertical_sigma": position.vertical_sigma}
    return replace(answer, position=replace(answer.position, **sigmas))


def _seen(slave: ImuRecord, master: MasterRecord, errors: MasterErrors, said: Assumed) -> list[Evidence]:
    """What clocks, positions and samples show; the master's errors are all it has, also those that no row that is matched bears."""
    parted = parted_clocks(slave, master, said.C_mb, said.delay)
    slow = math.hypot(errors.velocity, errors.velocity_drift)
    return [
        *([] if parted is None else [parted]),
        *master_evidence(master, slow),
        *moving_evidence(slave),
    ]


def _check_sigmas(
    lever_arm_sigma: float, delay: float, delay_sigma: float, mounting_sigma: float, heading_limit: float
) -> None:
    for name, value, shown in (
        ("lever_arm_sigma", lever_arm_sigma, f"{lever_arm_sigma:g} m"),
        ("delay_sigma", delay_sigma, f"{delay_sigma:g} s"),
        ("mounting_sigma", mounting_sigma, f"{math.degrees(mounting_sigma):g} deg"),
    ):
        if not 0.0 <= value < math.inf:
            raise UsageError(f"{name} is {shown}; expected zero (known) or a positive one-sigma")
    if not math.isfinite(delay):
        raise UsageError(f"delay is {delay}; expected seconds")
    if not heading_limit > 0.0:
        raise UsageError(f"heading limit {np.degrees(heading_limit):g} deg; expected a positive angle")


def _arm(given: Sequence[float] | None, sigma: float | None) -> tuple[Array, float]:
    """The arm and what it is uncertain by: of one that is given as a tape measures, else as on any vehicle."""
    if sigma is None:
        sigma = VEHICLE_ARM if given is None else LEVER_ARM_SIGMA
    meaning = "metres: right, forward, up of the slave, from the master"
    return _three((0.0, 0.0, 0.0) if given is None else given, "lever_arm", meaning), sigma


def _three(values: Sequence[float], name: str, meaning: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise UsageError(f"{name} is {values!r}; expected three finite numbers, {meaning}")
    return array
