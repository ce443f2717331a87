"""The encoder of an indexer: what it says of the angles, and with which errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.errors import UsageError
from truenorth.records.encoder import EncoderRecord
from truenorth.simulation.indexer import Indexer
from truenorth.simulation.streams import STREAMS, stream

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Encoder:
    """Errors of an encoder, one-sigma for each axis.

    ``measured = steps of (angle(t - latency) + offset + c cos(angle) + s sin(angle) + noise)``

    Attributes
    ----------
    resolution : float, rad
        Size of one step; what is measured is rounded to whole ones. Zero: none.
    noise : float, rad
        White, of each reading.
    offset : float, rad
    eccentricity : float, rad
        Of c and of s each: the disc turns about a point that is not its centre.
    latency : float, s
    """

    resolution: float = 0.0
    noise: float = 0.0
    offset: float = 0.0
    eccentricity: float = 0.0
    latency: float = 0.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 <= value < float("inf"):
                raise UsageError(f"encoder: {item.name} is {value}; expected zero or more, and finite")


@dataclass(frozen=True, eq=False)
class EncoderErrors:
    """The constant errors of one run.

    Attributes
    ----------
    offset : (A,) array, rad
    eccentricity : (A, 2) array, rad
        Coefficients of cosine and sine of the angle.
    """

    offset: Array
    eccentricity: Array


def encoder_record(
    indexer: Indexer,
    times: ArrayLike,
    encoder: Encoder | None = None,
    *,
    seed: int = 0,
    run: int = 0,
    scenario: int = 0,
    given: Mapping[str, ArrayLike] | None = None,
) -> tuple[EncoderRecord, EncoderErrors]:
    """What the encoder says.

    Parameters
    ----------
    indexer : Indexer
    times : (N,) array, s
    encoder : Encoder, optional
        A perfect one when left out.
    seed, run, scenario : int
        The same three give the same bits.
    given : mapping, optional
        ``offset`` (A,) and ``eccentricity`` (A, 2) in place of their draws.

    Returns
    -------
    EncoderRecord
        Angles (N, A), or (N,) of a single axis.
    EncoderErrors

    Raises
    ------
    UsageError
        A given error that is not known, or of another shape.
    """
    encoder = encoder or Encoder()
    count = len(indexer.axes)
    shapes: dict[str, tuple[int, ...]] = {"offset": (count,), "eccentricity": (count, 2)}
    fixed = {name: np.asarray(value, dtype=np.float64) for name, value in (given or {}).items()}
    for name, value in fixed.items():
        if shapes.get(name) != value.shape:
            raise UsageError(f"encoder errors: {name} of shape {value.shape}; expected {shapes}")

    def draw(name: str, shape: tuple[int, ...]) -> Array:
        if name in fixed:
            return fixed[name]
        sigma = getattr(encoder, name)
        rng = stream(seed, scenario, run, STREAMS[f"encoder_{name}"])
        return sigma * rng.standard_normal(shape) if sigma > 0.0 else np.zeros(shape)

    errors = EncoderErrors(**{name: draw(name, shape) for name, shape in shapes.items()})
    times = np.asarray(times, dtype=np.float64)
    true = indexer.angles(times - encoder.latency)
    c, s = errors.eccentricity.T
    angles = true + errors.offset + c * np.cos(true) + s * np.sin(true) + draw("noise", true.shape)
    if encoder.resolution > 0.0:
        angles = np.round(angles / encoder.resolution) * encoder.resolution
    return EncoderRecord(times, angles[:, 0] if count == 1 else angles, "simulation"), errors
