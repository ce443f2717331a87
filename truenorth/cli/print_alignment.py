"""What a person reads of an alignment in the terminal."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from truenorth.cli.console import in_reader_s_words, make_console, print_written
from truenorth.cli.remedies import reasons_of
from truenorth.core.language import translated as _

if TYPE_CHECKING:
    from rich.console import Console

    from truenorth.alignment import Alignment
    from truenorth.alignment.transfer_result import Transfer


def print_alignment(result: Alignment, paths: list[Path]) -> None:
    """Verdict, angles, biases, and what the recipe found besides."""
    from rich.table import Table
    from rich.text import Text

    from truenorth.report.words import clauses

    console = make_console()
    s = result.summary()
    colour = {"aligned": "green", "level_only": "yellow"}.get(result.status, "red")
    status = Text(in_reader_s_words(result.status), style=f"bold {colour}")
    console.print(status, f" {result.source}, {result.duration:.1f} s", soft_wrap=True)
    for reason in reasons_of(result):
        console.print(f"  {reason}", soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for title in ("", _("deg"), _("one sigma, deg"), _("floor, deg")):
        table.add_column(title, justify="right" if title else "left")
    floors = {name: s[f"{name}_sigma_floor_deg"] for name in ("heading", "pitch", "roll")}
    if result.near_vertical:  # first: heading and roll by themselves mean little there
        floors = {result.azimuth[0]: math.degrees(math.sqrt(result.phi_floor[2, 2])), **floors}
    for name, floor in floors.items():
        value = s[f"{name}_deg"]
        shown = _("refused") if value is None else f"{value:.4f}"
        table.add_row(_(name.replace("_", " ")), shown, f"{s[f'{name}_sigma_deg']:.4f}", f"{floor:.4f}")
    console.print(table)
    for name, values, sigmas, known in (
        (_("gyro bias, deg/h"), s["gyro_bias_deg_h"], s["gyro_bias_sigma_deg_h"], s["gyro_bias_estimated"]),
        (_("accelerometer bias, ug"), s["accel_bias_ug"], s["accel_bias_sigma_ug"], s["accel_bias_estimated"]),
    ):
        axes_shown = [
            f"{axis} {value:.4g} ± {sigma:.3g}"
            if ok
            else _("{name} not estimated (± {sigma:.3g})").format(name=axis, sigma=sigma)
            for axis, value, sigma, ok in zip("xyz", values, sigmas, known, strict=True)
        ]
        console.print(f"{name}: {', '.join(axes_shown)}", soft_wrap=True)
    if result.transfer is not None:
        print_transfer(console, result.transfer)
    how = _("attitude at {time:.3f} s, method {method}: {why}")
    console.print(how.format(time=result.time, method=result.method, why=clauses(result.method_reason)), soft_wrap=True)
    console.print(_("IMU: {source}").format(source=clauses(result.imu_source)), soft_wrap=True)
    if result.table is not None:
        print_table(console, result)
    print_moving(console, result)
    print_written(paths)


def print_moving(console: Console, result: Alignment) -> None:
    """Velocity, distance, and how the wheel sits and counts."""
    moving = result.moving
    if moving is None:
        return
    s = moving.summary()
    velocity = ", ".join(f"{v:.3f}" for v in s["velocity_m_s"])
    reached = _("velocity E, N, U: {velocity} m/s, after {distance:.0f} m")
    console.print(reached.format(velocity=velocity, distance=moving.distance), soft_wrap=True)
    for name, (delay, sigma) in moving.delays.items():
        late = _("{name}: {delay:.0f} ± {sigma:.2g} ms late")
        console.print(late.format(name=_(name), delay=round(1e3 * delay) + 0.0, sigma=1e3 * sigma), soft_wrap=True)
    if (wheel := moving.wheel) is None:
        return
    if result.heading_known:
        heading, sigma = s["vehicle_heading_deg"], s["vehicle_heading_sigma_deg"]
        of_vehicle = _("heading of the vehicle: {heading:.3f} ± {sigma:.3f} deg")
        console.print(of_vehicle.format(heading=heading, sigma=sigma), soft_wrap=True)
    yaw, pitch = s["mounting_deg"][:2]
    sigma_pitch, sigma_yaw = s["mounting_sigma_deg"]
    sits = _(
        "{sensor}: scale {scale:+.3f} ± {scale_sigma:.2g} %; IMU on the vehicle: heading {yaw:.3f} ± {sigma_yaw:.2g} deg, pitch "
        "{pitch:.3f} ± {sigma_pitch:.2g} deg"
    )
    said = {"yaw": yaw, "sigma_yaw": sigma_yaw, "pitch": pitch, "sigma_pitch": sigma_pitch}
    scale = {"scale": 100 * wheel.scale, "scale_sigma": 100 * wheel.scale_sigma}
    console.print(sits.format(sensor=_(wheel.sensor), **scale, **said), soft_wrap=True)


def print_table(console: Console, result: Alignment) -> None:
    """The positions, one a line, and the scale factors that turns brought to light."""
    from rich.table import Table

    assert result.table is not None
    s = result.table.summary(result.heading_known)
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    titles = (
        _("position"),
        _("from, s"),
        _("to, s"),
        _("turned, deg"),
        _("heading, deg"),
        _("pitch, deg"),
        _("roll, deg"),
    )
    for title in titles:
        table.add_column(title, justify="right")
    for number, p in enumerate(s["positions"], 1):
        heading = _("refused") if p["heading_deg"] is None else f"{p['heading_deg']:.3f}"
        table.add_row(
            str(number),
            f"{p['start_s']:.1f}",
            f"{p['stop_s']:.1f}",
            f"{p['turned_deg']:.3f}",
            heading,
            f"{p['pitch_deg']:.3f}",
            f"{p['roll_deg']:.3f}",
        )
    console.print(table)
    for name, title in (("gyro", _("gyro scale factor, ppm")), ("accel", _("accel scale factor, ppm"))):
        values = zip("xyz", s[f"{name}_scale_factor_ppm"], s[f"{name}_scale_factor_sigma_ppm"], strict=True)
        text = ", ".join(f"{axis} {value:.0f} ± {sigma:.0f}" for axis, value, sigma in values)
        console.print(f"{title}: {text}", soft_wrap=True)


def print_transfer(console: Console, transfer: Transfer) -> None:
    """Delay, lever arm and mounting, each with its sigma, or that it was not estimated or not matched."""

    def said(name: str, value: float, sigma: float, estimated: bool) -> str:
        if sigma == 0.0:
            return _("{name} {value:.4g} (as given)").format(name=name, value=value)
        # A delay of hours is known to a millisecond: as many digits as the sigma has.
        digits = max(4, 3 + math.floor(math.log10(max(abs(value), sigma) / sigma)))
        if estimated:
            return f"{name} {value:.{digits}g} ± {sigma:.3g}"
        return _("{name} not estimated (± {sigma:.3g})").format(name=name, sigma=sigma)

    s = transfer.summary()
    delay = said("", s["delay_ms"], s["delay_sigma_ms"], s["delay_estimated"]).strip()
    name = _("delay, ms")
    console.print(f"{name}: {delay}", soft_wrap=True)
    for title, key, unit, names, blind in (
        (_("lever arm, m"), "lever_arm", "m", (_("right"), _("forward"), _("up")), ("attitude",)),
        (
            _("mounting, deg"),
            "mounting",
            "deg",
            (_("heading"), _("pitch"), _("roll")),
            ("velocity", "position", "acceleration"),
        ),
    ):
        if s["matching"] in blind:
            unseen = _("{title}: not seen by {matching} matching").format(title=title, matching=_(s["matching"]))
            console.print(unseen, soft_wrap=True)
            continue
        columns = (s[f"{key}_{unit}"], s[f"{key}_sigma_{unit}"], s[f"{key}_estimated"])
        parts = [said(*row) for row in zip(names, *columns, strict=True)]
        console.print(f"{title}: {', '.join(parts)}", soft_wrap=True)
