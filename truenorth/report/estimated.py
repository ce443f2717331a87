"""What was estimated of the aiding sensors, in the units of their datasheets."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from truenorth.core.language import translated as _
from truenorth.errors.deflection import NAME as DEFLECTION
from truenorth.quality.converging import CONVERGING
from truenorth.report.document import Table
from truenorth.report.numbers import of_sigma, short
from truenorth.state.layout import ACCEL_AXES, GYRO_AXES
from truenorth.state.limits import is_estimated

if TYPE_CHECKING:
    from truenorth.alignment.moving import Moving
    from truenorth.alignment.transfer_result import Transfer
    from truenorth.navigation.result import Navigation

# The last words of a group's name tell what it is: unit, and how many of them an SI unit has.
DEG = ("deg", 180.0 / np.pi)
UNITS = {
    "lever arm": ("m", 1.0),
    "scale": ("%", 100.0),
    "scale factors": ("ppm", 1e6),
    "mounting": DEG,
    "attitude bias": DEG,
    "lag": ("ms", 1e3),
    "compliance": ("deg/g", 180.0 / np.pi * 9.80665),
    "deflection of the vertical": ("arcsec", 3600.0 * 180.0 / np.pi),
    "iron": ("% of the field", 100.0),
    "anomaly": ("% of the field", 100.0),
}
SCALES = {GYRO_AXES: "gyro scale factors", ACCEL_AXES: "accelerometer scale factors"}
AXES = ("x", "y", "z")


def estimated_rows(result: Navigation) -> list[tuple[str, str, str]]:
    """Name, value and one-sigma at the end of each group of states of an aiding sensor."""
    rows = []
    priors = dict(zip(result.track.layout.names, result.track.layout.priors, strict=True))
    for name, found in result.estimated().items():
        own = slice(None, None, 4) if name in SCALES else slice(None)  # of nine elements by rows the diagonal
        open_ = not np.any(is_estimated(np.array(found["sigma"])[own], np.array(priors[name])[own]))
        if name.startswith("slow") or name == CONVERGING or (open_ and name in (DEFLECTION, *SCALES)):
            # The slow parts of the IMU's biases, which the track holds; what is over; what is of earth or IMU and does not show.
            continue
        name = SCALES.get(name, name)
        unit, factor = _unit(name)
        sigmas = [factor * x for x in found["sigma"][own]]
        value = ", ".join(of_sigma(factor * x, s) for x, s in zip(found["value"][own], sigmas, strict=True))
        sigma = ", ".join(map(short, sigmas))
        shown = _("not estimated") if open_ else f"{value} {_(unit)}"
        rows.append((_(name).capitalize().replace("Gnss", "GNSS"), shown, f"{sigma} {_(unit)}"))
    return rows


def _unit(name: str) -> tuple[str, float]:
    for ending, found in UNITS.items():
        if name.endswith(ending):
            return found
    return ("m/s", 1.0) if "velocity" in name else ("m", 1.0)


def relation_table(transfer: Transfer | None, moving: Moving | None) -> Table | None:
    """How a slave sits on its master, or an odometer on its vehicle; None where there is neither."""
    if transfer is not None:
        rows = [
            (
                _("Delay of the master"),
                *_shown(1e3 * transfer.delay, 1e3 * transfer.delay_sigma, "ms", bool(transfer.delay_estimated)),
            )
        ]
        for i, axis in enumerate((_("right"), _("forward"), _("up"))):
            known = bool(transfer.lever_arm_estimated[i])
            name = _("Lever arm, {axis}").format(axis=axis)
            rows.append((name, *_shown(transfer.lever_arm[i], transfer.lever_arm_sigma[i], "m", known)))
        angles, sigmas = np.degrees(transfer.mounting), np.degrees(transfer.mounting_sigma)
        for i, angle in enumerate((_("heading"), _("pitch"), _("roll"))):
            name = _("Mounting, {angle}").format(angle=angle)
            rows.append((name, *_shown(angles[i], sigmas[i], "deg", bool(transfer.mounting_estimated[i]))))
        caption = _("The lever arm goes from the master to the slave, in axes of the slave.")
        return Table(_("Slave and master"), [_("Quantity"), _("Value"), _("One sigma")], rows, caption)
    if moving is None:
        return None
    v, sigma = moving.v_n, np.sqrt(np.diag(moving.P))[3:6]
    names = (_("Velocity east"), _("Velocity north"), _("Velocity up"))
    rows = [(name, *_shown(v[i], sigma[i], "m/s", True)) for i, name in enumerate(names)]
    heading = np.degrees([moving.vehicle_heading, moving.vehicle_heading_sigma])
    rows.append((_("Heading of the vehicle"), *_shown(heading[0], heading[1], "deg", True)))
    if moving.wheel is not None:
        wheel = moving.wheel
        rows.append(
            (
                _("Scale: {sensor}").format(sensor=_(wheel.sensor)),
                *_shown(100 * wheel.scale, 100 * wheel.scale_sigma, "%", True),
            )
        )
        for i, axis in enumerate((_("right"), _("forward"), _("up"))):
            name = _("Arm of the {sensor}, {axis}").format(sensor=_(wheel.sensor), axis=axis)
            rows.append((name, *_shown(wheel.lever_arm[i], wheel.lever_arm_sigma[i], "m", True)))
    return Table(_("Vehicle"), [_("Quantity"), _("Value"), _("One sigma")], rows)


def _shown(value: float, sigma: float, unit: str, estimated: bool) -> tuple[str, str]:
    if sigma == 0.0:
        return f"{short(value)} {unit}", _("given")
    return f"{of_sigma(value, sigma)} {unit}" if estimated else _("not estimated"), f"{short(sigma)} {unit}"
