"""`truenorth align --indexer`: a log of an IMU that turns on an indexer, and the angles of its encoder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truenorth.cli.reading import numbers_of

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.core.position import Position
    from truenorth.records import ImuRecord
    from truenorth.records.calibration import Calibration

PANEL = "IMU on an indexer"
GYROS = "gyros"
Indexer = Annotated[
    str | None,
    typer.Option(
        "--indexer",
        help="Log of the encoder's angles; or 'gyros': the body is still, the gyros show how the IMU turns.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]
IndexerAxes = Annotated[
    str, typer.Option("--indexer-axes", help="Axes of the indexer, the outermost first.", rich_help_panel=PANEL)
]
LeverArm = Annotated[
    str | None,
    typer.Option(
        "--lever-arm",
        help="Right, forward, up, m, from the body's centre of rotation (or from the master) to the IMU; estimated without it.",
        show_default=False,
        rich_help_panel=PANEL,
    ),
]


def align_on_indexer(
    record: ImuRecord,
    position: Position,
    imu: str | None,
    indexer: str,
    axes: str,
    lever_arm: str | None,
    calibration: Calibration | None,
    *,
    at: float | None,
    limit: float,
    progress: Callable[[str], None],
) -> Alignment:
    """Read the encoder's log and align the body."""
    from truenorth.alignment.rotary import align_rotary
    from truenorth.formats import read_encoder

    if calibration is not None:
        record = calibration.apply(record)
    encoder = None
    if indexer != GYROS:
        progress(f"reading {Path(indexer).name}")
        encoder = read_encoder(indexer)
    return align_rotary(
        record,
        encoder,
        position,
        imu or "navigation",
        axes=tuple(axes.replace(" ", "").lower().replace(",", "")),
        lever_arm=None if lever_arm is None else numbers_of(lever_arm, "--lever-arm", 3, "right,forward,up in metres"),
        at=at,
        heading_limit=limit,
        progress=progress,
    )
