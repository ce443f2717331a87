"""From the closed loop of transfer alignment to an `Alignment`: history, verdict, and what the motion could not separate."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import Matched
from truenorth.alignment.moving import handed_on
from truenorth.alignment.result import Alignment, History
from truenorth.alignment.transfer_filter import Assumed, axes_along
from truenorth.alignment.transfer_nominal import final_attitudes
from truenorth.alignment.transfer_result import Relation, Transfer
from truenorth.alignment.transfer_rows import MasterRows, by_rows
from truenorth.alignment.transfer_start import bias_sigmas, misalignment_covariance, sigma_of_mounting
from truenorth.alignment.transfer_system import seen_states, system_along
from truenorth.alignment.transfer_verdict import judge_transfer
from truenorth.analysis.observability import observability
from truenorth.core.attitude import (
    dcm_from_rotation_vector,
    euler_from_dcm,
    euler_sigma,
    rotation_vector_from_dcm,
)
from truenorth.core.position import Position
from truenorth.errors.axes import proper_bias, standing
from truenorth.errors.bending import BENDING
from truenorth.errors.master import ARM, ATTITUDE_ERROR, DELAY, MOUNTING, VELOCITY_ERROR, MasterErrors, TransferModel
from truenorth.estimate.memory import REJECTED, REOPENED, USED
from truenorth.records import ImuRecord, MasterRecord
from truenorth.records.motion import MotionStates
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence
from truenorth.state.layout import BA, BG, DP, DV, PHI
from truenorth.state.limits import limit
from truenorth.state.state import Start
from truenorth.state.track import Track
from truenorth.strapdown.increments import increments

Array = NDArray[np.float64]

MOST_EPOCHS = 400  # of the linear system that says what is separated
MOST_ROWS = 5000  # of the history
LONG_SILENCE = 3.0  # nominal intervals, and a second: shorter drop-outs are not worth a word
LEAST_GYRO, LEAST_ACCEL = 1e-9, 1e-6  # rad/s, m/s^2: smaller priors of biases leave nothing open
UNITS = {None: "rad", "velocity": "m/s", "position": "m", "acceleration": "m/s^2"}

WORDS = {
    "dv_E": "velocity error east",
    "dv_N": "velocity error north",
    "dv_U": "velocity error up",
    "dp_E": "position error east",
    "dp_N": "position error north",
    "dp_U": "position error up",
    "phi_E": "tilt about east",
    "phi_N": "tilt about north",
    "phi_U": "heading error",
    **{f"master_dv_{axis}": f"master's velocity error {side}" for axis, side in zip("ENU", ("east", "north", "up"))},
    **{
        f"master_phi_{axis}": f"master's attitude error about {side}"
        for axis, side in zip("ENU", ("east", "north", "up"))
    },
    "tau": "delay",
    "r_right": "lever arm right",
    "r_forward": "lever arm forward",
    "r_up": "lever arm up",
    **{f"nabla_{axis}": f"accelerometer bias {axis}" for axis in "xyz"},
    **{f"eps_{axis}": f"gyro bias {axis}" for axis in "xyz"},
    **{f"mu_{axis}": f"mounting about {axis}" for axis in "xyz"},
    **{f"theta_{axis}": f"flexure about {axis}" for axis in "xyz"},
    **{f"theta'_{axis}": f"rate of flexure about {axis}" for axis in "xyz"},
}


class LastPass(NamedTuple):
    """The pass over two records that the answer comes from, and what it was given."""

    slave: ImuRecord  # the part that the master covers
    master: MasterRecord
    model: TransferModel
    assumed: Assumed
    start: Start
    what: Matched
    noise: tuple[float, float]  # of translation and attitude of the master's rows
    track: Track
    errors: MasterErrors = (
        MasterErrors()
    )  # of the master, all that is said; the model has those that its rows bear as states
    least: float = 0.0  # noise of its translation, as given, or what the fit begins with
    left: float = 0.0  # sigmas that the last pass that sought the motion has still moved it by

    @property
    def carried(self) -> float:
        """Error of the master's velocity that its positions bear, and the slave's velocity with them, m/s."""
        return math.hypot(self.errors.velocity, self.errors.velocity_drift) if self.what.kind == "position" else 0.0

    @property
    def considered(self) -> bool:
        """Whether what the master's errors do to the rows that are matched is in sigma.

        Of positions that is how fast their error changes: a constant error of a velocity goes into the slave's velocity, its drift
        counts as noise of the accelerometers (`accel_random_walk`); an attitude's error does not act on them.
        """
        borne = any(self.model.slice_of(own) is not None for own in (ATTITUDE_ERROR, VELOCITY_ERROR))
        return borne or self.carried > 0.0


def assemble_transfer(
    last: LastPass,
    spec: ImuSpec,
    where: str,
    notes: tuple[str, ...],
    heading_limit: float,
    of_master: list[Evidence],
) -> Alignment:
    """The answer at the last row of the master, judged; `of_master` is what was found of the master before, its clock included."""
    slave, master, model, assumed, _, what, _, track, *_ = last
    P, said = track.P[-1], by_rows(track)
    phi_covariance, floor = misalignment_covariance(P)
    gyro_prior, accel_prior = bias_sigmas(spec)
    lat, lon, alt = (float(x) for x in track.position[-1])
    transfer = _transfer(last, said, notes)
    sigma = track.sigma[-1]
    force = standing(assumed.C_mb)
    accel_bias, accel_sigma = proper_bias(track[-1:], force, spec.acting_variance(force))
    answer = Alignment(
        status="not_converged",
        evidence=(),
        method=f"transfer, {what} matching",
        method_reason=f"{model.states} states, closed loop over {transfer.used} rows of {master.source}",
        time=float(track.time[-1]),
        C_nb=track.C_nb[-1],
        phi_covariance=phi_covariance,
        phi_floor=floor,
        gyro_bias=track.sensors[-1, BG],
        gyro_bias_sigma=sigma[BG],
        gyro_bias_prior=gyro_prior,
        accel_bias=accel_bias[0],
        accel_bias_sigma=accel_sigma[0],
        accel_bias_prior=accel_prior,
        position=Position(lat, lon, alt),
        imu=spec,
        imu_source=where,
        duration=slave.duration,
        disturbance=np.full(3, np.nan),
        history=_history(slave, track, said, what, spec.acting_variance(force), force),
        source=slave.source,
        transfer=transfer,
    )
    return judge_transfer(answer, transfer, track, assumed, heading_limit, of_master, last.least, last.left)


def _transfer(last: LastPass, said: MasterRows, notes: tuple[str, ...]) -> Transfer:
    _, master, model, assumed, _, what, noise, track, errors, *_ = last
    sigma, aux, C_mb = track.sigma[-1], track.sensors[-1], axes_along(track, assumed)[-1]
    tau, arm, mount, coupling = (model.slice_of(which) for which in (DELAY, ARM, MOUNTING, BENDING))
    silent = master.gaps[master.steps[master.gaps] > max(1.0, LONG_SILENCE * master.interval)]
    silences = tuple(
        f"the master is silent for {master.steps[k]:.1f} s after {master.time[k - 1]:.1f} s" for k in silent[:3]
    )
    verdict = said.verdict[:, np.array([what.translation is not None, what.attitude])]
    fitted = dict.fromkeys(("velocity", "position", "acceleration"), math.nan)
    fitted[what.kind] = noise[0] if np.isfinite(noise[0]) else math.nan
    P, known = handed_on(track)
    return Transfer(
        matching=what.name,
        delay=assumed.delay + (0.0 if tau is None else float(aux[tau][0])),
        delay_sigma=0.0 if tau is None else float(sigma[tau][0]),
        delay_prior=assumed.delay_sigma,
        lever_arm=assumed.lever_arm + (0.0 if arm is None else aux[arm]),
        lever_arm_sigma=np.zeros(3) if arm is None else sigma[arm],
        lever_arm_prior=np.full(3, assumed.lever_arm_sigma),
        mounting=_signed(np.array(euler_from_dcm(C_mb))),
        mounting_sigma=sigma_of_mounting(track.P[-1], mount, C_mb),
        mounting_prior=np.full(3, 0.0 if mount is None else assumed.mounting_sigma),
        velocity_noise=fitted["velocity"],
        attitude_noise=noise[1] if np.isfinite(noise[1]) else math.nan,
        used=int(np.sum(np.any((verdict == USED) | (verdict == REOPENED), axis=1))),
        rejected=int(np.sum(np.any(verdict == REJECTED, axis=1))),
        v_n=track.v_n[-1],
        P=_placed(P, Position(0.0), last.carried),
        relative_sigma=_relative(track, model, errors),
        considered=last.considered,
        jumps=_jumps(track, said, what),
        open=_open(last),
        notes=(*notes, *silences),
        position_noise=fitted["position"],
        acceleration_noise=fitted["acceleration"],
        residuals=track.residuals,
        course=_course(model, assumed, track),
        coupling=None if coupling is None else np.asarray(model.coupling) + aux[coupling],
        coupling_sigma=None if coupling is None else sigma[coupling],
        known=known,
        force=standing(assumed.C_mb),
        acting_bias=track.sensors[-1, BA],
    )


def _course(model: TransferModel, assumed: Assumed, track: Track) -> Relation:
    """Delay, lever arm and mounting row by row."""
    k = np.arange(0, len(track.time), max(1, -(-len(track.time) // MOST_ROWS)))
    aux, sigma, C_mb = track.sensors[k], track.sigma[k], axes_along(track, assumed)[k]
    tau, arm, mount = (model.slice_of(which) for which in (DELAY, ARM, MOUNTING))
    none, nothing = np.zeros(len(k)), np.zeros((len(k), 3))
    return Relation(
        track.time[k],
        assumed.delay + (none if tau is None else aux[:, tau][:, 0]),
        none if tau is None else sigma[:, tau][:, 0],
        assumed.lever_arm + (nothing if arm is None else aux[:, arm]),
        nothing if arm is None else sigma[:, arm],
        _signed(np.stack(euler_from_dcm(C_mb), axis=1)),
        np.array([sigma_of_mounting(P, mount, C) for P, C in zip(track.P[k], C_mb, strict=True)]),
    )


def _relative(track: Track, model: TransferModel, errors: MasterErrors) -> Array:
    """(3,) sigmas of heading, pitch and roll against the master's own solution: ``phi - m``.

    Where the master's attitude is not matched, its error is none of the slave's, and is added to it.
    """
    P, at = track.P[-1], model.slice_of(ATTITUDE_ERROR)
    J = np.zeros((3, model.states))
    J[:, PHI] = np.eye(3)
    if at is not None:
        J[:, at] = -np.eye(3)
    apart = np.zeros(3) if at is not None else errors.attitude
    return euler_sigma(track.C_nb[-1], J @ P @ J.T + np.diag(apart**2))


def _placed(P: Array, place: Position, carried: float) -> Array:
    """(15 + m, 15 + m) covariance as navigation takes it, the place as uncertain as `place` says by default."""
    result = P.copy()
    result[DV, DV] += carried**2 * np.eye(3)
    result[DP, :], result[:, DP] = 0.0, 0.0
    result[DP, DP] = np.diag(np.square([place.horizontal_sigma, place.horizontal_sigma, place.vertical_sigma]))
    return result


def _signed(angles: Array) -> Array:
    return np.asarray((angles + np.pi) % (2 * np.pi) - np.pi)


def _jumps(track: Track, said: MasterRows, matched: Matched) -> tuple[str, ...]:
    unit = "m" if matched.kind == "position" else "m/s"  # an acceleration is not taken up
    found = []
    for k, kind in np.argwhere(said.verdict == REOPENED):
        size = float(np.linalg.norm(said.innovation[k, 3 * kind : 3 * kind + 3]))
        what = (
            f"{matched.kind} jumped by {size:.2g} {unit}"
            if kind == 0
            else f"attitude jumped by {math.degrees(size):.2g} deg"
        )
        found.append(f"the master's {what} shortly before {track.time[k]:.1f} s and stays so: taken up from there")
    return tuple(found)


def _open(last: LastPass) -> tuple[str, ...]:
    """What the motion as it was could not separate, from the model along the track."""
    slave, _, model, assumed, start, what, noise, track, *_ = last
    every = max(1, len(track.time) // MOST_EPOCHS)
    k = np.arange(0, len(track.time), every)
    if len(k) < 3:
        return ()
    whole = model.names
    model = replace(model, master=MasterErrors(), axes=(), filter=(0.0, 0.0, 0.0), coupling_sigma=0.0)
    middle, at, T = _states(slave, track, k)
    speed = float(np.max(np.linalg.norm(track.v_n, axis=1)))
    P0 = model.prior(
        1.0,
        max(assumed.mounting_sigma, math.radians(1.0)),
        np.maximum(np.sqrt(np.diag(start.P)[BA]), LEAST_ACCEL),
        np.maximum(np.sqrt(np.diag(start.P)[BG]), LEAST_GYRO),
        tau=assumed.delay_sigma,
        # As long as the way driven in the delay's sigma, so that neither is favoured in the words.
        arm=max(assumed.lever_arm_sigma, speed * assumed.delay_sigma),
        mounting=assumed.mounting_sigma,
    )
    R = np.repeat([s**2 / every if np.isfinite(s) else np.inf for s in noise], 3)
    system = system_along(middle, at, T, model, P0, R, assumed.lever_arm, assumed.C_mb, what.kind)
    seen = seen_states(model, what.kind)
    names = [WORDS[model.names[i]] for i in seen]
    said = observability(system, names, [model.units[i] for i in seen])
    quiet = set()  # what nothing is expected of
    if what.translation in (None, "acceleration"):
        quiet |= {WORDS[f"dv_{axis}"] for axis in "ENU"}
    if what.translation is None:
        quiet |= {WORDS[f"nabla_{axis}"] for axis in "xyz"}
    unseen = [group.states[0] for group in said.hardly if len(group.states) == 1 and group.states[0] not in quiet]
    words = [str(group) for group in said.hardly if len(group.states) > 1 and not quiet.issuperset(group.states)]
    if unseen:
        words.append(f"not seen at all: {', '.join(unseen)}")
    own = [whole.index(model.names[i]) for i in seen]
    return (*words, *_tied(names, track.P[-1][np.ix_(own, own)], quiet | set(unseen)))


def _tied(names: list[str], P: Array, quiet: set[str]) -> tuple[str, ...]:
    """States whose errors go together in the end: each is worse known than the group would be with one of them given."""
    sigma = np.sqrt(np.diag(P))
    size = np.where(sigma > 0.0, sigma, 1.0)
    tied = (np.abs(P / np.outer(size, size)) > limit("tied")) | np.eye(len(names), dtype=bool)
    left, found = set(range(len(names))), []
    while left:
        group, grown = {min(left)}, set[int]()
        while group != grown:
            grown, group = group, {int(j) for i in group for j in np.flatnonzero(tied[i])}
        left -= group
        said = [names[i] for i in sorted(group) if names[i] not in quiet]
        if len(said) > 1:
            listed = f"{', '.join(said[:-1])} and {said[-1]}"
            found.append(f"{listed} are known together far better than each alone (correlation above {limit('tied')})")
    return tuple(found)


def _states(slave: ImuRecord, track: Track, k: NDArray[np.intp]) -> tuple[MotionStates, MotionStates, Array]:
    """The slave's motion as estimated: means over the intervals between the rows k, and at their ends."""
    dtheta, dvel = increments(slave)
    turned = np.vstack([np.zeros(3), np.cumsum(dtheta, axis=0)])
    moved = np.vstack([np.zeros(3), np.cumsum(dvel, axis=0)])
    row = np.searchsorted(slave.time, track.time[k] - 0.5 * slave.interval) + 1
    keep = np.concatenate([[True], np.diff(row) > 0])
    k, row = k[keep], row[keep]
    T = np.diff(slave.time[row - 1])
    gyro, accel = track.sensors[k[1:], BG], track.sensors[k[1:], BA]
    w = np.diff(turned[row], axis=0) / T[:, None] - gyro
    f = np.diff(moved[row], axis=0) / T[:, None] - accel
    half = rotation_vector_from_dcm(np.swapaxes(track.C_nb[k[:-1]], 1, 2) @ track.C_nb[k[1:]]) / 2
    middle = track.C_nb[k[:-1]] @ dcm_from_rotation_vector(half)
    v = 0.5 * (track.v_n[k[1:]] + track.v_n[k[:-1]])

    def states(C: Array, v: Array, at: NDArray[np.intp], w: Array, f: Array) -> MotionStates:
        place = track.position[at]
        return MotionStates(track.time[at], C, v, place[:, 0], place[:, 1], place[:, 2], w, f, np.zeros_like(w))

    # Rate and force at an end: as over the interval before; a row of a tenth of a second does not show the difference.
    return states(middle, v, k[1:], w, f), states(track.C_nb[k[1:]], track.v_n[k[1:]], k[1:], w, f), T


