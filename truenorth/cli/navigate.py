"""`truenorth navigate`: from an alignment onward, free inertial or aided, with bands, track and report."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from truenorth.cli.console import make_console, stages
from truenorth.cli.reading import Axes, Columns, Format, Kind, Log, Rate, To, Topic, Units, numbers_of, read_log
from truenorth.cli.remedies import reasons_of

if TYPE_CHECKING:
    from truenorth.damping.options import Damper
    from truenorth.navigation import Mounting, Navigation

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth align log.csv --lat 34.246 --lon 108.910 --alt 380 --imu navigation --to 300 -o start
  truenorth navigate log.csv --start start -o track
  truenorth navigate log.csv --start start --gnss gnss.csv --lever-arm 0.3,1.2,0.8 --smooth -o track
  truenorth navigate log.csv --start start --odometer odo.csv --estimate scale,mounting --zupt auto
  truenorth navigate log.csv --start start --velocity dvl.csv --altitude fixed --json
  truenorth navigate log.csv --start start --baro baro.csv --altitude baro --offset -0.35
  truenorth navigate log.csv --start start --damping augmented --velocity log.csv -o damped

Exit codes: 0 navigated; 2 wrong usage; 3 bad data; 4 the alignment has no usable heading, or the measurements contradict
the track (the result is written all the same).
"""
PARTS = ("scale", "mounting", "lever_arm", "latency", "scale_factors")
SIGMAS = {"scale": 0.05, "mounting": math.radians(5.0), "lever_arm": 2.0, "latency": 0.3}
WEATHER, WEATHER_TIME = 10.0, 3600.0  # of a barometer: m, s


