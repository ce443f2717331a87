"""How long, and in which positions, to reach a wanted heading: covariance analysis before any data are recorded.

The filter of `align_positions` is run on the log that an ideal IMU would give in each scheme of positions, for its covariance
alone: what the specification allows, over time. An error budget says which source is in the way.

Source: A. Gelb (ed.), *Applied Optimal Estimation*, 1974, chapter 7 (covariance analysis, error budgets).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.advice.better import Better, better
from truenorth.alignment.positions import ARM_SIGMA, SHORTEST_POSITION, prior_covariance
from truenorth.alignment.unsaid import as_usual
from truenorth.analysis.error_budget import Source, error_budget
from truenorth.core.earth import DEFLECTION
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.core.shown import Shown
from truenorth.core.units import significant
from truenorth.errors.staying import BA, BG, DV, PHI, QUIETEST_BASE, StaticModel
from truenorth.estimate.staying import StayingLog, prior_of
from truenorth.filters import LinearSystem, kalman
from truenorth.records.motion import Moving
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation import Axis, Indexed, Indexer, rest, simulate, steps
from truenorth.strapdown.inertial import earth_rotation, integrate

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

# Turns about the vertical between positions that share the time equally, deg.
SCHEMES: dict[str, tuple[float, ...]] = {
    "one position": (),
    "two positions, 180 deg apart": (180.0,),
    "four positions, 90 deg apart": (90.0, 90.0, 90.0),
}
SLEW = math.radians(10.0)  # rad/s
SHORTEST, LONGEST, TIMES = 60.0, 3600.0, 9  # s, and how many lengths are tried between
EPOCHS = 240  # of the filter, at least 1 s each
IDEAL_RATE = 5.0  # Hz
DISTURBANCE = 1e-4  # m/s: RMS velocity of a quiet base, over one second


@dataclass(frozen=True)
class SchemeAdvice:
    """What one scheme of positions reaches."""

    name: str
    time: Array  # (N,) s: lengths of data, turns included
    sigma: Array  # (N,) rad: one-sigma of heading after each
    reached: float | None  # s; length after which the wanted sigma is reached; None if not within the longest
    # part of each error source in the variance of heading, at `reached` or else at `least`; greatest first
    share: Mapping[str, float]

    @property
    def least(self) -> tuple[float, float]:
        """Length (s) with the smallest sigma (rad), and that: of biases that wander, more data is not always better."""
        k = int(np.argmin(self.sigma))
        return float(self.time[k]), float(self.sigma[k])


@dataclass(frozen=True, repr=False)
class Advice(Shown):
    """How to reach a heading.

    Attributes
    ----------
    wanted : float, rad
        One-sigma of heading.
    imu : ImuSpec
    position : Position
    disturbance : float, m/s
    schemes : tuple of SchemeAdvice
    would : Better or str
        The specification with which the nearest scheme reaches it, or what is in the way of every IMU; empty where one reaches it.
    """

    wanted: float
    imu: ImuSpec
    position: Position
    disturbance: float
    schemes: tuple[SchemeAdvice, ...]
    would: Better | str = ""

    @property
    def nearest(self) -> SchemeAdvice:
        """The scheme with the smallest sigma of all."""
        return min(self.schemes, key=lambda scheme: scheme.least[1])

    @property
    def best(self) -> SchemeAdvice | None:
        """The scheme that reaches the wanted sigma first; None if none does."""
        reaching = [scheme for scheme in self.schemes if scheme.reached is not None]
        return min(reaching, key=lambda scheme: scheme.reached or 0.0, default=None)

    @property
    def words(self) -> tuple[str, ...]:
        """The advice, scheme by scheme, the answer first."""
        lines = []
        best = self.best
        if best is not None:
            lines.append(f"{_angle(self.wanted)} of heading (one sigma): {best.name}, {best.reached:.0f} s in all")
        else:
            least = self.nearest
            lines.append(
                f"{_angle(self.wanted)} of heading (one sigma) is out of reach of IMU {self.imu.name!r} within "
                f"{least.time[-1]:.0f} s: {least.name} come nearest, {_angle(least.least[1])} after {least.least[0]:.0f} s; in "
                f"the way: {next(iter(least.share))}"
            )
            lines.append(self._what_would(least))
        for scheme in self.schemes:
            what, part = next(iter(scheme.share.items()))
            where = f"{scheme.reached:.0f} s" if scheme.reached is not None else "not reached"
            time, sigma = scheme.least
            lines.append(
                f"{scheme.name}: {where}; at best {_angle(sigma)}, after {time:.0f} s; {part:.0%} of the variance "
                f"{'then' if scheme.reached is not None else 'there'} is {what}"
            )
        return tuple(lines)

    def _what_would(self, scheme: SchemeAdvice) -> str:
        if isinstance(self.would, str):
            return f"what would reach it: no better IMU alone would, {self.would} is in the way"
        return (
            f"what would reach it: an IMU {significant(self.would.factor)} times as good ({self.would.words}), in {scheme.name}, "
            f"{scheme.least[0]:.0f} s"
        )

    def in_brief(self) -> dict[str, str]:
        """The answer, then scheme by scheme."""
        answer, *each = self.words
        return {"answer": answer} | dict(line.split(": ", 1) for line in each)

    def to_frame(self) -> pd.DataFrame:
        """One-sigma of heading (deg) over the length of data: scheme, time_s, heading_sigma_deg."""
        import pandas as pd

        rows = [(s.name, t, math.degrees(x)) for s in self.schemes for t, x in zip(s.time, s.sigma, strict=True)]
        return pd.DataFrame(rows, columns=["scheme", "time_s", "heading_sigma_deg"])

    def summary(self) -> dict[str, Any]:
        """One dictionary in datasheet units, ready for JSON."""
        return {
            "wanted_heading_sigma_deg": math.degrees(self.wanted),
            "imu": self.imu.name,
            "lat_deg": math.degrees(self.position.lat),
            "disturbance_m_s": self.disturbance,
            "best": None if self.best is None else self.best.name,
            "time_s": None if self.best is None else self.best.reached,
            "what_would": self.would or None
            if isinstance(self.would, str)
            else {
                "scheme": self.nearest.name,
                "time_s": self.nearest.least[0],
                "factor": self.would.factor,
                "sources": list(self.would.sources),
                "imu": self.would.imu.to_mapping(),
            },
            "schemes": [
                {
                    "name": scheme.name,
                    "time_s": scheme.time.tolist(),
                    "heading_sigma_deg": np.degrees(scheme.sigma).tolist(),
                    "reached_s": scheme.reached,
                    "share": dict(scheme.share),
                }
                for scheme in self.schemes
            ],
        }


def advise(
    imu: ImuSpec | str | PathLike[str] | dict[str, Any],
    position: Position | Sequence[float],
    heading_sigma: float,
    *,
    disturbance: float = DISTURBANCE,
    longest: float = LONGEST,
    rate: float = 100.0,
    schemes: Mapping[str, Sequence[float]] = SCHEMES,
    arm_sigma: float = ARM_SIGMA,
) -> Advice:
    """Say how long, and in which positions, an IMU needs for a wanted heading.

    Parameters
    ----------
    imu : ImuSpec, str, path or mapping
    position : Position, or (lat, lon[, alt]) in degrees and metres
    heading_sigma : float, rad
        Wanted one-sigma.
    disturbance : float, m/s
        RMS of the base's own velocity, its mean over one second, white.
    longest : float, s
        Of the lengths that are looked at.
    rate : float, Hz
        Of the IMU: noise that a specification gives for each sample is spread over it.
    schemes : mapping of str to sequence of float, deg
        Turns about the vertical between positions that share the time equally.
    arm_sigma : float, m
        How far the IMU may sit from the table's axis.

    Raises
    ------
    UsageError
        A sigma, disturbance or length that makes no sense.
    """
    for name, value, least in (
        ("heading_sigma", heading_sigma, 0.0),
        ("disturbance", disturbance, 0.0),
        ("rate", rate, 0.0),
        ("longest", longest, 2 * SHORTEST),
    ):
        if not (math.isfinite(value) and value > least):
            shown = f"{math.degrees(value):g} deg" if name == "heading_sigma" else f"{value:g}"
            raise UsageError(f"advise: {name} is {shown}; expected a number above {least:g}")
    if not schemes:
        raise UsageError("advise: no schemes; expected one at least, such as {'two positions': (180,)}")
    spec, position = as_usual(imu_spec(imu)).with_random_walks(1.0 / rate), Position.of(position)
    found = []
    for name, turns in schemes.items():
        time = np.geomspace(SHORTEST, longest, TIMES)
        lengths = [_Scheme(spec, position, turns, T, disturbance, arm_sigma) for T in time.tolist()]
        sigma = np.sqrt([length.heading_variance() for length in lengths])
        reached = _first(time, sigma, heading_sigma)
        at = lengths[int(np.argmin(sigma))]
        if reached is not None:
            at = _Scheme(spec, position, turns, reached, disturbance, arm_sigma)
        found.append(SchemeAdvice(name, time, sigma, reached, at.shares()))
    advice = Advice(heading_sigma, spec, position, disturbance, tuple(found))
    if advice.best is not None:
        return advice
    name, T = advice.nearest.name, advice.nearest.least[0]

    def evaluate(other: ImuSpec) -> tuple[float, Mapping[str, float]]:
        scheme = _Scheme(other, position, schemes[name], T, disturbance, arm_sigma)
        return scheme.heading_variance(), scheme.shares()

    return replace(advice, would=better(spec, heading_sigma, evaluate))


class _Scheme:
    """The filter's model of an ideal log of a scheme of some length."""

    def __init__(
        self, spec: ImuSpec, position: Position, turns: Sequence[float], T: float, disturbance: float, arm_sigma: float
    ) -> None:
        self.position, self.T = position, T
        P_bias = prior_covariance(spec, position)
        self.prior = prior_of(P_bias, spec=spec, arm=np.zeros(3), arm_sigma=arm_sigma)
        self.model = StaticModel.of(spec)
        self.record = simulate(_motion(position, turns, T), rate=IDEAL_RATE, duration=T).record
        self.interval = max(1.0, T / EPOCHS)
        self.integrals = integrate(self.record, self.interval)
        self.base = (disturbance**2 / self.integrals.intervals)[:, None, None] * np.eye(3)
        self.base += QUIETEST_BASE**2 * np.eye(3)

    def system(self, model: StaticModel) -> LinearSystem:
        """With some noise of the sensors."""
        C = rest(self.position).states(np.array(0.0)).C_nb
        log = StayingLog(self.record, C, self.position, model, self.prior, self.interval, integrals=self.integrals)
        system = log.linearise()
        return system.with_arrays(R=system.R + self.base - QUIETEST_BASE**2 * np.eye(3))

    def heading_variance(self) -> float:
        """At the end, deflection of the vertical included, rad^2."""
        P = kalman(self.system(self.model), innovations=False).state.P
        return self.about_vertical(P) + _deflected(self.position)

    def shares(self) -> dict[str, float]:
        """Parts of the sources in the variance of heading at the end, greatest first."""
        budget = error_budget(self.system(self.model), self.sources())
        parts = {name: self.about_vertical(P[-1]) for name, P in zip(budget.sources, budget.P, strict=True)}
        parts["deflection of the vertical"] = _deflected(self.position)
        total = sum(parts.values())
        return {name: part / total for name, part in sorted(parts.items(), key=lambda item: -item[1])}

    def sources(self) -> dict[str, Source]:
        """What the model is made of."""
        matrices, arm = self.prior.groups["matrices"], self.prior.groups["arm"]
        middle = (matrices.start + matrices.stop) // 2
        parts = {
            "initial attitude and velocity": (PHI, DV),
            "gyro bias": (BG,),
            "accelerometer bias": (BA,),
            "gyro scale factors and misalignments": (slice(matrices.start, middle),),
            "accelerometer scale factors and misalignments": (slice(middle, matrices.stop),),
            "lever arm": (arm,),
        }
        sources = {name: Source(P0=_part(self.prior.P, slices)) for name, slices in parts.items()}
        names = ("gyro noise", "accelerometer noise", "gyro bias instability", "accelerometer bias instability")
        for name, which, walk in zip(names, np.eye(4), astuple(self.model), strict=True):
            one = self.system(StaticModel(*(walk * which).tolist()))
            sources[name] = Source(Q=one.Q, R=one.R - self.base, S=one.S)
        sources["motion of the base"] = Source(R=self.base)
        return sources

    def about_vertical(self, P: Array) -> float:
        """Variance of phi about the vertical of the end, of a covariance of states in n0."""
        up = earth_rotation(self.T, self.position.lat)[:, 2]
        return float(up @ P[PHI, PHI] @ up)


