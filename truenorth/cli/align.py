"""`truenorth align`: from a log to pitch, roll and true heading, a verdict and a report."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from truenorth.cli.align_in_motion import (
    AntennaArm,
    Gnss,
    Latency,
    MountingAngles,
    MountingSigma,
    Odometer,
    OdometerNoise,
    Offset,
    WheelArm,
    align_moving,
    print_moving,
)
from truenorth.cli.align_options import check_options
from truenorth.cli.align_rotary import Indexer, IndexerAxes, LeverArm, align_on_indexer
from truenorth.cli.align_transfer import (
    ArmSigma,
    Delay,
    Flexure,
    Master,
    MasterColumns,
    MasterUnits,
    Matching,
    align_to_master,
    print_transfer,
    read_master_log,
)
from truenorth.cli.console import make_console, stages
from truenorth.cli.reading import Axes, Columns, Format, From, Kind, Log, Rate, To, Topic, Units, read_log
from truenorth.cli.remedies import reasons_of

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.records import ImuRecord

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth align log.csv --lat 34.246 --lon 108.910 --alt 380
  truenorth align log.csv --lat 34.246 --imu navigation -o result
  truenorth align bag/ --lat 48.1 --axes FLU --from 10 --to 310 --json
  truenorth align old.csv --lat -33.9 --units deg/s,g --rate 100
  truenorth align log.csv --lat 34.246 --imu my_imu.yaml --method oba
  truenorth align slave.csv --master master.csv --imu tactical --lever-arm 0.5,1.2,0 --delay '30 ms'
  truenorth align turntable.csv --lat 39.98 --imu tactical --positions auto
  truenorth align imu.csv --lat 40 --imu navigation --indexer encoder.csv --indexer-axes z,x
  truenorth align drive.csv --odometer odo.csv --lat 39.9 --imu navigation -o start
  truenorth align drive.csv --gnss gnss.csv --imu industrial -o start

Exit codes: 0 aligned or level_only; 2 wrong usage; 3 bad data; 4 the data cannot be aligned.
"""


