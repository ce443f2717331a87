"""Where each error state stands: fifteen of the INS in one order, then groups by name."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

PHI = slice(0, 3)
DV = slice(3, 6)
DP = slice(6, 9)
BG = slice(9, 12)
BA = slice(12, 15)
STATES = 15

SLOW_GYRO, SLOW_ACCEL = "slow gyro bias", "slow accelerometer bias"
GYRO_AXES, ACCEL_AXES = "gyro axes", "accelerometer axes"
ANTENNA_ARM = "GNSS lever arm"


@dataclass(frozen=True)
class Layout:
    """Groups of error states behind the fifteen of the INS, in order."""

    names: tuple[str, ...] = ()  # of the groups
    priors: tuple[tuple[float, ...], ...] = ()  # one-sigma of each of their states at the start

    @cached_property
    def states(self) -> int:
        """How many."""
        return STATES + sum(map(len, self.priors))

    @cached_property
    def groups(self) -> dict[str, slice]:
        """Where the states of each group stand."""
        found, start = {}, STATES
        for name, prior in zip(self.names, self.priors, strict=True):
            found[name] = slice(start, start + len(prior))
            start += len(prior)
        return found

    def slice_of(self, name: str) -> slice | None:
        """Where the states of this group stand; None where there is no such group."""
        return self.groups.get(name)

    def first_of(self, name: str) -> int:
        """The first state of this group, -1 where there is none: for kernels."""
        found = self.slice_of(name)
        return -1 if found is None else int(found.start)
