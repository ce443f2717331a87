"""One page on a log: what the sensors saw, how the base moved, and the Allan deviation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from truenorth.core.errors import UsageError
from truenorth.core.units import parse_unit
from truenorth.figures.style import AXES_NAMES, COLOURS, REFERENCE, headed, new_figure, style, trace

if TYPE_CHECKING:
    from truenorth.analysis.allan import NoiseCoefficients
    from truenorth.quality import Inspection
    from truenorth.records import ImuRecord

Array = NDArray[np.float64]

# Pale: the traces lie over them; the legend names them.
REGIME_COLOURS = {
    "still": "#E3F1E7",
    "disturbed": "#FBF0C9",
    "swaying": "#D3E6F5",
    "rotating": "#E8DAEC",
    "moving": "#F9D8C4",
    "unknown": "#EEEEEE",
}
FAULT = "#B00020"


def plot_inspection(inspection: Inspection) -> Figure:
    """Draw rates, specific force and wander over the regimes of motion, and the Allan deviations.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with style():
        figure = new_figure(11.5, 8.0)
        columns = figure.add_gridspec(1, 2, width_ratios=[1.6, 1.0])
        left, right = columns[0].subgridspec(3, 1), columns[1].subgridspec(2, 1)
        rate = figure.add_subplot(left[0])
        force = figure.add_subplot(left[1], sharex=rate)
        wander = figure.add_subplot(left[2], sharex=rate)
        _signals(inspection, rate, force)
        _wander(inspection, wander)
        for ax in (rate, force, wander):
            _mark(inspection, ax)
        for ax in (rate, force):
            ax.tick_params(labelbottom=False)
        wander.set_xlabel("time, s")
        draw_allan(figure.add_subplot(right[0]), inspection.gyro_noise, "Gyro Allan deviation", "deg/h")
        draw_allan(figure.add_subplot(right[1]), inspection.accel_noise, "Accelerometer Allan deviation", "ug")
        headed(figure, _title(inspection))
        figure.legend(handles=_legend(inspection), loc="outside lower left", ncols=9, fontsize=9, handlelength=1.4)
    return figure


def _title(inspection: Inspection) -> str:
    faults = [f.code.replace("_", " ") for f in inspection.findings if f.severity != "note"]
    verdict = f"found: {', '.join(dict.fromkeys(faults))}" if faults else "nothing wrong was found"
    motion = ", ".join(
        f"{kind} {inspection.motion.fraction(kind):.0%}"
        for kind in REGIME_COLOURS
        if inspection.motion.fraction(kind) > 0.0
    )
    return (
        f"{inspection.source}: {inspection.duration:.0f} s at {1.0 / inspection.interval:.4g} Hz, {motion}\n{verdict}"
    )


def _signals(inspection: Inspection, rate: Axes, force: Axes) -> None:
    """One-second means, over the faint samples where these do not fill the panel."""
    record, motion = _record(inspection), inspection.motion
    scale = 1.0 / record.interval if record.kind == "increments" else 1.0
    middle = _middle(inspection)
    panels = (
        (rate, np.degrees(record.gyro * scale), np.degrees(motion.rate + motion.rate_bias), np.zeros(3)),
        (force, record.accel * scale, motion.specific_force, middle),
    )
    for ax, samples, means, about in panels:
        slow = 1.2 * float(np.abs(means - about).max(initial=0.0))
        fast = 1.1 * float(np.quantile(np.abs(samples - about), 0.999))
        if slow == 0.0 or fast < 4.0 * slow:
            for axis, colour in enumerate(COLOURS[:3]):
                trace(ax, record.time, samples[:, axis] - about[axis], color=colour, alpha=0.25, linewidth=0.5)
            slow = max(slow, fast, 1e-9)
        for axis, colour in enumerate(COLOURS[:3]):
            trace(ax, motion.time - 0.5, means[:, axis] - about[axis], color=colour)
        ax.set_ylim(-slow, slow)
    rate.set_title("Angular rate, one-second means")
    rate.set_ylabel("deg/s")
    force.set_title("Specific force about ({:+.3f}, {:+.3f}, {:+.3f}) m/s²".format(*middle))
    force.set_ylabel("m/s²")


