"""`truenorth navigate`: from an alignment onward, free inertial or aided, with bands, track and report."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import typer

from truenorth.cli.aiding_options import on_its_day, shifted
from truenorth.cli.attitude_options import OfAttitude
from truenorth.cli.console import in_reader_s_words, make_console, print_written, stages
from truenorth.cli.fields import Sets, given, plain
from truenorth.cli.options import AsJson, command, option
from truenorth.cli.reading import Calibrated, Log, Reading, numbers_of
from truenorth.cli.remedies import reasons_of
from truenorth.cli.sensor_options import Sensors
from truenorth.core.language import translated as _

if TYPE_CHECKING:
    from truenorth.damping.options import Damper
    from truenorth.errors.deflection import Deflection
    from truenorth.navigation import Navigation
    from truenorth.records import ImuRecord
    from truenorth.state.state import Start

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth align log.csv --lat 34.2 --lon 108.9 --to 300 -o start
  truenorth navigate log.csv --start start -o track
  truenorth navigate log.csv --start start --gnss gnss.csv --smooth -o track
  truenorth navigate log.csv --start start --odometer odo.csv --zupt auto
  truenorth navigate log.csv --start start --velocity dvl.csv \\
    --log-kind doppler-bottom --json
  truenorth navigate log.csv --start start --baro baro.csv --altitude baro
  truenorth navigate log.csv --master ins.csv --imu tactical --gnss gnss.csv
  truenorth navigate log.csv --start start --attitude ahrs.csv \\
    --attitude-sigma 0.1,0.3,300
  truenorth navigate log.csv --heading 123,1 --position 48.1,11.5,520 \\
    --imu consumer --gnss gnss.csv
  truenorth navigate log.csv --start start --damping augmented \\
    --velocity log.csv -o damped

Exit codes: 0 navigated; 2 wrong usage; 3 bad data; 4 no usable heading, or a track that is contradicted (and written).
"""


@dataclass(frozen=True)
class Damping:
    """Options of damping."""

    PANEL: ClassVar = "Damping"
    damping: Annotated[
        str | None,
        option(
            "Damp a free INS at sea: none, internal, external, kalman, double or augmented; --velocity is the reference."
        ),
        Sets("damping", plain("method")),
    ] = None
    damping_ratio: Annotated[
        float, option("Of the networks (internal, external)."), Sets("damping", plain("ratio"))
    ] = 0.5
    damping_order: Annotated[int, option("Of the networks: 1 or 2."), Sets("damping", plain("order"))] = 2
    azimuth_damping: Annotated[
        float, option("Ratio for the 24 h oscillation (external); 0: none."), Sets("damping", plain("azimuth"))
    ] = 0.0
    damping_start: Annotated[
        float, option("Seconds after the start, when it is switched on."), Sets("damping", plain("start"))
    ] = 0.0
    damping_ramp: Annotated[
        float, option("Seconds in which a network is switched on."), Sets("damping", plain("ramp"))
    ] = 0.0
    damping_switching: Annotated[
        bool, option("Internal damping is switched off in manoeuvres."), Sets("damping", plain("switching"))
    ] = True

    def damper(self) -> Damper | None:
        """The method; None: no damping."""
        from truenorth.damping.options import Damper

        return None if self.damping is None else Damper(**given(self, "damping"))


