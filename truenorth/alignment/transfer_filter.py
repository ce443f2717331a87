"""From records to the closed loop of transfer alignment and back: what the compiled loop takes and what it leaves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import transfer_loop as loop
from truenorth.core.attitude import dcm_from_quaternion, quaternion_from_dcm
from truenorth.core.earth import earth_rate_n, gravity_n, transport_rate_n
from truenorth.core.errors import DataError
from truenorth.core.linalg import padded
from truenorth.filters.recursion import SOUND
from truenorth.models.transfer import TransferModel
from truenorth.records import ImuRecord, MasterRecord
from truenorth.strapdown.increments import increments, interval_lengths, read_only

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LONGEST_STEP = 0.2  # s of one step of the filter; the level frame and the body turn little in it


@dataclass(frozen=True)
class SlaveStart:
    """Where the slave is said to be at the beginning, and what is assumed.

    Attributes
    ----------
    C_nb : (3, 3) array
    v_n : (3,) array, m/s
    lat, lon, alt : float, rad, rad, m
    P : (n, n) array
        Of the states of a :class:`truenorth.models.transfer.TransferModel`.
    C_mb : (3, 3) array
        Slave to master axes.
    arm : (3,) array, m
        Master to slave, slave axes.
    delay : float, s
        Of the master.
    gyro_bias, accel_bias : (3,) arrays, rad/s and m/s^2
    """

    C_nb: Array
    v_n: Array
    lat: float
    lon: float
    alt: float
    P: Array
    C_mb: Array = field(default_factory=lambda: np.eye(3))
    arm: Array = field(default_factory=lambda: np.zeros(3))
    delay: float = 0.0
    gyro_bias: Array = field(default_factory=lambda: np.zeros(3))
    accel_bias: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Matching:
    """What of the master is matched, and how much it is believed.

    Attributes
    ----------
    velocity_sigma, attitude_sigma : float, m/s and rad
        White noise of each row and axis; infinite: not matched.
    gate : float
        Probability of rejecting a sound row; 0: none is rejected.
    patience : float, s
        Rejections for so long are a jump: the state that takes it up is opened again.
    """

    velocity_sigma: float
    attitude_sigma: float = float("inf")
    gate: float = 0.0
    patience: float = 1.0


@dataclass(frozen=True)
class Linear:
    """Attitudes of master and slave at the master's rows, (M, 3, 3), better known than the rows tell."""

    C_nm: Array
    C_nb: Array


@dataclass(frozen=True)
class TransferTrack:
    """The slave at each row of the master, as known then.

    Attributes
    ----------
    time : (K,) array, s
        End of the slave's sample that is nearest, on the slave's clock.
    delay : float, s
        The known one.
    sample : (K,) int array
        Its row in the slave's record.
    row : (K,) int array
        The master's.
    C_nb : (K, 3, 3) array
    v_n, position : (K, 3) arrays
    aux : (K, n) array
        What is assumed in the places of the states: biases, delay and lever arm beside the known ones, flexure.
    C_mb : (K, 3, 3) array
    sigma : (K, n) array
    P : (K, n, n) array, or (0, n, n) where it was not kept
    last_P : (n, n) array
    innovation, innovation_sigma : (K, 6) arrays
        Velocity (m/s) and attitude (rad); NaN where absent.
    nis : (K, 2) array
    verdict : (K, 2) int array
        `ABSENT`, `USED`, `REJECTED` or `REOPENED`, of :mod:`truenorth.alignment.transfer_loop`.
    """

    time: Array
    delay: float
    sample: Integers
    row: Integers
    C_nb: Array
    v_n: Array
    position: Array
    aux: Array
    C_mb: Array
    sigma: Array
    P: Array
    last_P: Array
    innovation: Array
    innovation_sigma: Array
    nis: Array
    verdict: Integers


