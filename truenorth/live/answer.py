"""What a live run knows now: attitude with its uncertainty and verdict; under way velocity and place as well."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.result import Alignment
from truenorth.core.attitude import angle_text, euler_from_dcm
from truenorth.live.intake import Counts
from truenorth.live.remaining import seconds_to
from truenorth.state.layout import DP
from truenorth.state.track import velocity_sigma

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Where a vehicle is and how it moves.

    Attributes
    ----------
    v_n : (3,) array, m/s
        East, north, up.
    position : (3,) array
        Latitude, longitude (rad), height (m).
    v_sigma, position_sigma : (3,) arrays, m/s and m
        One sigma, east, north, up. NaN of a vertical velocity that nothing shows: where height is held it is taken for zero.
    """

    v_n: Array
    position: Array
    v_sigma: Array
    position_sigma: Array

    @classmethod
    def of(cls, found: Alignment) -> Motion:
        """At the epoch of an alignment on the move."""
        state = found.moving or found.transfer
        assert state is not None
        at = found.position
        return cls.known(state.v_n, np.array([at.lat, at.lon, at.alt]), np.sqrt(np.diag(state.P)))

    @classmethod
    def known(cls, v_n: Array, position: Array, sigma: Array) -> Motion:
        """With the sigmas of a filter's states, whose vertical velocity has none where height is held."""
        return cls(v_n, position, velocity_sigma(sigma), sigma[DP].copy())

    def summary(self) -> dict[str, Any]:
        """The part of :meth:`Answer.summary`."""
        return {
            "lat_deg": float(np.degrees(self.position[0])),
            "lon_deg": float(np.degrees(self.position[1])),
            "alt_m": float(self.position[2]),
            "position_sigma_m": self.position_sigma.tolist(),
            "v_n_m_s": self.v_n.tolist(),
            "v_n_sigma_m_s": [sigma if math.isfinite(sigma) else None for sigma in self.v_sigma.tolist()],
        }


@dataclass(frozen=True)
class Answer:
    """What is known now.

    Attributes
    ----------
    time : float, s
        Of the newest row.
    C_nb : (3, 3) array
    sigma, floor : (3,) arrays, rad
        Of heading, pitch, roll; the floor is the part that waiting does not improve.
    status : str
        Of the last solution, see :class:`truenorth.Alignment`; under way ``navigated``, ``inconsistent``, or ``lost`` after a gap
        that is too long.
    reasons : tuple of str
    solution : Alignment or None
        The last one, at its own epoch; None for navigation from a start that no alignment gave.
    counts : Counts
        Rows taken and left out.
    left : float or None, s
        When the base began to leave its place; the solution ends there, and the gyros carry it on.
    motion : Motion or None
        Under way.
    """

    time: float
    C_nb: Array
    sigma: Array
    floor: Array
    status: str
    reasons: tuple[str, ...]
    solution: Alignment | None
    counts: Counts
    left: float | None = None
    motion: Motion | None = None

    def __repr__(self) -> str:
        angles = zip(("heading", "pitch", "roll"), np.degrees(self.euler), self.sigma, strict=True)
        shown = [
            f"{name}: {angle:.4f}° ± {angle_text(float(sigma))}"
            for name, angle, sigma in angles
            if name != "heading" or self.heading_known
        ]
        return f"Answer(status: {self.status}, time: {self.time:.3f} s, {', '.join(shown)})"

    @property
    def euler(self) -> Array:
        """(3,) heading, pitch, roll, rad."""
        return np.array(euler_from_dcm(self.C_nb))

    @property
    def heading_known(self) -> bool:
        """Whether the heading may be used."""
        return self.status in ("aligned", "navigated")

    def remaining(self, goal: float) -> float | None:
        """Seconds until the one-sigma heading error comes down to `goal` (rad); 0: it has; None: it will not."""
        if self.solution is None or self.status == "navigated":
            return 0.0 if self.sigma[0] <= goal else None
        return seconds_to(self.solution, float(self.sigma[0]), goal, self.time)

    def summary(self) -> dict[str, Any]:
        """One flat dictionary in degrees, ready for JSON; a heading that may not be used is None."""
        heading, pitch, roll = np.degrees(self.euler)
        heading_sigma, pitch_sigma, roll_sigma = np.degrees(self.sigma)
        return {
            "time_s": self.time,
            "status": self.status,
            "heading_deg": float(heading) if self.heading_known else None,
            "pitch_deg": float(pitch),
            "roll_deg": float(roll),
            "heading_sigma_deg": float(heading_sigma),
            "pitch_sigma_deg": float(pitch_sigma),
            "roll_sigma_deg": float(roll_sigma),
            "heading_sigma_floor_deg": float(np.degrees(self.floor[0])),
            "solution_time_s": None if self.solution is None else self.solution.time,
            "reasons": list(self.reasons),
            "rows": self.counts.taken,
            "rows_left_out": self.counts.left_out,
            **({} if self.motion is None else self.motion.summary()),
        }


def under_way(found: Alignment) -> bool:
    """Whether an alignment holds for a vehicle that moves: it has a velocity."""
    return found.moving is not None or found.transfer is not None
