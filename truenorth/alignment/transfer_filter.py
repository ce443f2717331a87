"""From records to the closed loop for transfer alignment and back: the master's rows as aiding, the loop's track as the slave's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.master import MASTER_ATTITUDE, MASTER_VELOCITY
from truenorth.aiding.master_acceleration import MASTER_ACCELERATION
from truenorth.aiding.master_position import MASTER_POSITION
from truenorth.aiding.matching import Translation
from truenorth.aiding.row import Row
from truenorth.aiding.source import Aiding, Role
from truenorth.alignment.transfer_bending import Bend
from truenorth.alignment.transfer_columns import OTHER_NOISE, Columns
from truenorth.alignment.transfer_nominal import Nominal
from truenorth.alignment.transfer_rows import stamped_as_the_master
from truenorth.alignment.transfer_turns import (
    HALVES,
    KNOWN,
    MEAN,
    push_of,
    rates_at,
    shaken,
    slopes_at,
    spins_at,
    spins_of,
    turns_at,
)
from truenorth.core.attitude import dcm_from_rotation_vector, quaternion_from_dcm, rotation_vector_from_dcm
from truenorth.core.earth import earth_rate_n, gravity_n, transport_rate_n
from truenorth.core.errors import DataError
from truenorth.errors.bending import BENDING
from truenorth.errors.group import Group
from truenorth.errors.master import (
    ARM,
    ATTITUDE_ERROR,
    DELAY,
    FILTER,
    FLEXURE,
    MOUNTING,
    PLACE_SIGMA,
    VELOCITY_ERROR,
    TransferModel,
)
from truenorth.estimate.memory import AS_IT_IS, OVER_GROUND
from truenorth.estimate.run import navigate_track
from truenorth.quality.stamps import with_scatter
from truenorth.records import ImuRecord, MasterRecord
from truenorth.state.layout import ACCEL_AXES, BA, BG, DP, DV, GYRO_AXES, PHI
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

LONGEST_STEP = 0.2  # s of one step of the filter; the level frame and the body turn little in it


@dataclass(frozen=True)
class Assumed:
    """What is assumed of the master, with its one-sigma; a sigma of 0: known, no state."""

    lever_arm: Array = field(default_factory=lambda: np.zeros(3))  # (3,) m: master to slave, slave axes
    lever_arm_sigma: float = 0.0  # m
    delay: float = 0.0  # s
    delay_sigma: float = 0.0  # s
    C_mb: Array = field(default_factory=lambda: np.eye(3))  # (3, 3): slave to master axes
    mounting_sigma: float = 0.0  # rad
    heading: float | None = None  # rad; of the slave at the start, where no master gives attitude; else its course


NOTHING_BETWEEN = Assumed()


@dataclass(frozen=True)
class Matching:
    """What of the master is matched, and how much it is believed."""

    sigma: float  # of the translation, m/s, m or m/s^2; white noise of each row and axis; infinite: not matched
    attitude_sigma: float = float("inf")  # rad
    translation: Translation = "velocity"  # what of it is matched
    gate: float = 0.0  # probability of rejecting a sound row; 0: none is rejected
    patience: float = 1.0  # s; rejections for so long are a jump: the state that takes it up is opened again


@dataclass(frozen=True)
class Linear:
    """Attitudes of master and slave at the master's rows, (M, 3, 3), better known than from the rows, and how late these are."""

    C_nm: Array
    C_nb: Array
    delay: float = 0.0  # s; beyond the known one
    # s: what the filter begins with of it, and the sigma of that; as the start says when left out
    begin: tuple[float, float] | None = None
    phase: float = math.inf  # s: sigma of the delay, by which the phase of a vibration at the rows is known
    columns: Columns | None = None  # of delay and arm in an open loop; those of the instant where None
    scatter: Mapping[str, float] = field(default_factory=dict)  # s: one sigma of stamps, by the name of their rows
    scattered: Mapping[str, Array] = field(default_factory=dict)  # (M, 3) what that adds to sigmas
    flatter: Array | None = None  # (M, 6) what a filter of the master's velocity makes flatter
    late: float = 0.0  # s: by which a filter makes velocities later than `delay`
    C_late: Array | None = None  # the slave's when these held; `C_nb` where None
    bend: Bend | None = None  # how its seat bends


