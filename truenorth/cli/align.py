"""`truenorth align`: from a log to pitch, roll and true heading, a verdict and a report."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from truenorth.cli.ahead import compile_ahead
from truenorth.cli.aiding_options import ByMaster, OnIndexer, OnTheMove, Turntable, on_its_day, shifted
from truenorth.cli.align_options import check_options
from truenorth.cli.attitude_options import OfAttitude
from truenorth.cli.console import make_console, stages
from truenorth.cli.options import AsJson, command, option
from truenorth.cli.print_alignment import print_alignment
from truenorth.cli.reading import Calibrated, Log, Place, ReadingWindow
from truenorth.cli.remedies import reasons_of
from truenorth.cli.wording import in_options
from truenorth.core.language import retold, translated

if TYPE_CHECKING:
    from truenorth.core.position import Position
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
  truenorth align slave.csv --master master.csv --imu tactical --delay '30 ms'
  truenorth align turntable.csv --lat 39.98 --imu tactical --positions auto
  truenorth align imu.csv --lat 40 --imu navigation --indexer encoder.csv
  truenorth align drive.csv --odometer odo.csv --lat 39.9 --imu navigation
  truenorth align drive.csv --gnss gnss.csv --imu industrial -o start
  truenorth align boat.csv --velocity dvl.csv --log-kind doppler-bottom \\
    --lat 59.4 --imu navigation
  truenorth align car.csv --gnss gnss.csv --imu consumer --magnetometer m.csv

Exit codes: 0 aligned or level_only; 2 wrong usage; 3 bad data; 4 the data cannot be aligned.
"""


@command(EXAMPLES)
def align(
    context: typer.Context,
    log: Log,
    where: Place,
    imu: Annotated[
        str | None,
        option(
            "Specification: navigation, tactical, industrial, consumer, or a YAML file; else inferred from the log."
        ),
    ] = None,
    method: Annotated[
        str,
        option(
            "auto, analytic, inertial, oba, kalman or swaying; on the move gyrocompass or motion; published filters: kf, sakf, "
            "makf, imakf, states10, states8, and by an odometer ekf, ukf, ckf, gh3, sgkf ..."
        ),
    ] = "auto",
    at: Annotated[float | None, option("Epoch of the attitude, s; the last sample without it.")] = None,
    heading_limit: Annotated[float, option("Largest usable one-sigma heading error, deg.")] = 5.0,
    calibration: Calibrated = None,
    any_attitude: Annotated[
        bool, option("The IMU really lies on its head: do not refuse z pointing down.", "--any-attitude")
    ] = False,
    output: Annotated[
        Path | None, option("Folder for summary.json, history.parquet and report.html.", "-o", "--output")
    ] = None,
    as_json: AsJson = False,
    *,
    reading: ReadingWindow,
    table: Turntable,
    indexer: OnIndexer,
    master: ByMaster,
    moving: OnTheMove,
    pointing: OfAttitude,
) -> None:
    """Find pitch, roll and true heading of an IMU: still, swaying, turned on purpose, on the move, or against a master."""
    check_options(context)
    aided = (moving.named, pointing.named, master.master, table.positions, indexer.indexer)
    if not any(aided):
        compile_ahead()  # before what takes time to import

    from dataclasses import replace

    from truenorth.alignment import align as align_record
    from truenorth.core.atomic import writable_folder
    from truenorth.core.errors import UsageError
    from truenorth.records.calibration import Calibration

    place = where.position()
    if place is None and not moving.named and master.master is None:
        raise UsageError(
            "the latitude is missing; expected --lat DEGREES, or --gnss FILE or --master FILE with positions"
        )
    if output is not None:
        writable_folder(output)  # before the work, not after it
    paths: list[Path] = []
    with stages(quiet=as_json) as tell:
        tell(f"reading {log.name}")
        record = reading.read(log)
        if imu is None and moving.named and master.master is None:
            raise UsageError(
                "on the move the errors of the IMU cannot be found from the log; expected --imu navigation, tactical, industrial, "
                "consumer or a YAML file"
            )
        found = shifted(moving.aids() if master.master is None else [], moving.offset, pointing.keys)
        found = on_its_day(record, found)
        directions: list[Any] = []
        if pointing.named:
            directions = pointing.aids(record, place or _first_place(record, found))
        aids: list[Any] = [
            *master.aids(indexer, moving),
            *found,
            *on_its_day(record, shifted(directions, moving.offset, [aid.key for aid in found])),
            *table.aids(),
            *indexer.aids(),
        ]
        if indexer.indexer is None:  # which turns its IMU on its head, and fast
            free = any_attitude or table.positions is not None
            _refuse_implausible(record, _latitude(place, aids), free, units_given=reading.units is not None)
        result = align_record(
            record,
            place,
            imu,
            aid=aids,
            method=method,
            at=at,
            calibration=None if calibration is None else Calibration.from_file(calibration),
            heading_limit=math.radians(heading_limit),
            progress=tell,
            **({"errors": moving.error} if moving.error else {}),
        )
        if output is not None:
            from truenorth.quality import inspect

            tell("inspecting the log")
            result = replace(result, inspection=inspect(record, result.position.lat))
            tell("writing the report")
            paths = result.save(output)
    advice = None
    if table.advise is not None:
        from truenorth.cli.advise import advice_after, print_advice

        advice = advice_after(result, table.advise)
    if as_json:
        more = {} if advice is None else {"advice": advice.summary()}
        print(json.dumps(result.summary() | {"reasons": reasons_of(result)} | more, allow_nan=False))
    else:
        print_alignment(result, paths)
        if advice is not None:
            print_advice(make_console(), advice)
    if result.status not in ("aligned", "level_only"):
        raise typer.Exit(4)


def _first_place(record: ImuRecord, aids: list[Any]) -> Position | None:
    """Where GNSS says that a log begins."""
    fixes = next((aid.record for aid in aids if aid.key == "gnss" and aid.record.has_position.any()), None)
    if fixes is None:
        return None
    from truenorth.alignment.in_motion_task import first_fix

    wheel = next((aid.record for aid in aids if aid.key in ("odometer", "velocity")), None)
    return first_fix(record, fixes, wheel)


def _latitude(place: Position | None, aids: list[Any]) -> float | None:
    """The latitude that is given, or a master's first, rad."""
    if place is not None:
        return place.lat
    lat = next((aid.record.lat for aid in aids if aid.key == "master"), None)
    return None if lat is None else float(lat[0])


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
            said = f"{record.source}: rows 1 to {len(record)}: {finding.message}"
            if doubtful_unit:
                raise DataError(f"{said}; if they are in rad/s, say so: --units rad/s,m/s^2")
            raise DataError(f"{said}, or --any-attitude if it really is" if finding.code == "axes_down" else said)
        if finding.severity == "warning":
            print(
                translated("truenorth: warning: {text}").format(text=in_options(retold(finding.message))),
                file=sys.stderr,
            )
