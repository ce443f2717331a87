"""`truenorth example`: a sample recording, to try the commands on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from truenorth.cli.console import make_console, print_written
from truenorth.cli.options import argument, command, option

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Samples:
  rlg        ring-laser IMU on a parked vehicle, people and engine moving it
  fog        fibre-optic IMU with GNSS, vehicle with its engine idling
  transfer   fibre-optic master INS and a MEMS IMU on one car
\b
Examples:
  truenorth example rlg -o .
  truenorth align log.csv --lat 34.246 --lon 108.910 --imu navigation
"""

# What aligns the files of each sample.
COMMANDS = {
    "rlg": "truenorth align log.csv --lat 34.246048 --lon 108.909664 --alt 380 --imu navigation",
    "fog": "truenorth align drive.csv --lat 34.0256 --alt 416",
    "transfer": "truenorth align slave.csv --master master.csv --imu industrial",
}


@command(EXAMPLES)
def example(
    name: Annotated[str | None, argument("rlg, fog or transfer; without one they are listed.")] = None,
    output: Annotated[Path, option("Folder for the logs.", "-o", "--output")] = Path(),
) -> None:
    """Write a sample recording as logs that the other commands read."""
    from truenorth.formats.samples import SAMPLES, write_sample

    console = make_console()
    if name is None:
        for known, what in SAMPLES.items():
            console.print(f"{known}: {what}", soft_wrap=True)
        return
    print_written(write_sample(name, output))
    console.print(f"{SAMPLES[name]}; try: {COMMANDS[name]}", soft_wrap=True)
