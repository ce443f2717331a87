"""`truenorth reproduce gyro_free`: the angular rate of twelve accelerometers, by three ways. Related work of system 4."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from truenorth.core.earth import EARTH_RATE
from truenorth.core.units import MICRO_G
from truenorth.figures.style import COLOURS, REFERENCE
from truenorth.papers.drawing import sheet
from truenorth.papers.study import Study
from truenorth.papers.table import Table
from truenorth.papers.texts import read_texts
from truenorth.simulation.streams import stream
from truenorth.strapdown.gyro_free import field_of, rate_filter

Array = NDArray[np.float64]

RUNS = 50
RATE, DURATION, WINDOW = 100.0, 60.0, 10.0  # Hz, s, s
ARM = 0.3  # m, of the places on the three axes
PLACES = ARM * np.vstack([np.zeros(3), np.eye(3)])
BIAS, WALK = 50.0 * MICRO_G, 50.0 * MICRO_G  # m/s^2, and of a second's mean
AMPLITUDES, PERIODS = np.radians([60.0, 45.0, 30.0]), np.array([3.0, 4.0, 5.0])  # rad/s, s
DEGREE_PER_HOUR = np.radians(1.0 / 3600.0)
STREAM = 320
NAMES = {"integrated": "w' integrated", "roots": "roots of the squares", "filter": "Kalman filter"}

TEXTS = read_texts(__file__)
RULES = TEXTS.rules


def reproduce(runs: int | None, seed: int, full: bool, workers: int, progress: Callable[[str], None]) -> Study:
    """Run the study; see :func:`truenorth.papers.reproduce`."""
    count, table = runs or RUNS, Table()
    drawn: dict[str, Array] = {}
    for number, (case, amplitude) in enumerate({"tumbling": AMPLITUDES, "rest": np.zeros(3)}.items()):
        progress(f"{case}: {count} runs")
        true, found, sigma = simulate(amplitude, count, seed, number)
        for method, rate in found.items():
            error = (rate - true) / DEGREE_PER_HOUR
            last = np.sqrt(np.mean(error[:, -round(WINDOW * RATE) :] ** 2, axis=(1, 2)))
            begin = DURATION - WINDOW
            table.errors(case, method, "rate", last, "deg/h", time=DURATION, start=begin, noise="random_walk")
            for i, axis in enumerate("xyz"):
                claimed = sigma[:, -1, i] / DEGREE_PER_HOUR if method == "filter" else None
                table.errors(
                    case, method, f"rate_{axis}", error[:, -1, i], "deg/h", claimed, time=DURATION, noise="random_walk"
                )
        if case == "tumbling":
            drawn = {method: rate - true for method, rate in found.items()}
    return TEXTS.study(table, {"rate": draw_rate(drawn)}, arm=ARM, rate=RATE)


def simulate(amplitude: Array, runs: int, seed: int, case: int) -> tuple[Array, dict[str, Array], Array]:
    """True rate (K, 3), the rate by each method (R, K, 3), and the filter's sigma."""
    h = 1.0 / RATE
    t = h * np.arange(1.0, DURATION * RATE + 1.0)
    turn = 2.0 * np.pi / PERIODS
    earth = EARTH_RATE * np.array([0.0, 0.7, 0.7])
    w = earth + amplitude * np.sin(turn * t[:, None])
    middle = t[:, None] - 0.5 * h
    draws = [stream(seed, case, run, STREAM) for run in range(runs)]
    bias = np.stack([BIAS * rng.standard_normal((4, 3)) for rng in draws])
    noise = np.stack([rng.standard_normal((len(t), 4, 3)) for rng in draws]) * WALK / np.sqrt(h)
    start = earth + np.radians(0.1) * np.stack([rng.standard_normal(3) for rng in draws])

    def force(rate: Array, acceleration: Array) -> Array:
        arms = np.cross(acceleration[:, None], PLACES) + np.cross(rate[:, None], np.cross(rate[:, None], PLACES))
        return np.asarray(np.array([0.0, 0.0, 9.8]) + arms)

    # The mean acceleration of a sample is that at its middle, the squares are those at its end.
    at_end = field_of(force(w, amplitude * turn * np.cos(turn * t[:, None])) + bias[:, None] + noise, PLACES)
    w_middle = earth + amplitude * np.sin(turn * middle)
    mid = field_of(force(w_middle, amplitude * turn * np.cos(turn * middle)) + bias[:, None] + noise, PLACES)
    field = at_end._replace(acceleration=mid.acceleration)
    rate, sigma = rate_filter(field, h, PLACES, WALK / np.sqrt(h), BIAS, start, float(np.radians(0.1)))
    found = {
        "integrated": start[:, None] + h * np.cumsum(field.acceleration, axis=1),
        "roots": np.sign(w) * np.sqrt(np.maximum(field.square[..., :3], 0.0)),
        "filter": rate,
    }
    return w, found, sigma


def draw_rate(errors: Mapping[str, Array]) -> Figure:
    """RMS of the rate's error over time."""
    with sheet(9.0, 4.2, legend=3) as (figure, ax):
        for (method, e), colour in zip(errors.items(), COLOURS, strict=False):
            rms = np.sqrt(np.mean(e**2, axis=(0, 2))) / DEGREE_PER_HOUR
            ax.plot(np.arange(1, len(rms) + 1) / RATE, rms, color=colour, linewidth=1.0, label=NAMES[method])
        ax.axhline(EARTH_RATE / DEGREE_PER_HOUR, color=REFERENCE, linestyle="--", linewidth=0.8)
        ax.set(yscale="log", xlabel="time, s", ylabel="error of the rate, deg/h", xlim=(0.0, DURATION))
    return figure
