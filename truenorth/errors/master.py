"""Groups of transfer alignment: what a slave does not know of its master, and the model they make with the INS.

| group | states | unit |
| --- | --- | --- |
| `DELAY` | delay of the master beyond the known one: true minus assumed | s |
| `ARM` | lever arm from the master to the slave, slave axes: true minus assumed | m |
| `FILTER` | a filter of its velocity: mean delay beyond its attitude's, variance / 2, third moment / 6 | s, s^2, s^3 |
| `MOUNTING` | mounting of the slave on the master, master axes: ``C_mb = (I + [mu x]) C_mb_assumed`` | rad |
| `FLEXURE` | the slave's seat turned against the rigid body, slave axes; behind it its rate | rad, rad/s |
| `BENDING` | how far its end moves for what it turns, by axis (:mod:`truenorth.errors.bending`) | 1 |
| `GYRO_AXES`, `ACCEL_AXES` | scale factors and misalignments of the slave's sensors, by rows (:mod:`truenorth.errors.axes`) | 1 |
| `VELOCITY_ERROR`, `ATTITUDE_ERROR` | the master's own slow errors, east, north, up: a constant and a drift each | m/s, rad |

(The mounting stands in the *master's* axes, in which it does not turn with what is estimated: in the slave's axes the filter would
take its own corrections of tilt for knowledge of heading.) Flexure is ``theta'' = -2 beta theta' - beta^2 theta + white noise``.
The master's own errors are *considered*: they count in the covariance, and the slave is not corrected for them, since a
slave that takes up its master's motion cannot tell its own tilt from its master's. Constant and drift of an axis are one
process, of the variance of both, ``sigma^2``, whose differences over short times are those of the drift: its correlation
time is that of the drift times ``sigma^2 / drift^2``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from truenorth.core.errors import UsageError
from truenorth.core.units import parse
from truenorth.errors.axes import known_as_bias
from truenorth.errors.bending import BENDING, bending
from truenorth.errors.group import Group
from truenorth.errors.model import InsModel
from truenorth.errors.walks import Walks
from truenorth.records.flexure import COUPLING
from truenorth.state.layout import ACCEL_AXES, DV, GYRO_AXES, PHI, Layout
from truenorth.state.prior import joined, prior_covariance

Array = NDArray[np.float64]

DELAY, ARM, MOUNTING, FLEXURE = "master delay", "master lever arm", "mounting", "flexure"
VELOCITY_ERROR, ATTITUDE_ERROR = "master velocity error", "master attitude error"
FILTER = "master velocity filter"
SIDES = ("right", "forward", "up")
FILTER_SIGMA = 0.15  # s: masters put out what a filter of some tenths of a second has smoothed
PLACE_SIGMA = 10.0  # m: the slave's place is set to the master's, its error moves attitude by parts in a million
_OF_GROUPS = {
    DELAY: (("tau",), "s"),
    ARM: (tuple(f"r_{side}" for side in SIDES), "m"),
    FILTER: (("lambda", "chi", "kappa"), "s"),
    MOUNTING: (tuple(f"mu_{axis}" for axis in "xyz"), "rad"),
    FLEXURE: (tuple(f"theta_{axis}" for axis in "xyz") + tuple(f"theta'_{axis}" for axis in "xyz"), "rad"),
    BENDING: (tuple(f"k_{side}" for side in SIDES), "1"),
    VELOCITY_ERROR: (tuple(f"master_dv_{axis}" for axis in "ENU"), "m/s"),
    ATTITUDE_ERROR: (tuple(f"master_phi_{axis}" for axis in "ENU"), "rad"),
    GYRO_AXES: (tuple(f"M_g {row}{column}" for row in "xyz" for column in "xyz"), "1"),
    ACCEL_AXES: (tuple(f"M_a {row}{column}" for row in "xyz" for column in "xyz"), "1"),
}
_OF_INS = (
    ("phi", "ENU", "rad"),
    ("dv", "ENU", "m/s"),
    ("dp", "ENU", "m"),
    ("eps", "xyz", "rad/s"),
    ("nabla", "xyz", "m/s^2"),
)


@dataclass(frozen=True)
class MasterErrors:
    """Slow errors of the master's own solution, one-sigma: constants, and what they drift by.

    Attributes
    ----------
    level, heading : float, rad
    velocity : float, m/s
        Constant, of each axis.
    attitude_drift, velocity_drift : float, rad and m/s
        Of each axis: a stationary Gauss-Markov process.
    heading_drift : float or None, rad
        The same of heading, which neither gravity nor a velocity at a steady course holds as they hold level; None: as
        `attitude_drift`.
    correlation_time : float, s
        Of the drift.
    filter : float, s
        Sigma of the time constant of a filter that its velocity went through and its attitude did not; 0: none.
    """

    level: float = 0.0
    heading: float = 0.0
    velocity: float = 0.0
    attitude_drift: float = 0.0
    velocity_drift: float = 0.0
    correlation_time: float = 300.0
    filter: float = FILTER_SIGMA
    heading_drift: float | None = None

    def __post_init__(self) -> None:
        sigmas = (self.level, self.heading, self.velocity, *self.attitude_drifts, self.velocity_drift, self.filter)
        if not all(0.0 <= x < math.inf for x in sigmas):
            raise UsageError(f"{self}: expected sigmas of zero or more")
        if not self.correlation_time > 0.0:
            raise UsageError(
                f"correlation time of the master's errors {self.correlation_time:g} s; expected above zero"
            )

    @property
    def attitude(self) -> Array:
        """(3,) sigmas of the errors about east, north and up, constant and drift, rad."""
        return np.hypot([self.level, self.level, self.heading], self.attitude_drifts)

    @property
    def attitude_drifts(self) -> tuple[float, float, float]:
        """Sigmas of the drift about east, north and up, rad."""
        level = self.attitude_drift
        return level, level, level if self.heading_drift is None else self.heading_drift


MASTERS = {
    "navigation": MasterErrors(
        math.radians(0.3 / 60), math.radians(2.0 / 60), 0.05, math.radians(0.3 / 60), 0.05, correlation_time=300.0
    ),
    "tactical": MasterErrors(
        math.radians(3.0 / 60),
        math.radians(20.0 / 60),
        0.2,
        math.radians(3.0 / 60),
        0.2,
        correlation_time=300.0,
        heading_drift=math.radians(5.0 / 60),  # gyros of 1 deg/h, over the time for which it lasts
    ),
}  # by grade: an aided INS of a ship or an aircraft
DIMENSIONS = {
    "level": "angle",
    "heading": "angle",
    "velocity": "speed",
    "attitude_drift": "angle",
    "velocity_drift": "speed",
    "heading_drift": "angle",
    "correlation_time": "time",
    "filter": "time",
}


def master_errors(given: MasterErrors | str | None) -> MasterErrors:
    """Of a grade's name, of words such as ``level=.3 arcmin, heading=2 arcmin, velocity=.05 m/s``, or as given.

    None, or ``none``: the master is taken for the truth. Of words, drifts that are left out are as large as the constants.

    Raises
    ------
    UsageError
        An unknown grade or name, a value that cannot be read.
    """
    if given is None or given == "none":
        return MasterErrors()
    if isinstance(given, MasterErrors):
        return given
    if given in MASTERS:
        return MASTERS[given]
    said = dict(part.split("=", 1) for part in given.split(",") if "=" in part)
    values = {name.strip(): text for name, text in said.items()}
    if len(said) != given.count(",") + 1 or not values.keys() <= DIMENSIONS.keys():
        raise UsageError(
            f"errors of the master {given!r}; expected one of {', '.join(MASTERS)}, or sigmas by name "
            f"({', '.join(DIMENSIONS)}), such as level=0.3 arcmin,heading=2 arcmin,velocity=0.05 m/s"
        )
    found = {name: parse(text, DIMENSIONS[name]) for name, text in values.items()}
    if "attitude_drift" not in found and "heading" in found:
        found.setdefault("heading_drift", found["heading"])
    found.setdefault("attitude_drift", found.get("level", 0.0))
    found.setdefault("velocity_drift", found.get("velocity", 0.0))
    return MasterErrors(**found)


def own_errors(attitude_sigma: Array | None, velocity_sigma: Array | None) -> MasterErrors | None:
    """What a master's own filter says of its errors; None where it says nothing.

    A filter's sigma is of the whole error, and says nothing of how fast it changes: medians over the log, half of their squares
    taken for constants and half for drift.

    Parameters
    ----------
    attitude_sigma : (N, 3) array or None, rad
        Of heading, pitch and roll.
    velocity_sigma : (N, 3) array or None, m/s
    """
    if attitude_sigma is None and velocity_sigma is None:
        return None
    half = math.sqrt(0.5)
    heading = level = velocity = 0.0
    if attitude_sigma is not None:
        heading, level = _median(attitude_sigma[:, 0]), _median(attitude_sigma[:, 1:])
    if velocity_sigma is not None:
        velocity = _median(velocity_sigma)
    return MasterErrors(
        level * half, heading * half, velocity * half, level * half, velocity * half, heading_drift=heading * half
    )


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else 0.0


@dataclass(frozen=True)
class TransferModel(Walks):
    """Noise of the slave, and which groups there are; one-sigma, SI."""

    # (2,) s; what scale factors and misalignments of the gyros do in turns, where they are no states; as of
    # :class:`truenorth.errors.model.InsModel`
    turn_noise: tuple[float, float] = (0.0, 0.0)
    axes: tuple[Group, ...] = ()  # they, and those of the accelerometers, as states
    delay: bool = True  # groups for them
    lever_arm: bool = True
    mounting: bool = False
    arm_considered: bool = False  # the arm counts in the covariance and is not estimated, where acceleration is matched
    delay_walk: float = 0.0  # s/sqrt(s); how the delay wanders, for a master whose clock runs at another rate
    # (3,) rad: of the seat's angles about right, forward, up; zeros: it does not bend, and there are no such states
    flexure_sigma: tuple[float, float, float] = (0.0, 0.0, 0.0)
    flexure_beta: float = 1.0  # rad/s; natural frequency of its critically damped processes
    coupling: tuple[float, float, float] = (COUPLING,) * 3  # of the end of a seat that bends, as assumed
    coupling_sigma: float = 0.0  # 0: it is known, and no state
    master: MasterErrors = MasterErrors()  # of the master itself; zeros: it is taken for the truth
    filter: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )  # s, s^2, s^3: sigmas of `FILTER`; zeros: there are no such states
    considered: bool = True  # whether the master's errors count in the covariance alone; else they are estimated

    def __post_init__(self) -> None:
        super().__post_init__()
        if not all(0.0 <= x < math.inf for x in (*self.turn_noise, self.delay_walk, *self.flexure_sigma, *self.filter)):
            raise UsageError(f"{self}: a random walk or a sigma is negative or not finite")
        if not 0.0 < self.flexure_beta < math.inf:
            raise UsageError(f"flexure_beta is {self.flexure_beta}; expected a positive frequency, rad/s")

    @cached_property
    def groups(self) -> dict[str, Group]:
        """Those there are, by name, in order; the priors of delay, arm and mounting are given with :meth:`prior`."""
        of, found = self.master, []
        if self.delay:
            found.append(Group(DELAY, np.zeros(1), walk=self.delay_walk, unit="s"))
        if self.lever_arm:
            found.append(Group(ARM, np.zeros(3), considered=self.arm_considered, unit="m"))
        if any(self.filter):
            found.append(Group(FILTER, np.array(self.filter), unit="s"))
        if self.mounting:
            found.append(Group(MOUNTING, np.zeros(3), rotation=True, unit="rad"))
        if any(self.flexure_sigma):
            found.append(Group(FLEXURE, np.array(self.flexure_sigma), frequency=self.flexure_beta, unit="rad"))
        found += self.axes
        if any(self.flexure_sigma) and self.coupling_sigma > 0.0:
            found.append(bending(self.coupling_sigma))
        for name, sigma, drift, unit in (
            (
                VELOCITY_ERROR,
                np.full(3, math.hypot(of.velocity, of.velocity_drift)),
                np.full(3, of.velocity_drift),
                "m/s",
            ),
            (ATTITUDE_ERROR, of.attitude, np.array(of.attitude_drifts), "rad"),
        ):
            if sigma.any():
                lasts = of.correlation_time * np.divide(sigma**2, drift**2, out=np.full(3, np.inf), where=drift > 0.0)
                found.append(Group(name, sigma, lasts, considered=self.considered, unit=unit))
        return {group.name: group for group in found}

    @cached_property
    def ins(self) -> InsModel:
        """The error model: fifteen states and the groups."""
        return InsModel(
            self.gyro_random_walk,
            self.accel_random_walk,
            self.gyro_rate_walk,
            self.accel_rate_walk,
            self.turn_noise,
            tuple(self.groups.values()),
        )

    @property
    def layout(self) -> Layout:
        """Where the states stand."""
        return self.ins.layout

    @property
    def states(self) -> int:
        """How many."""
        return self.layout.states

    def slice_of(self, name: str) -> slice | None:
        """Where a group's values (of flexure the angles alone) stand; None where there is none."""
        found = self.layout.slice_of(name)
        return slice(found.start, found.start + 3) if found is not None and name == FLEXURE else found

    @property
    def names(self) -> tuple[str, ...]:
        """Of all states."""
        own = [f"{state}_{axis}" for state, axes, _ in _OF_INS for axis in axes]
        return (*own, *(name for group in self.groups for name in _OF_GROUPS[group][0]))

    @property
    def units(self) -> tuple[str, ...]:
        """Of all states, SI."""
        own = [unit for _, _, unit in _OF_INS for _ in range(3)]
        return (*own, *(_unit(name, group) for group in self.groups for name in _OF_GROUPS[group][0]))

    def prior(
        self,
        dv: ArrayLike,
        phi: ArrayLike,
        accel_bias: ArrayLike,
        gyro_bias: ArrayLike,
        *,
        tau: float = 0.0,
        arm: ArrayLike = 0.0,
        mounting: ArrayLike = 0.0,
        dp: ArrayLike = PLACE_SIGMA,
        C_nb: ArrayLike | None = None,
        C_mb: ArrayLike | None = None,
    ) -> Array:
        """(n, n) covariance at the start.

        Parameters
        ----------
        dv, phi, accel_bias, gyro_bias : one or (3,) sigmas, m/s, rad, m/s^2, rad/s
        tau : float, s
        arm, mounting : one or (3,) sigmas, m and rad
            Of groups that are not there, ignored.
        dp : one or (3,) sigmas, m
            Of the place.
        C_nb : (3, 3) array, optional
            The slave's attitude was handed over from the master through the assumed mounting: ``phi = C_nm mu + C theta`` and
            the master's own error, besides what `phi` says; its velocity with the master's. Without it they are independent.
            Of accelerometers whose axes are states, `accel_bias` is of the bias proper.
        C_mb : (3, 3) array, optional
            The assumed mounting; the unit matrix when left out.
        """
        given = {DELAY: tau, ARM: arm, MOUNTING: mounting}
        biases = np.concatenate([np.broadcast_to(np.square(bias), 3) for bias in (gyro_bias, accel_bias)])
        sigmas = (np.broadcast_to(given.get(g.name, g.prior), len(g.prior)) for g in self.groups.values())
        P = joined(prior_covariance(phi, dv, dp, biases), *sigmas)
        ties: list[tuple[slice, str, Array]] = [(DV, VELOCITY_ERROR, np.eye(3))]
        if C_nb is not None:
            seat = np.asarray(C_nb, dtype=np.float64)
            C_nm = seat if C_mb is None else seat @ np.asarray(C_mb).T
            ties += [(PHI, MOUNTING, C_nm), (PHI, FLEXURE, seat), (PHI, ATTITUDE_ERROR, np.eye(3))]
        for part, name, C in ties:
            if (at := self.slice_of(name)) is not None:
                own = P[at, at].copy()
                P[part, at] = C @ own
                P[at, part] = P[part, at].T
                P[part, part] += C @ own @ C.T
        if ACCEL_AXES in self.groups:
            P, _ = known_as_bias(P, np.zeros(len(P)), self.groups[ACCEL_AXES], self.layout.first_of(ACCEL_AXES), None)
        return P


def _unit(name: str, group: str) -> str:
    if name in ("chi", "kappa"):
        return "s^2" if name == "chi" else "s^3"
    return "rad/s" if name.startswith("theta'") else _OF_GROUPS[group][1]
