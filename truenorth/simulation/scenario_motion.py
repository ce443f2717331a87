"""Motions and disturbances as a scenario file describes them.

A motion is built by ``build(position, arm, rng, folder)``: `arm` (m, body axes) goes from its centre to the IMU, `rng` draws
what the file leaves to chance, `folder` is where the file's own relative paths begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from truenorth.core.plugins import plugin
from truenorth.core.position import Position
from truenorth.core.schema import (
    Acceleration,
    AccelerationDensity,
    Angle,
    AngularRate,
    Frequency,
    Length,
    Ratio,
    Speed,
    Strict,
    Time,
    numbered,
)
from truenorth.simulation.motion import Motion
from truenorth.simulation.scenario_courses import Arm, LegsMotion, RingMotion, Rng, RouteMotion
from truenorth.simulation.sea import COMPONENTS, Hull, WaveSpectrum, narrow_band, sea_motion
from truenorth.simulation.sway import Disturbed, Sway
from truenorth.simulation.tones import Tone
from truenorth.simulation.turntable import Hold, turntable
from truenorth.simulation.vibration import random_vibration, sine_vibration


class _Tone(Strict):
    """A sinusoid, or narrow-band swell where rms and bandwidth are given."""

    period: Time
    phase: Angle | None = None
    bandwidth: Ratio | None = None
    components: int = Field(COMPONENTS, ge=1, le=1000)

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        amplitude, rms = getattr(self, "amplitude", None), getattr(self, "rms", None)
        sine = amplitude is not None and rms is None and self.bandwidth is None
        swell = rms is not None and self.bandwidth is not None and amplitude is None and self.phase is None
        if sine == swell:
            raise ValueError("expected amplitude, period, phase for a sinusoid, or rms, period, bandwidth for swell")
        return self

    def tones(self, rng: Rng) -> tuple[Tone, ...]:
        """One tone, or the components of the swell; a phase left out is drawn."""
        rms, bandwidth = getattr(self, "rms", None), self.bandwidth
        if rms is not None and bandwidth is not None:
            return narrow_band(rms, self.period, bandwidth, rng, self.components)
        phase = rng.uniform(0, 2 * math.pi) if self.phase is None else self.phase
        return (Tone(getattr(self, "amplitude", 0.0), self.period, phase),)


class AngleTone(_Tone):
    """Of an angle, ``amplitude cos(2 pi t/period + phase)``."""

    amplitude: Angle | None = None
    rms: Angle | None = None


class LengthTone(_Tone):
    """Of a displacement, ``amplitude sin(2 pi t/period + phase)``."""

    amplitude: Length | None = None
    rms: Length | None = None


class Tones(Strict):
    """Sway of the angles about their mean, and of the centre about its place."""

    heading: tuple[AngleTone, ...] = ()
    pitch: tuple[AngleTone, ...] = ()
    roll: tuple[AngleTone, ...] = ()
    east: tuple[LengthTone, ...] = ()
    north: tuple[LengthTone, ...] = ()
    up: tuple[LengthTone, ...] = ()

    def tones(self, rng: Rng) -> dict[str, Any]:
        """By the names that motions take."""
        return {
            f"{name}_tones": tuple(tone for item in getattr(self, name) for tone in item.tones(rng))
            for name in Tones.model_fields
        }


class HullShape(Strict):
    """See :class:`truenorth.simulation.sea.Hull`."""

    length: Length = Hull.length
    beam: Length = Hull.beam
    roll_period: Time = Hull.roll_period
    pitch_period: Time = Hull.pitch_period
    heave_period: Time = Hull.heave_period
    roll_damping: float = Hull.roll_damping
    pitch_damping: float = Hull.pitch_damping
    heave_damping: float = Hull.heave_damping
    yaw_gain: float = Hull.yaw_gain


class Waves(Strict):
    """The sea: by its significant height and peak period, or by the wind that has raised it; `direction` it runs to."""

    direction: Angle
    height: Length | None = None
    period: Time | None = None
    peakedness: float = 3.3
    wind: Speed | None = None
    components: int = Field(COMPONENTS, ge=1, le=1000)

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        measured = self.height is not None and self.period is not None and self.wind is None
        blown = self.wind is not None and self.height is None and self.period is None
        if measured == blown:
            raise ValueError("expected height and period, or wind alone")
        return self

    def tones(self, hull: HullShape, heading: float, speed: float, rng: Rng) -> dict[str, Any]:
        """Of a ship on a heading (rad) at a speed (m/s)."""
        if self.wind is not None:
            spectrum = WaveSpectrum.of_wind(self.wind)
        else:
            spectrum = WaveSpectrum(float(self.height or 0.0), float(self.period or 0.0), self.peakedness)
        return sea_motion(
            spectrum,
            Hull(**hull.__dict__),
            rng,
            direction=self.direction,
            heading=heading,
            speed=speed,
            components=self.components,
        )


class RestMotion(Strict):
    """A base that stands still."""

    kind: Literal["rest"]
    heading: Angle = 0.0
    pitch: Angle = 0.0
    roll: Angle = 0.0

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        return Sway(position, self.heading, self.pitch, self.roll, lever_arm=arm)


class SwayMotion(Strict):
    """A base that sways by given tones."""

    kind: Literal["sway"]
    heading: Angle = 0.0
    pitch: Angle = 0.0
    roll: Angle = 0.0
    tones: Tones

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        return Sway(position, self.heading, self.pitch, self.roll, lever_arm=arm, **self.tones.tones(rng))


class SeaMotion(Strict):
    """A ship that lies in waves."""

    kind: Literal["sea"]
    heading: Angle = 0.0
    waves: Waves
    hull: HullShape = HullShape()

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        return Sway(position, self.heading, lever_arm=arm, **self.waves.tones(self.hull, self.heading, 0.0, rng))


class TablePosition(Strict):
    """A position of a turntable."""

    duration: Time
    heading: Angle = 0.0
    pitch: Angle = 0.0
    roll: Angle = 0.0


class TurntableMotion(Strict):
    """A turntable going through positions."""

    kind: Literal["turntable"]
    positions: tuple[TablePosition, ...] = Field(min_length=1)
    rate: AngularRate = math.radians(10.0)
    onset: Time = 0.5

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        holds = [Hold(**item.__dict__) for item in self.positions]
        return turntable(position, holds, rate=self.rate, onset=self.onset, lever_arm=arm)


class PlugInMotion(Strict):
    """A motion of another package, by the name of its entry point."""

    kind: Literal["plug-in"]
    name: str
    options: dict[str, Any] = Field(default_factory=dict)

    def build(self, position: Position, arm: Arm, rng: Rng, folder: Path) -> Motion:
        """The motion."""
        motion: Motion = plugin("truenorth.motions", self.name)(position, arm, rng, **self.options)
        return motion


MotionModel = Annotated[
    RestMotion | SwayMotion | SeaMotion | RingMotion | LegsMotion | RouteMotion | TurntableMotion | PlugInMotion,
    Field(discriminator="kind"),
]


# From when to when a disturbance lasts, and in what time it comes and goes.
Window = tuple[Time, Time, Time]


class SwayDisturbance(Strict):
    """Tones on top of a motion."""

    kind: Literal["sway"]
    tones: Tones
    window: Window | None = None

    def build(self, motion: Motion, rng: Rng) -> Motion:
        """The disturbed motion."""
        return Disturbed(motion, **self.tones.tones(rng), window=self.window)


class SeaDisturbance(Strict):
    """Waves under a ship under way; `heading` and `speed` are those at which it meets them."""

    kind: Literal["sea"]
    heading: Angle
    speed: Speed
    waves: Waves
    hull: HullShape = HullShape()
    window: Window | None = None

    def build(self, motion: Motion, rng: Rng) -> Motion:
        """The disturbed motion."""
        tones = self.waves.tones(self.hull, self.heading, self.speed, rng)
        return Disturbed(motion, **tones, window=self.window)


class Sine(Strict):
    """One sinusoid of an engine: peak acceleration along body axes (right, forward, up)."""

    frequency: Frequency
    acceleration: tuple[Acceleration, Acceleration, Acceleration]


class SpectrumPoint(Strict):
    """A break point of a power spectral density."""

    frequency: Frequency
    density: AccelerationDensity


class Vibration(Strict):
    """Vibration of the IMU in the vehicle: sinusoids, and random vibration alike on the three axes."""

    kind: Literal["vibration"]
    sines: tuple[Sine, ...] = ()
    random: tuple[SpectrumPoint, ...] = ()
    components: int = Field(64, ge=1, le=1000)
    window: Window | None = None

    def build(self, motion: Motion, rng: Rng) -> Motion:
        """The disturbed motion."""
        axes: list[tuple[Tone, ...]] = []
        for axis in range(3):
            tones = [
                sine_vibration(sine.acceleration[axis], sine.frequency, rng.uniform(0, 2 * math.pi))
                for sine in self.sines
            ]
            if self.random:
                table = [(point.frequency, point.density) for point in self.random]
                tones += random_vibration(table, rng, self.components)
            axes.append(tuple(tones))
        right, forward, up = axes
        return Disturbed(motion, mount_tones=(right, forward, up), window=self.window)


Disturbance = Annotated[SwayDisturbance | SeaDisturbance | Vibration, Field(discriminator="kind")]


def disturbed(motion: Motion, disturbances: Sequence[Any], generators: Sequence[Rng]) -> Motion:
    """A motion with all disturbances, each drawn from a generator of its own."""
    for number, (item, rng) in enumerate(zip(disturbances, generators, strict=True), 1):
        with numbered("disturbances", number):
            motion = item.build(motion, rng)
    return motion
