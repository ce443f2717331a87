"""Fixes from outside as measurements of the errors of a course: what they show, which are taken, what is left of them.

A fix is one measurement: of a place both axes are taken, or none. It is weighed by itself, behind the log's row of its epoch,
against what the filter expects of it, or what the bands do where these are wider: bands know errors of the log that the filter
does not. Which fix is taken depends on those before it, which the bands have to know: after as many passes as there are fixes
both agree, mostly after one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from truenorth.aiding.fixes import AZIMUTH, PLACE, Fixes
from truenorth.analysis.chi_square import chi_square_limit
from truenorth.core import earth
from truenorth.core.errors import DataError
from truenorth.damping.course import motion_at, place_at
from truenorth.errors.marine import DP, PHI
from truenorth.filters import FilterState, LinearSystem, kalman
from truenorth.state.limits import limit
from truenorth.state.track import Residuals, Track

Array = NDArray[np.float64]
ROWS = [DP.start, DP.start + 1, PHI.stop - 1]  # states that they show: place east, north, heading
ANYWHERE = np.array([earth.SEMI_MAJOR, earth.SEMI_MAJOR, math.pi])  # one sigma, m and rad, of what is not known at all
BOUNDLESS = 1e12  # m or rad: with errors as large as this every fix is taken


@dataclass(frozen=True)
class FixRows:
    """Fixes in order of time, (M,) and (M, 3): place error east, north (m), heading error (rad).

    Attributes
    ----------
    epoch : (M,) array of int
        From the switch on, that being 0.
    time : (M,) array, s
        Their own.
    z : (M, 3) array
        The course less the fix; NaN where it shows nothing.
    sigma : (M, 3) array
        Of the fixes.
    least : (M, 3) array
        One sigma, at least, of the error of the answer before each fix; zero where the filter knows it.
    anew : bool
        What a fix shows begins anew with it, as if nothing had been known of it: of methods that do not know how wrong they are.
    """

    epoch: NDArray[np.int64]
    time: Array
    z: Array
    sigma: Array
    least: Array
    anew: bool = False

    @staticmethod
    def rows(states: int) -> Array:
        """(3, n) what a fix shows of this many states."""
        return np.eye(states)[ROWS]

    def some(self, kept: NDArray[np.bool_]) -> FixRows:
        """Some of them."""
        rows = {name: getattr(self, name)[kept] for name in ("epoch", "time", "z", "sigma", "least")}
        return replace(self, **rows)

    def expected(self, errors: Array) -> FixRows:
        """With the errors (K+1, 7), one sigma from the switch on, that the answer has before each fix."""
        return replace(self, least=errors[self.epoch - 1][:, ROWS])

    def unasked(self) -> FixRows:
        """The same, taken whatever they say."""
        return replace(self, least=np.full(self.z.shape, BOUNDLESS))

    def unknown(self, there: NDArray[np.bool_], states: int) -> Array:
        """(..., n, n) what a covariance has in addition before fixes that show these (..., 3); nothing where none begins anew."""
        rows = self.rows(states)
        return np.asarray(rows.T @ ((self.anew * there * ANYWHERE**2)[..., None] * rows))

    def sigma_of_steps(self, stride: int, count: int) -> Array:
        """(count, 3) of all fixes within each step of `stride` epochs, weighed together; infinite where there is none.

        Where what they show begins anew, the last one of a step counts.
        """
        information = np.zeros((count, 3))
        for k, z, size in zip((self.epoch - 1) // stride, self.z, self.sigma, strict=True):
            there = np.isfinite(z)
            if k < count:
                information[k, there] = size[there] ** -2.0 + (0.0 if self.anew else information[k, there])
        with np.errstate(divide="ignore"):
            sigma: Array = information**-0.5
        return sigma


def fixes_on(course: Track, seen: Track, fixes: Fixes, start: int, *, anew: bool = False) -> FixRows | None:
    """Fixes as errors of a course at their own times, given to the nearest epochs after the switch; None without any.

    Parameters
    ----------
    course : Track
    seen : Track
        The same with more epochs, by which the fixes are compared.
    start : int
        Epoch of the switch.
    anew : bool
        What they show begins anew with them.

    Raises
    ------
    DataError
        A fix before the switch or after the end.
    """
    times = [*(fix.time for fix in fixes.positions), *(fix.time for fix in fixes.azimuths)]
    if not times:
        return None
    epochs = np.array([_epoch(course, time, start) for time in times])
    shown, sigma = np.full((len(times), 3), np.nan), np.empty((len(times), 3))
    for row, fix in enumerate(fixes.positions):
        lat, lon, alt = place_at(seen, fix.time)
        R_M, R_N = earth.radii(lat)
        apart = math.remainder(lon - fix.lon, 2.0 * math.pi)
        shown[row, :2] = apart * (R_N + alt) * math.cos(lat), (lat - fix.lat) * (R_M + alt)
        sigma[row] = fix.sigma
    for row, turn in enumerate(fixes.azimuths, len(fixes.positions)):
        C_nb = motion_at(seen, np.array([turn.time]))[0][0]
        heading = math.atan2(C_nb[0, 1], C_nb[1, 1])
        shown[row, 2], sigma[row] = math.remainder(heading - turn.heading, 2.0 * math.pi), turn.sigma
    order = np.argsort(times, kind="stable")
    return FixRows(
        epochs[order],
        np.array(times)[order],
        shown[order],
        sigma[order],
        np.zeros(shown.shape),
        anew,
    )


def _epoch(course: Track, time: float, start: int) -> int:
    """From the switch on; a time before it or after the end is refused."""
    epoch = round((time - course.time[0]) / course.interval)
    if not start < epoch < len(course):
        raise DataError(
            f"a fix at {time:.1f} s; damping runs from {course.time[start]:.1f} s to {course.time[-1]:.1f} s"
        )
    return epoch - start


class Weighed:
    """What a method made of its fixes: innovations and their sigma (M, 3), NIS (M,), which it took (M,)."""

    def __init__(self, fixes: FixRows) -> None:
        self.fixes = fixes
        self.innovation, self.sigma = np.full((2, *fixes.z.shape), np.nan)
        self.nis, self.used = np.zeros(len(fixes.z)), np.zeros(len(fixes.z), dtype=bool)

    def take(self, number: int, state: FilterState) -> FilterState:
        """The filter behind one fix: all of it is taken, or none."""
        fixes, there = self.fixes, np.isfinite(self.fixes.z[number])
        n = state.x.shape[-1]
        H = fixes.rows(n)[there]
        z, R = fixes.z[number, there], np.diag(fixes.sigma[number, there] ** 2)
        if not self._weigh(number, z - H @ state.x, H @ state.P @ H.T):
            return state
        Q = fixes.unknown(there, n)
        system = LinearSystem(np.eye(n)[None], Q[None], H[None], R[None], z[None], np.zeros(n), state.P)
        after = kalman(system, replace(state, memory=np.zeros(0))).state
        return replace(after, memory=state.memory)  # of the gate of the log's rows

    def put_right(self, number: int, x: Array) -> Array:
        """(3,) what a fix takes off errors (7,) of which nobody but the bands knows the size; zero where it is rejected."""
        z = self.fixes.z[number]
        there = np.isfinite(z)
        off = np.where(there, z - x[ROWS], 0.0)
        return off * self._weigh(number, off[there], np.zeros((there.sum(), there.sum())))

    def _weigh(self, number: int, nu: Array, P: Array) -> bool:
        """Whether a fix is taken, by its innovations and the covariance of what was expected of it, or that of the bands."""
        fixes, there = self.fixes, np.isfinite(self.fixes.z[number])
        wider = np.maximum(fixes.least[number, there] ** 2 - np.diag(P), 0.0)
        S = P + np.diag(wider + fixes.sigma[number, there] ** 2)
        self.innovation[number, there], self.sigma[number, there] = nu, np.sqrt(np.diag(S))
        self.nis[number] = nu @ np.linalg.solve(S, nu)
        self.used[number] = self.nis[number] <= chi_square_limit(limit("log's gate"), int(there.sum()))
        return bool(self.used[number])

    def residuals(self) -> list[Residuals]:
        """Of places and of headings, each a source as any other."""
        found = []
        for name, unit, axes, columns in (
            (PLACE, "m", ("east", "north", "up"), [0, 1]),
            (AZIMUTH, "rad", ("heading",), [2]),
        ):
            own = np.isfinite(self.fixes.z[:, columns]).all(axis=1)
            if not own.any():
                continue
            nu, sigma = np.full((2, own.sum(), 3), np.nan)
            nu[:, : len(columns)] = self.innovation[own][:, columns]
            sigma[:, : len(columns)] = self.sigma[own][:, columns]
            time, jumped = self.fixes.time[own], np.zeros(own.sum(), dtype=bool)
            found.append(
                Residuals(name, time, nu, sigma, self.nis[own], self.used[own], 0, time, jumped, unit=unit, axes=axes)
            )
        return found
