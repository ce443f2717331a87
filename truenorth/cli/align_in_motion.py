"""`truenorth align` on the move: its options, the call, and what is printed beside the attitude."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from rich.console import Console

    from truenorth.alignment import Alignment
    from truenorth.core.position import Position
    from truenorth.records import ImuRecord
    from truenorth.records.calibration import Calibration

PANEL = "On the move"

Odometer = Annotated[
    Path | None,
    typer.Option(
        help="Odometer log of a vehicle that moves from the first second on (needs --imu).",
        rich_help_panel=PANEL,
        show_default=False,
    ),
]
Gnss = Annotated[
    Path | None,
    typer.Option(
        help="GNSS log, positions and/or velocities, alone or with an odometer; --lat is then not needed.",
        rich_help_panel=PANEL,
        show_default=False,
    ),
]
Offset = Annotated[
    float, typer.Option(help="Added to the times of the odometer's and the GNSS log, s.", rich_help_panel=PANEL)
]
WheelArm = Annotated[
    str | None,
    typer.Option(
        help="IMU to the odometer's wheel, m: right,forward,up; estimated without it.",
        rich_help_panel=PANEL,
        show_default=False,
    ),
]
AntennaArm = Annotated[
    str | None,
    typer.Option(help="IMU to the GNSS antenna, m: right,forward,up.", rich_help_panel=PANEL, show_default=False),
]
Latency = Annotated[
    float | None,
    typer.Option(
        help="GNSS measurements are older than their stamps by this, s; estimated without it.",
        rich_help_panel=PANEL,
        show_default=False,
    ),
]
MountingAngles = Annotated[
    str | None,
    typer.Option(
        help="Heading,pitch,roll of the IMU against the vehicle (or the master), deg.",
        rich_help_panel=PANEL,
        show_default=False,
    ),
]
MountingSigma = Annotated[
    float, typer.Option(help="How far off those may be, one sigma, deg; estimated.", rich_help_panel=PANEL)
]
OdometerNoise = Annotated[
    float | None,
    typer.Option(help="One-sigma noise of the odometer's speed, m/s.", rich_help_panel=PANEL, show_default=False),
]


def align_moving(
    record: ImuRecord,
    position: Position | None,
    imu: str | None,
    method: str,
    odometer: Path | None,
    gnss: Path | None,
    *,
    offset: float,
    wheel_arm: str | None,
    antenna_arm: str | None,
    latency: float | None,
    mounting: str | None,
    mounting_sigma: float,
    odometer_noise: float | None,
    calibration: Calibration | None,
    limit: float,
    progress: Callable[[str], None],
) -> Alignment:
    """Read the aiding logs and align.

    Raises
    ------
    UsageError
        No specification of the IMU; a mounting sigma that is not positive.
    """
    from dataclasses import replace

    import numpy as np

    from truenorth.alignment import align_in_motion
    from truenorth.alignment.in_motion import WHEEL, usual_antenna
    from truenorth.core.errors import UsageError
    from truenorth.formats import read_gnss, read_odometer
    from truenorth.state.mounting import mounting_angles

    if imu is None:
        raise UsageError(
            "on the move a log cannot be asked for its IMU's errors; expected --imu navigation, tactical, industrial, consumer "
            "or a YAML file"
        )
    if not mounting_sigma > 0.0:
        raise UsageError(f"--mounting-sigma {mounting_sigma:g}: expected degrees above zero")
    wheel = replace(WHEEL, angle_sigma=math.radians(mounting_sigma), noise=odometer_noise)
    if mounting is not None:
        turned = [math.radians(x) for x in numbers_of(mounting, "--mounting", 3, "heading,pitch,roll in degrees")]
        wheel = replace(wheel, C_mb=mounting_angles(*turned))
    if wheel_arm is not None:
        arm = np.array(numbers_of(wheel_arm, "--wheel-arm", 3, "right,forward,up in metres"))
        wheel = replace(wheel, lever_arm=arm, lever_arm_sigma=0.0)
    receiver = None if gnss is None else read_gnss(gnss)
    antenna = usual_antenna(receiver)
    if antenna_arm is not None:
        arm = np.array(numbers_of(antenna_arm, "--antenna-arm", 3, "right,forward,up in metres"))
        antenna = replace(antenna, lever_arm=arm)
    if latency is not None:
        antenna = replace(antenna, latency=latency, latency_sigma=0.0)
    return align_in_motion(
        record,
        imu,
        odometer=None if odometer is None else read_odometer(odometer),
        gnss=receiver,
        position=position,
        wheel=wheel,
        antenna=antenna,
        method=method,
        heading_limit=limit,
        calibration=calibration,
        offset=offset,
        progress=progress,
    )


def print_moving(console: Console, result: Alignment) -> None:
    """Velocity, distance, and how the wheel sits and counts."""
    moving = result.moving
    if moving is None:
        return
    s = moving.summary()
    velocity = ", ".join(f"{v:.3f}" for v in s["velocity_m_s"])
    console.print(f"velocity E, N, U: {velocity} m/s, after {moving.distance:.0f} m", soft_wrap=True)
    if moving.wheel is None:
        return
    if result.heading_known:
        heading, sigma = s["vehicle_heading_deg"], s["vehicle_heading_sigma_deg"]
        console.print(f"heading of the vehicle: {heading:.3f} ± {sigma:.3f} deg", soft_wrap=True)
    yaw, pitch, _ = s["mounting_deg"]
    sigma_pitch, sigma_yaw = s["mounting_sigma_deg"]
    console.print(
        f"odometer: scale {100 * s['odometer_scale']:+.3f} ± {100 * s['odometer_scale_sigma']:.2g} %; IMU on the vehicle: heading "
        f"{yaw:.3f} ± {sigma_yaw:.2g} deg, pitch {pitch:.3f} ± {sigma_pitch:.2g} deg",
        soft_wrap=True,
    )
