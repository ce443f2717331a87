"""What damping did to a navigation: method, reference, spectra, modes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.damping.loop import Mode
from truenorth.damping.options import Damper
from truenorth.damping.reference import Reference
from truenorth.damping.spectrum import Spectrum

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Damping:
    """What damping did to a navigation.

    Attributes
    ----------
    damper : Damper
    switch : float, s
        When it was switched on.
    reference : Reference or None
    before, after : Spectrum or None
        Of the velocity, east + i north, less the reference's where there is one: undamped and damped, from the switch on.
    lines : (float, float)
        Periods of the undamped Schuler lines, s; NaN in a short log.
    modes : tuple of Mode
        Of the loop, for networks; of the undamped INS otherwise.
    reference_error, reference_error_sigma : (2,) arrays or None, m/s
        The reference's constant error east, north as the 15-state filter found it.
    rejected : int
        Measurements that the filter's gate kept out.
    length : float, s
        From the switch to the end: what tells lines apart.
    """

    damper: Damper
    switch: float
    reference: Reference | None = field(repr=False)
    before: Spectrum | None = field(repr=False)
    after: Spectrum | None = field(repr=False)
    lines: tuple[float, float]
    modes: tuple[Mode, ...] = field(repr=False)
    reference_error: Array | None = None
    reference_error_sigma: Array | None = None
    rejected: int = 0
    length: float = np.inf

    def in_words(self) -> str:
        """One line: method, switch, the lines it had, and what the log's error was found to be."""
        parts = [f"{self.damper.method} from {self.switch:.0f} s on"]
        if not np.isnan(self.lines[0]):
            apart = 0.5 * self.lines[1] ** 2 / self.length  # half of what the log's length can tell apart
            lines = " and ".join(f"{x / 60.0:.1f}" for x in self.lines)
            parts.append(f"undamped Schuler lines at {lines} min (to {apart / 60.0:.1f} min)")
        if self.reference is not None:
            parts.append(f"log noise {self.reference.noise:.3f} m/s")
        if self.reference_error is not None and self.reference_error_sigma is not None:
            found = zip(("east", "north"), self.reference_error, self.reference_error_sigma)
            parts.append("log error " + ", ".join(f"{axis} {x:+.3f} ± {e:.3f} m/s" for axis, x, e in found))
        return "; ".join(parts)

    def summary(self) -> dict[str, Any]:
        """One dictionary, ready for JSON."""
        told: dict[str, Any] = {
            "method": self.damper.method,
            "switch_s": self.switch,
            "schuler_periods_min": [None if np.isnan(x) else x / 60.0 for x in self.lines],
            "modes": [
                {
                    "name": m.name,
                    "period_min": m.period / 60.0 if np.isfinite(m.period) else None,
                    "damping_ratio": m.damping,
                }
                for m in self.modes
                if m.name != "still"
            ],
        }
        if self.reference is not None:
            told["reference"] = {
                "noise_m_s": self.reference.noise,
                "outliers": self.reference.outliers,
                "jumps": [list(jump) for jump in self.reference.jumps],
                "gaps": [list(gap) for gap in self.reference.gaps],
                "rejected": self.rejected,
            }
        if self.reference_error is not None and self.reference_error_sigma is not None:
            told["reference_error_m_s"] = self.reference_error.tolist()
            told["reference_error_sigma_m_s"] = self.reference_error_sigma.tolist()
        return told
