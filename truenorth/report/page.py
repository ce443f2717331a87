"""The page of an alignment: verdict first, then the numbers, then how they came about, then the log's health."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from truenorth.core.attitude import angle_text
from truenorth.core.units import DEG_PER_HOUR, MICRO_G, parse_unit
from truenorth.report.charts import charts

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.alignment.table import TurntableErrors

VERDICTS = {
    "aligned": ("good", "Aligned"),
    "level_only": ("fair", "Levelled; heading refused"),
    "not_converged": ("bad", "Not converged"),
    "not_observable": ("bad", "Heading not observable"),
    "inconsistent": ("bad", "The data contradict a base that stays"),
}
CHART_OPTIONS = {"displaylogo": False, "responsive": True}
MOTION_COLOURS = {
    "still": "#cfe8cf",
    "disturbed": "#f6e3b4",
    "swaying": "#bcd9f0",
    "rotating": "#dcc5ec",
    "moving": "#f3b7a5",
    "unknown": "#e6e6e6",
}


def alignment_page(result: Alignment) -> str:
    """HTML text of the page; plotly's script is inside, so that it works offline."""
    from jinja2 import Environment, PackageLoader
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=PackageLoader("truenorth.report", "templates"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    shown = [
        (title, caption, figure.to_html(full_html=False, include_plotlyjs=False, config=CHART_OPTIONS))
        for title, caption, figure in charts(result)
    ]
    from truenorth.core.version import __version__

    mood, verdict = VERDICTS[result.status]
    return environment.get_template("alignment.html").render(
        result=result,
        mood=mood,
        verdict=verdict,
        numbers=_numbers(result),
        facts=_facts(result),
        biases=_biases(result),
        charts=shown,
        health=_health(result),
        plotly=get_plotlyjs() if shown else "",
        version=__version__,
    )


def _numbers(result: Alignment) -> list[dict[str, str]]:
    rows = []
    names = ("Heading", "Pitch", "Roll")
    for i, name in enumerate(names):
        known = name != "Heading" or result.heading_known
        rows.append(
            {
                "name": name,
                "value": f"{np.degrees(result.euler[i]):.4f}°" if known else "refused",
                "sigma": angle_text(float(result.euler_sigma[i])),
                "floor": angle_text(float(result.euler_sigma_floor[i])),
            }
        )
    if result.near_vertical:
        name, value, sigma = result.azimuth
        rows.insert(  # first: heading and roll by themselves mean little there
            0,
            {
                "name": name.replace("_", " ").capitalize(),
                "value": f"{np.degrees(value):.4f}°" if result.heading_known else "refused",
                "sigma": angle_text(sigma),
                "floor": angle_text(float(np.sqrt(result.phi_floor[2, 2]))),
            },
        )
    return rows


def short(x: float) -> str:
    """Three significant digits, never with an exponent."""
    return str(np.format_float_positional(x, precision=3, fractional=False, trim="-"))


def _quantity(value: float, unit: str) -> str:
    """An SI value in a datasheet unit, spelt for reading."""
    return f"{short(value / parse_unit(unit)[0])} {unit.replace('ug', 'µg').replace('sqrt(h)', '√h').replace('sqrt(Hz)', '√Hz')}"


def _facts(result: Alignment) -> list[tuple[str, str]]:
    p, imu = result.position, result.imu
    facts = [
        ("Log", f"{result.source}, {result.duration:.1f} s used"),
        ("Attitude at", f"{result.time:.3f} s on the log's clock"),
        ("Place", f"{np.degrees(p.lat):.5f}°, {np.degrees(p.lon):.5f}°, {p.alt:.0f} m"),
        ("Method", f"{result.method}: {result.method_reason}"),
        (
            "IMU",
            f"{result.imu_source}: gyro bias {_quantity(imu.gyro_bias, 'deg/h')}, "
            f"random walk {_quantity(imu.gyro_random_walk, 'deg/sqrt(h)')}; accelerometer bias "
            f"{_quantity(imu.accel_bias, 'ug')}, random walk {_quantity(imu.accel_random_walk, 'ug/sqrt(Hz)')} (one sigma)",
        ),
    ]
    if np.all(np.isfinite(result.disturbance)):
        east, north, up = 1e3 * result.disturbance
        facts.append(("Base's own motion", f"{short(east)}, {short(north)}, {short(up)} mm/s RMS (east, north, up)"))
    if result.table is not None:
        facts += _table_facts(result.table, result.heading_known)
    if result.pays_until is not None and result.heading_known:
        verb = "stopped paying after" if result.pays_until <= result.duration else "pays until about"
        facts.append(("More time", f"{verb} {result.pays_until:.0f} s: then heading's random part is half its floor"))
    return facts


def _table_facts(table: TurntableErrors, heading_known: bool) -> list[tuple[str, str]]:
    s = table.summary(heading_known)
    stops = [
        f"{p['start_s']:.0f} to {p['stop_s']:.0f} s" + (f", turned {p['turned_deg']:.3f}°" if number else "")
        for number, p in enumerate(s["positions"])
    ]
    facts = [("Positions", f"{len(stops)}: {'; '.join(stops)}")]
    for name in ("gyro", "accel"):
        values = zip("xyz", s[f"{name}_scale_factor_ppm"], s[f"{name}_scale_factor_sigma_ppm"], strict=True)
        words = ", ".join(f"{axis} {value:.0f} ± {sigma:.0f}" for axis, value, sigma in values)
        facts.append((f"Scale factors, {'gyros' if name == 'gyro' else 'accelerometers'}", f"{words} ppm"))
    if s["touched_at_s"] is not None:
        facts.append(("Touched", f"at about {s['touched_at_s']:.0f} s"))
    return facts


def _biases(result: Alignment) -> list[dict[str, str]]:
    rows = []
    for name, unit, scale, values, sigmas, known in (
        (
            "Gyro",
            "deg/h",
            DEG_PER_HOUR,
            result.gyro_bias,
            result.gyro_bias_sigma,
            result.gyro_bias_estimated,
        ),
        (
            "Accelerometer",
            "µg",
            MICRO_G,
            result.accel_bias,
            result.accel_bias_sigma,
            result.accel_bias_estimated,
        ),
    ):
        for axis, value, sigma, told in zip("xyz", values / scale, sigmas / scale, known, strict=True):
            rows.append(
                {
                    "name": f"{name} {axis}",
                    "value": f"{short(value)} {unit}" if told else "not estimated",
                    "sigma": f"{short(sigma)} {unit}",
                }
            )
    return rows


def _health(result: Alignment) -> dict[str, Any] | None:
    found = result.inspection
    if found is None:
        return None
    d = found.to_dict()
    stretches = [
        {
            "kind": r.kind,
            "share": 100.0 * r.duration / max(found.duration, 1e-9),
            "colour": MOTION_COLOURS[r.kind],
            "words": f"{r.kind}, {r.start:.0f} to {r.stop:.0f} s",
        }
        for r in found.regimes
    ]
    facts = [
        ("Rate", f"{d['rate_hz']:.4g} Hz, jitter {d['jitter_rms_ms']:.3f} ms RMS"),
        ("Gaps", _gaps(d["gaps"])),
        ("Repeated rows", str(d["repeated_rows"])),
        ("Saturated rows", str(sum(d["saturated_rows"]))),
    ]
    noise = d["noise"]
    return {
        "findings": found.findings,
        "stretches": stretches,
        "legend": {s["kind"]: s["colour"] for s in stretches},
        "facts": facts,
        "noise": [] if noise is None else _densities(noise),
        "noise_from": "" if noise is None else f"{noise['motion']}, {noise['from_s']:.0f} to {noise['to_s']:.0f} s",
    }


def _gaps(gaps: list[dict[str, float]]) -> str:
    if not gaps:
        return "0"
    longest = max(gaps, key=lambda gap: gap["length_s"])
    return f"{len(gaps)}, the longest {longest['length_s']:.3g} s at {longest['time_s']:.1f} s"


def _densities(noise: dict[str, Any]) -> list[dict[str, Any]]:
    """Noise of each axis; a term that the log does not resolve is left out."""
    rows = []
    for words, key, unit in (
        ("Angle random walk", "angle_random_walk_deg_sqrt_h", "deg/√h"),
        ("Gyro bias instability", "gyro_bias_instability_deg_h", "deg/h"),
        ("Velocity random walk", "velocity_random_walk_ug_sqrt_hz", "µg/√Hz"),
        ("Accelerometer bias instability", "accel_bias_instability_ug", "µg"),
    ):
        values = [short(value) if value else "–" for value in noise[key]]
        if any(noise[key]):
            rows.append({"name": words, "axes": values, "unit": unit})
    return rows
