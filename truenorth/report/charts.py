"""Charts of an alignment: convergence with bands, sigma against time, biases, innovations, NIS, the log's Allan deviation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truenorth.core.language import translated as _
from truenorth.core.units import DEG_PER_HOUR, MICRO_G
from truenorth.figures.convergence import NIS_BLOCK, Course, averaged_nis, courses, settled_limits
from truenorth.figures.units import Clock, accel_unit, unit_of
from truenorth.report.chart import Chart
from truenorth.report.document import Panel

if TYPE_CHECKING:
    from truenorth.alignment.result import Alignment, History
    from truenorth.analysis.allan import NoiseCoefficients
    from truenorth.quality import Inspection

Array = NDArray[np.float64]


def panels(result: Alignment) -> list[Panel]:
    """Charts of the history, none without one; then the Allan deviation, where the log was inspected."""
    return [*_of_history(result), *allan_panels(result.inspection)]


def _of_history(result: Alignment) -> list[Panel]:
    h = result.history
    if h is None:
        return []
    angles = courses(result)
    clock = Clock.of(h.time)
    refused = "" if result.heading_known else " " + _("The heading is refused, and not drawn.")
    not_estimated = _("With one-sigma bands. A band as wide as at the start means: not estimated.")
    return [
        Panel(
            _("Convergence"),
            _(
                "The attitude at the answer's epoch as each earlier time gives it, with the base's own motion taken out. Light "
                "band: one sigma. Dark band: its floor, which waiting does not improve. The axes fit the last three quarters of "
                "the log."
            )
            + refused,
            _convergence(h.time, angles, result.heading_known, clock),
        ),
        Panel(
            _("How the uncertainty falls"),
            _(
                "One sigma of each angle; dotted: its floor. Where a line has met its floor, more time does not pay. Here time "
                "counts from the first epoch."
            ),
            _sigmas(h.time, angles, clock),
        ),
        Panel(
            _("Gyro bias"), not_estimated, _biases(h.time, h.gyro_bias, h.gyro_bias_sigma, DEG_PER_HOUR, "deg/h", clock)
        ),
        Panel(
            _("Accelerometer bias"),
            not_estimated,
            _biases(h.time, h.accel_bias, h.accel_bias_sigma, *accel_unit(h.accel_bias_sigma[-1]), clock),
        ),
        Panel(
            _("Innovations"),
            _(
                "Predicted less measured: {what}. Dotted: two sigma; dashed: three sigma. The innovations should look like "
                "noise and stay inside."
            ).format(what=_(h.innovation_of)),
            _innovations(h, clock),
        ),
        Panel(
            _("Normalised innovation squared"),
            _(
                "Mean of {block} epochs, with the 95 % band of such a mean. {expected} is expected; the mean over the log is "
                "{mean:.2f}. The band is that of independent innovations: where the base's own motion makes neighbours alike, "
                "more means fall outside."
            ).format(block=NIS_BLOCK, expected=len(h.components), mean=np.nanmean(h.nis)),
            _nis(h, clock),
        ),
    ]


def over_time(clock: Clock) -> str:
    """Title of an axis of time."""
    return _("time, {unit}").format(unit=clock.label)


def _convergence(t: Array, angles: list[Course], heading_known: bool, clock: Clock) -> Chart:
    shown = list(enumerate(angles))[0 if heading_known else 1 :]
    chart = Chart([f"{_(course.name)}, deg" for _number, course in shown], over_time(clock))
    for row, (number, course) in enumerate(shown):
        value, sigma, floor = (np.degrees(x) for x in (course.value, course.sigma, course.floor))
        for half in (sigma, floor):
            chart.band(row, clock(t), value - half, value + half, f"c{number}")
        chart.line(row, clock(t), value, f"c{number}", _(course.name))
        chart.axis(row, range=list(settled_limits(value, sigma)))
    return chart


def _sigmas(t: Array, angles: list[Course], clock: Clock) -> Chart:
    chart = Chart([_("one sigma, arcmin")], _("time, {unit}").format(unit=clock.unit), height=380)
    since = clock.lasting(t[1:] - t[0])  # zero has no logarithm
    for number, course in enumerate(angles):
        for values, dash, name in (
            (course.sigma, "solid", _(course.name)),
            (course.floor, "dot", _("{angle}, floor").format(angle=_(course.name))),
        ):
            chart.line(0, since, 60 * np.degrees(values[1:]), f"c{number}", name, dash=dash, key=True)
    lowest = 0.5 * 60 * np.degrees(min(course.floor[-1] for course in angles))
    highest = 2.0 * 60 * np.degrees(max(course.sigma[1:].max() for course in angles))
    chart.axis(0, type="log", range=[float(np.log10(max(lowest, 1e-6))), float(np.log10(highest))])
    chart.across(type="log")
    return chart


def _biases(t: Array, bias: Array, sigma: Array, scale: float, unit: str, clock: Clock) -> Chart:
    chart = Chart([f"{axis}, {unit}" for axis in "xyz"], over_time(clock))
    for i, axis in enumerate("xyz"):
        middle, half = bias[:, i] / scale, sigma[:, i] / scale
        chart.band(i, clock(t), middle - half, middle + half, f"c{i}")
        chart.line(i, clock(t), middle, f"c{i}", axis)
        chart.axis(i, range=list(settled_limits(middle, half)))
    return chart


def _innovations(h: History, clock: Clock) -> Chart:
    scale, unit = unit_of(h.innovation_unit, h.innovation_sigma[len(h.time) // 4 :])
    names = [_(h.innovation_axes[i]) for i in h.components]
    chart = Chart([f"{name}, {unit}" for name in names], over_time(clock))
    for row, (i, name) in enumerate(zip(h.components, names)):
        sigma = h.innovation_sigma[:, i] / scale
        chart.line(row, clock(h.time), h.innovation[:, i] / scale, f"c{row}", name)
        limits(chart, row, clock(h.time), sigma)
        chart.axis(row, range=list(settled_limits(np.zeros_like(sigma), 4.0 * sigma)))
    return chart


def limits(chart: Chart, row: int, x: Array, sigma: Array) -> None:
    """Two and three sigma on both sides."""
    for factor, dash in ((2.0, "dot"), (3.0, "dash")):
        for sign in (1.0, -1.0):
            chart.limit(row, x, sign * factor * sigma, dash)


def _nis(h: History, clock: Clock) -> Chart:
    t, mean, low, high = averaged_nis(h)
    chart = Chart(["NIS"], over_time(clock), height=320)
    ends = clock(h.time[[0, -1]])
    chart.band(0, ends, np.full(2, low), np.full(2, high), "ref")
    chart.limit(0, ends, np.full(2, float(len(h.components))), "dash")
    chart.line(0, clock(t), mean, "c0", "NIS")
    chart.axis(0, range=[0.0, max(1.3 * high, float(np.quantile(mean, 0.98)) if mean.size else 0.0)])
    chart.across(range=list(ends))
    return chart


def allan_panels(inspection: Inspection | None) -> list[Panel]:
    """The Allan deviation of the longest part at rest, with the model that was fitted to it."""
    if inspection is None or inspection.gyro_noise is None or inspection.accel_noise is None:
        return []
    rest = inspection.noise_from
    assert rest is not None  # the noise comes from there
    chart = Chart([_("gyro, deg/h"), _("accelerometer, µg")], _("averaging time, s"), height=460)
    for row, (noise, scale) in enumerate(
        ((inspection.gyro_noise, DEG_PER_HOUR), (inspection.accel_noise, MICRO_G)),
    ):
        _allan(chart, row, noise, scale)
    chart.across(type="log")
    return [
        Panel(
            _("Allan deviation"),
            _(
                "From the longest part at rest, {start:.0f} to {stop:.0f} s, with one-sigma bars; dashed: the fitted model. A "
                "slope of -1/2 is random walk, the flat part bias instability. Where the base moves, it is an upper bound."
            ).format(start=rest.start, stop=rest.stop),
            chart,
        )
    ]


def _allan(chart: Chart, row: int, noise: NoiseCoefficients, scale: float) -> None:
    tau = noise.allan.tau
    model = np.sqrt(noise.variance(tau)) / scale
    deviation, sigma = noise.allan.deviation / scale, noise.allan.sigma / scale
    for i, axis in enumerate("xyz"):
        bars = (np.minimum(sigma[:, i], 0.9 * deviation[:, i]), sigma[:, i])
        chart.points(row, tau, deviation[:, i], f"c{i}", axis, error=bars, key=row == 0, size=6.0)
        chart.line(row, tau, np.where(model[:, i] > 0.0, model[:, i], np.nan), f"c{i}", "", dash="dash")
    chart.axis(row, type="log")
