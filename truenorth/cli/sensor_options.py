"""Options of the aids of a navigation: what `navigate` reads besides the IMU's log, and how it is mounted."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.aiding_options import Baseline, Errors, KnownLatency, LogKind, OdometerNoise, Offset
from truenorth.cli.fields import Fields, Read, Sets, angles, arm, given, plain, quantity, quantity_and_time
from truenorth.cli.options import option
from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from truenorth.aiding.fixes import Fixes
    from truenorth.errors.log import LogErrors
    from truenorth.state.mounting import Mounting
    from truenorth.state.state import Start

PARTS = ("scale", "mounting", "lever_arm", "latency", "scale_factors")
SIGMAS = {"scale": 0.05, "mounting": math.radians(5.0), "lever_arm": 2.0, "latency": 0.3}


def parts_of(text: str | None, option: str) -> set[str]:
    """Names of what is estimated.

    Raises
    ------
    UsageError
        One that is not of `PARTS`.
    """
    from truenorth.core.errors import UsageError

    parts = {part.strip().replace("-", "_") for part in text.split(",")} if text else set()
    if unknown := parts - set(PARTS):
        raise UsageError(f"{option} {min(unknown)!r} is not known; choose of {', '.join(PARTS)}")
    return parts


def estimated(*names: str) -> Read:
    """Sigmas of those of `names` that are to be estimated."""
    fields = {name: "angle_sigma" if name == "mounting" else f"{name}_sigma" for name in names}
    return lambda text, option: {fields[part]: SIGMAS[part] for part in names if part in parts_of(text, option)}


def drift_of_places(text: str, option: str) -> Fields:
    """Slow error of a receiver's positions."""
    from truenorth.core.errors import UsageError

    sigma, time = numbers_of(text, option, 2, "one sigma in metres, time in seconds")
    if not (sigma >= 0.0 and time > 0.0):
        raise UsageError(f"{option} {text}: expected metres (0: there is none) and seconds above zero, such as 2,60")
    return {"bias_sigma": sigma, "bias_time": time}