def transfer_filter(
    slave: ImuRecord,
    master: MasterRecord,
    model: TransferModel,
    start: Start,
    matching: Matching,
    assumed: Assumed = NOTHING_BETWEEN,
    *,
    linear: Linear | None = None,
    nominal: Nominal | None = None,
) -> Track:
    """Run the loop over two records on one clock.

    Parameters
    ----------
    slave : ImuRecord
        Without gaps.
    master : MasterRecord
        Rows that fall outside the slave's record say nothing.
    start : Start
        At the beginning of the slave's record; P is of all states of the model.
    assumed : Assumed, optional
        Delay, lever arm and axes besides which the model's states stand; its sigmas are P's.
    linear : Linear, optional
        Attitudes to linearise with, such as those of an earlier pass. The filter's own corrections, and the noise of the master's
        rows (as much as 1 rad^-2 of information a row), would otherwise give a little false information on mounting and delay.
    nominal : Nominal, optional
        The motion to linearise about in an open loop; the start stays the prior. A closed loop when left out.

    Raises
    ------
    DataError
        No row of the master falls into the slave's record; a covariance that broke down.

    Returns
    -------
    Track
        The slave at each row of the master, as known then: at the time at which the row holds, on the slave's clock.
    """
    values = np.zeros(model.states)
    values[BG], values[BA] = start.gyro_bias, start.accel_bias
    P = start.P.copy()
    if linear is not None and linear.begin is not None and (tau := model.slice_of(DELAY)) is not None:
        values[tau], P[tau, tau] = linear.begin[0], linear.begin[1] ** 2
    off = None
    if nominal is not None:
        off = nominal.off(start.C_nb, values, model.slice_of(MOUNTING))
        start, values = replace(start, C_nb=nominal.C_nb), nominal.values
    # A poor IMU's attitude that translation alone shows is corrected by degrees, and velocity with it.
    by_degrees = nominal is None and ACCEL_AXES in model.groups and not np.isfinite(matching.attitude_sigma)
    track = navigate_track(
        slave,
        start,
        model.ins,
        master_aiding(master, model, assumed, matching, linear, slave),
        interval=LONGEST_STEP,
        every=0,
        invariant=OVER_GROUND if by_degrees else AS_IT_IS,
        prior=(P, values),
        open_until=None if nominal is None else nominal.until,
        off=off,
    )
    if len(track) == 0:
        raise DataError(
            f"{master.source}: no row falls into the slave's record ({slave.time[0]:.3f} s to {slave.time[-1]:.3f} s; the master "
            f"runs from {master.time[0]:.3f} s to {master.time[-1]:.3f} s): check that both logs have the same clock"
        )
    late = 0.0 if linear is None or matching.translation != "velocity" else linear.late
    return stamped_as_the_master(track, master.time - assumed.delay, late)


