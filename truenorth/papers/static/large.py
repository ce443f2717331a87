"""Alignment from any azimuth: nonlinear filters, the classical loop and methods that need no start, on the same logs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import align
from truenorth.coarse import oba
from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector, misalignment
from truenorth.core.position import Position
from truenorth.errors.large_azimuth import Form, attitude_error, large_azimuth_system
from truenorth.errors.stationary import StationaryModel
from truenorth.errors.walks import Walks
from truenorth.filters import (
    FilterState,
    around_circle,
    cloud_in,
    extended,
    gaussian_sum,
    particle,
    unscented,
)
from truenorth.papers.errors import level
from truenorth.papers.static.gyrocompass import gyrocompass_loop
from truenorth.papers.table import Table
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.simulation import rest, simulate
from truenorth.simulation.streams import stream
from truenorth.strapdown.inertial import InertialIntegrals, earth_rotation, integrate

Array = NDArray[np.float64]

DURATION, RATE = 300.0, 10.0  # s, Hz
INTERVAL = 5.0  # s, of the nonlinear filters
QUIET = 1e-10  # (m/s)^2: what even a still base is allowed
VELOCITY_PRIOR = 1e-3  # m/s, one sigma
CIRCLE = math.pi / math.sqrt(3.0)  # rad, one sigma of an azimuth of which nothing is known
PASSES, HYPOTHESES, PARTICLES = 5, 12, 400
START_STREAM, PARTICLE_STREAM = 304, 305
ARCMIN = math.radians(1.0) / 60.0
FOUND = math.radians(1.0)  # a heading nearer than this has found north
Answers = dict[str, tuple[Array, Array | None]]


@dataclass(frozen=True)
class Logs:
    """Logs of a still base, and attitudes to start from that are wrong by any azimuth."""

    records: list[ImuRecord]
    integrals: list[InertialIntegrals]
    C_nb: Array  # (runs, 3, 3): true attitude; the base is still
    start: Array  # (runs, 3, 3): what the INS is given at the first sample


@dataclass(frozen=True)
class Setting:
    """Where, with what, and what a filter believes to begin with."""

    position: Position
    spec: ImuSpec
    P0: Array
    seed: int

    @property
    def model(self) -> StationaryModel:
        """The error model at the place."""
        lat, alt = self.position.lat, self.position.alt
        return StationaryModel(lat, alt, Walks.of(self.spec))


def make_setting(lat: float, spec: ImuSpec, tilt_sigma: float, seed: int) -> Setting:
    """Prior of the ten states with nothing known of azimuth."""
    sigmas = [tilt_sigma] * 2 + [CIRCLE] + [VELOCITY_PRIOR] * 2 + [spec.gyro_bias] * 3 + [spec.accel_bias] * 2
    return Setting(Position(lat), spec, np.diag(np.square(sigmas)), seed)


def simulate_logs(setting: Setting, runs: int) -> Logs:
    """Headings and azimuth errors all around the circle, tilts from their prior."""
    records, C_nb, start = [], [], []
    tilt_sigma = math.sqrt(setting.P0[0, 0])
    for run in range(runs):
        draw = stream(setting.seed, 1, run, START_STREAM)
        heading, azimuth = draw.uniform(0.0, 2 * math.pi), draw.uniform(-math.pi, math.pi)
        tilt = np.array([*draw.normal(0.0, tilt_sigma, 2), 0.0])
        motion = rest(setting.position, heading)
        made = simulate(motion, imu=setting.spec, rate=RATE, duration=DURATION, seed=setting.seed, scenario=1, run=run)
        records.append(made.record)
        C_nb.append(dcm_from_euler(heading, 0.0, 0.0))
        wrong = dcm_from_rotation_vector(-tilt) @ dcm_from_rotation_vector([0.0, 0.0, -azimuth])
        start.append(wrong @ C_nb[-1])
    return Logs(records, [integrate(record, INTERVAL) for record in records], np.stack(C_nb), np.stack(start))


def align_all(logs: Logs, setting: Setting, workers: int) -> Answers:
    """Misalignment (runs, 3) at the end by each method, and sigmas of the same shape where a method claims any."""
    system = partial(large_azimuth_system, setting.model, logs.integrals, P0=setting.P0, R=QUIET)
    lat, alt = setting.position.lat, setting.position.alt
    C_ib = np.stack([one.C_ib[-1] for one in logs.integrals])

    def at_end(C_n0_i: Array) -> Array:
        C_nb = earth_rotation(DURATION, lat).T @ C_n0_i @ C_ib
        return misalignment(C_nb, logs.C_nb)

    def by_filter(run: Callable[..., FilterState], form: Form = "tilt_azimuth") -> tuple[Array, Array | None]:
        state = run(system(C_n0_i=logs.start, form=form))
        sigma = None if form == "quaternion" else np.sqrt(np.diagonal(state.P, axis1=1, axis2=2)[:, :3])
        return at_end(_corrected(logs.start, state.x, form)), sigma

    def ekf(S: object) -> FilterState:
        return extended(S, innovations=False, workers=workers).state  # type: ignore[arg-type]

    def ukf(S: object, alpha: float) -> FilterState:
        return unscented(S, alpha=alpha, beta=2.0, kappa=0.0, innovations=False, workers=workers).state  # type: ignore[arg-type]

    found: Answers = {
        "ekf": by_filter(ekf),
        # Nodes a sigma of 104 deg away go around the circle: near the mean where the states are angles.
        "ukf": by_filter(partial(ukf, alpha=0.1)),
        "ukf_rotation_vector": by_filter(partial(ukf, alpha=1.0), "rotation_vector"),
        "ukf_quaternion": by_filter(partial(ukf, alpha=1.0), "quaternion"),
    }
    C = logs.start
    for _ in range(PASSES):
        state = ekf(system(C_n0_i=C))
        C = _corrected(C, state.x)
    found["ekf_passes"] = at_end(C), np.sqrt(np.diagonal(state.P, axis1=1, axis2=2)[:, :3])

    several = gaussian_sum(
        extended,
        system(C_n0_i=logs.start),
        around_circle(np.zeros(10), setting.P0, 2, HYPOTHESES),
        innovations=False,
        workers=workers,
    )
    x, P = several.hypotheses.likeliest
    found["gaussian_sum"] = at_end(_corrected(logs.start, x)), np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, :3])

    generators = [stream(setting.seed, 1, run, PARTICLE_STREAM) for run in range(len(logs.records))]
    cloud = particle(
        system(C_n0_i=logs.start),
        generators=generators,
        particles=PARTICLES,
        nonlinear=[2],
        innovations=False,
        workers=workers,
    )
    weight, X = cloud_in(cloud.state, PARTICLES)
    x = np.einsum("rl,rls->rs", weight, X)
    x[:, 2] = np.angle(np.einsum("rl,rl->r", weight, np.exp(1j * X[..., 2])))  # an angle has no mean but this
    found["particle"] = at_end(_corrected(logs.start, x)), None

    found["oba"] = at_end(np.stack([oba(one, lat, alt, history=False).C_n0_i for one in logs.integrals])), None
    gyro, accel = (np.stack([getattr(record, name) for record in logs.records]) for name in ("gyro", "accel"))
    loop = gyrocompass_loop(gyro, accel, 1.0 / RATE, logs.start, lat, alt)
    found["gyrocompass_loop"] = misalignment(loop, logs.C_nb), None
    answers = [align(record, setting.position, setting.spec) for record in logs.records]
    sigmas = np.sqrt([np.diag(answer.phi_covariance) for answer in answers])
    found["product"] = misalignment(np.stack([answer.C_nb for answer in answers]), logs.C_nb), sigmas
    return found


def add_large(table: Table, found: Answers) -> None:
    """Errors of each method, and which runs have not found north."""
    for method, (phi, sigma) in found.items():
        common: dict[str, Any] = {"time": DURATION, "noise": "random_walk"}
        table.errors("large_180", method, "level", level(phi) / ARCMIN, "arcmin", **common)
        heading, claimed = np.abs(phi[:, 2]) / ARCMIN, None if sigma is None else sigma[:, 2] / ARCMIN
        table.errors(
            "large_180", method, "heading", heading, "arcmin", claimed, statistics=("rms", "max", "median"), **common
        )
        lost = (np.abs(phi[:, 2]) > FOUND).astype(float)
        table.errors("large_180", method, "diverged", lost, "1", statistics=("mean",), **common)


def _corrected(C_n0_i: Array, x: Array, form: Form = "tilt_azimuth") -> Array:
    return np.asarray(np.swapaxes(attitude_error(x, form), 1, 2) @ C_n0_i)
