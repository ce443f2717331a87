"""Simulated master INS: a solution with errors of its own, late, with drop-outs and jumps, on its own clock, in its own place.

The motion is that of the *slave's* IMU on the rigid body (on a structure that bends: the motion beneath
:class:`truenorth.simulation.flexure.Flexed`). The master sits in another place, in other axes, and has the errors of an INS: they
change slowly, so they are a constant, a Gauss-Markov part and an oscillation of the Schuler period whose tilts, velocities and
places belong together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.core.attitude import dcm_from_euler, dcm_from_rotation_vector
from truenorth.core.earth import normal_gravity, radii
from truenorth.core.errors import UsageError
from truenorth.records import MasterRecord
from truenorth.records.motion import MotionStates, Moving
from truenorth.records.unit_spec import value
from truenorth.simulation.aiding import Aided, Draws, DroppingSpec, kept
from truenorth.simulation.gnss import moved, place_of
from truenorth.simulation.processes import gauss_markov
from truenorth.simulation.sensing import acceleration_gain

Array = NDArray[np.float64]
THREE = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class MasterSpec(DroppingSpec[MasterRecord]):
    """A master INS, where it sits, and its errors (computed minus true; ``C_hat = exp(-[phi x]) C``).

    Attributes
    ----------
    clock_offset, clock_drift : float, s and 1
        A row sampled at t carries ``t + latency + clock_offset + clock_drift (t - start)``.
    lever_arm : (3,) floats, m
        From the master to the slave's IMU, slave axes.
    mounting : (3,) floats, rad
        Heading, pitch and roll of the slave's axes seen from the master's: at level the slave's heading is the master's plus the
        first.
    level, heading : float, rad
        Sigma of constant errors of both tilts, and of heading.
    attitude_drift, attitude_noise : float, rad
        Sigma of Gauss-Markov and white errors of each axis.
    velocity, velocity_drift, velocity_noise : float, m/s
        Sigma of constant, Gauss-Markov and white errors of each axis.
    position : float, m
        Sigma of a constant error of each axis.
    schuler : float, m/s
        Sigma of the two amplitudes (sine and cosine) of the Schuler oscillation, in velocity east and north.
    correlation_time : float, s
        Of the Gauss-Markov errors.
    jumps : tuple of (time, east, north), s and m/s
        Steps of the velocity, such as those of a correction by another sensor; they stay.
    jump_rate, jump_size : float, 1/s and m/s
        More of them at random: mean number a second, sigma of each component.
    with_attitude, with_velocity, with_position, with_sensors : bool
        What the record holds; the sensors' rates and forces, in the master's axes and place, are without error.
    """

    sensor = "master"
    rate: float = value("frequency", "Hz", 10.0, sign="positive")
    clock_offset: float = value("time", "s", sign="any")
    clock_drift: float = value("ratio", "ppm", sign="any")
    lever_arm: tuple[float, float, float] = value("length length length", "m m m", THREE, sign="any")
    mounting: tuple[float, float, float] = value("angle angle angle", "deg deg deg", THREE, sign="any")
    level: float = value("angle", "arcmin")
    heading: float = value("angle", "arcmin")
    attitude_drift: float = value("angle", "arcmin")
    attitude_noise: float = value("angle", "arcmin")
    velocity: float = value("speed", "m/s")
    velocity_drift: float = value("speed", "m/s")
    velocity_noise: float = value("speed", "m/s")
    position: float = value("length", "m")
    schuler: float = value("speed", "m/s")
    correlation_time: float = value("time", "s", 300.0, sign="positive")
    jumps: tuple[tuple[float, float, float], ...] = value("time speed speed", "s m/s m/s", (), sign="any", many=True)
    jump_rate: float = value("frequency", "Hz")
    jump_size: float = value("speed", "m/s", 0.1)
    with_attitude: bool = True
    with_velocity: bool = True
    with_position: bool = True
    with_sensors: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.clock_drift <= -1.0:
            raise UsageError(f"clock_drift is {self.clock_drift:g}; expected a clock that goes forward, above -1")
        if not (self.with_attitude or self.with_velocity):
            raise UsageError("a master without attitude and velocity; expected with_attitude or with_velocity")

    def sense(self, body: Moving, times: Array, draws: Draws) -> Aided[MasterRecord]:
        """A master INS by a slave's IMU on the rigid body.

        Errors row by row: ``attitude`` (phi), ``velocity``, ``position`` (N, 3), in rad, m/s and m east, north, up; ``jumps``
        (time, east, north) that were made.
        """
        start = times[0]
        phi, dv, dp, jumps = _errors(self, body.states(times[0]), times, draws)
        there = kept(self, times, draws)
        times, phi, dv, dp = times[there], phi[there], dv[there], dp[there]

        at = body.states(times)
        arm = -np.asarray(self.lever_arm)
        C_sm = dcm_from_euler(*self.mounting).T
        lat, lon, alt, v_n = place_of(at, arm)
        values: dict[str, Any] = {}
        if self.with_attitude:
            C_nm = at.C_nb @ C_sm if any(self.mounting) else at.C_nb
            values["C_nb"] = dcm_from_rotation_vector(-phi) @ C_nm if phi.any() else C_nm
        if self.with_velocity:
            values["v_n"] = v_n + dv
        if self.with_position:
            values["lat"], values["lon"], values["alt"] = moved(lat, lon, alt, dp)
        if self.with_sensors:
            values["w_ib_b"] = at.w_ib_b @ C_sm
            values["f_b"] = (at.f_b + acceleration_gain(at) @ arm) @ C_sm
        stamps = times + self.latency + self.clock_offset + self.clock_drift * (times - start)
        record = MasterRecord(stamps, source="simulation", **values)
        return Aided(record, times, {"attitude": phi, "velocity": dv, "position": dp, "jumps": jumps})


def _errors(spec: MasterSpec, at: MotionStates, times: Array, draws: Draws) -> tuple[Array, Array, Array, Any]:
    """Attitude, velocity and position errors (N, 3) and the jumps."""
    count, interval = len(times), 1.0 / spec.rate
    constant = np.array([spec.level, spec.level, spec.heading]) * draws("attitude").standard_normal(3)
    walk = gauss_markov(spec.attitude_drift, spec.correlation_time, interval, count, draws("attitude_drift"))
    phi = constant + walk + spec.attitude_noise * draws("attitude_noise").standard_normal((count, 3))
    steady = spec.velocity * draws("velocity").standard_normal(3)
    walk = gauss_markov(spec.velocity_drift, spec.correlation_time, interval, count, draws("velocity_drift"))
    dv = steady + walk + spec.velocity_noise * draws("velocity_noise").standard_normal((count, 3))
    dp = np.zeros((count, 3)) + spec.position * draws("position").standard_normal(3)

    if spec.schuler > 0.0:
        oscillation = _schuler(spec.schuler * draws("schuler").standard_normal((2, 2)), at, times - times[0])
        phi, dv, dp = phi + oscillation[0], dv + oscillation[1], dp + oscillation[2]
    rng = draws("jumps")
    span = float(times[-1] - times[0])
    moments = times[0] + span * np.sort(rng.random(rng.poisson(spec.jump_rate * span)))
    sizes = spec.jump_size * rng.standard_normal((len(moments), 2))
    jumps = (*spec.jumps, *((float(t), float(e), float(n)) for t, (e, n) in zip(moments, sizes, strict=True)))
    for moment, east, north in jumps:
        dv[times >= moment, :2] += east, north
    return phi, dv, dp, jumps


def _schuler(amplitudes: Array, at: MotionStates, t: Array) -> tuple[Array, Array, Array]:
    """Free oscillation of an INS: ``dv_E' = -g phi_N``, ``phi_N' = dv_E/R``; ``dv_N' = g phi_E``, ``phi_E' = -dv_N/R``.

    Heading follows by ``phi_U' = dv_E tan(lat)/R``, position by ``dp' = dv``; both are the oscillating parts.

    Parameters
    ----------
    amplitudes : (2, 2) array, m/s
        Of sine and cosine, east and north.
    at : MotionStates
        At the start.
    t : (N,) array, s
        Since then.
    """
    g, R = float(normal_gravity(at.lat, at.alt)), float(np.mean(radii(at.lat)) + at.alt)
    w = np.sqrt(g / R)
    s, c, zero = np.sin(w * t), np.cos(w * t), np.zeros_like(t)
    dv_E, dv_N = (a * s + b * c for a, b in amplitudes.T)
    turn_E, turn_N = (w * (a * c - b * s) / g for a, b in amplitudes.T)  # derivatives by g
    phi = np.column_stack([turn_N, -turn_E, -turn_E * np.tan(at.lat)])
    dp = np.column_stack([-R * turn_E, -R * turn_N, zero])
    return phi, np.column_stack([dv_E, dv_N, zero]), dp
