"""The methods of the study on the runs of a case, and their errors second by second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.matching import Translation
from truenorth.alignment.transfer_filter import (
    Assumed,
    Linear,
    Matching,
    transfer_filter,
)
from truenorth.alignment.transfer_passes import delay_found
from truenorth.core.attitude import misalignment
from truenorth.errors.master import ARM, DELAY, TransferModel
from truenorth.papers.errors import AttitudeErrors
from truenorth.papers.transfer.truth import (
    ACCELERATION_NOISE,
    ARM_SIGMA,
    ATTITUDE_NOISE,
    END,
    FLEXURE,
    HEADING,
    LEVEL,
    POSITION_NOISE,
    TAU_SIGMA,
    VELOCITY_NOISE,
    Flights,
    Run,
    extrapolated,
)
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import BA, BG, PHI
from truenorth.state.state import Start
from truenorth.state.track import Track

Array = NDArray[np.float64]

EPOCHS = np.arange(1.0, END + 0.5)  # s
NOISE: dict[Translation, float] = {
    "velocity": VELOCITY_NOISE,
    "position": POSITION_NOISE,
    "acceleration": ACCELERATION_NOISE,
}
NEAR = 0.06  # s: a row of the master that near stands for the epoch
MISALIGNMENT = np.array([LEVEL, LEVEL, HEADING])
HANDED_OVER = 1e-7  # rad: what the one-shot hand-over of an attitude adds to the mounting


@dataclass(frozen=True)
class Method:
    """Which states a filter has and what it is given.

    Attributes
    ----------
    delay, lever_arm : bool
    known : bool
        It knows the true delay and lever arm.
    translation : {"velocity", "position", "acceleration"} or None
    attitude : bool
        What is matched; with attitude there are states of the mounting.
    flexure : bool
    late : {"past", "ignored", "extrapolated"}
        What is done about a known delay: rows are taken at the time at which they hold; or when they come, as they are or
        carried on.
    noise : float
        Of the master's rows as believed, over the true one.
    tau_sigma, arm_sigma : float, s and m
        In P0.
    every : int
        Of the master's rows, ten a second, one in so many is taken.
    """

    delay: bool = False
    lever_arm: bool = False
    known: bool = False
    translation: Translation | None = "velocity"
    attitude: bool = False
    flexure: bool = False
    late: Literal["past", "ignored", "extrapolated"] = "past"
    noise: float = 1.0
    tau_sigma: float = TAU_SIGMA
    arm_sigma: float = ARM_SIGMA
    every: int = 1


VELOCITY = {
    "states12": Method(),
    "states13": Method(delay=True),
    "states16": Method(delay=True, lever_arm=True),
    "oracle": Method(known=True),
}
METHODS = {
    **VELOCITY,
    **{f"{name}_att": replace(method, attitude=True) for name, method in VELOCITY.items()},
    "attitude_only": Method(delay=True, translation=None, attitude=True),
    **{
        f"{kind}_{name}": replace(method, translation=kind)
        for kind in ("position", "acceleration")
        for name, method in VELOCITY.items()
    },
    "ignored": Method(late="ignored"),
    "extrapolated": Method(late="extrapolated"),
    "past_state": Method(),
    "augmented": Method(delay=True, late="ignored", tau_sigma=5 * TAU_SIGMA),
    "flexure": Method(delay=True, lever_arm=True, attitude=True, flexure=True),
}


@dataclass(frozen=True)
class Errors(AttitudeErrors):
    """Errors of all runs (runs, K, ...) at `EPOCHS`, estimated minus true, with their sigmas; NaN where the master was silent.

    Attributes
    ----------
    gyro, gyro_sigma : (runs, K, 3) arrays, rad/s
    accel, accel_sigma : (runs, K, 3) arrays, m/s^2
    tau, tau_sigma : (runs, K) arrays, s
        NaN without such a state, as the lever arm's.
    arm, arm_sigma : (runs, K, 3) arrays, m
    gyro_bias : (runs, K, 3) array, rad/s
        The true ones.
    """

    gyro: Array
    gyro_sigma: Array
    accel: Array
    accel_sigma: Array
    tau: Array
    tau_sigma: Array
    arm: Array
    arm_sigma: Array
    gyro_bias: Array


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
        arm_considered=method.translation == "acceleration",
    )


def prior_of(method: Method, model: TransferModel, spec: ImuSpec, C_nb: Array) -> Array:
    """What a method believes at the start: the truth's sigmas, and .05 s and 1 m of delay and lever arm."""
    return model.prior(
        VELOCITY_NOISE,
        HANDED_OVER if method.attitude else C_nb_sigma(C_nb),
        spec.accel_bias,
        spec.gyro_bias,
        tau=method.tau_sigma,
        arm=method.arm_sigma,
        mounting=MISALIGNMENT,
        C_nb=C_nb if method.attitude else None,
    )


