"""Options of the aids of a navigation: what `navigate` reads besides the IMU's log, and how it is mounted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from truenorth.cli.aiding_options import Baseline, Offset, angles_of, arm_of, on_baseline
from truenorth.cli.options import option
from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from truenorth.aiding.fixes import Fixes
    from truenorth.errors.log import LogErrors
    from truenorth.state.mounting import Mounting

PARTS = ("scale", "mounting", "lever_arm", "latency", "scale_factors")
SIGMAS = {"scale": 0.05, "mounting": math.radians(5.0), "lever_arm": 2.0, "latency": 0.3}


@dataclass(frozen=True)
class Sensors:
    """Options of the aids of a navigation."""

    PANEL: ClassVar = "Aiding sensors"
    gnss: Annotated[Path | None, option("GNSS log: CSV, Parquet, NMEA, ...")] = None
    odometer: Annotated[Path | None, option("Odometer log.")] = None
    velocity: Annotated[Path | None, option("Log of a Doppler or speed log, or of a reference velocity.")] = None
    log_kind: Annotated[
        str | None,
        option("Kind of the velocity log: reference, em, doppler-water or doppler-bottom; sets its slow errors."),
    ] = None
    log_drift: Annotated[
        str | None, option("Its drift east and north, such as a current, and how long it lasts: '0.5 m/s, 3 h'.")
    ] = None
    log_scale: Annotated[str | None, option("Its scale error, one sigma: '0.5 %'.")] = None
    log_mounting: Annotated[str | None, option("Its error of mounting about the vertical: '0.3 deg'.")] = None
    log_bias: Annotated[str | None, option("Its bias along the hull's axes: '0.1 m/s'.")] = None
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
    error: Annotated[list[str] | None, option("Error states of a plug-in, by name; more than one by repeating it.")] = (
        None
    )
    baro_loop: Annotated[
        float, option("Time constant of a third-order vertical loop on the barometer, s; 0: Kalman gain.")
    ] = 0.0
    lever_arm: Annotated[str | None, option("IMU to GNSS antenna, m: right,forward,up.")] = None
    baseline: Baseline = None
    wheel_arm: Annotated[str | None, option("IMU to the odometer's wheel, m: right,forward,up.")] = None
    mounting: Annotated[
        str | None, option("Heading,pitch,roll of the IMU against the vehicle, deg (odometer, log).")
    ] = None
    estimate: Annotated[str | None, option(f"What is not known and estimated, of: {', '.join(PARTS)}.")] = None
    odometer_noise: Annotated[float | None, option("One-sigma noise of the odometer's speed, m/s.")] = None
    offset: Offset = None
    latency: Annotated[float, option("GNSS measurements are older than their stamps by this, s.")] = 0.0
    gnss_drift: Annotated[
        str | None,
        option("Slow error of the GNSS positions: one sigma in m and its time in s, as '2,60'; none without it."),
    ] = None

    @property
    def parts(self) -> set[str]:
        """What --estimate names."""
        from truenorth.core.errors import UsageError

        parts = {part.strip().replace("-", "_") for part in self.estimate.split(",")} if self.estimate else set()
        if unknown := parts - set(PARTS):
            raise UsageError(f"--estimate {min(unknown)!r} is not known; choose of {', '.join(PARTS)}")
        return parts

    def antenna(self) -> Mounting:
        """Of the GNSS receiver."""
        from dataclasses import replace

        from truenorth.core.errors import UsageError

        antenna = self._mounted(self.lever_arm, "--lever-arm", None, self.parts & {"lever_arm", "latency"})
        if self.gnss_drift is not None:
            sigma, time = numbers_of(self.gnss_drift, "--gnss-drift", 2, "one sigma in metres, time in seconds")
            if not (sigma >= 0.0 and time > 0.0):
                raise UsageError(
                    f"--gnss-drift {self.gnss_drift}: expected metres (0: there is none) and seconds above zero, such as 2,60"
                )
            antenna = replace(antenna, bias_sigma=sigma, bias_time=time)
        return on_baseline(replace(antenna, latency=self.latency), self.baseline)

    def log_errors(self, frame: str) -> LogErrors | None:
        """Of the velocity log: those of its kind, and what is given of them; None: nothing is said."""
        from dataclasses import replace

        from truenorth.core.units import parse
        from truenorth.errors.log import LogErrors, log_errors

        given: dict[str, float | None] = {}
        for name, text, dimension in (
            ("scale", self.log_scale, "ratio"),
            ("mounting", self.log_mounting, "angle"),
            ("bias", self.log_bias, "speed"),
        ):
            if text is not None:
                given[name] = parse(text, dimension)
        if self.log_drift is not None:
            size, _, time = self.log_drift.partition(",")
            given["drift"] = parse(size, "speed")
            given["drift_time"] = None if not time.strip() else parse(time, "time")
        if self.log_kind is None and not given:
            return None
        return replace(LogErrors() if self.log_kind is None else log_errors(self.log_kind, frame), **given)  # type: ignore[arg-type]

    def wheel(self) -> Mounting:
        """Of the odometer, and of a velocity log."""
        return self._mounted(self.wheel_arm, "--wheel-arm", self.mounting, self.parts - {"latency"})

    def aids(self, found: Mounting | None) -> list[Any]:
        """The sensors that are named; `found` is how an alignment on the move found the odometer."""
        from dataclasses import replace

        from truenorth.aiding.aids import Barometer, Gnss, Odometer, VelocityLog
        from truenorth.core.errors import UsageError
        from truenorth.core.plugins import plugin
        from truenorth.formats import read_gnss, read_height, read_odometer, read_velocity

        antenna, wheel = self.antenna(), self.wheel()
        said = self.wheel_arm is not None or self.mounting is not None
        said = said or bool(self.parts & {"scale", "mounting", "lever_arm"})
        known = said or found is None or self.odometer_noise is not None
        sits = replace(wheel if said or found is None else found, noise=self.odometer_noise) if known else None
        aids: list[Any] = []
        if self.gnss is not None:
            aids.append(Gnss(read_gnss(self.gnss), antenna))
        if self.odometer is not None:
            aids.append(Odometer(read_odometer(self.odometer), sits))
        if self.velocity is not None:
            log = replace(wheel, lever_arm_sigma=0.0)
            record = read_velocity(self.velocity)
            aids.append(VelocityLog(record, log, self.log_errors(record.frame)))
        if self.baro is not None:
            aids.append(Barometer(read_height(self.baro), loop=self.baro_loop))
        if self.fix or self.azimuth:
            aids.append(_fixes(self.fix or (), self.azimuth or ()))
        for text in self.aid or ():
            name, _, file = text.partition("=")
            if not file:
                raise UsageError(f"--aid {text!r}: expected NAME=FILE")
            aids.append(plugin("truenorth.aiding", name)(Path(file)))
        return aids

    @staticmethod
    def _mounted(arm: str | None, option: str, angles: str | None, parts: set[str]) -> Mounting:
        import numpy as np

        from truenorth.state.mounting import Mounting

        sigma = {part: SIGMAS[part] for part in parts if part in SIGMAS}
        return Mounting(
            lever_arm=np.zeros(3) if arm is None else arm_of(arm, option),
            lever_arm_sigma=sigma.get("lever_arm", 0.0),
            C_mb=np.eye(3) if angles is None else angles_of(angles),
            angle_sigma=sigma.get("mounting", 0.0),
            scale_sigma=sigma.get("scale", 0.0),
            latency_sigma=sigma.get("latency", 0.0),
        )


def _fixes(places: Sequence[str], headings: Sequence[str]) -> Fixes:
    from truenorth.aiding.fixes import AzimuthFix, Fixes, PositionFix

    def place(text: str) -> PositionFix:
        time, lat, lon, sigma = numbers_of(text, "--fix", 4, "time, latitude, longitude and one sigma in s, deg and m")
        return PositionFix(time, math.radians(lat), math.radians(lon), sigma)

    def heading(text: str) -> AzimuthFix:
        time, heading, sigma = numbers_of(text, "--azimuth", 3, "time, heading and one sigma in s and deg")
        return AzimuthFix(time, math.radians(heading), math.radians(sigma))

    return Fixes(tuple(map(place, places)), tuple(map(heading, headings)))
