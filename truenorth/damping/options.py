"""How a navigation is to be damped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from truenorth.core.errors import UsageError

Method = Literal["none", "internal", "external", "kalman", "double", "augmented"]


@dataclass(frozen=True)
class Damper:
    """A damping method and its figures.

    Attributes
    ----------
    method : {"none", "internal", "external", "kalman", "double", "augmented"}
        None: the free INS, with its spectrum; a network without a reference; with one; filter 1; the paper's double filter;
        fifteen states and more, which estimate the errors of the log.
    ratio : float
        Damping ratio of the networks.
    azimuth : float
        Damping ratio of the 24 h oscillation, of the external network; 0: none.
    start : float, s
        After the beginning of navigation, when it is switched on.
    order : {1, 2}
        Of the networks.
    ramp : float, s
        In which a network goes from undamped to damped; its bands are those of an abrupt switch.
    switching : bool
        Internal damping is switched off in manoeuvres, see :mod:`truenorth.damping.switching`.
    """

    method: Method = "augmented"
    ratio: float = 0.5
    azimuth: float = 0.0
    start: float = 0.0
    ramp: float = 0.0
    order: Literal[1, 2] = 2
    switching: bool = True

    def __post_init__(self) -> None:
        if self.method not in get_args(Method):
            raise UsageError(f"damping {self.method!r}; expected one of {', '.join(get_args(Method))}")
        if not 0.0 < self.ratio < 1.0:
            raise UsageError(f"damping ratio {self.ratio:g}; expected between 0 and 1, such as 0.5")
        if not 0.0 <= self.azimuth < 1.0:
            raise UsageError(f"azimuth damping ratio {self.azimuth:g}; expected 0 to below 1")
        if self.azimuth > 0.0 and self.method != "external":
            raise UsageError(
                f"azimuth damping with damping {self.method}; expected damping external: it needs a reference"
            )
        if not self.start >= 0.0:
            raise UsageError(
                f"damping starts at {self.start:g} s; expected zero or later, from the beginning of navigation"
            )
        if self.order not in (1, 2):
            raise UsageError(f"network of order {self.order}; expected 1 or 2")
        if not self.ramp >= 0.0:
            raise UsageError(f"damping with a ramp of {self.ramp:g} s; expected zero or more")

    @property
    def needs_reference(self) -> bool:
        """Whether it works without a velocity log."""
        return self.method not in ("none", "internal")