@dataclass(frozen=True)
class KnownStart:
    """Options of a start of which the heading is known."""

    PANEL: ClassVar = "A start that is known"
    heading: Annotated[
        str | None,
        option("Heading and its one-sigma, deg: '123,1'; with --position, or with a --start that has levelled."),
    ] = None
    master: Annotated[
        Path | None, option("Log of another system's solution: the start is its first row within the log.")
    ] = None
    master_sigma: Annotated[str | None, option("One sigma of that row's heading and level, deg: '0.5,0.1'.")] = None
    position: Annotated[
        str | None, option("Where the log begins: lat,lon or lat,lon,alt in degrees and metres; needs --imu.")
    ] = None
    pitch: Annotated[float | None, option("Deg; without it the level is that of the log's beginning.")] = None
    roll: Annotated[float | None, option("Deg; with --pitch.")] = None
    speed: Annotated[
        str | None,
        option("Forward speed at the start and its one-sigma, m/s: '8,0.5'; with --pitch. At rest without it."),
    ] = None

    def given(self) -> tuple[float, float]:
        """Heading and sigma, rad."""
        heading, sigma = numbers_of(self.heading or "", "--heading", 2, "heading and its one-sigma in degrees")
        return math.radians(heading), math.radians(sigma)

    def of_folder(self, folder: Path | None) -> Start | None:
        """The start that a folder holds, turned to the heading; None: it comes from the log."""
        from truenorth.core.errors import UsageError
        from truenorth.navigation.start import read_start, start_from_alignment

        if self.master is not None:
            if folder is not None or self.heading is not None:
                raise UsageError("--master is a start itself; expected it without --start and --heading")
            if self.master_sigma is None:
                raise UsageError(
                    "--master without --master-sigma HEADING,LEVEL: how good that row is cannot be seen in it"
                )
            return None
        if folder is None:
            if self.heading is None or self.position is None:
                raise UsageError(
                    "no start; expected --start FOLDER, or --heading DEG,SIGMA with --position LAT,LON, or --master FILE"
                )
            self.given()
            return None
        if self.position is not None or self.pitch is not None or self.roll is not None:
            raise UsageError("--start has place and level; expected --position, --pitch and --roll without it")
        if self.heading is None:
            return read_start(folder)[0]
        from truenorth.core.shown import load
        from truenorth.navigation.known import with_heading

        return start_from_alignment(with_heading(load(folder), *self.given()))

    def of_log(self, record: ImuRecord, imu: str) -> Start:
        """The start from heading, place and the log's own level."""
        from truenorth.core.errors import UsageError
        from truenorth.core.position import Position
        from truenorth.navigation.known import known_start

        text = self.position or ""
        place = (
            numbers_of(text, "--position", 2 if text.count(",") == 1 else 3, "lat,lon or lat,lon,alt") if text else None
        )
        if self.master is not None:
            from truenorth.formats import read_master
            from truenorth.navigation.known import start_from_master

            given = numbers_of(self.master_sigma or "", "--master-sigma", 2, "heading and level in degrees")
            sigmas = [math.radians(x) for x in given]
            at = None if place is None else Position.from_degrees(*place)
            return start_from_master(record, read_master(self.master), imu, *sigmas, place=at)
        if (self.pitch is None) != (self.roll is None):
            raise UsageError("--pitch or --roll alone; expected both, or none: the level then comes from the log")
        if self.speed is not None and self.pitch is None:
            raise UsageError("--speed without --pitch and --roll; expected them: a level is found at rest alone")
        level: dict[str, Any] = {}
        if self.pitch is not None:
            level = {"pitch": math.radians(self.pitch), "roll": math.radians(self.roll or 0.0)} | self._moving()
        return known_start(record, Position.from_degrees(*(place or ())), imu, *self.given(), **level)

    def _moving(self) -> dict[str, Any]:
        """Velocity at the start along the heading, and its sigma: across, that of the heading turns it."""
        if self.speed is None:
            return {}
        speed, sigma = numbers_of(self.speed, "--speed", 2, "forward speed and its one-sigma in m/s")
        heading, uncertain = self.given()
        climb = math.radians(self.pitch or 0.0)
        level = speed * math.cos(climb)
        velocity = level * math.sin(heading), level * math.cos(heading), speed * math.sin(climb)
        return {"velocity": velocity, "velocity_sigma": math.hypot(sigma, speed * uncertain)}

    def imu_of(self, folder: Path | None) -> Any:
        """The specification in the folder, where a heading turns its start."""
        from truenorth.core.shown import load

        return None if self.heading is None or folder is None else load(folder).imu


@command(EXAMPLES)
def navigate(
    log: Log,
    start: Annotated[Path | None, option("Folder that `truenorth align -o` wrote.")] = None,
    altitude: Annotated[
        str | None, option("fixed, free, baro or gnss; by default what the logs allow, else fixed.")
    ] = None,
    zupt: Annotated[
        str | None, option("Stops: auto, or seconds such as '0-20,63-70'. None are used without it.")
    ] = None,
    smooth: Annotated[bool, option("Estimate each epoch from the whole log.", "--smooth", panel="The track")] = False,
    imu: Annotated[str | None, option("Specification; the alignment's own without it.")] = None,
    deflection: Annotated[
        str, option("Of the vertical along the way: one sigma and over which distance, or none.")
    ] = "6 arcsec, 20 km",
    every: Annotated[float | None, option("Seconds between rows of the track.", panel="The track")] = None,
    calibration: Calibrated = None,
    output: Annotated[
        Path | None, option("Folder for summary.json, track.parquet, .geojson, report.html.", "-o", "--output")
    ] = None,
    as_json: AsJson = False,
    *,
    known: KnownStart,
    sensors: Sensors,
    pointing: OfAttitude,
    reading: Reading,
    damped: Damping,
) -> None:
    """Carry an IMU log on from an alignment: position, velocity and attitude with their uncertainty."""
    from truenorth.core.atomic import writable_folder
    from truenorth.core.errors import UsageError
    from truenorth.core.position import Position
    from truenorth.navigation import navigate as navigate_record
    from truenorth.records.calibration import Calibration

    sensors.antenna(), sensors.wheel()  # what is wrong with them, before a long log is read
    stops = _stops(zupt)
    damper = damped.damper()
    if (begin := known.of_folder(start)) is None and imu is None:
        raise UsageError(
            "the specification of the IMU is missing; expected --imu navigation, tactical, ... or a YAML file"
        )
    if output is not None:
        writable_folder(output)
    paths: list[Path] = []
    with stages(quiet=as_json) as tell:
        tell(f"reading {log.name}")
        record = reading.read(log)
        begin = begin or known.of_log(record, imu or "")
        place = Position(begin.lat, begin.lon, begin.alt)
        result = navigate_record(
            record,
            begin if known.heading is not None or start is None else start,
            aid=on_its_day(record, shifted([*sensors.aids(begin), *pointing.aids(record, place)], sensors.offset)),
            altitude=altitude,  # type: ignore[arg-type]  # checked there, with the choices in the message
            zupt=stops,
            smooth=smooth,
            imu=imu or known.imu_of(start),
            scale_factors="scale_factors" in sensors.parts,
            errors=tuple(sensors.error or ()),
            deflection=_deflection(deflection),
            calibration=None if calibration is None else Calibration.from_file(calibration),
            output=every,
            damping=damper,
            progress=tell,
        )
        if output is not None:
            tell("writing the report")
            paths = result.save(output)
    for reason in reasons_of(result):
        if reason.startswith("warning"):
            print(f"truenorth: {reason}", file=sys.stderr)
    if as_json:
        print(json.dumps(result.summary() | {"reasons": reasons_of(result)}, allow_nan=False))
    else:
        print_navigation(result, paths)
    if result.status != "navigated":
        raise typer.Exit(4)