def _history(slave: ImuRecord, track: Track, said: MasterRows, what: Matched, acting: Array, force: Array) -> History:
    columns = slice(3, 6) if what.translation is None else slice(0, 3)
    present = np.flatnonzero(np.isfinite(said.innovation[:, columns]).all(axis=1))
    k = present[:: max(1, -(-len(present) // MOST_ROWS))]
    covariance, floor = misalignment_covariance(track.P[k])
    final = final_attitudes(slave, track)[k]
    accel_bias, accel_sigma = proper_bias(track[k], force, acting)
    return History(
        time=track.time[k],
        C_nb=track.C_nb[k],
        phi_covariance=covariance,
        phi_floor=floor,
        departure=-rotation_vector_from_dcm(track.C_nb[k] @ np.swapaxes(final, 1, 2)),
        gyro_bias=track.sensors[k, BG],
        gyro_bias_sigma=track.sigma[k, BG],
        accel_bias=accel_bias,
        accel_bias_sigma=accel_sigma,
        innovation=said.innovation[k, columns],
        innovation_sigma=said.sigma[k, columns],
        nis=said.nis[k, 1 if what.translation is None else 0],
        innovation_of=f"{what.translation or 'attitude'} of the master",
        innovation_unit=UNITS[what.translation],
    )
