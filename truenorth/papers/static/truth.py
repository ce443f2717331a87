"""What the two filters measure: error dynamics of an INS on a base that is still, sways, vibrates or is turned.

The truth is integrated at the paper's period of .02 s by the exact exponential; the filters get what an INS gives at their own
rate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_euler
from truenorth.errors.stationary import BA, BG, DV, PHI, StationaryModel
from truenorth.simulation.streams import stream

Array = NDArray[np.float64]

PERIOD = 0.02  # s, the paper's
EVERY = 5  # periods between two measurements of the honest cases: 10 Hz
BLOCK = 1000  # measurements whose noise is drawn at once
DRIVEN = slice(PHI.start, DV.stop)  # by white noise
STUDY_STREAMS = {"initial": 300, "gyro": 301, "accel": 302, "base": 303}
ARCMIN = math.radians(1.0) / 60.0


@dataclass(frozen=True)
class Base:
    """How the base moves."""

    name: str
    sway: float = 0.0  # m/s; RMS velocity of a sway of 4 to 8 s period, along E and N
    vibration: float = 0.0  # m/s; RMS velocity of a vibration that is new at every sample
    # sequence of float, rad; positions about the vertical that share the time equally; turned at once
    headings: Sequence[float] = (0.0,)


@dataclass(frozen=True)
class Truth:
    """Measurements of a block of runs, and what they are measurements of."""

    time: Array  # (K,) s
    velocity: Array  # (runs, K, 2) m/s: what the ten-state filter sees
    # (runs, K, 2) m/s^2: mean level acceleration over each interval, of a platform that is not fed by velocity: what the
    # eight-state filter sees
    force: Array
    phi: Array  # (runs, K, 3) rad: of the INS; `phi_platform` of the platform
    phi_platform: Array
    bias: Array  # (runs, 5): gyro (x, y, z) and accelerometer (x, y) biases
    C_nb: Array  # (K, 3, 3): attitude of the body during the interval that ends at each time


def simulate(
    model: StationaryModel,
    base: Base,
    *,
    duration: float,
    runs: int,
    seed: int,
    phi_sigma: Array,
    gyro_bias: float | Array,
    accel_bias: float | Array,
    every: int = EVERY,
    given: bool = False,
) -> Truth:
    """Simulate runs; initial misalignment and biases are drawn from their sigmas, or are what is `given` for all runs.

    Parameters
    ----------
    model : StationaryModel
        Its random walks are the true ones.
    base : Base
    duration : float, s
    runs, seed : int
    phi_sigma : (3,) array, rad
    gyro_bias, accel_bias : float or array of each axis, rad/s and m/s^2
    every : int
        Periods of .02 s between measurements.
    """
    steps = round(duration / PERIOD)
    count, T = steps // every, PERIOD * every
    draw = {name: [stream(seed, 0, run, number) for run in range(runs)] for name, number in STUDY_STREAMS.items()}
    initial = np.ones((runs, 8)) if given else np.stack([rng.standard_normal(8) for rng in draw["initial"]])
    x = np.zeros((runs, 10))
    x[:, PHI] = initial[:, :3] * phi_sigma
    x[:, BG], x[:, BA] = initial[:, 3:6] * gyro_bias, initial[:, 6:] * accel_bias
    bias = x[:, BG.start :].copy()

    turns = attitudes(base)
    which = np.minimum(np.arange(steps) * len(turns) // steps, len(turns) - 1)
    # From one measurement to the next, of the INS and of the platform: what becomes of the state, and of the noise between.
    moves, adds = (np.stack(parts) for parts in zip(*(_from_to(model, C, every) for C in turns), strict=True))
    among = which[every - 1 :: every][:count]
    states = np.empty((2, runs, count, 10))
    walk = np.sqrt(PERIOD) * np.array([model.walks.gyro_random_walk] * 3 + [model.walks.accel_random_walk] * 2)
    now = np.stack([x, x])
    for first in range(0, count, BLOCK):  # noise in blocks: the same whatever the number of runs
        block = slice(first, min(first + BLOCK, count))
        number = (block.stop - first) * every
        noise = np.concatenate(
            [
                np.stack([rng.standard_normal((number, n)) for rng in draw[name]])
                for name, n in (("gyro", 3), ("accel", 2))
            ],
            axis=2,
        )
        kicks = (walk * noise).reshape(runs, -1, every * len(walk))
        for turn in range(len(turns)):
            here = first + np.flatnonzero(among[block] == turn)
            states[:, :, here] = np.einsum("rkn,snx->srkx", kicks[:, here - first], adds[turn], optimize=True)
        for k in range(block.start, block.stop):
            now = now @ moves[among[k]] + states[:, :, k]
            states[:, :, k] = now
    (velocity, integrated), (phi, phi_platform) = states[..., DV], states[..., PHI]
    force = np.diff(integrated, axis=1, prepend=np.broadcast_to(x[:, None, DV], (runs, 1, 2))) / T
    time: Array = T * np.arange(1.0, count + 1.0)
    moved = np.stack([_base_velocity(base, np.concatenate([[0.0], time]), rng) for rng in draw["base"]])
    velocity += moved[:, 1:]
    force += np.diff(moved, axis=1) / T
    C = np.stack(turns)[which[every - 1 :: every][:count]]
    return Truth(time, velocity, force, phi, phi_platform, bias, C)


def attitudes(base: Base) -> list[Array]:
    """``C_nb`` of each position of a base."""
    return [dcm_from_euler(heading, 0.0, 0.0) for heading in base.headings]


def _from_to(model: StationaryModel, C_nb: Array, every: int) -> tuple[Array, Array]:
    """Over `every` periods: transitions (2, 10, 10) and what each period's noise adds (2, 5 every, 10), for rows of states.

    First with the velocity error fed back through the transport rate, then without.
    """
    from scipy.linalg import expm

    fed = model.dynamics(C_nb)
    free = fed.copy()
    free[:, DV] = 0.0  # its "velocity" is the integral of the accelerometers, and turns nothing
    moves, adds = [], []
    for F in (fed, free):
        period = expm(F * PERIOD).T
        powers = [np.eye(10)]
        for _ in range(every):
            powers.append(powers[-1] @ period)
        moves.append(powers[-1])
        adds.append(np.concatenate([power[DRIVEN] for power in powers[-2::-1]]))  # noise comes at the end of its period
    return np.stack(moves), np.stack(adds)


def _base_velocity(base: Base, time: Array, rng: np.random.Generator) -> Array:
    """(K, 2) velocity of the base along E and N, m/s."""
    periods, phases = rng.uniform(4.0, 8.0, 2), rng.uniform(0, 2 * math.pi, 2)
    sway = base.sway * math.sqrt(2) * np.cos(2 * math.pi * time[:, None] / periods + phases)
    return sway + base.vibration * rng.standard_normal((time.size, 2))
