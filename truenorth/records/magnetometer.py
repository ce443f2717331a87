"""The magnetometer's record: the magnetic field in the sensor's axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as default
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.records.base import Record

Array = NDArray[np.float64]
WEAKEST, STRONGEST = 5e-6, 5e-4  # T: the earth's field is 22 to 67 uT, and iron adds to it


@dataclass(frozen=True, repr=False)
class MagnetometerRecord(Record):
    """What a magnetometer of three axes measures.

    Parameters
    ----------
    time : (N,) array, s
    field : (N, 3) array, T
        Right, forward, up in the sensor's axes.
    source : str

    Raises
    ------
    DataError
        As for :class:`ImuRecord`; a field that is not the earth's by a factor.
    """

    GROUPS: ClassVar[Mapping[str, Sequence[str]]] = {"field": ("mag_x", "mag_y", "mag_z")}

    time: Array
    field: Array
    source: str = default(default="magnetometer record", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        typical = float(np.median(np.linalg.norm(self.field, axis=1)))
        if not WEAKEST < typical < STRONGEST:
            raise DataError(
                f"{self.source}: a field of {typical:.3g} T; the earth's is 22 to 67 uT: check the unit, tesla are expected"
            )
