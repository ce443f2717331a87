"""`truenorth noise`: what the sensors' noise is, from a log at rest, as a specification for filters."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from truenorth.cli.console import drawing, make_console, print_written
from truenorth.cli.options import AsJson, command, option
from truenorth.cli.reading import Log, ReadingWindow

if TYPE_CHECKING:
    from truenorth.analysis.allan import NoiseCoefficients
    from truenorth.quality import Inspection

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth noise still.csv
  truenorth noise still.csv --like tactical -o noise
  truenorth align log.csv --lat 48.1 --imu noise/imu.yaml

Writes imu.yaml (the specification), kalibr.yaml (Kalibr's form of it) and noise.svg (Allan deviation and fit).

Exit codes: 0 done; 2 wrong usage; 3 bad data; 4 the base moved, so that the log does not show the sensors' noise.
"""
WIDTH = 96  # columns, also where the output is no terminal
TERMS = (
    ("random walk", "random_walk", ("deg/sqrt(h)", "ug/sqrt(Hz)")),
    ("bias instability", "bias_instability", ("deg/h", "ug")),
    ("rate random walk", "rate_random_walk", ("deg/h/sqrt(h)", "ug/sqrt(s)")),
    ("quantisation", "quantisation", ("arcsec", "mm/s")),
)


@command(EXAMPLES)
def noise(
    log: Log,
    reading: ReadingWindow,
    like: Annotated[
        str | None, option("Specification of what rest does not show: biases, scale factors.", panel="Files")
    ] = None,
    output: Annotated[Path | None, option("Folder for the files.", "-o", "--output", panel="Files")] = None,
    as_json: AsJson = False,
) -> None:
    """Measure the sensors' noise in a log at rest: Allan deviation, its coefficients with their one-sigma."""
    from truenorth.core.errors import AlignmentError
    from truenorth.quality import inspect

    record = reading.read(log)
    found = inspect(record)
    rest = found.noise_from
    if rest is None or found.gyro_noise is None or found.accel_noise is None:
        raise AlignmentError(
            f"{record.source}: nowhere 15 s at rest; record an hour with the base still, and no one near it"
        )
    if rest.kind != "still":
        raise AlignmentError(
            f"{record.source}: the base moves even where it is quietest ({rest.start:.0f} s to {rest.stop:.0f} s); what the log "
            "shows is motion, not the sensors' noise: record an hour with the base still"
        )
    figures = _figures(found.gyro_noise, found.accel_noise)
    paths = [] if output is None else _write(output, found, like)
    if as_json:
        print(json.dumps({"from_s": rest.start, "to_s": rest.stop, "noise": figures}, allow_nan=False))
        return
    _print(record.source, rest.start, rest.stop, figures, paths)


def _figures(gyro: NoiseCoefficients, accel: NoiseCoefficients) -> list[dict[str, Any]]:
    """One row a sensor and a term: value and one-sigma of each axis; None where the log does not show it."""
    from truenorth.core.units import parse_unit

    rows = []
    for sensor, coefficients in (("gyro", gyro), ("accelerometer", accel)):
        for words, name, units in TERMS:
            unit = units[sensor != "gyro"]
            factor = parse_unit(unit)[0]
            values, sigmas = getattr(coefficients, name) / factor, getattr(coefficients, f"{name}_sigma") / factor
            rows.append(
                {
                    "sensor": sensor,
                    "term": words,
                    "unit": unit,
                    "value": [float(v) if v > 0.0 else None for v in values],
                    "sigma": [float(s) if math.isfinite(s) else None for s in sigmas],
                }
            )
    return rows


def _write(output: Path, found: Inspection, like: str | None) -> list[Path]:
    from truenorth.core.atomic import atomic_files, writable_folder
    from truenorth.quality.noise import noise_from_log, with_terms_seen
    from truenorth.records.kalibr import write_kalibr

    folder = writable_folder(output)
    record, rest, gyro, accel = found.record, found.noise_from, found.gyro_noise, found.accel_noise
    assert record is not None and rest is not None and gyro is not None and accel is not None  # noqa: PT018  # checked before
    spec = with_terms_seen(noise_from_log(record.between(rest.start, rest.stop), like, record.source).spec, gyro, accel)
    paths = [folder / name for name in ("imu.yaml", "kalibr.yaml", "noise.svg")[: 3 if drawing() else 2]]
    with atomic_files() as file:
        spec.to_yaml(file(paths[0]))
        write_kalibr(spec, record.rate, file(paths[1]))
        for path in paths[2:]:
            _draw(found, file(path))
    return paths


def _draw(found: Inspection, path: Path) -> None:
    """The figure; the same log makes the same bytes."""
    from matplotlib import rc_context

    from truenorth.figures.noise import plot_noise

    with rc_context({"svg.hashsalt": "noise"}):
        plot_noise(found).savefig(path, metadata={"Date": None})


def _print(source: str, start: float, stop: float, figures: list[dict[str, Any]], paths: list[Path]) -> None:
    from rich.table import Table

    console = make_console()
    console.print(f"{source}, at rest from {start:.0f} s to {stop:.0f} s; one sigma after each figure", soft_wrap=True)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for title in ("", "x", "y", "z", "unit"):
        table.add_column(title, no_wrap=True)
    for sensor in dict.fromkeys(row["sensor"] for row in figures):
        table.add_row(sensor)
        for row in figures:
            if row["sensor"] == sensor:
                table.add_row(f"  {row['term']}", *map(_cell, row["value"], row["sigma"]), row["unit"])
    console.width = max(console.width, WIDTH)
    console.print(table)
    print_written(paths)


def _cell(value: float | None, sigma: float | None) -> str:
    """With as many digits as its sigma has, which has one; two where that is a 1."""
    if value is None:
        return "not seen"
    if sigma is None:
        return f"{value:.3g} ± ?"
    first = math.floor(math.log10(sigma))
    decimals = max(0, -first + (sigma < 2.0 * 10.0**first))
    return f"{value:.{decimals}f} ± {sigma:.{decimals}f}"