def transfer_filter(
    slave: ImuRecord,
    master: MasterRecord,
    model: TransferModel,
    start: SlaveStart,
    matching: Matching,
    *,
    covariances: bool = False,
    linear: Linear | None = None,
) -> TransferTrack:
    """Run the closed loop over two records on one clock.

    Parameters
    ----------
    slave : ImuRecord
        Without gaps.
    master : MasterRecord
        Rows that fall outside the slave's record say nothing.
    model : TransferModel
    start : SlaveStart
        At the beginning of the slave's record.
    matching : Matching
    covariances : bool
        Keep ``P`` at each row.
    linear : Linear, optional
        Attitudes to linearise with, such as those of an earlier pass. The filter's own corrections, and the noise of the master's
        rows (as much as 1 rad^-2 of information a row), would otherwise tell a little of the mounting and of the delay falsely.

    Returns
    -------
    TransferTrack

    Raises
    ------
    DataError
        No row of the master falls into the slave's record; a covariance that broke down.
    """
    n, count = model.states, len(master)
    dtheta, dvel = increments(slave)
    steps = interval_lengths(slave)
    samples = loop.Samples(*(read_only(x) for x in (steps, slave.time, dtheta, dvel)))
    rows = _rows(master, start.delay, matching, linear)
    state = np.concatenate([quaternion_from_dcm(start.C_nb), start.v_n, [start.lat, start.lon, start.alt], np.zeros(9)])
    aux = np.zeros(n)
    aux[6:9], aux[9:12] = start.accel_bias, start.gyro_bias
    C_mb, P = np.array(start.C_mb, dtype=np.float64), np.array(start.P, dtype=np.float64)
    kept = loop.Kept(
        np.full(count, -1),
        np.zeros((count, 10)),
        np.zeros((count, n)),
        np.zeros((count, 3, 3)),
        np.zeros((count, n)),
        np.zeros((count if covariances else 0, n, n)),
        np.full((count, 6), np.nan),
        np.full((count, 6), np.nan),
        np.full((count, 2), np.nan),
        np.zeros((count, 2), dtype=np.int64),
    )
    failure, row = loop.run(
        padded(n),
        samples,
        rows,
        _settings(model, matching, start, slave.interval, master.interval),
        state,
        aux,
        C_mb,
        P,
        kept,
    )
    if failure != SOUND:
        raise DataError(
            f"{master.source}: row {row + 1}: the filter's covariance broke down; expected noise and prior sigmas "
            "that a double can hold beside each other"
        )
    found = (kept.sample >= 0) & (kept.verdict.max(axis=1) > loop.ABSENT)
    if not found.any():
        raise DataError(
            f"{master.source}: no row falls into the slave's record ({slave.time[0]:.3f} s to {slave.time[-1]:.3f} s; the master "
            f"runs from {master.time[0]:.3f} s to {master.time[-1]:.3f} s): check that both logs have the same clock"
        )
    return TransferTrack(
        time=slave.time[kept.sample[found]],
        delay=start.delay,
        sample=kept.sample[found],
        row=np.flatnonzero(found),
        C_nb=dcm_from_quaternion(kept.state[found, :4]),
        v_n=kept.state[found, 4:7],
        position=kept.state[found, 7:10],
        aux=kept.aux[found],
        C_mb=kept.C_mb[found],
        sigma=kept.sigma[found],
        P=kept.P[found] if covariances else kept.P,
        last_P=P,
        innovation=kept.innovation[found],
        innovation_sigma=kept.innovation_sigma[found],
        nis=kept.nis[found],
        verdict=kept.verdict[found],
    )


def _rows(master: MasterRecord, delay: float, matching: Matching, linear: Linear | None) -> loop.Master:
    """The master's rows as the loop takes them; what is not matched is NaN."""
    count = len(master)
    nothing = np.full((count, 3), np.nan)
    velocity, C_nm, place, acceleration = nothing, np.full((count, 3, 3), np.nan), nothing, nothing
    if master.v_n is not None and np.isfinite(matching.velocity_sigma):
        velocity = master.v_n
    if master.C_nb is not None and np.isfinite(matching.attitude_sigma):
        C_nm = master.C_nb
    smooth = (C_nm, np.full((count, 3, 3), np.nan)) if linear is None else (linear.C_nm, linear.C_nb)
    if master.lat is not None and master.lon is not None and master.alt is not None:
        place = np.column_stack([master.lat, master.lon, master.alt])
    if master.f_b is not None and master.C_nb is not None and np.isfinite(place).all() and master.v_n is not None:
        lat, alt, v = place[:, 0], place[:, 2], master.v_n
        coriolis = np.cross(2 * earth_rate_n(lat) + transport_rate_n(lat, alt, v), v)
        acceleration = np.einsum("kij,kj->ki", master.C_nb, master.f_b) - coriolis + gravity_n(lat, alt)
    return loop.Master(*(read_only(x) for x in (master.time - delay, velocity, place, acceleration, C_nm, *smooth)))


def _settings(
    model: TransferModel, matching: Matching, start: SlaveStart, interval: float, master_interval: float
) -> loop.Loop:
    from scipy.special import chdtri

    gate = chdtri(3.0, matching.gate) if matching.gate > 0.0 else np.inf
    return loop.Loop(
        noise=model.noise,
        places=model.places,
        flexure=np.array(model.flexure_sigma) ** 2,
        beta=model.flexure_beta,
        turn=model.turn_noise,
        velocity=np.full(3, matching.velocity_sigma**2),
        attitude=np.full(3, matching.attitude_sigma**2),
        gates=np.full(2, gate),
        arm=np.asarray(start.arm, dtype=np.float64),
        longest=max(1, round(LONGEST_STEP / interval)),
        patience=max(2, round(matching.patience / master_interval)),
    )
