"""The methods of the study on the runs of a case, and their errors second by second."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_filter import Matching, SlaveStart, TransferTrack, transfer_filter
from truenorth.analysis.consistency import nees
from truenorth.core.attitude import misalignment
from truenorth.errors.master import ARM, DELAY, TransferModel
from truenorth.papers.transfer.truth import (
    ARM_SIGMA,
    ATTITUDE_NOISE,
    END,
    FLEXURE,
    HEADING,
    LEVEL,
    TAU_SIGMA,
    VELOCITY_NOISE,
    Flights,
    Run,
)
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import BA, BG, PHI

Array = NDArray[np.float64]

EPOCHS = np.arange(1.0, END + 0.5)  # s
NEAR = 0.06  # s: a row of the master that near stands for the epoch
MISALIGNMENT = np.array([LEVEL, LEVEL, HEADING])
HANDED_OVER = 1e-7  # rad: what the one-shot hand-over of an attitude adds to the mounting


@dataclass(frozen=True)
class Method:
    """Which states a filter has and what it is given.

    Attributes
    ----------
    delay, lever_arm : bool
    told : bool
        It knows the true delay and lever arm.
    velocity, attitude : bool
        What is matched; with attitude there are states of the mounting.
    flexure : bool
    """

    delay: bool = False
    lever_arm: bool = False
    told: bool = False
    velocity: bool = True
    attitude: bool = False
    flexure: bool = False


VELOCITY = {
    "states12": Method(),
    "states13": Method(delay=True),
    "states16": Method(delay=True, lever_arm=True),
    "oracle": Method(told=True),
}
METHODS = {
    **VELOCITY,
    **{f"{name}_att": replace(method, attitude=True) for name, method in VELOCITY.items()},
    "attitude_only": Method(delay=True, velocity=False, attitude=True),
    "flexure": Method(delay=True, lever_arm=True, attitude=True, flexure=True),
}


@dataclass(frozen=True)
class Errors:
    """Errors of all runs at `EPOCHS`, estimated minus true, with their sigmas; NaN where the master was silent.

    Attributes
    ----------
    phi, phi_sigma : (runs, K, 3) arrays, rad
    gyro, gyro_sigma : (runs, K, 3) arrays, rad/s
    accel, accel_sigma : (runs, K, 3) arrays, m/s^2
    tau, tau_sigma : (runs, K) arrays, s
        NaN without such a state, as the lever arm's.
    arm, arm_sigma : (runs, K, 3) arrays, m
    nees : (runs, K) array
        Of phi, over 3.
    """

    phi: Array
    phi_sigma: Array
    gyro: Array
    gyro_sigma: Array
    accel: Array
    accel_sigma: Array
    tau: Array
    tau_sigma: Array
    arm: Array
    arm_sigma: Array
    nees: Array


def model_of(method: Method, spec: ImuSpec) -> TransferModel:
    """The model of a method."""
    heading, pitch, roll = FLEXURE.sigma
    return TransferModel(
        spec.gyro_random_walk,
        spec.accel_random_walk,
        delay=method.delay,
        lever_arm=method.lever_arm,
        mounting=method.attitude,
        flexure_sigma=(pitch, roll, heading) if method.flexure else (0.0, 0.0, 0.0),
        flexure_beta=FLEXURE.beta,
    )


def prior_of(method: Method, model: TransferModel, spec: ImuSpec, C_nb: Array) -> Array:
    """What a method believes at the start: the truth's sigmas, and .05 s and 1 m of delay and lever arm."""
    return model.prior(
        VELOCITY_NOISE,
        HANDED_OVER if method.attitude else C_nb_sigma(C_nb),
        spec.accel_bias,
        spec.gyro_bias,
        tau=TAU_SIGMA,
        arm=ARM_SIGMA,
        mounting=MISALIGNMENT,
        C_nb=C_nb if method.attitude else None,
    )


def C_nb_sigma(C_nb: Array) -> Array:
    """(3,) sigmas of the misalignment in n: those of the mounting, turned."""
    return np.sqrt((C_nb**2) @ MISALIGNMENT**2)


def errors_of(
    flights: Flights, methods: Sequence[str], runs: int, workers: int, known_delay: float = 0.0
) -> dict[str, Errors]:
    """Run methods on the same runs of a case.

    Parameters
    ----------
    flights : Flights
    methods : sequence of str
        Keys of `METHODS`.
    runs : int
    workers : int
        Threads, which share the runs; the numbers do not depend on it.
    known_delay : float, s
        Given to all methods.
    """

    def one(number: int) -> list[list[Array]]:
        run = flights(number)
        return [_errors(run, METHODS[name], _track(flights, run, METHODS[name], known_delay)) for name in methods]

    one(0)  # compiles, and fills what the runs share, before the threads ask for it
    with ThreadPoolExecutor(workers) as pool:
        found = list(pool.map(one, range(runs)))
    return {
        name: Errors(*(np.stack([run[i][part] for run in found]) for part in range(len(found[0][i]))))
        for i, name in enumerate(methods)
    }


def _track(flights: Flights, run: Run, method: Method, known_delay: float) -> TransferTrack:
    spec, at = flights.scenario.imu_spec, flights.start
    model = model_of(method, spec)
    start = SlaveStart(
        run.C_nb,
        run.v_n,
        float(at.lat),
        float(at.lon),
        float(at.alt),
        prior_of(method, model, spec, at.C_nb),
        arm=run.arm if method.told else np.zeros(3),
        delay=run.tau if method.told else known_delay,
    )
    matching = Matching(VELOCITY_NOISE if method.velocity else np.inf, ATTITUDE_NOISE if method.attitude else np.inf)
    return transfer_filter(run.slave, run.master, model, start, matching)


def _errors(run: Run, method: Method, track: TransferTrack) -> list[Array]:
    """The arrays of `Errors` of one run."""
    k = np.clip(np.searchsorted(track.time, EPOCHS), 1, len(track.time) - 1)
    k -= np.abs(track.time[k - 1] - EPOCHS) < np.abs(track.time[k] - EPOCHS)
    silent = np.abs(track.time[k] - EPOCHS) > NEAR
    C = run.motion.states(track.time[k]).C_nb
    phi = misalignment(track.C_nb[k], C)
    aux, sigma, P = track.aux[k], track.sigma[k], track.P[k][:, PHI, PHI]
    nothing = np.full(len(k), np.nan)
    model = model_of(method, ImuSpec())
    tau, tau_sigma, arm, arm_sigma = nothing, nothing, np.full((len(k), 3), np.nan), np.full((len(k), 3), np.nan)
    if (at := model.slice_of(DELAY)) is not None:
        tau, tau_sigma = aux[:, at.start] + track.delay - run.tau, sigma[:, at.start]
    if (at := model.slice_of(ARM)) is not None:
        arm, arm_sigma = aux[:, at] - run.arm, sigma[:, at]
    square = nees(phi, P) / 3
    arrays = [
        phi,
        sigma[:, PHI],
        aux[:, BG] - run.gyro_bias,
        sigma[:, BG],
        aux[:, BA] - run.accel_bias,
        sigma[:, BA],
        tau,
        tau_sigma,
        arm,
        arm_sigma,
        square,
    ]
    return [np.where(silent.reshape(-1, *[1] * (a.ndim - 1)), np.nan, a) for a in arrays]
