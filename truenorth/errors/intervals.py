"""A trajectory as the error models take it: its means over intervals."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Intervals:
    """K intervals, and the means over each of what errors are linearised about, in ENU.

    Attributes
    ----------
    T : (K,) array, s
    C_nb : (K, 3, 3) array
    f_n, v_n : (K, 3) arrays, m/s^2 and m/s
    lat, alt : (K,) arrays, rad and m
    w_ib_b : (K, 3) array, rad/s
        Needed for scale factors and misalignments of the gyros; zeros when left out.
    """

    T: Array
    C_nb: Array
    f_n: Array
    v_n: Array
    lat: Array
    alt: Array
    w_ib_b: Array = field(default_factory=lambda: np.zeros((1, 3)))

    def __post_init__(self) -> None:
        object.__setattr__(self, "w_ib_b", np.broadcast_to(self.w_ib_b, np.shape(self.f_n)))
        for given in fields(self):
            object.__setattr__(self, given.name, np.ascontiguousarray(getattr(self, given.name), dtype=np.float64))

    @property
    def axis(self) -> Array:
        """(K, 3) the earth's axis, east, north, up."""
        return np.stack([np.zeros_like(self.lat), np.cos(self.lat), np.sin(self.lat)], axis=-1)
