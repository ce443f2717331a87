"""Sensors of a scenario besides the IMU: aiding sensors, an indexer with its encoder, flexure; as a file describes them."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from truenorth.core.errors import UsageError
from truenorth.core.schema import Angle, AngularRate, Strict, Time
from truenorth.simulation.aiding import AidingSpec
from truenorth.simulation.axis_angles import SCHEMES, Spin, Swing, Turning, scheme
from truenorth.simulation.encoder import EncoderSpec
from truenorth.simulation.gnss import GnssSpec, HeightSpec
from truenorth.simulation.indexer import Axis, Indexer
from truenorth.simulation.master import MasterSpec
from truenorth.simulation.odometer import OdometerSpec
from truenorth.simulation.tones import Tone
from truenorth.simulation.velocity_log import VelocityLogSpec

# Key in a scenario: the specification that its mapping is.
AIDING: dict[str, type[AidingSpec[Any]]] = {
    "odometer": OdometerSpec,
    "velocity_log": VelocityLogSpec,
    "gnss": GnssSpec,
    "height": HeightSpec,
    "master": MasterSpec,
}
Direction = Literal["x", "y", "z"]


class SpinAxis(Strict):
    """An axis that turns at a constant rate, counter-clockwise about its direction."""

    kind: Literal["spin"]
    direction: Direction
    rate: AngularRate
    start: Angle = 0.0
    tilt: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)

    def axis(self) -> Axis:
        """The axis."""
        return Axis(self.direction, Spin(self.rate, self.start), self.tilt)


class SwingAxis(Strict):
    """An axis that swings to and fro, ``mean + amplitude cos(2 pi t/period + phase)``."""

    kind: Literal["swing"]
    direction: Direction
    amplitude: Angle
    period: Time
    phase: Angle = 0.0
    mean: Angle = 0.0
    tilt: tuple[Angle, Angle, Angle] = (0.0, 0.0, 0.0)

    def axis(self) -> Axis:
        """The axis."""
        return Axis(self.direction, Swing(Tone(self.amplitude, self.period, self.phase), self.mean), self.tilt)


class IndexerModel(Strict):
    """A rotation mechanism: axes that turn for ever, the outermost first, or a scheme of positions.

    Its encoder is a mapping of :class:`truenorth.simulation.EncoderSpec`; an ideal one at the IMU's rate when left out.
    """

    axes: tuple[Annotated[SpinAxis | SwingAxis, Field(discriminator="kind")], ...] = ()
    scheme: str | None = Field(None, coerce_numbers_to_str=True)  # a bare 8 in YAML is a number
    directions: tuple[Direction, ...] = ("z", "x")
    dwell: Time = 60.0
    rate: AngularRate = 0.17453292519943295
    encoder: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if bool(self.axes) == (self.scheme is not None):
            raise ValueError(f"expected axes, or a scheme ({', '.join(SCHEMES)}) with its directions and dwell")
        return self

    def build(self, duration: float) -> Indexer:
        """The mechanism, its scheme going on for a time (s).

        Raises
        ------
        UsageError
            A scheme that is not known, or one of more axes than there are directions.
        """
        if self.scheme is None:
            return Indexer(tuple(item.axis() for item in self.axes))
        angles: tuple[Turning, ...] = scheme(self.scheme, dwell=self.dwell, duration=duration, rate=self.rate)
        if len(angles) > len(self.directions):
            raise UsageError(
                f"scheme {self.scheme!r} turns {len(angles)} axes; directions names {len(self.directions)}"
            )
        return Indexer(tuple(Axis(name, angle) for name, angle in zip(self.directions, angles, strict=False)))

    def encoder_spec(self, rate: float, where: str) -> EncoderSpec:
        """The encoder, at a rate (Hz) where it names none; `where` leads the messages of the DataError."""
        return EncoderSpec.from_mapping({"rate": f"{rate!r} Hz", **self.encoder}, where)
