"""`truenorth align --positions auto`: a log of a turntable."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from truenorth.core.errors import UsageError

if TYPE_CHECKING:
    from rich.console import Console

    from truenorth.alignment import Alignment
    from truenorth.core.position import Position
    from truenorth.records import ImuRecord
    from truenorth.records.calibration import Calibration


def align_table(
    positions: str,
    record: ImuRecord,
    position: Position,
    imu: str | None,
    calibration: Calibration | None,
    arm_sigma: float,
    heading_limit: float,
    tell: Callable[[str], None],
) -> Alignment:
    """Align over the positions of a turntable."""
    if positions != "auto":
        raise UsageError(f"--positions {positions!r}; expected auto: turns and positions are found in the log")
    from truenorth.alignment import align_positions

    return align_positions(
        record,
        position,
        imu,
        calibration=calibration,
        arm_sigma=arm_sigma,
        heading_limit=heading_limit,
        progress=tell,
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