def C_nb_sigma(C_nb: Array) -> Array:
    """(3,) sigmas of the misalignment in n: those of the mounting, turned."""
    return np.sqrt((C_nb**2) @ MISALIGNMENT**2)


def errors_of(
    flights: Flights, methods: Sequence[str] | Mapping[str, Method], runs: int, workers: int
) -> dict[str, Errors]:
    """Run methods on the same runs of a case.

    Parameters
    ----------
    flights : Flights
    methods : sequence of str, or mapping
        Keys of `METHODS`, or methods by name.
    runs : int
    workers : int
        Threads, which share the runs; the numbers do not depend on it.
    """
    of = methods if isinstance(methods, Mapping) else {name: METHODS[name] for name in methods}

    def one(number: int) -> list[list[Array]]:
        run = flights(number)
        return [
            _errors(run, _track(flights, run, method), assumed_of(flights, run, method).delay) for method in of.values()
        ]

    one(0)  # compiles, and fills what the runs share, before the threads ask for it
    with ThreadPoolExecutor(workers) as pool:
        found = list(pool.map(one, range(runs)))
    return {
        name: Errors(*(np.stack([run[i][part] for run in found]) for part in range(len(found[0][i]))))
        for i, name in enumerate(of)
    }


def assumed_of(flights: Flights, run: Run, method: Method) -> Assumed:
    """Delay and lever arm that a method is given."""
    if method.known:
        return Assumed(run.arm, delay=run.tau)
    return Assumed(delay=flights.case.extra_delay if method.late == "past" else 0.0)


def _track(flights: Flights, run: Run, method: Method) -> Track:
    spec, C_nb = flights.scenario.imu_spec, flights.start.C_nb
    model = model_of(method, spec)
    start = Start.of(run.start, prior_of(method, model, spec, C_nb))
    assumed = assumed_of(flights, run, method)
    kind = method.translation or "velocity"
    sigma = np.inf if method.translation is None else method.noise * NOISE[kind]
    matching = Matching(sigma, ATTITUDE_NOISE if method.attitude else np.inf, kind)
    master = run.master if kind == "velocity" else run.felt
    if method.late == "extrapolated":
        master = extrapolated(master, flights.case.extra_delay)
    linear, master = None, master[:: method.every]
    if kind == "acceleration" and method.delay:
        found = delay_found(transfer_filter(run.slave, master, model, start, Matching(VELOCITY_NOISE), assumed))
        assert found is not None
        assert master.C_nb is not None
        linear = Linear(master.C_nb, master.C_nb, found[0], found)
    return transfer_filter(run.slave, master, model, start, matching, assumed, linear=linear)


def _errors(run: Run, track: Track, delay: float) -> list[Array]:
    """The arrays of `Errors` of one run, in the order of its fields."""
    k = np.clip(np.searchsorted(track.time, EPOCHS), 1, len(track.time) - 1)
    k -= np.abs(track.time[k - 1] - EPOCHS) < np.abs(track.time[k] - EPOCHS)
    silent = np.abs(track.time[k] - EPOCHS) > NEAR
    C = run.motion.states(track.time[k]).C_nb
    phi = misalignment(track.C_nb[k], C)
    aux, sigma = track.sensors[k], track.sigma[k]
    nothing = np.full(len(k), np.nan)
    tau, tau_sigma, arm, arm_sigma = nothing, nothing, np.full((len(k), 3), np.nan), np.full((len(k), 3), np.nan)
    if (at := track.layout.slice_of(DELAY)) is not None:
        tau, tau_sigma = aux[:, at.start] + delay - run.tau, sigma[:, at.start]
    if (at := track.layout.slice_of(ARM)) is not None:
        arm, arm_sigma = aux[:, at] - run.arm, sigma[:, at]
    arrays = [
        *vars(AttitudeErrors.of(phi, track.P[k][:, PHI, PHI])).values(),
        aux[:, BG] - run.gyro_bias,
        sigma[:, BG],
        aux[:, BA] - run.accel_bias,
        sigma[:, BA],
        tau,
        tau_sigma,
        arm,
        arm_sigma,
        np.broadcast_to(run.gyro_bias, (len(k), 3)),
    ]
    return [np.where(silent.reshape(-1, *[1] * (a.ndim - 1)), np.nan, a) for a in arrays]