def _middle(inspection: Inspection) -> Array:
    """(3,) usual specific force, m/s^2: single samples may know few values, their means know more."""
    record, motion = _record(inspection), inspection.motion
    if motion.time.size:
        return np.asarray(np.median(motion.specific_force, axis=0))
    scale = 1.0 / record.interval if record.kind == "increments" else 1.0
    return np.asarray(record.accel.mean(axis=0) * scale)


def _wander(inspection: Inspection, ax: Axes) -> None:
    from truenorth.quality.signals import STILL_ANGLE, WINDOW

    motion = inspection.motion
    ax.set_title(f"Wander of the angle over {WINDOW} s, RMS (dashed: sensor noise alone)")
    ax.set_ylabel("arcsec")
    if not motion.time.size:
        return
    arcsec = parse_unit("arcsec")[0]
    trace(ax, motion.time - 0.5, np.maximum(motion.wander, 1e-3 * arcsec) / arcsec, color=REFERENCE)
    noise = float(np.max(motion.angle_noise)) * np.sqrt(WINDOW / 15.0)
    ax.axhline(noise / arcsec, color=COLOURS[0], linestyle="--", linewidth=1.2)
    ax.set_yscale("log")
    low = np.log10(max(min(float(motion.wander.min()), noise) / arcsec, 1e-3))
    high = np.log10(max(float(motion.wander.max()), STILL_ANGLE) / arcsec)
    ax.set_ylim(10.0 ** np.floor(low), 10.0 ** np.ceil(high))


def _mark(inspection: Inspection, ax: Axes) -> None:
    """Shade the regimes and mark the gaps."""
    for regime in inspection.regimes:
        ax.axvspan(regime.start, regime.stop, color=REGIME_COLOURS[regime.kind], linewidth=0.0, zorder=0)
    for time, length in zip(inspection.sampling.gap_times, inspection.sampling.gap_lengths):
        ax.axvspan(time - length, time, color=FAULT, alpha=0.6, linewidth=0.8, zorder=3)
    ax.set_xlim(inspection.start, inspection.stop)


def _legend(inspection: Inspection) -> list[Patch]:
    kinds = [kind for kind in REGIME_COLOURS if any(r.kind == kind for r in inspection.regimes)]
    handles = [Patch(color=COLOURS[axis], label=name) for axis, name in enumerate(AXES_NAMES)]
    handles += [Patch(facecolor=REGIME_COLOURS[kind], edgecolor="#BBBBBB", label=kind) for kind in kinds]
    if inspection.sampling.gap_times.size:
        handles.append(Patch(color=FAULT, alpha=0.6, label="gap"))
    return handles


def draw_allan(ax: Axes, noise: NoiseCoefficients | None, title: str, unit: str) -> None:
    """Measured points with their one-sigma, and the fitted model through them."""
    ax.set_title(title)
    if noise is None:
        ax.text(0.5, 0.5, "no stretch at rest", transform=ax.transAxes, ha="center", va="center", color=REFERENCE)
        ax.set_axis_off()
        return
    factor, _ = parse_unit(unit)
    allan = noise.allan
    tau = np.geomspace(allan.tau[0], allan.tau[-1], 100)
    model = np.sqrt(noise.variance(tau)) / factor
    for axis in range(3):
        positive = allan.deviation[:, axis] > 0.0
        ax.errorbar(
            allan.tau[positive],
            allan.deviation[positive, axis] / factor,
            np.minimum(allan.sigma, 0.9 * allan.deviation)[positive, axis] / factor,
            color=COLOURS[axis],
            fmt="o",
            markersize=3.5,
            linewidth=0.9,
        )
        if np.any(model[:, axis] > 0.0):
            ax.plot(tau, model[:, axis], color=COLOURS[axis], linewidth=1.0)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.margins(x=0.04)
    ax.set_xlabel("averaging time, s")
    ax.set_ylabel("deg/h" if unit == "deg/h" else "µg")
    ax.grid(True, which="minor", linewidth=0.3, color="#E8E8E8")


def _record(inspection: Inspection) -> ImuRecord:
    if inspection.record is None:
        raise UsageError(
            f"{inspection.source}: an inspection that was read from a file has no log to draw; inspect the log again"
        )
    return inspection.record