def master_aiding(
    master: MasterRecord,
    model: TransferModel,
    assumed: Assumed,
    matching: Matching,
    linear: Linear | None = None,
    slave: ImuRecord | None = None,
) -> list[Aiding]:
    """The master's rows as the loop takes them: its place, its translation, its attitude; what is not matched is left out."""
    count, groups, kind = len(master), model.groups, matching.translation
    stamps, found, place = master.time - assumed.delay, [], None
    late = linear.late if linear is not None and kind == "velocity" else 0.0
    patience = max(2, round(matching.patience / master.interval))
    held = stamps - (0.0 if linear is None else linear.delay)  # when they held, as far as is known
    of_sample = 0.0 if slave is None else model.gyro_random_walk**2 / slave.interval
    own: tuple[float, ...] = (OTHER_NOISE * of_sample, KNOWN)
    bend = None if linear is None or slave is None else linear.bend
    if master.lat is not None and master.lon is not None and master.alt is not None:
        place = np.column_stack([master.lat, master.lon, master.alt])
    if place is not None and kind != "position":
        sigma = np.full((count, 3), PLACE_SIGMA)
        lag, arm = _states(groups, {"lag": DELAY}), -assumed.lever_arm
        found.append(
            Aiding("master place", "position", stamps, place, sigma, arm, states=lag, retimed=True, does="place")
        )
    measured = _translation(master, kind, place, linear) if np.isfinite(matching.sigma) else None
    if measured is not None and slave is not None:
        if kind == "acceleration":
            measured[:, 3:9] = slopes_at(slave if bend is None else bend.chord(slave, assumed.lever_arm), held)
            if bend is not None:
                measured[:, 9:12], measured[:, 12:15] = bend.at(held, 1), bend.at(held, 2)
        elif kind == "velocity":
            own = (own[0], _add_turns(measured, slave, master, model, assumed, held - late, linear))
        elif (reach := _reach(assumed)) > 0.0:
            seat = slave if bend is None else bend.chord(slave)
            turns, of_turn = turns_at(seat, held, model.gyro_random_walk, matching.sigma / reach)
            measured[:, 3:6], own = np.nan if turns is None else turns, (of_turn,)
            if bend is not None:
                measured[:, 6:9] = bend.at(held)
    has_C = master.C_nb is not None and np.isfinite(matching.attitude_sigma)
    known_C = np.isfinite(master.C_nb).all(axis=(1, 2)) if has_C and master.C_nb is not None else np.zeros(count, bool)
    if measured is not None:
        row, opens, error = _ROWS[kind]
        known = np.isfinite(measured[:, :3]).all(axis=1)
        roles: dict[Role, str] = {"lag": DELAY, "lever arm": ARM}
        roles |= {"own": GYRO_AXES} if kind != "position" else {}
        roles |= {"filter": FILTER} if kind == "velocity" else {}
        roles |= {"scale": ACCEL_AXES} if kind == "acceleration" else {}
        roles |= {"flexure": BENDING} if bend is not None else {}
        at_rest = groups[ACCEL_AXES].figures if ACCEL_AXES in groups else (0.0, 0.0, 0.0)
        figures = (*(at_rest if kind == "acceleration" else own), *model.coupling)
        found.append(
            Aiding(
                row.name,
                row,
                stamps - late,
                measured,
                np.full((count, 3), matching.sigma),
                assumed.lever_arm,
                states=_states(groups, roles if error is None else {**roles, "bias": error}),
                gate=matching.gate,
                figures=figures,
                retimed=True,
                patience=patience if opens is not None else 0,
                opens=opens,
                output=np.asarray(known & ~known_C),
            )
        )
    if has_C and master.C_nb is not None:
        measured = np.full((count, 10), np.nan)
        measured[:, :4] = _quaternions(master.C_nb)
        measured[:, 4:7] = (
            0.0 if linear is None else rotation_vector_from_dcm(linear.C_nm @ np.swapaxes(master.C_nb, 1, 2))
        )
        of_turn = 0.0
        if slave is not None:
            body = slave if bend is None else bend.without(slave)  # a delay is one of what the master turns
            turns, of_turn = turns_at(body, held, model.gyro_random_walk, matching.attitude_sigma)
            if turns is None and bend is not None:
                turns = rates_at(body, held)
            measured[:, 7:] = np.nan if turns is None else turns
        roles = {"lag": DELAY, "mounting": MOUNTING, "flexure": FLEXURE, "bias": ATTITUDE_ERROR}
        found.append(
            Aiding(
                MASTER_ATTITUDE.name,
                MASTER_ATTITUDE,
                stamps,
                measured,
                np.full((count, 3), matching.attitude_sigma),
                C_mb=assumed.C_mb,
                states=_states(groups, roles),
                gate=matching.gate,
                figures=(of_turn,),
                retimed=True,
                patience=patience,
                opens=MOUNTING if MOUNTING in groups else PHI.start,
                output=np.asarray(known_C),
            )
        )
    return found if linear is None else with_scatter(found, linear.scattered)


def _reach(assumed: Assumed) -> float:
    """How long an arm may be, m, its sigma included."""
    return math.hypot(*assumed.lever_arm, math.sqrt(3.0) * assumed.lever_arm_sigma)


