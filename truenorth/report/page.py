"""The page of an alignment: verdict first, then the numbers, then how they came about, then the log's health."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from truenorth.core.attitude import angle_text
from truenorth.core.language import translated as _
from truenorth.core.units import DEG_PER_HOUR
from truenorth.figures.units import accel_unit, speed_unit
from truenorth.report.charts import panels
from truenorth.report.document import Table, render, verdict_lines
from truenorth.report.estimated import relation_table
from truenorth.report.numbers import quantity, short
from truenorth.report.transfer import transfer_panels
from truenorth.report.words import clauses
from truenorth.state.wording import headline

if TYPE_CHECKING:
    from truenorth.alignment import Alignment
    from truenorth.alignment.table import TurntableErrors

MOODS = {"aligned": "good", "navigated": "good", "level_only": "fair"}


def head_of(result: Any, warned: str, doubts: Sequence[Any] = ()) -> dict[str, Any]:
    """What stands on top of a page: the verdict with its mood (`warned`: a good one with warnings), reasons and warnings."""
    mood, verdict = MOODS.get(result.status, "bad"), headline(result.status, result.evidence)
    reasons, warnings = verdict_lines(result.reasons)
    warnings = [*warnings, *doubts]
    if warnings and mood == "good":
        mood, verdict = "fair", warned
    return {"result": result, "mood": mood, "verdict": _(verdict), "reasons": reasons, "warnings": warnings}


def alignment_page(result: Alignment) -> str:
    """HTML text of the page; everything is inside, so that it works offline."""
    shown, health = panels(result), _health(result)
    shown += transfer_panels(result.transfer, "" if result.history is None else result.history.innovation_of)
    relation = relation_table(result.transfer, result.moving)
    tables = [relation] if relation else []
    tables += [_positions(result.table, result.heading_known)] if result.table is not None else []
    findings = () if result.inspection is None else result.inspection.findings
    doubts = [finding for finding in findings if finding.severity != "note"]
    contents = [_("Verdict"), _("Attitude"), _("How it was found")]
    contents += [table.title for table in tables]
    contents += [panel.title for panel in shown] or [_("Convergence")]
    return render(
        "alignment.html",
        interactive=bool(shown),
        **head_of(result, "Aligned, with warnings", doubts),
        numbers=_numbers(result),
        facts=_facts(result),
        biases=_biases(result),
        tables=tables,
        panels=shown,
        health=health,
        contents=contents + ([_("Health of the log")] if health else []),
    )


def _numbers(result: Alignment) -> list[dict[str, str]]:
    rows = []
    for i, name in enumerate(("Heading", "Pitch", "Roll")):
        known = name != "Heading" or result.heading_known
        rows.append(
            {
                "name": _(name),
                "value": f"{np.degrees(result.euler[i]):.4f}°" if known else _("refused"),
                "sigma": angle_text(float(result.euler_sigma[i])),
                "floor": angle_text(float(result.euler_sigma_floor[i])),
            }
        )
    if result.near_vertical:
        name, value, sigma = result.azimuth
        rows.insert(  # first: heading and roll by themselves mean little there
            0,
            {
                "name": _(name.replace("_", " ").capitalize()),
                "value": f"{np.degrees(value):.4f}°" if result.heading_known else _("refused"),
                "sigma": angle_text(sigma),
                "floor": angle_text(float(np.sqrt(result.phi_floor[2, 2]))),
            },
        )
    return rows


def _facts(result: Alignment) -> list[tuple[str, str]]:
    p, imu = result.position, result.imu
    facts = [
        (_("Log"), _("{source}, {duration:.1f} s used").format(source=result.source, duration=result.duration)),
        (_("Attitude at"), _("{time:.3f} s on the log's clock").format(time=result.time)),
        (_("Place"), f"{np.degrees(p.lat):.5f}°, {np.degrees(p.lon):.5f}°, {p.alt:.0f} m"),
        (_("Method"), f"{result.method}: {clauses(result.method_reason)}"),
        (
            "IMU",
            _(
                "{source}: gyro bias {gyro_bias}, random walk {gyro_walk}; accelerometer bias {accel_bias}, random walk "
                "{accel_walk} (one sigma)"
            ).format(
                source=clauses(result.imu_source),
                gyro_bias=quantity(imu.gyro_bias, "deg/h"),
                gyro_walk=quantity(imu.gyro_random_walk, "deg/sqrt(h)"),
                accel_bias=quantity(imu.accel_bias, "ug"),
                accel_walk=quantity(imu.accel_random_walk, "ug/sqrt(Hz)"),
            ),
        ),
    ]
    if np.all(np.isfinite(result.disturbance)):
        scale, unit = speed_unit(result.disturbance)
        east, north, up = (short(x) for x in result.disturbance / scale)
        words = _("{east}, {north}, {up} {unit} RMS (east, north, up)").format(east=east, north=north, up=up, unit=unit)
        facts.append((_("Base's own motion"), words))
    if result.table is not None:
        facts += _table_facts(result.table, result.heading_known)
    if result.pays_until is not None and result.heading_known:
        late = result.pays_until <= result.duration
        words = (
            _("stopped paying after {time:.0f} s: from there heading's random part is below half its floor")
            if late
            else _("pays until about {time:.0f} s: then heading's random part is half its floor")
        )
        facts.append((_("More time"), words.format(time=result.pays_until)))
    return facts


def _table_facts(table: TurntableErrors, heading_known: bool) -> list[tuple[str, str]]:
    s = table.summary(heading_known)
    facts = []
    for key, name in (("gyro", _("Scale factors, gyros")), ("accel", _("Scale factors, accelerometers"))):
        values = zip("xyz", s[f"{key}_scale_factor_ppm"], s[f"{key}_scale_factor_sigma_ppm"], strict=True)
        facts.append((name, ", ".join(f"{axis} {value:.0f} ± {sigma:.0f}" for axis, value, sigma in values) + " ppm"))
    if s["touched_at_s"] is not None:
        facts.append((_("Touched"), _("at about {time:.0f} s").format(time=s["touched_at_s"])))
    return facts


def _positions(table: TurntableErrors, heading_known: bool) -> Table:
    """When the IMU stood how, and by how much it had been turned."""
    return Table(
        _("Positions of the turntable"),
        [_("position"), _("from, s"), _("to, s"), _("turned, deg"), _("heading, deg"), _("pitch, deg"), _("roll, deg")],
        [
            [
                str(number),
                f"{p['start_s']:.0f}",
                f"{p['stop_s']:.0f}",
                "–" if number == 1 else f"{p['turned_deg']:.3f}",
                _("refused") if p["heading_deg"] is None else f"{p['heading_deg']:.3f}",
                f"{p['pitch_deg']:.3f}",
                f"{p['roll_deg']:.3f}",
            ]
            for number, p in enumerate(table.summary(heading_known)["positions"], start=1)
        ],
    )


def _biases(result: Alignment) -> list[tuple[str, str, str]]:
    rows = []
    accel_scale, accel_name = accel_unit(result.accel_bias_sigma)
    for name, unit, scale, values, sigmas, known in (
        (
            _("Gyro {axis}"),
            "deg/h",
            DEG_PER_HOUR,
            result.gyro_bias,
            result.gyro_bias_sigma,
            result.gyro_bias_estimated,
        ),
        (
            _("Accelerometer {axis}"),
            accel_name,
            accel_scale,
            result.accel_bias,
            result.accel_bias_sigma,
            result.accel_bias_estimated,
        ),
    ):
        for axis, value, sigma, estimated in zip("xyz", values / scale, sigmas / scale, known, strict=True):
            shown = f"{short(value)} {unit}" if estimated else _("not estimated")
            rows.append((name.format(axis=axis), shown, f"{short(sigma)} {unit}"))
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
            "words": _("{motion}, {start:.0f} to {stop:.0f} s").format(motion=_(r.kind), start=r.start, stop=r.stop),
        }
        for r in found.regimes
    ]
    facts = [
        (
            _("Rate"),
            _("{rate:.4g} Hz, jitter {jitter:.3f} ms RMS").format(rate=d["rate_hz"], jitter=d["jitter_rms_ms"]),
        ),
        (_("Gaps"), _gaps(d["gaps"])),
        (_("Repeated rows"), str(d["repeated_rows"])),
        (_("Saturated rows"), str(sum(d["saturated_rows"]))),
    ]
    noise = d["noise"]
    return {
        "notes": [finding for finding in found.findings if finding.severity == "note"],
        "stretches": stretches,
        "legend": {r.kind: _(r.kind) for r in found.regimes},
        "facts": facts,
        "noise": [] if noise is None else _densities(noise),
        "at_rest": noise is not None and noise["motion"] == "still",
        "noise_from": ""
        if noise is None
        else _("{motion}, {start:.0f} to {stop:.0f} s").format(
            motion=_(noise["motion"]), start=noise["from_s"], stop=noise["to_s"]
        ),
    }


def _gaps(gaps: list[dict[str, float]]) -> str:
    if not gaps:
        return "0"
    longest = max(gaps, key=lambda gap: gap["length_s"])
    return _("{count}, the longest {length:.3g} s at {time:.1f} s").format(
        count=len(gaps), length=longest["length_s"], time=longest["time_s"]
    )


def _densities(noise: dict[str, Any]) -> list[list[str]]:
    """Noise of each axis; a process that the log does not resolve is left out."""
    rows = []
    for words, key, unit in (
        (_("Angle random walk"), "angle_random_walk_deg_sqrt_h", "deg/√h"),
        (_("Gyro bias instability"), "gyro_bias_instability_deg_h", "deg/h"),
        (_("Velocity random walk"), "velocity_random_walk_ug_sqrt_hz", "µg/√Hz"),
        (_("Accelerometer bias instability"), "accel_bias_instability_ug", "µg"),
    ):
        if any(noise[key]):
            rows.append([words, *(short(value) if value else "–" for value in noise[key]), unit])
    return rows
