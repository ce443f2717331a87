"""A base at rest or swaying about a fixed place, and any other motion disturbed by sway or vibration."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.simulation.motion import Kinematics, Motion, displaced, staying
from truenorth.simulation.profile import Profile, pulse
from truenorth.simulation.tones import Tone, Triple, cosines, shortest, sines

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class _Tones:
    """Oscillations of the angles, rad, and of the centre, m."""

    heading_tones: tuple[Tone, ...] = ()
    pitch_tones: tuple[Tone, ...] = ()
    roll_tones: tuple[Tone, ...] = ()
    east_tones: tuple[Tone, ...] = ()
    north_tones: tuple[Tone, ...] = ()
    up_tones: tuple[Tone, ...] = ()


@dataclass(frozen=True)
class Sway(_Tones, Motion):
    """A base that sways about a fixed place; without tones, a base at rest.

    Attributes
    ----------
    position : Position
        Of the centre of rotation.
    heading, pitch, roll : float, rad
        Mean attitude.
    heading_tones, pitch_tones, roll_tones : tuple of Tone
        Angles are the mean plus ``sum A cos(w t + phase)``.
    east_tones, north_tones, up_tones : tuple of Tone
        The centre's displacement is ``sum A sin(w t + phase)``, its velocity ``sum A w cos(w t + phase)``.
    lever_arm : (3,) sequence, m
        From the centre of rotation to the IMU, body axes.
    """

    position: Position
    heading: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0
    lever_arm: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0))

    @property
    def shortest_period(self) -> float:
        """Of all tones, s."""
        turns = (self.heading_tones, self.pitch_tones, self.roll_tones)
        return shortest(*turns, self.east_tones, self.north_tones, self.up_tones)

    @property
    def at_rest(self) -> bool:
        """Whether it has no tones."""
        return math.isinf(self.shortest_period)

    def kinematics(self, t: Array) -> Kinematics:
        """Mean attitude and place, and the tones about them."""
        angles = (
            cosines(self.heading_tones, t, self.heading),
            cosines(self.pitch_tones, t, self.pitch),
            cosines(self.roll_tones, t, self.roll),
        )
        values, rates, accelerations = (np.stack(x) for x in zip(*angles, strict=True))
        path = staying(self.position, t)
        moves = self.east_tones, self.north_tones, self.up_tones
        if any(moves):
            shifts = [sines(tones, t) for tones in moves]
            east_north_up, velocity, acceleration = (np.stack(x) for x in zip(*shifts, strict=True))
            path = displaced(path, (east_north_up, velocity, acceleration))
        return Kinematics(values, rates, accelerations, *path)


def rest(position: Position, heading: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Sway:
    """A base at rest; angles in rad."""
    return Sway(position, heading, pitch, roll)


@dataclass(frozen=True)
class Disturbed(_Tones, Motion):
    """Another motion with sway or vibration on top.

    Attributes
    ----------
    motion : Motion
    heading_tones, pitch_tones, roll_tones : tuple of Tone, rad
        Added to the angles.
    east_tones, north_tones, up_tones : tuple of Tone, m
        Displacement of the centre, ``sum A sin(w t + phase)``.
    mount_tones : three tuples of Tone, m
        Displacement of the IMU in the body (right, forward, up), ``sum A cos(w t + phase)``: what an engine does.
    window : (3,) floats or None, s
        Start, stop, and the time of fading in and out; always when left out.

    Raises
    ------
    UsageError
        A window shorter than its two fadings.
    """

    motion: Motion
    mount_tones: tuple[tuple[Tone, ...], tuple[Tone, ...], tuple[Tone, ...]] = ((), (), ())
    window: tuple[float, float, float] | None = None
    _envelope: Profile | None = field(init=False, repr=False, compare=False, default=None)

    def __post_init__(self) -> None:
        if self.window is None:
            return
        start, stop, fade = self.window
        if not (fade > 0 and stop - start >= 2 * fade):
            raise UsageError(
                f"window from {start:g} s to {stop:g} s with a fading of {fade:g} s; expected a positive fading and a "
                "window of twice its length at least"
            )
        object.__setattr__(self, "_envelope", pulse(start, stop, fade))

    @property
    def breaks(self) -> Array:
        """Those of the motion beneath and of the window."""
        own = np.empty(0) if self._envelope is None else self._envelope.breaks
        return np.union1d(self.motion.breaks, own)

    @property
    def shortest_period(self) -> float:
        """Of the motion beneath and all tones, s."""
        turns = (self.heading_tones, self.pitch_tones, self.roll_tones)
        own = shortest(*turns, self.east_tones, self.north_tones, self.up_tones, *self.mount_tones)
        return min(self.motion.shortest_period, own)

    def kinematics(self, t: Array) -> Kinematics:
        """The motion beneath plus the tones."""
        base = self.motion.kinematics(t)
        turns = (self.heading_tones, self.pitch_tones, self.roll_tones)
        envelope = None if self._envelope is None else self._envelope(t)
        angles = [_faded(cosines(tones, t), envelope) for tones in turns]
        shifts = [_faded(sines(x, t), envelope) for x in (self.east_tones, self.north_tones, self.up_tones)]
        east_north_up, velocity, acceleration = (np.stack(x) for x in zip(*shifts, strict=True))
        values, rates, accelerations = (np.stack(x) for x in zip(*angles, strict=True))
        path = displaced((base.lat, base.lon, base.alt, base.v, base.a), (east_north_up, velocity, acceleration))
        return Kinematics(base.angles + values, base.rates + rates, base.accelerations + accelerations, *path)

    def arm(self, t: Array) -> tuple[Array, Array, Array]:
        """The arm of the motion beneath plus the vibration of the mount."""
        fixed = self.motion.arm(t)
        if not any(self.mount_tones):
            return fixed
        envelope = None if self._envelope is None else self._envelope(t)
        moving = [_faded(cosines(tones, t), envelope) for tones in self.mount_tones]
        r, dr, ddr = (f + np.stack(x, -1) for f, x in zip(fixed, zip(*moving, strict=True), strict=True))
        return r, dr, ddr


def _faded(signal: Triple, envelope: Triple | None) -> Triple:
    if envelope is None:
        return signal
    (x, dx, ddx), (e, de, dde) = signal, envelope
    return e * x, de * x + e * dx, dde * x + 2 * de * dx + e * ddx
