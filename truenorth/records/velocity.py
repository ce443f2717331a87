"""The velocity log's record: Doppler or electromagnetic log, or any reference velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError
from truenorth.records.base import Record, check_positive

Array = NDArray[np.float64]

COLUMNS = {"body": ("v_right", "v_forward", "v_up"), "navigation": ("VE", "VN", "VU")}


@dataclass(frozen=True, repr=False)
class VelocityRecord(Record):
    """Velocity over the ground (or through the water) from an external sensor.

    Parameters
    ----------
    time : (N,) array, s
    velocity : (N, 3) array, m/s
        Right, forward, up in body axes, or east, north, up; NaN where an axis is not measured (a forward log has NaN for
        right and up).
    frame : {"body", "navigation"}
    sigma : (N, 3) array or None, m/s
        One-sigma errors, NaN where not known.
    source : str

    Raises
    ------
    DataError
        As for :class:`ImuRecord`; not one velocity in the record, or a sigma that is not positive.
    """

    OPTIONAL: ClassVar[frozenset[str]] = frozenset({"sigma"})
    PARTIAL: ClassVar[frozenset[str]] = frozenset({"velocity", "sigma"})

    time: Array
    velocity: Array
    frame: Literal["body", "navigation"] = "body"
    sigma: Array | None = None
    source: str = field(default="velocity record", compare=False)

    def groups(self) -> Mapping[str, Sequence[str]]:
        """``velocity`` and ``sigma`` with the columns of the frame."""
        columns = COLUMNS[self.frame]
        return {"velocity": columns, "sigma": tuple(f"sigma_{name}" for name in columns)}

    def __post_init__(self) -> None:
        if self.frame not in COLUMNS:
            raise DataError(f"{self.source}: frame {self.frame!r} is not known; use 'body' or 'navigation'")
        super().__post_init__()
        check_positive(self, "sigma")
        if not np.isfinite(self.velocity).any():
            raise DataError(
                f"{self.source}: not one velocity, all are NaN; expected at least one axis that is measured"
            )

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(3,) which axes are measured at all."""
        right, forward, up = np.isfinite(self.velocity).T
        return np.array([right.any(), forward.any(), up.any()])

    def velocity_b(self, C_mb: Array) -> Array:
        """(N, 3) velocity in body axes, m/s; between its rows where one is empty, zero along an axis that is not measured."""
        filled = np.zeros_like(self.velocity)
        for i in np.flatnonzero(self.measured):
            known = np.isfinite(self.velocity[:, i])
            filled[:, i] = np.interp(self.time, self.time[known], self.velocity[known, i])
        return np.asarray(filled @ C_mb)

    def way_b(self, C_mb: Array) -> Array:
        """(N, 3) way of the interval that ends at each row, body axes, by the trapezoidal rule, m."""
        v = self.velocity_b(C_mb)
        v[1:] = 0.5 * (v[1:] + v[:-1])
        return np.asarray(v * self.steps[:, None])

    def columns(self) -> dict[str, Array]:
        """Of the axes that are measured."""
        kept = [name for name, there in zip(COLUMNS[self.frame], self.measured) if there]
        return {name: values for name, values in super().columns().items() if name.removeprefix("sigma_") in kept}
