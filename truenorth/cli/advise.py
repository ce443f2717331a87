"""`truenorth advise`, and `--advise` of `truenorth align`: how long, and in which positions, for a wanted heading."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truenorth.cli.console import make_console, print_written, stages
from truenorth.cli.options import AsJson, command, option

if TYPE_CHECKING:
    from rich.console import Console

    from truenorth.advice.manoeuvres import ManoeuvreAdvice
    from truenorth.advice.positions import Advice
    from truenorth.alignment import Alignment

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth advise --lat 45 --imu navigation --heading 0.05
  truenorth advise --lat 45 --imu my_imu.yaml --heading 0.02 -o advice
  truenorth advise --lat 34 --imu tactical --heading 0.2 --speed 200
\b
Exit codes: 0 within reach; 2 wrong usage; 4 out of reach.
"""


@command(EXAMPLES)
def advise(
    lat: Annotated[float, option("Latitude, deg, north positive.", panel="IMU and base")],
    imu: Annotated[
        str, option("Specification: navigation, tactical, industrial, consumer, or a YAML file.", panel="IMU and base")
    ],
    heading: Annotated[float, option("Wanted one-sigma of heading, deg.", panel="What is wanted")],
    disturbance: Annotated[
        float, option("RMS velocity of the base, mean over one second, m/s.", panel="IMU and base")
    ] = 1e-4,
    longest: Annotated[
        float | None,
        option("Longest recording that is considered, s; 3600, of manoeuvres 120, without it.", panel="What is wanted"),
    ] = None,
    rate: Annotated[float, option("Sampling rate of the IMU, Hz.", panel="IMU and base")] = 100.0,
    speed: Annotated[
        float | None,
        option("Of a vehicle whose master INS aligns this IMU, m/s: which manoeuvre?", panel="Transfer alignment"),
    ] = None,
    attitude_noise: Annotated[
        float | None,
        option(
            "Of the master's attitude, arcmin, where that is matched as well as its velocity.",
            panel="Transfer alignment",
        ),
    ] = None,
    output: Annotated[Path | None, option("Folder for advice.json and advice.png.", "-o", "--output")] = None,
    as_json: AsJson = False,
) -> None:
    """Say how long, and in which positions or by which manoeuvre, an IMU needs for a wanted heading."""
    from truenorth.advice.manoeuvres import advise_manoeuvre
    from truenorth.advice.positions import advise as advise_for
    from truenorth.core.atomic import writable_folder
    from truenorth.core.errors import UsageError
    from truenorth.core.position import Position

    if attitude_noise is not None and speed is None:
        raise UsageError("--attitude-noise is of a master INS; expected --speed with it")
    place, wanted = Position.from_degrees(lat, 0.0), math.radians(heading)
    if output is not None:
        writable_folder(output)  # before the work, not after it
    with stages(quiet=as_json) as tell:
        tell("covariances of each scheme")
        advice: Advice | ManoeuvreAdvice
        if speed is None:
            advice = advise_for(
                imu, place, wanted, disturbance=disturbance, longest=3600.0 if longest is None else longest, rate=rate
            )
        else:
            noise = math.inf if attitude_noise is None else math.radians(attitude_noise / 60.0)
            longest = 120.0 if longest is None else longest
            advice = advise_manoeuvre(imu, place, speed, wanted, attitude_noise=noise, longest=longest)
    paths = [] if output is None else _save(advice, output)
    if as_json:
        print(json.dumps(advice.summary(), allow_nan=False))
    else:
        console = make_console()
        print_advice(console, advice)
        print_written(paths)
    if advice.best is None:
        raise typer.Exit(4)


def advice_after(result: Alignment, heading: float) -> Advice:
    """Advice for the IMU and the base that an alignment has seen; `heading` in degrees."""
    from truenorth.advice.positions import DISTURBANCE
    from truenorth.advice.positions import advise as advise_for

    seen = float(max(result.disturbance[:2]))
    disturbance = seen if math.isfinite(seen) and seen > 0.0 else DISTURBANCE
    return advise_for(result.imu, result.position, math.radians(heading), disturbance=disturbance)


def print_advice(console: Console, advice: Advice | ManoeuvreAdvice) -> None:
    """The answer, then scheme by scheme."""
    first, *others = advice.words
    console.print(f"advice: {first}", soft_wrap=True)
    for line in others:
        console.print(f"  {line}", soft_wrap=True)


def _save(advice: Advice | ManoeuvreAdvice, folder: Path) -> list[Path]:
    from truenorth.core.atomic import atomic_files

    paths = [folder / "advice.json", folder / "advice.png"]
    with atomic_files() as file:
        file(paths[0]).write_text(json.dumps(advice.summary(), indent=2, allow_nan=False), "utf-8")
        advice.plot().savefig(file(paths[1]))
    return paths
