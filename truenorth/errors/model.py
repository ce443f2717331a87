"""The error model of a specification: noise of an INS, its states and the groups behind them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.compiled import compiled
from truenorth.core.linalg import padded
from truenorth.errors.axes import axis_groups
from truenorth.errors.dynamics import Dynamics, couple_pairs, dynamics_of, noise_of_pairs
from truenorth.errors.group import Group, columns_at
from truenorth.errors.ins import TURN_TIME, couple_sensors, error_dynamics, transition
from truenorth.errors.intervals import Intervals
from truenorth.errors.log import DRIFT
from truenorth.errors.walks import Walks
from truenorth.records.specs import ImuSpec
from truenorth.state.layout import BA, BG, DV, GYRO_AXES, PHI, SLOW_ACCEL, SLOW_GYRO, STATES, Layout
from truenorth.state.now import NOW_C, NOW_FORCE_B, NOW_FORCE_W, NOW_LENGTH, NOW_MEAN_RATE, NOW_SINCE
from truenorth.state.prior import joined

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InsModel(Walks):
    """Noise of an INS, and its states; everything one-sigma, SI."""

    # (2,) s: what scale factors and misalignments of the gyros do in turns, as noise: their variances times `TURN_TIME`
    turn_noise: tuple[float, float] = (0.0, 0.0)
    groups: tuple[Group, ...] = ()  # further states, in order
    fixed_altitude: bool = False  # height held: its error and that of vertical velocity stay as they are

    @classmethod
    def from_spec(
        cls,
        spec: ImuSpec,
        *,
        standing: ArrayLike | None = None,
        every_axis: bool = False,
        unsteady: bool = False,
        groups: tuple[Group, ...] = (),
        fixed_altitude: bool = False,
    ) -> InsModel:
        """The model of a specification: its bias instabilities are Gauss-Markov states of their own.

        Parameters
        ----------
        standing : (3,) array, optional, m/s^2
            Specific force at rest as the vehicle stands at the start, body axes: scale factors and misalignments are states
            (:mod:`truenorth.errors.axes`). Without it those of the gyros count as noise in turns, those of the accelerometers not.
        every_axis : bool
            Such states even where their effect is small.
        unsteady : bool
            Those of the gyros are no constants: they count as noise in turns as well.
        groups : tuple of Group
            On top.
        """
        own: list[Group] = []
        for name, sigma in (
            (SLOW_GYRO, spec.gyro_bias_instability),
            (SLOW_ACCEL, spec.accel_bias_instability),
        ):
            if sigma > 0.0:
                own.append(Group(name, np.full(3, sigma), spec.correlation_time))
        axes = () if standing is None else axis_groups(spec, standing, always=every_axis)
        as_noise = TURN_TIME if unsteady or not any(group.name == GYRO_AXES for group in axes) else 0.0
        return cls.of(
            spec,
            "state",
            turn_noise=(spec.gyro_scale_factor**2 * as_noise, spec.gyro_misalignment**2 * as_noise),
            groups=(*own, *axes, *groups),
            fixed_altitude=fixed_altitude,
        )

    @cached_property
    def layout(self) -> Layout:
        """Where the states stand."""
        return Layout(tuple(g.name for g in self.groups), tuple(tuple(map(float, g.prior)) for g in self.groups))

    @property
    def states(self) -> int:
        """How many."""
        return self.layout.states

    @property
    def sensor_states(self) -> NDArray[np.int64]:
        """(3,) first states of the slow biases, for which :func:`couple_sensors` asks, and of the gyros' axes; -1: none."""
        return np.array([self.layout.first_of(name) for name in (SLOW_GYRO, SLOW_ACCEL, GYRO_AXES)])

    @property
    def drift_state(self) -> int:
        """First state of a log's drift along east and north; -1 where it has none."""
        return self.layout.first_of(DRIFT)

    @cached_property
    def dynamics(self) -> Dynamics:
        """How the states run by themselves, for kernels."""
        return dynamics_of(self.groups, self.noise)

    @property
    def noise(self) -> Array:
        """(15,) spectral density of the white noise that drives the states of the INS, their unit^2/s."""
        q = self.density(STATES, PHI, DV, BG, BA)
        if self.fixed_altitude:
            q[DV.stop - 1] = 0.0
        return q

    def prior(self, P15: ArrayLike) -> Array:
        """(n, n) covariance at the start: the given one of the fifteen, the groups' own sigmas behind it."""
        P = joined(P15, *(group.prior for group in self.groups))
        if self.fixed_altitude:
            P[DV.stop - 1, :] = 0.0
            P[:, DV.stop - 1] = 0.0
        return P

    def linearise(self, along: Intervals) -> tuple[Array, Array]:
        """``Phi`` and ``Q``, (K, n, n), for :class:`truenorth.filters.LinearSystem`.

        ``Q = (Phi q Phi' + q) T/2``: the noise's density by the trapezoid.
        """
        T, C, f, v, w_b = along.T, along.C_nb, along.f_n, along.v_n, along.w_ib_b
        n = self.states
        Phi = np.empty((len(T), n, n))
        fixed, at = self.fixed_altitude, self.sensor_states
        dynamics = self.dynamics
        pairs = np.zeros((len(T), n, n))
        speed = np.ascontiguousarray(np.linalg.norm(v, axis=1))
        _stack(padded(n), T, C, f, w_b, v, speed, along.axis, along.alt, fixed, at, dynamics, Phi, pairs)
        q = np.zeros((len(T), n, n))
        q[:, range(n), range(n)] = dynamics.noise + speed[:, None] * dynamics.wander
        square = w_b**2
        turning = self.turn_noise[0] * square + self.turn_noise[1] * (square.sum(axis=1, keepdims=True) - square)
        q[:, PHI, PHI] += (C * turning[:, None, :]) @ np.swapaxes(C, 1, 2)
        return Phi, 0.5 * T[:, None, None] * (Phi @ q @ np.swapaxes(Phi, 1, 2) + q) + pairs


