"""`truenorth align --master`: a slave's log against the solution of a master INS on the same vehicle."""

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
    from truenorth.alignment.transfer_result import Transfer
    from truenorth.core.position import Position
    from truenorth.records import ImuRecord, MasterRecord
    from truenorth.records.calibration import Calibration
    from truenorth.records.flexure import FlexureSpec

PANEL = "Against a master INS"
Master = Annotated[
    Path | None,
    typer.Option(
        "--master",
        help="Log of the master: time, heading, pitch, roll and/or VE, VN, VU, and lat, lon, alt where it has them.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]
MasterColumns = Annotated[
    str | None,
    typer.Option(
        "--master-columns",
        help="Names of the columns in the master's log, as 'time=t,VE=ve'.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]
MasterUnits = Annotated[
    str | None,
    typer.Option(
        "--master-units",
        help="Units of its columns, as 'attitude=rad,position=rad'.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]
Matching = Annotated[
    str, typer.Option("--matching", help="What is matched: auto, velocity, attitude or both.", rich_help_panel=PANEL)
]
Delay = Annotated[
    str | None,
    typer.Option(
        "--delay",
        help="By which the master's stamps are late: '30 ms', or with its uncertainty '30 ms,5 ms'; 0 and 50 ms without it.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]
ArmSigma = Annotated[
    float,
    typer.Option(
        "--lever-arm-sigma",
        help="What --lever-arm (master to slave) is uncertain by, m; 0: known.",
        rich_help_panel=PANEL,
    ),
]
Flexure = Annotated[
    str | None,
    typer.Option(
        "--flexure",
        help="The slave's seat bends: '3 arcmin,5 s', one sigma of each axis and correlation time.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]


def read_master_log(path: Path, columns: str | None, units: str | None) -> MasterRecord:
    """Read the master's log as the options say."""
    from truenorth.formats import read_master

    return read_master(path, columns=columns, units=units)


def align_to_master(
    record: ImuRecord,
    master: MasterRecord,
    imu: str | None,
    position: Position | None,
    *,
    matching: str,
    lever_arm: str | None,
    lever_arm_sigma: float,
    delay: str | None,
    mounting: str | None,
    mounting_sigma: float,
    flexure: str | None,
    calibration: Calibration | None,
    limit: float,
    progress: Callable[[str], None],
) -> Alignment:
    """Align the slave as the options say."""
    from truenorth.alignment.transfer import DELAY_SIGMA, align_transfer

    late, late_sigma = _delay(delay, DELAY_SIGMA)
    angles = (
        [0.0, 0.0, 0.0] if mounting is None else numbers_of(mounting, "--mounting", 3, "heading,pitch,roll in degrees")
    )
    return align_transfer(
        record,
        master,
        imu,
        matching=matching,  # type: ignore[arg-type]  # checked there, with the choices in the message
        lever_arm=(0.0, 0.0, 0.0)
        if lever_arm is None
        else numbers_of(lever_arm, "--lever-arm", 3, "right,forward,up in metres"),
        lever_arm_sigma=lever_arm_sigma,
        delay=late,
        delay_sigma=late_sigma,
        mounting=[math.radians(x) for x in angles],
        mounting_sigma=math.radians(mounting_sigma),
        flexure=None if flexure is None else _flexure(flexure),
        position=position,
        calibration=calibration,
        heading_limit=limit,
        progress=progress,
    )


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
        ("lever arm, m", "lever_arm", "m", ("right", "forward", "up"), "attitude"),
        ("mounting, deg", "mounting", "deg", ("heading", "pitch", "roll"), "velocity"),
    ):
        if s["matching"] == blind:
            console.print(f"{title}: not seen by {blind} matching", soft_wrap=True)
            continue
        columns = (s[f"{key}_{unit}"], s[f"{key}_sigma_{unit}"], s[f"{key}_estimated"])
        parts = [told(*row) for row in zip(names, *columns, strict=True)]
        console.print(f"{title}: {', '.join(parts)}", soft_wrap=True)


def _delay(text: str | None, usual: float) -> tuple[float, float]:
    from truenorth.core.units import parse

    if text is None:
        return 0.0, usual
    first, _, second = text.partition(",")
    return parse(first, "time"), parse(second, "time") if second.strip() else usual


def _flexure(text: str) -> FlexureSpec:
    from truenorth.core.errors import UsageError
    from truenorth.core.units import parse
    from truenorth.records.flexure import FlexureSpec

    first, comma, second = text.partition(",")
    if not comma:
        raise UsageError(f"--flexure {text!r}: expected an angle and a time, such as '3 arcmin,5 s'")
    return FlexureSpec(sigma=(parse(first, "angle"),) * 3, correlation_time=parse(second, "time"))