def _deflection(text: str) -> Deflection:
    from truenorth.core.errors import UsageError
    from truenorth.core.units import parse
    from truenorth.errors.deflection import Deflection

    if text == "none":
        return Deflection(0.0)
    first, comma, second = text.partition(",")
    if not comma:
        raise UsageError(f"--deflection {text!r}: expected an angle and a distance, such as '6 arcsec, 20 km', or none")
    return Deflection(parse(first, "angle"), parse(second, "length"))


def _stops(zupt: str | None) -> Any:
    from truenorth.core.errors import UsageError

    if zupt is None or zupt == "auto":
        return zupt
    pairs = []
    for part in zupt.split(","):
        first, _, last = part.partition("-")
        try:
            pairs.append((float(first), float(last)))
        except ValueError:
            raise UsageError(f"--zupt {zupt!r}: expected auto, or seconds such as 0-20,63-70") from None
    return pairs


def print_navigation(result: Navigation, paths: list[Path]) -> None:
    """Status, figures and where the results are."""
    from rich.table import Table
    from rich.text import Text

    from truenorth.figures.units import Clock, length_unit
    from truenorth.report.estimated import estimated_rows
    from truenorth.report.words import clauses

    console = make_console()
    s = result.summary()
    status = Text(in_reader_s_words(result.status), style=f"bold {'green' if result.status == 'navigated' else 'red'}")
    clock, (metres, unit) = Clock.of(result.time), length_unit([s["distance_m"]])
    duration = (s["end_s"] - s["start_s"]) / clock.scale
    console.print(
        status, f" {result.source}, {duration:.1f} {clock.unit}, {s['distance_m'] / metres:.4g} {unit}", soft_wrap=True
    )
    for reason in reasons_of(result):
        console.print(f"  {reason}", soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    table.add_column(_("at {time:.1f} s").format(time=s["end_s"]))
    for title in ("", _("one sigma")):
        table.add_column(title, justify="right")
    sigma = s["position_sigma_m"]
    table.add_row(_("latitude"), f"{s['lat_deg']:.7f} deg", f"{sigma[1]:.2f} m")
    table.add_row(_("longitude"), f"{s['lon_deg']:.7f} deg", f"{sigma[0]:.2f} m")
    table.add_row(_("height"), f"{s['alt_m']:.2f} m", f"{sigma[2]:.2f} m")
    names = _("velocity east"), _("velocity north"), _("velocity up")
    for name, v, v_sigma in zip(names, s["v_n_m_s"], s["v_n_sigma_m_s"]):
        table.add_row(name, f"{v:.3f} m/s", "–" if v_sigma is None else f"{v_sigma:.3f} m/s")
    for name in ("heading", "pitch", "roll"):
        table.add_row(_(name), f"{s[f'{name}_deg']:.4f} deg", f"{s[f'{name}_sigma_deg']:.4f} deg")
    console.print(table)
    for name, noted in s["aiding"].items():
        used = noted["nis_over_rows"] is not None
        nis = _("NIS over rows {nis:.2f}").format(nis=noted["nis_over_rows"]) if used else _("none used")
        counts = _("{name}: {count} measurements, {rejected} rejected, {nis}")
        said = counts.format(name=_(name), count=noted["measurements"], rejected=noted["rejected"], nis=nis)
        console.print(said, soft_wrap=True)
    for name, value, sigma in estimated_rows(result):
        console.print(
            _("{name}: {value} (one sigma {sigma})").format(name=name, value=value, sigma=sigma), soft_wrap=True
        )
    if result.damping is not None:
        console.print(_("damping: {how}").format(how=result.damping.in_words()), soft_wrap=True)
    height = _("height: {how}; IMU: {source}").format(how=_(result.altitude), source=clauses(result.imu_source))
    console.print(height, soft_wrap=True)
    print_written(paths)
