"""`truenorth example`: a sample recording, to try the commands on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from truenorth.cli.console import make_console

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Samples:
  rlg        ring-laser IMU on a parked vehicle that people and its engine move
  fog        fibre-optic IMU with GNSS, vehicle with its engine idling
  transfer   fibre-optic master INS and a MEMS IMU on one car
\b
Examples:
  truenorth example rlg -o .
  truenorth align log.csv --lat 34.246 --lon 108.910 --alt 380 --imu navigation
"""


def example(
    name: Annotated[str, typer.Argument(help="rlg, fog or transfer.", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="Folder for the logs.")] = Path(),
) -> None:
    """Write a sample recording as logs that the other commands read."""
    from truenorth.formats.samples import SAMPLES, write_sample

    console = make_console()
    for path in write_sample(name, output):
        console.print(f"wrote {path}", soft_wrap=True)
    console.print(f"{SAMPLES[name].what}; try: {SAMPLES[name].command}", soft_wrap=True)


example.__doc__ = f"{example.__doc__}\n{EXAMPLES}"