@compiled
def _stack(
    size: Any,
    T: Any,
    C: Any,
    f_n: Any,
    w_b: Any,
    v: Any,
    speed: Any,
    axis: Any,
    alt: Any,
    fixed: bool,
    at: Any,
    dynamics: Dynamics,
    out: Any,
    pairs: Any,
) -> None:
    N, n = len(size), len(dynamics.decay)
    F, Phi, Phi_t = np.zeros((N, N)), np.zeros((N, N)), np.zeros((N, N))
    now, assumed = np.zeros(NOW_LENGTH), np.zeros(n)
    for k in range(len(T)):
        error_dynamics(C[k], f_n[k], v[k], axis[k], alt[k], True, fixed, F)
        couple_sensors(C[k], at, fixed, F)
        if len(dynamics.acts) > 0:
            _describe(C[k], f_n[k], w_b[k], v[k], T[k], now)
            for g in range(len(dynamics.acts)):
                columns_at(dynamics.acts[g])(now, dynamics.figures[g], dynamics.first[g], assumed, F)
        transition(size, F, dynamics.decay + speed[k] * dynamics.along, T[k], Phi, Phi_t)
        couple_pairs(dynamics, F, T[k], Phi, Phi_t)
        noise_of_pairs(dynamics, Phi, pairs[k])
        for i in range(n):
            for j in range(n):
                out[k, i, j] = Phi[i, j]


@compiled
def _describe(C: Any, f_n: Any, w_b: Any, v: Any, T: float, now: Any) -> None:
    """What columns are given of an interval that is known in its middle: the attitude is that at its end."""
    for i in range(3):
        now[4 + i], now[NOW_MEAN_RATE + i], now[NOW_FORCE_W + i] = v[i], w_b[i], f_n[i]
        now[NOW_FORCE_B + i] = C[0, i] * f_n[0] + C[1, i] * f_n[1] + C[2, i] * f_n[2]
        for j in range(3):
            a, b = (j + 1) % 3, (j + 2) % 3
            now[NOW_C + 3 * i + j] = C[i, j] + 0.5 * T * (C[i, a] * w_b[b] - C[i, b] * w_b[a])
    now[NOW_SINCE] = T
