"""One page on a simulated log: where the base went, how it moved and lay, and what the sensors give."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from truenorth.core.attitude import euler_from_dcm
from truenorth.core.earth import radii
from truenorth.core.units import STANDARD_GRAVITY
from truenorth.figures.style import AXES_NAMES, COLOURS, REFERENCE, headed, new_figure, style, trace
from truenorth.records import GnssRecord, HeightRecord, MasterRecord, OdometerRecord, Record, VelocityRecord

if TYPE_CHECKING:
    from truenorth.records.motion import MotionStates
    from truenorth.simulation.aiding import Aided
    from truenorth.simulation.runs import Simulation

Array = NDArray[np.float64]
AIDING_COLOURS = {
    "gnss": COLOURS[1],
    "odometer": COLOURS[1],
    "velocity_log": COLOURS[1],
    "height": COLOURS[3],
    "master": COLOURS[1],
}
SAMPLES = 20_000  # of the truth, evenly; enough for a page


def plot_simulation(simulation: Simulation, title: str = "", aiding: Mapping[str, Aided[Any]] | None = None) -> Figure:
    """Draw the track, speed and height, attitude, rates and specific forces of one run.

    Parameters
    ----------
    aiding : mapping of name to Aided, optional
        Logs of aiding sensors; what they say of track, speed and height is drawn as dots.

    Returns
    -------
    matplotlib.figure.Figure
    """
    record = simulation.record
    times = record.time[np.unique(np.linspace(0, len(record) - 1, SAMPLES).astype(np.intp))]
    truth = simulation.motion.states(times)
    span = float(times[-1] - times[0])
    unit, name = (3600.0, "h") if span > 3 * 3600 else (1.0, "s")
    with style():
        figure = new_figure(12.0, 8.5)
        columns = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.35])
        left, right = columns[0].subgridspec(3, 1, height_ratios=[2.0, 1.0, 1.0]), columns[1].subgridspec(4, 1)
        track = figure.add_subplot(left[0])
        _track(track, truth)
        speed = figure.add_subplot(left[1])
        height = figure.add_subplot(left[2], sharex=speed)
        trace(speed, times / unit, np.linalg.norm(truth.v_n, axis=1), color=COLOURS[0])
        trace(height, times / unit, truth.alt, color=COLOURS[2])
        speed.set(title="Speed", ylabel="m/s")
        height.set(title="Height above the ellipsoid", ylabel="m", xlabel=f"time, {name}")
        for sensor, log in (aiding or {}).items():
            _aiding_dots(sensor, log.record, track, speed, height, truth, unit)
        for ax in (speed, height):
            if ax.get_legend_handles_labels()[0]:
                _legend(ax, 3)
        rows = [figure.add_subplot(right[0])]
        rows += [figure.add_subplot(right[k], sharex=rows[0]) for k in range(1, 4)]
        _attitude(rows[0], rows[1], times / unit, truth)
        step = record.interval if record.kind == "increments" else 1.0
        _signals(rows[2], record.time / unit, np.degrees(record.gyro / step), "Gyros", "deg/s")
        _signals(rows[3], record.time / unit, record.accel / step / STANDARD_GRAVITY, "Accelerometers", "g")
        rows[3].set_xlabel(f"time, {name}")
        for ax in (speed, *rows[:3]):
            ax.tick_params(labelbottom=False)
        headed(figure, title or record.source)
    return figure


def _track(ax: Axes, truth: MotionStates) -> None:
    """East and north of the first position, in metres or kilometres, to one scale."""
    east, north = _plane(truth.lat, truth.lon, truth)
    extent = float(max(np.ptp(east), np.ptp(north)))
    factor, unit = (1e-3, "km") if extent > 3e3 else (1.0, "m")
    if extent < 1e-6:
        ax.plot(0.0, 0.0, "o", color=COLOURS[0])
        ax.set(xlim=(-1, 1), ylim=(-1, 1))
    else:
        ax.plot(east * factor, north * factor, color=COLOURS[0])
        ax.plot(east[0] * factor, north[0] * factor, "o", color=COLOURS[2], label="start")
        ax.plot(east[-1] * factor, north[-1] * factor, "s", color=COLOURS[1], label="end")
        ax.legend()
        ax.margins(0.08)
        ax.set_aspect("equal", adjustable="datalim")
    place = f"{abs(np.degrees(truth.lat[0])):.4f} {'N' if truth.lat[0] >= 0 else 'S'}, "
    place += f"{abs(np.degrees(truth.lon[0])):.4f} {'E' if truth.lon[0] >= 0 else 'W'}"
    ax.set(title=f"Track of the IMU, from {place}", xlabel=f"east, {unit}", ylabel=f"north, {unit}")


def _plane(lat: Array, lon: Array, truth: MotionStates) -> tuple[Array, Array]:
    """East and north of the first true position, m."""
    R_M, R_N = radii(truth.lat[0])
    return (lon - truth.lon[0]) * (R_N + truth.alt[0]) * np.cos(lat), (lat - truth.lat[0]) * (R_M + truth.alt[0])


def _aiding_dots(
    name: str, record: Record, track: Axes, speed: Axes, height: Axes, truth: MotionStates, unit: float
) -> None:
    """What an aiding sensor says of track, speed and height, faint."""
    dots: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 2.5, "alpha": 0.5, "zorder": 1}
    dots |= {"color": AIDING_COLOURS.get(name, REFERENCE), "label": name.replace("_", " ")}
    time = record.time / unit
    if isinstance(record, GnssRecord):
        east, north = _plane(record.lat, record.lon, truth)
        factor = 1e-3 if "km" in track.get_xlabel() else 1.0
        track.plot(east * factor, north * factor, **dots)
        track.legend()
        _legible(track)
        height.plot(time, record.alt, **dots)
    elif isinstance(record, HeightRecord):
        height.plot(time, record.alt, **dots)
    elif isinstance(record, OdometerRecord):
        speed.plot(time, np.abs(record.speed), **dots)
    elif isinstance(record, VelocityRecord):
        speed.plot(time, np.sqrt(np.nansum(record.velocity**2, axis=1)), **dots)
    elif isinstance(record, MasterRecord) and record.v_n is not None:
        speed.plot(time, np.linalg.norm(record.v_n, axis=1), **dots)


def _attitude(heading_axes: Axes, tilt_axes: Axes, time: Array, truth: MotionStates) -> None:
    heading, pitch, roll = (np.degrees(x) for x in euler_from_dcm(truth.C_nb))
    heading = np.mod(heading, 360.0)
    _turning(heading_axes, time, heading, color=COLOURS[0])
    if np.ptp(heading) > 180.0:
        heading_axes.set(ylim=(0, 360), yticks=(0, 90, 180, 270, 360))
    heading_axes.set(title="Heading of the IMU, true", ylabel="deg")
    trace(tilt_axes, time, pitch, color=COLOURS[0], label="pitch")
    _turning(tilt_axes, time, roll, color=COLOURS[1], label="roll")
    tilt_axes.set(title="Pitch and roll of the IMU, true", ylabel="deg")
    _legend(tilt_axes, 2)


def _turning(ax: Axes, time: Array, angle: Array, **options: Any) -> None:
    """An angle (deg) that goes round: no line across the page where it comes in again on the other side."""
    jumps = np.flatnonzero(np.abs(np.diff(angle)) > 180.0)
    if jumps.size:
        ax.plot(np.insert(time, jumps + 1, time[jumps]), np.insert(angle, jumps + 1, np.nan), **options)
    else:
        trace(ax, time, angle, **options)


def _signals(ax: Axes, time: Array, values: Array, title: str, unit: str) -> None:
    upright = unit == "g" and float(np.percentile(values[:, 2], 2.0)) > 0.5
    for axis in range(3):
        less_gravity = axis == 2 and upright  # or the vertical axis would flatten the others
        label = f"{AXES_NAMES[axis]} − 1 g" if less_gravity else AXES_NAMES[axis]
        trace(ax, time, values[:, axis] - less_gravity, color=COLOURS[axis], label=label, linewidth=0.8)
    ax.axhline(0.0, color=REFERENCE, linewidth=0.6)
    ax.set(title=f"{title}, as the IMU gives them", ylabel=unit)
    _legend(ax, 3)


def _legend(ax: Axes, columns: int) -> None:
    """On the title's line, where no trace can run through it."""
    ax.legend(ncols=columns, loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
    _legible(ax)


def _legible(ax: Axes) -> None:
    """Dots as faint and small as those of a log would not be seen in a legend."""
    legend = ax.get_legend()
    for handle in legend.legend_handles if legend is not None else ():
        if isinstance(handle, Line2D) and handle.get_marker() == ".":
            handle.set(markersize=9, alpha=1.0)
