"""What a transfer alignment tells besides the slave's attitude and biases: delay, lever arm, mounting, and what stays open."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.errors.axes import standing
from truenorth.state.layout import DV, PHI
from truenorth.state.limits import is_estimated
from truenorth.state.track import Residuals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Relation:
    """How the slave sits on its master as known at each time, (K,) and (K, 3), in the units of :class:`Transfer`."""

    time: Array  # s
    delay: Array
    delay_sigma: Array
    lever_arm: Array
    lever_arm_sigma: Array
    mounting: Array
    mounting_sigma: Array


@dataclass(frozen=True)
class Transfer:
    """Relation of the slave to its master, each with one-sigma now and before; sigma 0 where it was taken as known.

    Attributes
    ----------
    matching : {"velocity", "attitude", "both", "position", "acceleration", "position+attitude", "acceleration+attitude"}
    delay, delay_sigma, delay_prior : float, s
        The master's stamps are late by this much.
    lever_arm, lever_arm_sigma, lever_arm_prior : (3,) arrays, m
        From the master to the slave, slave axes (right, forward, up).
    mounting, mounting_sigma, mounting_prior : (3,) arrays, rad
        Heading, pitch and roll of the slave's axes seen from the master's; of the sigmas the first is that about the slave's z
        axis, the others those about x and y.
    velocity_noise, attitude_noise, position_noise, acceleration_noise : float, m/s, rad, m and m/s^2
        One-sigma white noise of the master's rows, as fitted or given; NaN where not matched.
    used, rejected : int
        Rows of the master.
    v_n : (3,) array, m/s
        Of the slave at the alignment's epoch.
    P : (15 + m, 15 + m) array
        Covariance of phi, dv, dp, gyro and accelerometer bias there (:mod:`truenorth.errors.ins`), and of `known` behind them: what
        navigation begins with.
    relative_sigma : (3,) array, rad
        Of heading, pitch and roll against the master's solution, where its own errors are considered; else as the absolute ones.
    considered : bool
        Whether the master's own errors are in the alignment's sigma, which is absolute then; else it is against the master.
    jumps : tuple of str
        Where the master jumped, in words.
    open : tuple of str
        Combinations that the motion could not separate, in words.
    notes : tuple of str
        What was found and mended on the way: delay of another clock, drop-outs.
    residuals : tuple of Residuals
        Of the master's rows, source by source.
    course : Relation or None
        Delay, lever arm and mounting on the way.
    known : mapping of name to (m,) values
        The slave's scale factors and misalignments (:mod:`truenorth.errors.axes`), where they were estimated.
    force : (3,) array, m/s^2
        Specific force at rest, slave axes: the accelerometers' axes of `known` act on what differs from it.
    coupling, coupling_sigma : (3,) arrays or None
        How far the end of a seat that bends moves for what it turns about right, forward and up (:mod:`truenorth.errors.bending`).
    acting_bias : (3,) array or None, m/s^2
        As that of an alignment on the move (:class:`truenorth.alignment.moving.Moving`).
    """

    matching: str
    delay: float
    delay_sigma: float
    delay_prior: float
    lever_arm: Array
    lever_arm_sigma: Array
    lever_arm_prior: Array
    mounting: Array
    mounting_sigma: Array
    mounting_prior: Array
    velocity_noise: float
    attitude_noise: float
    used: int
    rejected: int
    v_n: Array
    P: Array
    relative_sigma: Array
    considered: bool = False
    jumps: tuple[str, ...] = ()
    open: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    position_noise: float = math.nan
    acceleration_noise: float = math.nan
    residuals: tuple[Residuals, ...] = ()
    course: Relation | None = None
    known: Mapping[str, Array] = field(default_factory=dict)
    force: Array = field(default_factory=standing)
    acting_bias: Array | None = None
    coupling: Array | None = None
    coupling_sigma: Array | None = None

    @property
    def delay_estimated(self) -> bool:
        """Whether the data showed the delay."""
        return is_estimated(self.delay_sigma, self.delay_prior)

    @property
    def lever_arm_estimated(self) -> NDArray[np.bool_]:
        """(3,) whether the data showed this component."""
        return is_estimated(self.lever_arm_sigma, self.lever_arm_prior)

    @property
    def mounting_estimated(self) -> NDArray[np.bool_]:
        """(3,) whether the data showed this angle."""
        return is_estimated(self.mounting_sigma, self.mounting_prior)

    def less_sure(self, phi: Array, velocity: float) -> Transfer:
        """The same with a covariance (3, 3) of attitude added, rad^2, and sigmas of velocity so many times as large.

        What is added is an error of its own; the attitude against the master has it too.
        """
        P = self.P.copy()
        P[PHI, PHI] += phi
        P[DV, DV] += np.diag((velocity**2 - 1.0) * np.diag(P)[DV])
        more = np.sqrt(np.diag(phi))[[2, 0, 1]]
        return replace(self, P=P, relative_sigma=np.hypot(self.relative_sigma, more))

    def summary(self) -> dict[str, Any]:
        """Flat, in datasheet units, ready for JSON."""

        def known(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        bends = {}
        if self.coupling is not None and self.coupling_sigma is not None:
            bends = {"coupling": self.coupling.tolist(), "coupling_sigma": self.coupling_sigma.tolist()}
        return {
            "matching": self.matching,
            "velocity_m_s": self.v_n.tolist(),
            "delay_ms": 1e3 * self.delay,
            "delay_sigma_ms": 1e3 * self.delay_sigma,
            "delay_estimated": bool(self.delay_estimated),
            "lever_arm_m": self.lever_arm.tolist(),
            "lever_arm_sigma_m": self.lever_arm_sigma.tolist(),
            "lever_arm_estimated": self.lever_arm_estimated.tolist(),
            "mounting_deg": np.degrees(self.mounting).tolist(),
            "mounting_sigma_deg": np.degrees(self.mounting_sigma).tolist(),
            "mounting_estimated": self.mounting_estimated.tolist(),
            **bends,
            "master_velocity_noise_m_s": known(self.velocity_noise),
            "master_position_noise_m": known(self.position_noise),
            "master_acceleration_noise_m_s2": known(self.acceleration_noise),
            "master_attitude_noise_deg": known(float(np.degrees(self.attitude_noise))),
            "sigma_is": "absolute" if self.considered else "relative to the master",
            "relative_sigma_deg": np.degrees(self.relative_sigma).tolist(),
            "master_rows_used": self.used,
            "master_rows_rejected": self.rejected,
            "master_jumps": list(self.jumps),
            "not_told_apart": list(self.open),
            "notes": list(self.notes),
        }
