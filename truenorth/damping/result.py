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
from truenorth.damping.switching import Switching
from truenorth.errors.log import DRIFT

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LogHistory:
    """Errors of the speed log as the augmented filter found them, behind them the deflection of the vertical."""

    time: Array  # (K,) s
    names: tuple[str, ...]  # tuples of str; of each state; a name stands as often as its group has states
    units: tuple[str, ...]  # tuples of str
    x: Array  # (K
    sigma: Array  # m)

    def last(self, name: str) -> tuple[Array, Array]:
        """Values and one-sigma at the end, empty where there is no such group."""
        own = [i for i, n in enumerate(self.names) if n == name]
        return self.x[-1, own], self.sigma[-1, own]


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
        Of the loop of a network, or of the undamped INS; of a filter none.
    rejected : int
        Measurements that the filter's gate kept out.
    length : float, s
        From the switch to the end: what separates lines.
    time : (K,) array, s
        Of the epochs from the switch on.
    switching : Switching or None
        Of internal damping.
    log : LogHistory or None
        What the augmented filter found of the log.
    weight : (K, n) array or None
        Of filter 1 in the fusion, from the switch on.
    """

    damper: Damper
    switch: float
    reference: Reference | None = field(repr=False)
    before: Spectrum | None = field(repr=False)
    after: Spectrum | None = field(repr=False)
    lines: tuple[float, float]
    modes: tuple[Mode, ...] = field(repr=False)
    rejected: int = 0
    length: float = np.inf
    time: Array = field(default_factory=lambda: np.zeros(0), repr=False)
    switching: Switching | None = field(default=None, repr=False)
    log: LogHistory | None = field(default=None, repr=False)
    weight: Array | None = field(default=None, repr=False)

    @property
    def reference_error(self) -> Array | None:
        """(2,) drift of the log east, north at the end as the augmented filter found it, m/s; None: it has none."""
        return None if self.log is None or DRIFT not in self.log.names else self.log.last(DRIFT)[0]

    @property
    def reference_error_sigma(self) -> Array | None:
        """(2,) one-sigma of it, m/s."""
        return None if self.log is None or DRIFT not in self.log.names else self.log.last(DRIFT)[1]

    def in_words(self) -> str:
        """One line: method, switch, the lines it had, and what the log's error was found to be."""
        parts = [f"{self.damper.method} from {self.switch:.0f} s on"]
        if not np.isnan(self.lines[0]):
            apart = 0.5 * self.lines[1] ** 2 / self.length  # half of what the log's length can separate
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
        said: dict[str, Any] = {
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
            said["reference"] = {
                "noise_m_s": self.reference.noise,
                "outliers": self.reference.outliers,
                "jumps": [list(jump) for jump in self.reference.jumps],
                "gaps": [list(gap) for gap in self.reference.gaps],
                "rejected": self.rejected,
            }
        if self.reference_error is not None and self.reference_error_sigma is not None:
            said["reference_error_m_s"] = self.reference_error.tolist()
            said["reference_error_sigma_m_s"] = self.reference_error_sigma.tolist()
        if self.log is not None:
            ends = {name: self.log.last(name) for name in self.log.names}
            said["log"] = {name: {"value": x.tolist(), "sigma": e.tolist()} for name, (x, e) in ends.items()}
        if self.switching is not None:
            said["switches"] = [s._asdict() for s in self.switching.switches]
        return said
