"""A solution carried on to the newest row, until the next one is there; and whether the base has left its place meanwhile.

On a base that stays the filter of the solution goes on, or the gyros alone do (:mod:`.carry`); on the move the closed loop does
(:mod:`.navigator`), aided by what comes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment import Alignment
from truenorth.alignment.in_motion_task import usual_antenna
from truenorth.core.attitude import angle_text, euler_sigma
from truenorth.live.answer import Answer, Motion, under_way
from truenorth.live.carry import Carry
from truenorth.live.feed import Feed
from truenorth.live.intake import Counts
from truenorth.live.log import Kind
from truenorth.live.navigator import Navigator
from truenorth.live.recent import Recent
from truenorth.navigation.given import late_as_found
from truenorth.navigation.start import start_of
from truenorth.state.mounting import Mounting

Array = NDArray[np.float64]

UNKNOWN = {"gnss": usual_antenna(None)}  # an antenna of which nothing is said: as the alignment takes it
SETTLED = 20.0  # s after a solution, from which a drive that began in its rows would have been noticed
BACK = 10.0  # s before a solution's end, from which its filter may need rows
RECENT = 200.0  # s of the newest rows that are kept as they came: a drive is noticed within a minute


def as_found(start: Alignment) -> dict[str, Mounting]:
    """How antennas of which nothing is said are mounted: as late as the alignment has found them."""
    begin = start_of(start, None)[0]
    return {key: late_as_found(antenna, begin) for key, antenna in UNKNOWN.items()}


class Onward:
    """From the last solution to the newest row.

    Parameters
    ----------
    kind : {"rates", "increments"}
        Of the rows.
    """

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.solution: Alignment | None = None
        self.carry: Carry | None = None
        self.earlier: Carry | None = None  # of the solution before, which knows no row of a drive that has just begun
        self.mover: Navigator | None = None  # on the move
        self.newest = Recent()  # rows of the last `RECENT`, and what a running solution lacks
        self.left: float | None = None  # s: when the base began to leave its place
        self.gap_before = -np.inf  # s: the last gap before it did
        self.until_then = ""  # how well heading was known when it did

    def add(self, block: Array, since: float, gap: float) -> None:
        """Carry on over a block of rows.

        Parameters
        ----------
        block : (K, 7) array
        since : float, s
            Older rows are not needed again.
        gap : float, s
            The last gap in the rows that cannot be bridged.
        """
        self.newest.add(block)
        self.newest.forget(since)
        if self.mover is not None:
            push(self.mover, block)
        for carry in (self.earlier, self.carry):
            if carry is None:
                continue
            carry.add(block)
            if self.left is None and carry.left is not None:
                self.carry, self.earlier, self.solution = carry, None, carry.solution
                self._leave(carry.left, carry.solution, gap)

    def kept(self) -> dict[str, Any]:
        """What it goes on from; the closed loop begins again at the solution."""
        return {name: value for name, value in vars(self).items() if name != "mover"}

    def lose(self) -> None:
        """Nothing is known any more: what the base did in a gap, nobody knows."""
        self.solution = self.carry = self.earlier = None

    def take_over(self, found: Alignment, feeds: Mapping[str, Feed], *, turned: bool, gap: float) -> None:
        """Begin at a new solution; `turned`: something turns the IMU on a base that stays, so that only solutions say more."""
        before, self.solution = self.solution, found
        if found.moving is not None and before is not None and not under_way(before) and self.left is None:
            drives = [time for feed in feeds.values() if (time := feed.moves_from()) is not None]
            self._leave(min(drives), before, gap)
        if under_way(found):
            self.carry = self.earlier = self.mover = None
            if found.heading_known:
                # A master's solution knows the vertical motion, which goes on: held height would say that there is none.
                self.mover = self.navigator(found, feeds, altitude=None if found.transfer is None else "free")
        elif self.earlier is None or self.carry is None or self.carry.elapsed > SETTLED:
            self.earlier = self.carry
        if not under_way(found) and not turned:
            self.carry = Carry(found, self.kind)
        for block in self.newest:
            if block[-1, 0] < found.time - BACK:
                continue
            if self.mover is not None:
                push(self.mover, block)
            if self.carry is not None:
                self.carry.add(block)

    def navigator(self, start: Alignment, feeds: Mapping[str, Feed], **options: Any) -> Navigator:
        """One that begins at an alignment, with no row of the IMU yet."""
        return Navigator(start, feeds=list(feeds.values()), mountings=as_found(start), kind=self.kind, **options)

    def answer(self, reasons: Callable[[Alignment], tuple[str, ...]], counts: Counts) -> Answer | None:
        """What is known at the newest row; `reasons`: what there is to say of a solution. None before the first one."""
        at = self.solution
        if at is None:
            return None
        floor = np.asarray(at.euler_sigma_floor)
        now = None if self.mover is None else self.mover.answer
        if now is not None:
            status = at.status if now.status == "navigated" else now.status
            more = (*reasons(at), *now.reasons)
            return replace(now, status=status, floor=floor, reasons=more, counts=counts, left=self.left)
        time, C_nb, phi = at.time, at.C_nb, at.phi_covariance
        if self.carry is not None:
            time, C_nb, phi = self.carry.now()
        lost = "" if self.mover is None else self.mover.failure  # at its first row
        return Answer(
            time=time,
            C_nb=C_nb,
            sigma=euler_sigma(C_nb, phi),
            floor=floor,
            status="lost" if lost else at.status,
            reasons=(*reasons(at), lost) if lost else reasons(at),
            solution=at,
            counts=counts,
            left=self.left,
            motion=Motion.of(at) if under_way(at) else None,
        )

    def _leave(self, time: float, solution: Alignment, gap: float) -> None:
        """The base has left its place."""
        self.left, self.gap_before = time, gap
        sigma = angle_text(float(solution.euler_sigma[0]))
        self.until_then = (
            f"heading was known to {sigma} (one sigma)" if solution.heading_known else "heading was not known"
        )


def push(navigator: Navigator, block: Array) -> None:
    """Push rows ``time, gyro (3), accel (3)``."""
    navigator.push(block[:, 0], block[:, 1:4], block[:, 4:])
