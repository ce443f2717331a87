"""Which manoeuvre brings a slave's heading soonest to a wanted sigma: covariances along each, without any noise drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.transfer_start import Assumed, bias_sigmas, model_from_spec
from truenorth.alignment.transfer_system import system_of_motion
from truenorth.alignment.unsaid import as_usual
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.core.shown import Shown
from truenorth.estimate.poorer import poorer
from truenorth.filters import kalman
from truenorth.records.motion import Moving
from truenorth.records.specs import ImuSpec, imu_spec
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import accelerate, s_turn, straight, turn, wing_rock
from truenorth.state.layout import PHI

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

BEFORE = 20.0  # s straight on, before each manoeuvre
STEP = 0.5  # s of the covariance analysis
RATE, ANGLE, SIDE = math.radians(3.0), math.radians(90.0), math.radians(20.0)  # of turns; of each side of an S
GAIN, ACCELERATION = 0.25, 2.0  # change of speed, as a part of it, and m/s^2
LONGER, BETTER = 3.0, (3.0, 10.0, 30.0, 100.0)  # what would reach a wish: times as long, times as good an IMU
MATCHED = math.radians(3.0 / 60.0)  # of a master's attitude
ROCK, PERIOD, ROCKING = math.radians(20.0), 4.0, 30.0  # amplitude, s, s


@dataclass(frozen=True, repr=False)
class ManoeuvreAdvice(Shown):
    """Heading's one-sigma over time in each manoeuvre, and which is first below the wanted one.

    Attributes
    ----------
    time : (K,) array, s
    heading_sigma : mapping of manoeuvre to (K,) array, rad
    wanted : float, rad
    reached : mapping of manoeuvre to s
        Infinite: not in the time considered.
    begun : float, s
        When each manoeuvre begins.
    would : str
        What would bring the nearest manoeuvre there, of what was tried; empty where one is there, or nothing was tried.
    """

    time: Array
    heading_sigma: dict[str, Array]
    wanted: float
    reached: dict[str, float]
    begun: float = BEFORE
    would: str = ""

    @property
    def best(self) -> str | None:
        """The manoeuvre that is first below the wanted sigma; None: none is."""
        name = min(self.reached, key=lambda n: self.reached[n])
        return name if math.isfinite(self.reached[name]) else None

    @property
    def words(self) -> tuple[str, ...]:
        """The answer, and where none is there, what would be."""
        return (str(self), f"what would reach it: {self.would}") if self.would else (str(self),)

    def in_brief(self) -> dict[str, str]:
        """The answer."""
        return {"answer": "; ".join(self.words)}

    def to_frame(self) -> pd.DataFrame:
        """One-sigma of heading (deg) of each manoeuvre, index ``time``."""
        import pandas as pd

        columns = {name: np.degrees(sigma) for name, sigma in self.heading_sigma.items()}
        return pd.DataFrame(columns, index=pd.Index(self.time, name="time"))

    def summary(self) -> dict[str, Any]:
        """The answer as plain numbers: deg and s, None where it is out of reach."""
        return {
            "wanted_heading_sigma_deg": math.degrees(self.wanted),
            "best": self.best,
            "what_would": self.would or None,
            "manoeuvres": {
                name: {
                    "reached_s": t if math.isfinite(t) else None,
                    "heading_sigma_at_the_end_deg": math.degrees(float(self.heading_sigma[name][-1])),
                }
                for name, t in self.reached.items()
            },
        }

    def __str__(self) -> str:
        wanted = f"{60 * math.degrees(self.wanted):.3g} arcmin"
        if self.best is None:
            name = min(self.heading_sigma, key=lambda n: float(self.heading_sigma[n][-1]))
            least = 60 * math.degrees(float(self.heading_sigma[name][-1]))
            return (
                f"none of the manoeuvres brings heading to {wanted} in {self.time[-1]:.0f} s; {name} is nearest with {least:.3g} "
                "arcmin"
            )
        others = ", ".join(
            f"{name} {f'{t:.0f} s' if math.isfinite(t) else 'never'}"
            for name, t in self.reached.items()
            if name != self.best
        )
        return f"{self.best} brings heading to {wanted} after {self.reached[self.best]:.0f} s ({others})"


def advise_manoeuvre(
    imu: ImuSpec | str,
    position: Position | Sequence[float],
    speed: float,
    wanted: float,
    *,
    attitude_noise: float = math.inf,
    velocity_noise: float = 0.1,
    rate: float = 10.0,
    heading_sigma: float = math.radians(1.0),
    level_sigma: float = math.radians(0.5),
    delay_sigma: float = 0.05,
    lever_arm_sigma: float = 1.0,
    longest: float = 120.0,
    manoeuvres: Sequence[str] = (),
) -> ManoeuvreAdvice:
    """Say which of the standard manoeuvres shows heading soonest.

    Parameters
    ----------
    imu : ImuSpec, or a preset's or a file's name
        Of the slave.
    position : Position, or (lat, lon[, alt]) in degrees and metres
    speed : float, m/s
    wanted : float, rad
        One-sigma of heading.
    attitude_noise, velocity_noise : float, rad and m/s
        Of the master's rows; infinite: not matched.
    rate : float, Hz
        Of the master's rows.
    heading_sigma, level_sigma, delay_sigma, lever_arm_sigma : float, rad, rad, s, m
        What is known at the start.
    longest : float, s
    manoeuvres : sequence of str
        Those considered; all when left out.

    Raises
    ------
    UsageError
        A speed, a wanted sigma or a time that is not positive, or an unknown manoeuvre.
    """
    for name, value in (("speed", speed), ("wanted", wanted), ("longest", longest), ("rate", rate)):
        if not 0.0 < value < math.inf:
            raise UsageError(f"{name} is {value}; expected a positive number")
    spec, flights = as_usual(imu_spec(imu)), standard_manoeuvres(Position.of(position), speed)
    unknown = [name for name in manoeuvres if name not in flights]
    if unknown:
        raise UsageError(f"manoeuvre {unknown[0]!r} is not known; choose of {', '.join(flights)}")
    known = {
        "velocity_noise": velocity_noise,
        "rate": rate,
        "heading_sigma": heading_sigma,
        "level_sigma": level_sigma,
        "delay_sigma": delay_sigma,
        "lever_arm_sigma": lever_arm_sigma,
    }
    sigmas, reached = {}, {}
    time: Array = np.zeros(0)
    for name, flight in flights.items():
        if manoeuvres and name not in manoeuvres:
            continue
        time, sigma = _along(spec, flight, attitude_noise, longest, **known)
        below = np.flatnonzero(sigma <= wanted)
        sigmas[name], reached[name] = sigma, float(time[below[0]]) if below.size else math.inf
    advice = ManoeuvreAdvice(time, sigmas, wanted, reached)
    if advice.best is not None:
        return advice
    nearest = min(sigmas, key=lambda name: float(sigmas[name][-1]))

    def reaches(other: ImuSpec, noise: float, longest: float) -> bool:
        return bool(np.any(_along(other, flights[nearest], noise, longest, **known)[1] <= wanted))

    return replace(advice, would=_what_would(spec, nearest, attitude_noise, longest, reaches))


def _what_would(
    spec: ImuSpec, name: str, attitude_noise: float, longest: float, reaches: Callable[[ImuSpec, float, float], bool]
) -> str:
    """The first change of one thing, of some in their order, that is enough."""
    noise = min(attitude_noise, MATCHED)
    matched = f"the master's attitude matched to {60 * math.degrees(noise):.3g} arcmin"
    if reaches(spec, attitude_noise, LONGER * longest):
        return f"{name}, {LONGER * longest:.0f} s"
    if attitude_noise > noise and reaches(spec, noise, longest):
        return f"{name}, with {matched} too"
    for used, said in ((attitude_noise, ""), (noise, f" and {matched}")):
        for factor in BETTER:
            if reaches(poorer(spec, 1.0 / factor), used, longest):
                return f"{name}, with an IMU {factor:g} times as good{said}"
    return f"not even an IMU {BETTER[-1]:g} times as good: the master's measurements are in the way"


def _along(
    spec: ImuSpec,
    flight: Moving,
    attitude_noise: float,
    longest: float,
    *,
    velocity_noise: float,
    rate: float,
    heading_sigma: float,
    level_sigma: float,
    delay_sigma: float,
    lever_arm_sigma: float,
) -> tuple[Array, Array]:
    """Times and heading's one-sigma along one flight."""
    mounting = math.isfinite(attitude_noise)
    assumed = Assumed(np.zeros(3), lever_arm_sigma, 0.0, delay_sigma, np.eye(3), heading_sigma)
    model = model_from_spec(spec, assumed, mounting, None, 0.0)
    gyro, accel = bias_sigmas(spec)
    angles = np.array([level_sigma, level_sigma, heading_sigma])
    P0 = model.prior(
        velocity_noise if math.isfinite(velocity_noise) else 1.0,
        1e-5 if mounting else angles,
        np.maximum(accel, 1e-6),
        np.maximum(gyro, 1e-9),
        tau=delay_sigma,
        arm=lever_arm_sigma,
        mounting=angles,
        C_nb=np.eye(3) if mounting else None,
    )
    R = np.repeat([velocity_noise**2, attitude_noise**2], 3) / (rate * STEP)
    time: Array = STEP * np.arange(1.0, round(longest / STEP) + 0.5)
    system = system_of_motion(flight, model, P0, R, longest, STEP)
    return time, np.squeeze(kalman(system, history="sigma", innovations=False).sigma)[:, PHI.stop - 1]


def standard_manoeuvres(position: Position, speed: float) -> dict[str, Moving]:
    """The standard manoeuvres as motions, each begun after 20 s straight on to the north."""
    more = (1.0 + GAIN) * speed
    legs = {
        "straight": [],
        "flat turn": turn(ANGLE, RATE, "flat"),
        "banked turn": turn(ANGLE, RATE, "coordinated"),
        "S-turn": s_turn(SIDE, RATE),
        "acceleration": [*accelerate(more, ACCELERATION, speed), *accelerate(speed, ACCELERATION, more)],
        "wing rock": [],
    }
    flights: dict[str, Moving] = {}
    for name, parts in legs.items():
        motion = course(position, [*straight(BEFORE), *parts, *straight(1.0)], speed=speed)
        rocks = name == "wing rock"
        flights[name] = wing_rock(motion, BEFORE, BEFORE + ROCKING, ROCK, PERIOD) if rocks else motion
    return flights
