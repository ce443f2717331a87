"""The encoder of an indexer: what it says of the angles, and with which errors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.records.encoder import EncoderRecord
from truenorth.records.unit_spec import value
from truenorth.simulation.aiding import Aided, AidingSpec, Draws
from truenorth.simulation.indexer import Indexer

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class EncoderSpec(AidingSpec[EncoderRecord]):
    """An encoder and its errors, one-sigma for each axis.

    Measured is ``angle + offset + c cos(angle) + s sin(angle) + noise``, in whole steps.

    Attributes
    ----------
    resolution : float, rad
        Size of a step, to which what is measured is rounded. Zero: none.
    noise : float, rad
        White, of each reading.
    offset : float, rad
        Of the zero of each axis.
    eccentricity : float, rad
        Of c and of s each: the disc turns about a point that is not its centre.
    """

    sensor = "encoder"
    rate: float = value("frequency", "Hz", 100.0, sign="positive")
    resolution: float = value("angle", "arcsec")
    noise: float = value("angle", "arcsec")
    offset: float = value("angle", "arcsec")
    eccentricity: float = value("angle", "arcsec")

    def sense(
        self, body: Indexer, times: Array, draws: Draws, errors: Mapping[str, ArrayLike] | None = None
    ) -> Aided[EncoderRecord]:
        """The encoder of an indexer: angles (N, A), or (N,) of a single axis; errors ``offset, eccentricity``.

        Parameters
        ----------
        body : Indexer
        times : (N,) array, s
        draws : Draws
        errors : mapping, optional
            ``offset`` (A,) and ``eccentricity`` (A, 2; of cosine and sine), rad, given in place of their draws.

        Raises
        ------
        UsageError
            A given error that is not known, or of another shape.
        """
        count = len(body.axes)
        shapes: dict[str, tuple[int, ...]] = {"offset": (count,), "eccentricity": (count, 2)}
        given = {name: np.asarray(x, dtype=np.float64) for name, x in (errors or {}).items()}
        for name, x in given.items():
            if shapes.get(name) != x.shape:
                known = ", ".join(f"{key} of shape {shape}" for key, shape in shapes.items())
                raise UsageError(f"errors of the encoder: {name} of shape {x.shape}; expected {known}")
        drawn = {
            name: given.get(name, getattr(self, name) * draws(name).standard_normal(shape))
            for name, shape in shapes.items()
        }
        true = body.angles(times)
        c, s = drawn["eccentricity"].T
        angles = true + drawn["offset"] + c * np.cos(true) + s * np.sin(true)
        angles += self.noise * draws("noise").standard_normal(true.shape)
        if self.resolution > 0.0:
            angles = np.round(angles / self.resolution) * self.resolution
        record = EncoderRecord(times + self.latency, angles[:, 0] if count == 1 else angles, "simulation")
        return Aided(record, times, drawn)