@dataclass(frozen=True)
class Sensors:
    """Options of the aids of a navigation."""

    PANEL: ClassVar = "Aiding sensors"
    gnss: Annotated[Path | None, option("GNSS log: CSV, Parquet, NMEA, ...")] = None
    odometer: Annotated[Path | None, option("Odometer log.")] = None
    velocity: Annotated[Path | None, option("Log of a Doppler or speed log, or of a reference velocity.")] = None
    log_kind: LogKind = None
    log_drift: Annotated[
        str | None,
        option("Its drift east and north, such as a current, and how long it lasts: '0.5 m/s, 3 h'."),
        Sets("log", quantity_and_time("drift", "speed", "drift_time", drift_time=None)),
    ] = None
    log_scale: Annotated[
        str | None, option("Its scale error, one sigma: '0.5 %'."), Sets("log", quantity("scale", "ratio"))
    ] = None
    log_mounting: Annotated[
        str | None,
        option("Its error of mounting about the vertical: '0.3 deg'."),
        Sets("log", quantity("mounting", "angle")),
    ] = None
    log_bias: Annotated[
        str | None, option("Its bias along the hull's axes: '0.1 m/s'."), Sets("log", quantity("bias", "speed"))
    ] = None
    fix: Annotated[
        list[str] | None,
        option("Position fix: time, lat, lon, one sigma: '21600,20.1,115.3,100' (s, deg, m); repeat for more."),
    ] = None
    azimuth: Annotated[
        list[str] | None,
        option("Azimuth reset: time, heading, one sigma: '21600,45.2,0.05' (s, deg); repeat for more."),
    ] = None
    baro: Annotated[Path | None, option("Log of a barometer.")] = None
    aid: Annotated[
        list[str] | None, option("Log of a plug-in's sensor, as NAME=FILE; more than one by repeating it.")
    ] = None
    error: Errors = None
    baro_loop: Annotated[
        float,
        option("Time constant of a third-order vertical loop on the barometer, s; 0: Kalman gain."),
        Sets("baro", plain("loop")),
    ] = 0.0
    lever_arm: Annotated[str | None, option("IMU to GNSS antenna, m: right,forward,up."), Sets("antenna", arm)] = None
    baseline: Baseline = None
    wheel_arm: Annotated[
        str | None, option("IMU to the odometer's wheel or the log, m: right,forward,up."), Sets("wheel", arm)
    ] = None
    mounting: Annotated[
        str | None,
        option("Heading,pitch,roll of the IMU against the vehicle, deg (odometer, log)."),
        Sets("wheel", angles),
    ] = None
    latency: KnownLatency = None
    estimate: Annotated[
        str | None,
        option(f"What is not known and estimated, of: {', '.join(PARTS)}."),
        Sets("antenna", estimated("lever_arm", "latency")),
        Sets("wheel", estimated("scale", "mounting", "lever_arm")),
    ] = None
    odometer_noise: OdometerNoise = None
    offset: Offset = None
    gnss_drift: Annotated[
        str | None,
        option("Slow error of the GNSS positions: one sigma in m and its time in s, as '2,60'; none without it."),
        Sets("antenna", drift_of_places),
    ] = None

    @property
    def parts(self) -> set[str]:
        """What --estimate names."""
        return parts_of(self.estimate, "--estimate")

    def antenna(self, begin: Start | None = None) -> Mounting:
        """Of the GNSS receiver, late as an alignment found it where nothing is said of that."""
        from truenorth.aiding.aids import ANTENNA
        from truenorth.navigation.given import late_as_found

        unsaid, said = ANTENNA if begin is None else late_as_found(ANTENNA, begin), given(self, "antenna")
        if "latency" in said:  # which is that of all that the receiver says
            unsaid = replace(unsaid, velocities=None, drift=None)
        return replace(unsaid, **said)

    def wheel(self, found: Mounting | None = None) -> Mounting:
        """Of the odometer: what is said of it; for the rest, `found` is how an alignment found it; else the usual."""
        from truenorth.aiding.aids import WHEEL

        return replace(found or WHEEL, **given(self, "wheel"))

    def log(self) -> Mounting:
        """Of a velocity log; its scale and its angles have errors of their own, and an arm that is not said is estimated."""
        from truenorth.aiding.aids import HULL
        from truenorth.state.mounting import Mounting

        sigma = HULL if self.wheel_arm is None else 0.0
        return replace(Mounting(), **(given(self, "wheel") | {"lever_arm_sigma": sigma}))

    def log_errors(self, frame: str) -> LogErrors | None:
        """Of the velocity log: those of its kind, and what is given of them; None: nothing is said."""
        from truenorth.errors.log import LogErrors, log_errors

        said = given(self, "log")
        if self.log_kind is None and not said:
            return None
        return replace(LogErrors() if self.log_kind is None else log_errors(self.log_kind, frame), **said)

    def aids(self, begin: Start) -> list[Any]:
        """The sensors that are named; how an alignment on the move found them stands in the start."""
        from truenorth.aiding.aids import Barometer, Gnss, Odometer, VelocityLog
        from truenorth.core.errors import UsageError
        from truenorth.core.plugins import plugin
        from truenorth.formats import read_gnss, read_height, read_odometer, read_velocity

        said = given(self, "wheel") or given(self, "odometer")
        aids: list[Any] = []
        if self.gnss is not None:
            aids.append(Gnss(read_gnss(self.gnss), self.antenna(begin)))
        if self.odometer is not None:
            sits = replace(self.wheel(begin.wheel), **given(self, "odometer")) if said else None
            aids.append(Odometer(read_odometer(self.odometer), sits))
        if self.velocity is not None:
            record = read_velocity(self.velocity)
            aids.append(VelocityLog(record, self.log(), self.log_errors(record.frame)))
        if self.baro is not None:
            aids.append(Barometer(read_height(self.baro), **given(self, "baro")))
        if self.fix or self.azimuth:
            aids.append(_fixes(self.fix or (), self.azimuth or ()))
        for text in self.aid or ():
            name, _, file = text.partition("=")
            if not file:
                raise UsageError(f"--aid {text!r}: expected NAME=FILE")
            aids.append(plugin("truenorth.aiding", name)(Path(file)))
        return aids


def _fixes(places: Sequence[str], headings: Sequence[str]) -> Fixes:
    from truenorth.aiding.fixes import AzimuthFix, Fixes, PositionFix

    def place(text: str) -> PositionFix:
        time, lat, lon, sigma = numbers_of(text, "--fix", 4, "time, latitude, longitude and one sigma in s, deg and m")
        return PositionFix(time, math.radians(lat), math.radians(lon), sigma)

    def heading(text: str) -> AzimuthFix:
        time, heading, sigma = numbers_of(text, "--azimuth", 3, "time, heading and one sigma in s and deg")
        return AzimuthFix(time, math.radians(heading), math.radians(sigma))

    return Fixes(tuple(map(place, places)), tuple(map(heading, headings)))
