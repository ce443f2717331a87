"""What a person reads of an alignment in the terminal."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from truenorth.cli.console import make_console, print_written
from truenorth.cli.remedies import reasons_of

if TYPE_CHECKING:
    from rich.console import Console

    from truenorth.alignment import Alignment
    from truenorth.alignment.transfer_result import Transfer


def print_alignment(result: Alignment, paths: list[Path]) -> None:
    """Verdict, angles, biases, and what the recipe found besides."""
    from rich.table import Table
    from rich.text import Text

    console = make_console()
    s = result.summary()
    colour = {"aligned": "green", "level_only": "yellow"}.get(result.status, "red")
    status = Text(result.status, style=f"bold {colour}")
    console.print(status, f" {result.source}, {result.duration:.1f} s", soft_wrap=True)
    for reason in reasons_of(result):
        console.print(f"  {reason}", soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for title in ("", "deg", "one sigma, deg", "floor, deg"):
        table.add_column(title, justify="right" if title else "left")
    floors = {name: s[f"{name}_sigma_floor_deg"] for name in ("heading", "pitch", "roll")}
    if result.near_vertical:  # first: heading and roll by themselves mean little there
        floors = {result.azimuth[0]: math.degrees(math.sqrt(result.phi_floor[2, 2])), **floors}
    for name, floor in floors.items():
        value = s[f"{name}_deg"]
        shown = "refused" if value is None else f"{value:.4f}"
        table.add_row(name.replace("_", " "), shown, f"{s[f'{name}_sigma_deg']:.4f}", f"{floor:.4f}")
    console.print(table)
    for name, values, sigmas, known in (
        ("gyro bias, deg/h", s["gyro_bias_deg_h"], s["gyro_bias_sigma_deg_h"], s["gyro_bias_estimated"]),
        ("accelerometer bias, ug", s["accel_bias_ug"], s["accel_bias_sigma_ug"], s["accel_bias_estimated"]),
    ):
        axes_shown = [
            f"{axis} {value:.4g} ± {sigma:.3g}" if ok else f"{axis} not estimated (± {sigma:.3g})"
            for axis, value, sigma, ok in zip("xyz", values, sigmas, known, strict=True)
        ]
        console.print(f"{name}: {', '.join(axes_shown)}", soft_wrap=True)
    if result.transfer is not None:
        print_transfer(console, result.transfer)
    console.print(f"attitude at {result.time:.3f} s, method {result.method}: {result.method_reason}", soft_wrap=True)
    console.print(f"IMU: {result.imu_source}", soft_wrap=True)
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
    console.print(f"velocity E, N, U: {velocity} m/s, after {moving.distance:.0f} m", soft_wrap=True)
    if (wheel := moving.wheel) is None:
        return
    if result.heading_known:
        heading, sigma = s["vehicle_heading_deg"], s["vehicle_heading_sigma_deg"]
        console.print(f"heading of the vehicle: {heading:.3f} ± {sigma:.3f} deg", soft_wrap=True)
    yaw, pitch, _ = s["mounting_deg"]
    sigma_pitch, sigma_yaw = s["mounting_sigma_deg"]
    console.print(
        f"{wheel.sensor}: scale {100 * wheel.scale:+.3f} ± {100 * wheel.scale_sigma:.2g} %; IMU on the vehicle: heading "
        f"{yaw:.3f} ± {sigma_yaw:.2g} deg, pitch {pitch:.3f} ± {sigma_pitch:.2g} deg",
        soft_wrap=True,
    )


def print_table(console: Console, result: Alignment) -> None:
    """The positions, one a line, and the scale factors that turns brought to light."""
    from rich.table import Table

    assert result.table is not None
    s = result.table.summary(result.heading_known)
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for title in ("position", "from, s", "to, s", "turned, deg", "heading, deg", "pitch, deg", "roll, deg"):
        table.add_column(title, justify="right")
    for number, p in enumerate(s["positions"], 1):
        heading = "refused" if p["heading_deg"] is None else f"{p['heading_deg']:.3f}"
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
    for name in ("gyro", "accel"):
        values = zip("xyz", s[f"{name}_scale_factor_ppm"], s[f"{name}_scale_factor_sigma_ppm"], strict=True)
        text = ", ".join(f"{axis} {value:.0f} ± {sigma:.0f}" for axis, value, sigma in values)
        console.print(f"{name} scale factor, ppm: {text}", soft_wrap=True)


def print_transfer(console: Console, transfer: Transfer) -> None:
    """Delay, lever arm and mounting, each with its sigma, or that it was not estimated or not matched."""

    def told(name: str, value: float, sigma: float, estimated: bool) -> str:
        if sigma == 0.0:
            return f"{name} {value:.4g} (as given)"
        # A delay of hours is known to a millisecond: as many digits as the sigma has.
        digits = max(4, 3 + math.floor(math.log10(max(abs(value), sigma) / sigma)))
        return f"{name} {value:.{digits}g} ± {sigma:.3g}" if estimated else f"{name} not estimated (± {sigma:.3g})"

    s = transfer.summary()
    console.print(
        f"delay, ms: {told('', s['delay_ms'], s['delay_sigma_ms'], s['delay_estimated']).strip()}", soft_wrap=True
    )
    for title, key, unit, names, blind in (
        ("lever arm, m", "lever_arm", "m", ("right", "forward", "up"), ("attitude",)),
        ("mounting, deg", "mounting", "deg", ("heading", "pitch", "roll"), ("velocity", "position", "acceleration")),
    ):
        if s["matching"] in blind:
            console.print(f"{title}: not seen by {s['matching']} matching", soft_wrap=True)
            continue
        columns = (s[f"{key}_{unit}"], s[f"{key}_sigma_{unit}"], s[f"{key}_estimated"])
        parts = [told(*row) for row in zip(names, *columns, strict=True)]
        console.print(f"{title}: {', '.join(parts)}", soft_wrap=True)
