"""Error model of a marine INS with its height held: 13 states, and groups behind them (speed log, plumb line, the IMU's axes).

States, errors computed minus true:

| slice | state | unit |
| --- | --- | --- |
| PHI | misalignment E, N, U, ``C_nb_hat = (I - [phi x]) C_nb`` | rad |
| DV | velocity error east, north | m/s |
| DP | position error east, north | m |
| BG | gyro bias left, measured minus true, body axes | rad/s |
| BA | accelerometer bias left, measured minus true, body axes | m/s^2 |
| REF | drift of the speed log east, north, the first of its groups (:mod:`truenorth.errors.log`) | m/s |

It is the INS model of :mod:`truenorth.errors.ins` in ENU with altitude fixed, its rows of the vertical channel left out and
its biases first-order Gauss-Markov processes; a group is a constant or a first-order Gauss-Markov process. Against the paper's
states, ``dp_N = (R_M + h) dL`` and ``dp_E = (R_N + h) cos L dlon``: a metre has one meaning at every latitude
(:func:`position_in_angles`).

Source: L. Zhao, J. Li, J. Cheng, "Double-filters external damping strapdown inertial navigation algorithm", J. Harbin
Inst. Technol. 50 (3), 2018, eq. 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core import earth
from truenorth.core.compiled import compiled
from truenorth.core.errors import UsageError
from truenorth.core.linalg import padded
from truenorth.core.units import parse
from truenorth.errors.deflection import NAME as DEFLECTION
from truenorth.errors.deflection import STANDARD_GRAVITY
from truenorth.errors.dynamics import Dynamics, dynamics_of
from truenorth.errors.group import Group
from truenorth.errors.ins import error_dynamics, transition
from truenorth.errors.intervals import Intervals
from truenorth.errors.walks import Walks
from truenorth.records.specs import ImuSpec
from truenorth.state import layout as ins
from truenorth.state.prior import joined

Array = NDArray[np.float64]

PHI = slice(0, 3)
DV = slice(3, 5)
DP = slice(5, 7)
BG = slice(7, 10)
BA = slice(10, 13)
REF = slice(13, 15)
MOTION = slice(0, 7)  # what drives each other; the biases run by themselves
STATES = 13
# Of the states of errors.ins, all but its vertical channel, which does not move.
OF_INS = np.delete(np.arange(ins.STATES), [ins.DV.stop - 1, ins.DP.stop - 1])


@dataclass(frozen=True)
class MarineModel(Walks):
    """Noise and memory of the error model; one-sigma, SI."""

    accel_time: float = math.inf  # s; correlation times of the biases; infinite: constants, or random walks
    gyro_time: float = math.inf  # s
    groups: tuple[Group, ...] = ()  # behind the thirteen, those of the speed log first

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("accel_time", "gyro_time"):
            if not getattr(self, name) > 0.0:
                raise UsageError(f"{name} is {getattr(self, name)} s; expected more than zero")

    @classmethod
    def of_paper(cls) -> MarineModel:
        """The paper's ``Q``, taken per second, and the correlation time of 300 s that matches its figures."""
        g = parse("1 g", "acceleration")
        rate = parse("1 deg/h", "angular_rate")
        root = math.sqrt(2.0)
        return cls(
            accel_random_walk=root * 1e-4 * g,
            gyro_random_walk=root * 0.01 * rate,
            accel_rate_walk=root * 1e-5 * g,
            gyro_rate_walk=root * 0.001 * rate,
            accel_time=300.0,
            gyro_time=300.0,
        )

    @classmethod
    def from_spec(cls, spec: ImuSpec, groups: tuple[Group, ...] = ()) -> MarineModel:
        """The model of a specification: constant biases that may walk; over hours their instability is white noise."""
        return cls.of(spec, "white", groups=groups)

    @property
    def states(self) -> int:
        """Thirteen and those of the groups."""
        return STATES + sum(len(group.prior) for group in self.groups)

    def slice_of(self, name: str) -> slice | None:
        """Where a group stands; None: it is not there."""
        at = STATES
        for group in self.groups:
            if group.name == name:
                return slice(at, at + len(group.prior))
            at += len(group.prior)
        return None

    @property
    def _standing(self) -> Array:
        """(3,) m/s^2, on what differs from which the accelerometers' axes act."""
        return next(np.array(group.figures[:3]) for group in self.groups if group.name == ins.ACCEL_AXES)

    @cached_property
    def dynamics(self) -> Dynamics:
        """How the groups run by themselves."""
        return dynamics_of(self.groups, np.zeros(ins.STATES))

    def prior(self, P0: Array) -> Array:
        """(n, n) covariance: the given one of the thirteen, the groups' own behind it."""
        return joined(P0, *(group.prior for group in self.groups))

    @property
    def noise(self) -> Array:
        """(n,) spectral density of the white noise that drives each state in time, its unit^2/s."""
        q = self.density(self.states, PHI, DV, BG, BA)
        q[STATES:] = self.dynamics.noise[ins.STATES :]
        return q

    def noise_of(self, T: float, v_n: ArrayLike) -> Array:
        """(1, n, n), or (K, n, n) where a group runs along the way, covariance of the noise of K intervals of length T.

        Parameters
        ----------
        T : float, s
        v_n : (K, 3) array, m/s
        """
        wander = np.concatenate([np.zeros(STATES), self.dynamics.wander[ins.STATES :]])
        density = self.noise[None]
        if wander.any():
            density = density + np.linalg.norm(np.asarray(v_n)[:, :2], axis=1)[:, None] * wander
        return np.asarray(T * density[:, :, None] * np.eye(self.states))

    def linearise(self, along: Intervals) -> tuple[Array, Array]:
        """``F`` and ``Phi``, (K, n, n), of ``x' = F x + w`` and of the transition over each interval."""
        core, Phi = self._moved(along)
        F = np.zeros(Phi.shape)
        F[:, :STATES, :STATES] = core
        behind = np.arange(STATES, self.states)
        F[:, behind, behind] = -self._rates(along.v_n)
        for rows, own, effect in self._acting(along):
            F[:, rows, own] = effect
        return F, Phi

    def transitions(self, along: Intervals, like: tuple[MarineModel, Array] | None = None) -> Array:
        """``Phi`` of :meth:`linearise` alone: ``F`` of many states is as large, and filters of the velocity error ask for none.

        Parameters
        ----------
        like : MarineModel and array, optional
            A model and its ``Phi``, which is changed and given back where this model differs in how its groups forget alone.
        """
        if like is None or not self._moves_as(like[0]):
            return self._moved(along)[1]
        self._forget(along, like[1])
        return like[1]

    def _moves_as(self, other: MarineModel) -> bool:
        acting = [[(group.name, len(group.prior), group.figures) for group in model.groups] for model in (self, other)]
        return acting[0] == acting[1] and replace(self, groups=()) == replace(other, groups=())

    def _forget(self, along: Intervals, Phi: Array) -> None:
        behind = np.arange(STATES, self.states)
        Phi[:, behind, behind] = np.exp(-along.T[:, None] * self._rates(along.v_n))

    def _rates(self, v_n: Array) -> Array:
        """(K, n - 13), 1/s, at which the groups forget."""
        d = self.dynamics
        speed = np.linalg.norm(v_n[:, :2], axis=1)
        return np.asarray(d.decay[ins.STATES :] + speed[:, None] * d.along[ins.STATES :])

    def _acting(self, along: Intervals) -> list[tuple[slice, slice, Array]]:
        """Rows, columns and (K, rows, columns) elements of ``F`` by which groups act on the INS."""
        found = []
        deflected, gyros, accels = map(self.slice_of, (DEFLECTION, ins.GYRO_AXES, ins.ACCEL_AXES))
        if deflected is not None:
            found.append((DV, deflected, np.broadcast_to(STANDARD_GRAVITY * np.eye(2), (len(along.T), 2, 2))))
        if gyros is not None:  # phi' = -C M w
            turned = -(along.C_nb[:, :, :, None] * along.w_ib_b[:, None, None, :]).reshape(len(along.T), 3, 9)
            found.append((PHI, gyros, turned))
        if accels is not None:  # dv' = C M (f - f0)
            f_b = np.einsum("kji,kj->ki", along.C_nb, along.f_n) - self._standing
            pushed = (along.C_nb[:, :2, :, None] * f_b[:, None, None, :]).reshape(len(along.T), 2, 9)
            found.append((DV, accels, pushed))
        return found

    def _moved(self, along: Intervals) -> tuple[Array, Array]:
        """``F`` of the thirteen states, (K, 13, 13), and ``Phi``, (K, n, n)."""
        T, v, n = along.T, along.v_n, self.states
        decay = np.zeros(ins.STATES)
        decay[ins.BG], decay[ins.BA] = 1.0 / self.gyro_time, 1.0 / self.accel_time
        F, Phi = np.zeros((len(T), STATES, STATES)), np.zeros((len(T), n, n))
        _stack(padded(ins.STATES), T, along.C_nb, along.f_n, v, along.axis, along.alt, decay, OF_INS, F, Phi)
        self._forget(along, Phi)
        for rows, own, effect in self._acting(along):
            Phi[:, rows, own] = T[:, None, None] * effect
            if rows == PHI:  # the tilt of a turn drives velocity
                Phi[:, DV, own] = 0.5 * T[:, None, None] * (F[:, DV, PHI] @ Phi[:, PHI, own])
            else:
                Phi[:, DP, own] = 0.5 * T[:, None, None] * Phi[:, DV, own]
        return F, Phi


def position_in_angles(p: Array, lat: ArrayLike, alt: ArrayLike) -> Array:
    """Errors of latitude and longitude (..., 2) rad, of a position error east, north (..., 2) m."""
    lat = np.asarray(lat, dtype=np.float64)
    R_M, R_N = earth.radii(lat)
    return np.stack([p[..., 1] / (R_M + alt), p[..., 0] / ((R_N + alt) * np.cos(lat))], axis=-1)


@compiled
def _stack(
    size: Any, T: Any, C: Any, f_n: Any, v: Any, axis: Any, alt: Any, decay: Any, order: Any, F_out: Any, Phi_out: Any
) -> None:
    N = len(size)
    F, Phi, Phi_t = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N))
    for k in range(len(T)):
        error_dynamics(C[k], f_n[k], v[k], axis[k], alt[k], True, True, F)
        transition(size, F, decay, T[k], Phi, Phi_t)
        for i in range(len(order)):
            for j in range(len(order)):
                F_out[k, i, j] = F[order[i], order[j]]
                Phi_out[k, i, j] = Phi[order[i], order[j]]
            F_out[k, i, i] -= decay[order[i]]