def align(
    context: typer.Context,
    log: Log,
    lat: Annotated[float | None, typer.Option(help="Latitude, deg, north positive.", show_default=False)] = None,
    lon: Annotated[float, typer.Option(help="Longitude, deg, east positive.")] = 0.0,
    alt: Annotated[float, typer.Option(help="Height above the ellipsoid, m.")] = 0.0,
    position_sigma: Annotated[float, typer.Option(help="One-sigma error of that position, m.")] = 10.0,
    imu: Annotated[
        str | None,
        typer.Option(
            help="Specification: navigation, tactical, industrial, consumer, or a YAML file. Without it the log is asked.",
            show_default=False,
        ),
    ] = None,
    method: Annotated[
        str, typer.Option(help="auto, analytic, inertial, oba, kalman or swaying; on the move gyrocompass or motion.")
    ] = "auto",
    axes: Axes = None,
    units: Units = None,
    rate: Rate = None,
    columns: Columns = None,
    format: Format = None,
    kind: Kind = None,
    topic: Topic = None,
    start: From = None,
    stop: To = None,
    at: Annotated[
        float | None, typer.Option(help="Epoch of the attitude, s; the last sample without it.", show_default=False)
    ] = None,
    heading_limit: Annotated[float, typer.Option(help="Largest usable one-sigma heading error, deg.")] = 5.0,
    calibration: Annotated[
        Path | None,
        typer.Option(
            help="YAML file of known bias, scale factor and misalignment, taken off first.", show_default=False
        ),
    ] = None,
    any_attitude: Annotated[
        bool, typer.Option("--any-attitude", help="The IMU really lies on its head: do not refuse z pointing down.")
    ] = False,
    positions: Annotated[
        str | None,
        typer.Option(
            help="auto: a turntable takes the IMU from position to position; turns are found in the gyros.",
            rich_help_panel="Turntable",
            show_default=False,
        ),
    ] = None,
    arm_sigma: Annotated[
        float, typer.Option(help="How far the IMU may sit from the table's axes, m.", rich_help_panel="Turntable")
    ] = 0.05,
    indexer: Indexer = None,
    indexer_axes: IndexerAxes = "z,x",
    lever_arm: LeverArm = None,
    master: Master = None,
    master_columns: MasterColumns = None,
    master_units: MasterUnits = None,
    matching: Matching = "auto",
    delay: Delay = None,
    lever_arm_sigma: ArmSigma = 1.0,
    flexure: Flexure = None,
    advise: Annotated[
        float | None,
        typer.Option(
            help="A wanted one-sigma of heading, deg: say how long, and in which positions, this IMU on this base needs for it.",
            rich_help_panel="Turntable",
            show_default=False,
        ),
    ] = None,
    odometer: Odometer = None,
    gnss: Gnss = None,
    offset: Offset = 0.0,
    wheel_arm: WheelArm = None,
    antenna_arm: AntennaArm = None,
    latency: Latency = None,
    mounting: MountingAngles = None,
    mounting_sigma: MountingSigma = 3.0,
    odometer_noise: OdometerNoise = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Folder for summary.json, history.parquet and report.html.", show_default=False
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Find pitch, roll and true heading of an IMU on a base that stays where it is: still, shaken or swaying."""
    from truenorth.core.atomic import writable_folder
    from truenorth.core.errors import UsageError
    from truenorth.core.position import Position

    check_options(context)
    moving = odometer is not None or gnss is not None
    if lat is None and not moving and master is None:
        raise UsageError(
            "the latitude is missing; expected --lat DEGREES, or --gnss FILE or --master FILE with positions"
        )
    sigmas = {"horizontal_sigma": position_sigma, "vertical_sigma": 2 * position_sigma}
    place = None if lat is None else Position.from_degrees(lat, lon, alt, **sigmas)
    position = Position(math.pi / 4) if place is None else place
    if output is not None:
        writable_folder(output)  # before the work, not after it
    with stages(quiet=as_json) as tell:
        tell(f"reading {log.name}")
        record = read_log(
            log,
            axes=axes,
            units=units,
            rate=rate,
            columns=columns,
            format=format,
            kind=kind,
            topic=topic,
            start=start,
            stop=stop,
        )
        solution = None
        if master is not None:
            tell(f"reading {master.name}")
            solution = read_master_log(master, master_columns, master_units)
            if solution.lat is not None and solution.lon is not None:
                position = Position(float(solution.lat[0]), float(solution.lon[0]))
        if indexer is None:  # which turns its IMU on its head, and fast
            _refuse_implausible(
                record,
                None if moving and place is None else position.lat,
                any_attitude or positions is not None,
                units_given=units is not None,
            )
        from truenorth.alignment import align as align_record
        from truenorth.records.calibration import Calibration

        known = None if calibration is None else Calibration.from_file(calibration)
        limit = math.radians(heading_limit)
        if solution is not None:
            result = align_to_master(
                record,
                solution,
                imu,
                place,
                matching=matching,
                lever_arm=lever_arm,
                lever_arm_sigma=lever_arm_sigma,
                delay=delay,
                mounting=mounting,
                mounting_sigma=mounting_sigma,
                flexure=flexure,
                calibration=known,
                limit=limit,
                progress=tell,
            )
        elif moving:
            result = align_moving(
                record,
                place,
                imu,
                method,
                odometer,
                gnss,
                offset=offset,
                wheel_arm=wheel_arm,
                antenna_arm=antenna_arm,
                latency=latency,
                mounting=mounting,
                mounting_sigma=mounting_sigma,
                odometer_noise=odometer_noise,
                calibration=known,
                limit=limit,
                progress=tell,
            )
        elif positions is not None:
            from truenorth.cli.align_positions import align_table

            result = align_table(positions, record, position, imu, known, arm_sigma, limit, tell)
        elif indexer is not None:
            result = align_on_indexer(
                record, position, imu, indexer, indexer_axes, lever_arm, known, at=at, limit=limit, progress=tell
            )
        else:
            result = align_record(
                record,
                position,
                imu,
                method,  # type: ignore[arg-type]  # checked there, with the list of methods in the message
                at=at,
                calibration=known,
                heading_limit=limit,
                progress=tell,
            )
        paths: list[Path] = []
        if output is not None:
            from dataclasses import replace

            from truenorth.quality import inspect

            tell("inspecting the log")
            result = replace(result, inspection=inspect(record, result.position.lat))
            tell("writing the report")
            paths = result.save(output)
    advice = None
    if advise is not None:
        from truenorth.cli.advise import advice_after, print_advice

        advice = advice_after(result, advise)
    if as_json:
        more = {} if advice is None else {"advice": advice.summary()}
        print(json.dumps(result.summary() | {"reasons": reasons_of(result)} | more, allow_nan=False))
    else:
        print_answer(result, paths)
        if advice is not None:
            print_advice(make_console(), advice)
    if result.status not in ("aligned", "level_only"):
        raise typer.Exit(4)


def _refuse_implausible(record: ImuRecord, lat: float | None, any_attitude: bool, units_given: bool) -> None:
    """Stop at mistakes of units and axes that leave no other reading; mention those that do."""
    from truenorth.core.errors import DataError
    from truenorth.quality.plausibility import check_plausibility
    from truenorth.quality.regimes import motion_summary

    _, findings = check_plausibility(record, motion_summary(record), lat)
    for finding in findings:
        if finding.code == "axes_down" and any_attitude:
            continue
        doubtful_unit = finding.code == "gyro_unit" and not units_given
        if finding.severity == "error" or doubtful_unit:
            extra = ", or --any-attitude if it really is" if finding.code == "axes_down" else ""
            extra = "; if they are in rad/s, say so: --units rad/s,m/s^2" if doubtful_unit else extra
            raise DataError(f"{record.source}: rows 1 to {len(record)}: {finding.message}{extra}")
        if finding.severity == "warning":
            print(f"truenorth: warning: {finding.message}", file=sys.stderr)


def print_answer(result: Alignment, paths: list[Path]) -> None:
    """Print an alignment for people, and the files that were written."""
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
        from truenorth.cli.align_positions import print_table

        print_table(console, result)
    print_moving(console, result)
    for path in paths:
        console.print(f"wrote {path}", soft_wrap=True)


align.__doc__ = f"{align.__doc__}\n{EXAMPLES}"