def navigate(
    log: Log,
    start: Annotated[Path, typer.Option(help="Folder that `truenorth align -o` wrote.", show_default=False)],
    gnss: Annotated[Path | None, typer.Option(help="GNSS log: CSV, Parquet, NMEA, ...", show_default=False)] = None,
    odometer: Annotated[Path | None, typer.Option(help="Odometer log.", show_default=False)] = None,
    velocity: Annotated[
        Path | None, typer.Option(help="Log of a Doppler or speed log, or of a reference velocity.", show_default=False)
    ] = None,
    baro: Annotated[Path | None, typer.Option(help="Log of a barometer.", show_default=False)] = None,
    altitude: Annotated[
        str | None,
        typer.Option(help="fixed, free, baro or gnss; by default what the logs allow, else fixed.", show_default=False),
    ] = None,
    baro_loop: Annotated[
        float, typer.Option(help="Time constant of a third-order vertical loop on the barometer, s; 0: Kalman gain.")
    ] = 0.0,
    zupt: Annotated[
        str | None,
        typer.Option(
            help="Stops: auto, or seconds such as '0-20,63-70'. None are used without it.", show_default=False
        ),
    ] = None,
    smooth: Annotated[bool, typer.Option("--smooth", help="Give each epoch what the whole log says of it.")] = False,
    lever_arm: Annotated[
        str | None, typer.Option(help="IMU to GNSS antenna, m: right,forward,up.", show_default=False)
    ] = None,
    wheel_arm: Annotated[
        str | None, typer.Option(help="IMU to the odometer's wheel, m: right,forward,up.", show_default=False)
    ] = None,
    mounting: Annotated[
        str | None,
        typer.Option(
            help="Heading,pitch,roll of the IMU against the vehicle, deg (odometer, log).", show_default=False
        ),
    ] = None,
    estimate: Annotated[
        str | None,
        typer.Option(help=f"What is not known and estimated, of: {', '.join(PARTS)}.", show_default=False),
    ] = None,
    odometer_noise: Annotated[
        float | None, typer.Option(help="One-sigma noise of the odometer's speed, m/s.", show_default=False)
    ] = None,
    offset: Annotated[float, typer.Option(help="Added to the times of all aiding logs, s.")] = 0.0,
    latency: Annotated[float, typer.Option(help="GNSS measurements are older than their stamps by this, s.")] = 0.0,
    gnss_drift: Annotated[
        str | None,
        typer.Option(
            help="Slow error of the GNSS positions: one sigma in m and its time in s, as '2,60'; none without it.",
            show_default=False,
        ),
    ] = None,
    imu: Annotated[
        str | None, typer.Option(help="Specification; the alignment's own without it.", show_default=False)
    ] = None,
    axes: Axes = None,
    units: Units = None,
    rate: Rate = None,
    columns: Columns = None,
    format: Format = None,
    kind: Kind = None,
    topic: Topic = None,
    stop: To = None,
    every: Annotated[float | None, typer.Option(help="Seconds between rows of the track.", show_default=False)] = None,
    calibration: Annotated[
        Path | None, typer.Option(help="YAML file of known errors of the IMU, taken off first.", show_default=False)
    ] = None,
    damping: Annotated[
        str | None,
        typer.Option(
            help="Damp a free INS at sea: none, internal, external, kalman, double or augmented; --velocity is the reference.",
            rich_help_panel="Damping",
            show_default=False,
        ),
    ] = None,
    damping_ratio: Annotated[
        float, typer.Option(help="Of the networks (internal, external).", rich_help_panel="Damping")
    ] = 0.5,
    damping_order: Annotated[int, typer.Option(help="Of the networks: 1 or 2.", rich_help_panel="Damping")] = 2,
    azimuth_damping: Annotated[
        float, typer.Option(help="Ratio for the 24 h oscillation (external); 0: none.", rich_help_panel="Damping")
    ] = 0.0,
    damping_start: Annotated[
        float, typer.Option(help="Seconds after the start, when it is switched on.", rich_help_panel="Damping")
    ] = 0.0,
    damping_ramp: Annotated[
        float, typer.Option(help="Seconds in which a network is switched on.", rich_help_panel="Damping")
    ] = 0.0,
    log_error: Annotated[
        float, typer.Option(help="One-sigma constant error of the reference velocity, m/s.", rich_help_panel="Damping")
    ] = 0.3,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Folder for summary.json, track.parquet, .geojson, report.html.", show_default=False
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Carry an IMU log on from an alignment: position, velocity and attitude with their uncertainty."""
    from dataclasses import replace

    from truenorth.core.atomic import writable_folder
    from truenorth.navigation import navigate as navigate_record
    from truenorth.navigation.start import read_start
    from truenorth.records.calibration import Calibration

    parts = _parts(estimate)
    antenna = _mounting(lever_arm, "--lever-arm", None, parts & {"lever_arm", "latency"})
    wheel = _mounting(wheel_arm, "--wheel-arm", mounting, parts - {"latency"})
    antenna = _drifting(antenna, gnss_drift)
    stops = _stops(zupt)
    damper = _damper(
        damping,
        ratio=damping_ratio,
        order=damping_order,
        azimuth=azimuth_damping,
        start=damping_start,
        ramp=damping_ramp,
        reference_sigma=log_error,
    )
    begin, _, _ = read_start(start)  # what is wrong with it, before a long log is read
    told = wheel_arm is not None or mounting is not None or bool(parts & {"scale", "mounting", "lever_arm"})
    found = None if told else begin.wheel  # by an alignment on the move
    if output is not None:
        writable_folder(output)
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
            start=None,
            stop=stop,
        )
        aiding = _read_aiding(gnss, odometer, velocity, baro)
        result = navigate_record(
            record,
            start,
            **aiding,
            altitude=altitude,  # type: ignore[arg-type]  # checked there, with the choices in the message
            zupt=stops,
            smooth=smooth,
            imu=imu,
            antenna=replace(antenna, latency=latency),
            wheel=replace(found or wheel, noise=odometer_noise),
            log=replace(wheel, lever_arm_sigma=0.0),
            barometer=_barometer(),
            baro_loop=baro_loop,
            scale_factors="scale_factors" in parts,
            calibration=None if calibration is None else Calibration.from_file(calibration),
            offset=offset,
            output=every,
            damping=damper,
            progress=tell,
        )
        paths: list[Path] = []
        if output is not None:
            tell("writing the report")
            paths = result.save(output)
    for reason in reasons_of(result):
        if reason.startswith("warning"):
            print(f"truenorth: {reason}", file=sys.stderr)
    if as_json:
        print(json.dumps(result.summary() | {"reasons": reasons_of(result)}, allow_nan=False))
    else:
        _print(result, paths)
    if result.status != "navigated":
        raise typer.Exit(4)


def _read_aiding(gnss: Path | None, odometer: Path | None, velocity: Path | None, baro: Path | None) -> dict[str, Any]:
    from truenorth.formats import read_gnss, read_height, read_odometer, read_velocity

    found: dict[str, Any] = {}
    for name, path, read in (
        ("gnss", gnss, read_gnss),
        ("odometer", odometer, read_odometer),
        ("velocity", velocity, read_velocity),
        ("baro", baro, read_height),
    ):
        if path is not None:
            found[name] = read(path)
    return found


def _mounting(arm: str | None, option: str, angles: str | None, parts: set[str]) -> Mounting:
    import numpy as np

    from truenorth.navigation import Mounting
    from truenorth.state.mounting import mounting_angles

    sigma = {part: SIGMAS[part] for part in parts if part in SIGMAS}
    lever = np.zeros(3) if arm is None else np.array(numbers_of(arm, option, 3, "right,forward,up in metres"))
    turned = [0.0, 0.0, 0.0]
    if angles is not None:
        turned = [math.radians(x) for x in numbers_of(angles, "--mounting", 3, "heading,pitch,roll in degrees")]
    return Mounting(
        lever_arm=lever,
        lever_arm_sigma=sigma.get("lever_arm", 0.0),
        C_mb=mounting_angles(*turned),
        angle_sigma=sigma.get("mounting", 0.0),
        scale_sigma=sigma.get("scale", 0.0),
        latency_sigma=sigma.get("latency", 0.0),
    )


def _drifting(antenna: Mounting, drift: str | None) -> Mounting:
    from dataclasses import replace

    from truenorth.core.errors import UsageError

    if drift is None:
        return antenna
    sigma, time = numbers_of(drift, "--gnss-drift", 2, "one sigma in metres, time in seconds")
    if not (sigma > 0.0 and time > 0.0):
        raise UsageError(f"--gnss-drift {drift}: expected metres and seconds above zero, such as 2,60")
    return replace(antenna, bias_sigma=sigma, bias_time=time)


def _damper(method: str | None, **figures: Any) -> Damper | None:
    if method is None:
        return None
    from truenorth.damping.options import Damper

    return Damper(method, **figures)  # type: ignore[arg-type]  # checked there


def _barometer() -> Mounting:
    from truenorth.navigation import Mounting

    return Mounting(bias_sigma=WEATHER, bias_time=WEATHER_TIME)


def _parts(estimate: str | None) -> set[str]:
    from truenorth.core.errors import UsageError

    parts = {part.strip().replace("-", "_") for part in estimate.split(",")} if estimate else set()
    unknown = parts - set(PARTS)
    if unknown:
        raise UsageError(f"--estimate {sorted(unknown)[0]!r} is not known; choose of {', '.join(PARTS)}")
    return parts


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


def _print(result: Navigation, paths: list[Path]) -> None:
    from rich.table import Table
    from rich.text import Text

    console = make_console()
    s = result.summary()
    status = Text(result.status, style=f"bold {'green' if result.status == 'navigated' else 'red'}")
    duration = s["end_s"] - s["start_s"]
    console.print(status, f" {result.source}, {duration:.1f} s, {s['distance_m']:.0f} m", soft_wrap=True)
    for reason in reasons_of(result):
        console.print(f"  {reason}", soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for title in (f"at {s['end_s']:.1f} s", "", "one sigma"):
        table.add_column(title, justify="left" if title.startswith("at") else "right")
    sigma = s["position_sigma_m"]
    table.add_row("latitude", f"{s['lat_deg']:.7f} deg", f"{sigma[1]:.2f} m")
    table.add_row("longitude", f"{s['lon_deg']:.7f} deg", f"{sigma[0]:.2f} m")
    table.add_row("height", f"{s['alt_m']:.2f} m", f"{sigma[2]:.2f} m")
    for name, v, v_sigma in zip(("east", "north", "up"), s["v_n_m_s"], s["v_n_sigma_m_s"]):
        table.add_row(f"velocity {name}", f"{v:.3f} m/s", f"{v_sigma:.3f} m/s")
    for name in ("heading", "pitch", "roll"):
        table.add_row(name, f"{s[f'{name}_deg']:.4f} deg", f"{s[f'{name}_sigma_deg']:.4f} deg")
    console.print(table)
    for name, told in s["aiding"].items():
        nis = "none used" if told["nis_over_rows"] is None else f"NIS over rows {told['nis_over_rows']:.2f}"
        console.print(
            f"{name}: {told['measurements']} measurements, {told['rejected']} rejected, {nis}", soft_wrap=True
        )
    for name, told in s["estimated"].items():
        if not name.startswith("slow"):
            shown = ", ".join(f"{v:.4g} ± {e:.2g}" for v, e in zip(told["value"], told["sigma"]))
            console.print(f"{name}: {shown}", soft_wrap=True)
    if result.damping is not None:
        console.print(f"damping: {result.damping.in_words()}", soft_wrap=True)
    console.print(f"height: {result.altitude}; IMU: {result.imu_source}", soft_wrap=True)
    for path in paths:
        console.print(f"wrote {path}", soft_wrap=True)


navigate.__doc__ = f"{navigate.__doc__}\n{EXAMPLES}"