def _motion(position: Position, turns: Sequence[float], T: float) -> Moving:
    if not turns:
        return rest(position)
    slews = sum(abs(math.radians(turn)) / SLEW + 0.5 for turn in turns)
    dwell = (T - slews) / (len(turns) + 1)
    if dwell < SHORTEST_POSITION:
        raise UsageError(
            f"advise: {len(turns) + 1} positions in {T:.0f} s leave {dwell:.1f} s for each; expected "
            f"{SHORTEST_POSITION:g} s at least"
        )
    angles = [(0, math.radians(turn)) for turn in turns]
    (axis,) = steps(angles, dwell=dwell, duration=T, rate=SLEW, start=(0.0,))
    return Indexed(rest(position), Indexer((Axis("z", axis),)))


def _part(P0: Array, slices: Sequence[slice]) -> Array:
    part = np.zeros_like(P0)
    for here in slices:
        part[here, here] = P0[here, here]
    return part


def _deflected(position: Position) -> float:
    return float((DEFLECTION * math.tan(position.lat)) ** 2)


def _first(time: Array, sigma: Array, wanted: float) -> float | None:
    """When the curve first comes down to `wanted`, by a power law between neighbours."""
    below = np.flatnonzero(sigma <= wanted)
    if below.size == 0:
        return None
    k = int(below[0])
    if k == 0:
        return float(time[0])
    x, y = np.log(time[k - 1 : k + 1]), np.log(sigma[k - 1 : k + 1])
    return float(np.exp(x[0] + (math.log(wanted) - y[0]) * (x[1] - x[0]) / (y[1] - y[0])))


def _angle(x: float) -> str:
    degrees = math.degrees(x)
    return f"{degrees:.2f} deg" if degrees >= 0.5 else f"{60 * degrees:.2f} arcmin"