def _add_turns(
    measured: Array,
    slave: ImuRecord,
    master: MasterRecord,
    model: TransferModel,
    assumed: Assumed,
    held: Array,
    linear: Linear | None,
) -> float:
    """How the slave turns, into velocity rows; how they know the acceleration."""
    walk, phase = model.gyro_random_walk, math.inf if linear is None else linear.phase
    columns = None if linear is None else linear.columns
    assert master.v_n is not None
    own = bool(np.isfinite(measured[:, 3:6]).any())  # the master says its acceleration
    bend = None if linear is None else linear.bend
    rates = shaken(slave, held, walk, min(assumed.delay_sigma, phase))
    if bend is not None:
        # Of the same samples as what bends: the rule of the instant makes more of what is faster, and k would be too small.
        measured[:, 10:13], measured[:, 44:47] = bend.rates(slave, held), bend.at(held, 1)
    if columns is not None and rates is None and not own:
        measured[:, 3:6] = columns.push
        measured[:, 13:25], measured[:, 25:37] = columns.of.reshape(-1, 12), columns.common.reshape(-1, 12)
        return KNOWN
    pushed = KNOWN
    if not own:
        seat = slave if bend is None else bend.chord(slave)
        spins, pushed = spins_at(seat, held, walk, _reach(assumed), push_of(master.time, master.v_n))
        if spins is None and bend is not None and pushed == KNOWN:  # that of the instant is the slave's own
            spins, pushed = spins_of(seat, held, HALVES[0]), MEAN
        measured[:, 3:6] = np.nan if spins is None else spins
    if rates is not None:
        measured[:, 10:13] = rates.slow
        own_spin = rates.spin
        if bend is not None:
            bent = rates.alike(np.diff(bend.angles, axis=0) / np.diff(bend.knots)[:, None])
            measured[:, 44:47], own_spin = bent.slow, own_spin - (1.0 - bend.coupling) * bent.spin
        if not own and pushed == KNOWN:
            measured[:, 3:6], pushed = own_spin, MEAN
    return pushed


# Row, the first state that takes up a jump, the group of the master's own error.
_ROWS: dict[Translation, tuple[Row, int | None, str | None]] = {
    "velocity": (MASTER_VELOCITY, DV.start, VELOCITY_ERROR),
    "position": (MASTER_POSITION, DP.start, None),
    "acceleration": (MASTER_ACCELERATION, None, ATTITUDE_ERROR),
}


TRANSLATIONS = tuple(row.name for row, _, _ in _ROWS.values())


def _translation(master: MasterRecord, kind: Translation, place: Array | None, linear: Linear | None) -> Array | None:
    """(M, k) what the row of a translation is given; None where the master does not hold it."""
    if kind == "position":
        return None if place is None else np.column_stack([place, np.full((len(master), 6), np.nan)])
    if kind == "acceleration":
        if master.C_nb is None or master.f_b is None:
            return None
        force = np.einsum("kij,kj->ki", master.C_nb, master.f_b)
        return np.column_stack([force, np.full((len(master), 12), np.nan)])
    if master.v_n is None:
        return None
    measured = np.full((len(master), MASTER_VELOCITY.width), np.nan)
    measured[:, :3] = master.v_n
    measured[:, 3:6] = _acceleration(master, place)
    if linear is None:
        return measured
    if linear.late != 0.0:
        measured[:, 43] = linear.late
        then = master.time - linear.late
        measured[:, 3:6] = np.stack([np.interp(then, master.time, axis) for axis in measured[:, 3:6].T], axis=1)
    if linear.flatter is not None:
        measured[:, 37:43] = linear.flatter
    if np.isnan(measured[:, 3]).any():
        measured[:, 6:10] = _quaternions(linear.C_nb if linear.C_late is None else linear.C_late)
    return measured


def _states(groups: dict[str, Group], roles: dict[Role, str]) -> dict[Role, Group]:
    return {role: groups[name] for role, name in roles.items() if name in groups}


def _quaternions(C: Array) -> Array:
    """(M, 4), NaN where a matrix is."""
    found = np.full((len(C), 4), np.nan)
    known = np.isfinite(C).all(axis=(1, 2))
    found[known] = quaternion_from_dcm(C[known])
    return found


def _acceleration(master: MasterRecord, place: Array | None) -> Array:
    """(M, 3) the master's own, along east, north, up; NaN where it does not say its specific force."""
    nothing = np.full((len(master), 3), np.nan)
    if master.f_b is None or master.C_nb is None or master.v_n is None or place is None or not np.isfinite(place).all():
        return nothing
    lat, alt, v = place[:, 0], place[:, 2], master.v_n
    coriolis = np.cross(2 * earth_rate_n(lat) + transport_rate_n(lat, alt, v), v)
    return np.asarray(np.einsum("kij,kj->ki", master.C_nb, master.f_b) - coriolis + gravity_n(lat, alt))


def axes_along(track: Track, assumed: Assumed) -> Array:
    """(K, 3, 3) slave to master axes: the given ones, turned where there are states of the mounting."""
    mount = track.layout.slice_of(MOUNTING)
    if mount is None:
        return np.broadcast_to(assumed.C_mb, (len(track), 3, 3))
    return np.asarray(dcm_from_rotation_vector(track.sensors[:, mount]) @ assumed.C_mb)
