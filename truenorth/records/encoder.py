"""The encoder's record: how far the axes of an indexer have turned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from truenorth.records.base import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class EncoderRecord(Record):
    """Angles of the axes of an indexer (rotation mechanism), the outermost first.

    Parameters
    ----------
    time : (N,) array, s
        Strictly increasing.
    angles : (N, A) array, rad
        Of A axes, (N,) or (N, 1) of a single one, kept as (N,); turns are counted, so that an angle can be interpolated.
    source : str

    Raises
    ------
    DataError
        As for every record.
    """

    time: Array
    angles: Array
    source: str = field(default="encoder record", compare=False)

    def __post_init__(self) -> None:
        if np.ndim(self.angles) == 2 and np.shape(self.angles)[1] == 1:
            object.__setattr__(self, "angles", np.asarray(self.angles)[:, 0])
        super().__post_init__()

    def groups(self) -> Mapping[str, Sequence[str]]:
        """One angle an axis."""
        axes = np.shape(self.angles)[1] if np.ndim(self.angles) == 2 else 1
        return {"angles": [f"angle_{i}" for i in range(1, axes + 1)]}

    def columns(self) -> dict[str, Array]:
        """The angles in degrees."""
        return {name: np.degrees(x) for name, x in super().columns().items()}
