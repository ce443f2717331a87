"""What rounding leaves in the integrals of a sensor on the move: white noise and a bias that changes, or a random walk.

A row that is rounded to steps of q, and whose remainder is lost, is off by an error of variance ``q^2 / 12``. Noise or motion of
more than a step makes it white. Where less goes on it stays as it is, as long as the sensor stays where it is: of a sine of
amplitude A a mean error of at most ``(q / pi) |J_0(2 pi A / q)|`` is left, of noise of sigma s it has ``exp(-2 pi^2 s^2 / q^2)``
of that. A regime is a time in which the mean stays between the same two steps; its error acts over all of it.

Errors of regimes that last T on the average are independent, so that they are correlated as ``exp(-t/T)``: a Gauss-Markov process
of that size h. What measures velocity or position sees it within a regime; there it is a bias, which from one regime to the next
moves by ``sqrt(2) h``, as a random walk of the bias of density ``h sqrt(2/T)`` does. What nothing aids integrates over many
regimes; there it is forgotten, and white noise of density ``h sqrt(T)``, as regimes are of one length. Each way is wrong at the
other's place. A walk of that size is many times the noise of the sensor: aids that come within a regime were worth little against
it, and a master's attitude ten times a second hid the delay of a slave (27 ms off, its seat 8 sigmas).

A counter that carries the remainder on loses nothing: the error of its rows is the difference of white noise, so that the floor of
its spectrum, between the lines of a vibration, falls towards low frequencies. That of lost remainders does not.

Source: B. Widrow and I. Kollar, *Quantization Noise*, Cambridge 2008, ch. 4 and appendix G (Gaussian and sine waves);
A. Gelb (ed.), *Applied Optimal Estimation*, 1974, sec. 3.8 (a Gauss-Markov process and its limits).
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truenorth.quality.quantum import lattice, rounded
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec

Array = NDArray[np.float64]

REPEATS = 0.05  # of the rows that repeat the one before: fewer do where the noise is larger than a step
WINDOW, FEWEST = 4.0, 64  # s, and rows at least, of a window in which motion is looked at
LOW, HIGH = (0.03, 0.15), (0.25, 0.5)  # of the rate of rows: bands in which the error of rounding is looked at
CARRIED = 0.4  # of what remainders that are carried on make of their ratio; simulated: 0 of lost ones, .5 to 1 below .2 of noise
FLOOR = 0.02  # of a step squared, of at least .2: a vibration without noise has nothing between its lines
TWO = 0.9  # of the rows on the two fullest levels at least: else noise is wider than .4 of a step
NOISE = 0.9  # of the white part that is found: overtones of a rounded vibration add a tenth
LARGE = 4.0  # steps: motion that is larger passes over all places between two steps
LOWEST = 4  # lines of a spectrum that the slow motion of a vehicle fills


def with_rounding(spec: ImuSpec, record: ImuRecord, *, aided: bool = True) -> ImuSpec:
    """The specification with what lost remainders leave; as it is for sensors that it says to be counters.

    Parameters
    ----------
    spec : ImuSpec
    record : ImuRecord
        As it was logged: neither corrected nor bridged.
    aided : bool
        Velocity or position is measured within a regime: white noise, and biases that change from regime to regime. Else random
        walks of the same variance at the end.
    """
    if not aided:
        gyro, accel = rounding_walks(record)
        counts = spec.gyro_quantisation > 0.0, spec.accel_quantisation > 0.0
        return spec.with_more_noise(0.0 if counts[0] else gyro, 0.0 if counts[1] else accel)
    scale, unit = (record.interval, 1.0) if record.kind == "rates" else (1.0, 1.0 / record.interval)
    more: dict[str, Any] = {}
    for name, lost in zip(("gyro", "accel"), _of_sensors(record), strict=True):
        if getattr(spec, f"{name}_quantisation") > 0.0 or lost.walk == 0.0:
            continue
        held = {
            "random_walk": scale * lost.white / math.sqrt(record.interval),
            "bias": unit * lost.held,
            "rate_random_walk": unit * lost.held * math.sqrt(2.0 / (lost.rows * record.interval)),
        }
        more |= {f"{name}_{key}": math.hypot(getattr(spec, f"{name}_{key}"), size) for key, size in held.items()}
    return replace(spec, **more)


def rounding_walks(record: ImuRecord) -> tuple[float, float]:
    """Random walks of angle and velocity, rad/sqrt(s) and m/s/sqrt(s), of the worst axis: what lost remainders leave.

    Parameters
    ----------
    record : ImuRecord
        As it was logged: neither corrected nor bridged.
    """
    scale = record.interval if record.kind == "rates" else 1.0
    gyro, accel = (scale * x.walk / math.sqrt(record.interval) for x in _of_sensors(record))
    return gyro, accel


class Lost(NamedTuple):
    """Of the rows of a channel: one sigma of the white part and of what stays in a regime, and the rows of one."""

    white: float
    held: float
    rows: float

    @property
    def walk(self) -> float:
        """Root of the variance by which the sum of all rows grows in each."""
        return math.hypot(self.white, self.held * math.sqrt(self.rows))


NOTHING = Lost(0.0, 0.0, 1.0)


def _of_sensors(record: ImuRecord) -> list[Lost]:
    """What gyros and accelerometers lose, of the worst axis."""
    rows = max(FEWEST, round(WINDOW / record.interval))
    lost = [[_lost(x, rows) for x in sensor.T] for sensor in (record.gyro, record.accel)]
    # One logger wrote them: where most axes of a sensor carry on, so do those whose motion hides it.
    if any(sensor.count(None) > 1 for sensor in lost):
        return [NOTHING, NOTHING]
    return [max((x or NOTHING for x in sensor), key=lambda x: x.walk) for sensor in lost]


def _lost(values: Array, rows: int) -> Lost | None:
    """What rounding a channel (N,) loses; None where remainders are carried on."""
    if np.count_nonzero(np.diff(values) == 0.0) < REPEATS * len(values):
        return NOTHING
    step, counts = lattice(values)
    windows = len(counts) // rows
    if step == 0.0 or windows == 0:
        return NOTHING
    counts = counts[: windows * rows].reshape(windows, rows)
    mean, spread, lines = counts.mean(axis=1), counts.std(axis=1), _lines(counts)
    if spread.any() and _carried(lines[spread > 0.0].mean(axis=0)):
        return None
    floor = _floor(lines)
    of_noise = np.array([_of_noise(x) for x in counts])
    bounds = [0, *(1 + np.flatnonzero(np.abs(np.diff(mean)) > 0.5)), windows]
    sums = squares = 0.0
    for first, last in pairwise(bounds):
        part = slice(first, last)
        noise = max(NOISE * float(np.exp(np.mean(np.log(floor[part])))) - 1.0 / 12.0, 0.0)
        of_sine = _of_sine(np.sqrt(2.0 * np.maximum(spread[part] ** 2 - 1.0 / 12.0, 0.0))) * math.exp(
            -2.0 * math.pi**2 * noise
        )
        total = float(np.maximum(of_sine, of_noise[part]).sum())
        sums += total**2
        squares += total**2 / (last - first)
    white, held = step / math.sqrt(12.0), step * math.sqrt(squares / windows)
    return Lost(white, held, rows * sums / squares) if squares > 0.0 else Lost(white, 0.0, 1.0)


def _carried(lines: Array) -> bool:
    """Whether what a row leaves is counted in the next, by the mean logarithms of a periodogram (n / 2 + 1,) of counts.

    The error of rounding is then the difference of white noise: its spectrum goes with ``4 sin^2(pi f)``, at low frequencies by
    tens below that of lost remainders, which is white. Medians leave out lines of a vibration, however tall; one without any noise
    hides whether remainders are carried on.
    """
    frequency = np.arange(len(lines)) / (2.0 * (len(lines) - 1))  # of the rate of rows
    low, high = (lines[(frequency > a) & (frequency < b)] for a, b in (LOW, HIGH))
    expected = 2.0 * math.log(math.sin(math.pi * np.mean(HIGH)) / math.sin(math.pi * np.mean(LOW)))
    return bool(np.median(high) > math.log(FLOOR) and np.median(high) - np.median(low) > CARRIED * expected)


def _lines(counts: Array) -> Array:
    """(W, n / 2 + 1) logarithms of the periodograms of counts (W, n), tapered."""
    taper = np.hanning(counts.shape[1])
    tapered = (counts - counts.mean(axis=1, keepdims=True)) * taper
    return np.log(np.maximum(np.abs(np.fft.rfft(tapered, axis=1)) ** 2 / np.sum(taper**2), 1e-12))


def _floor(lines: Array) -> Array:
    """(W,) variance of the white part of counts, by their periodograms: what a prediction from all rows before would miss.

    Source: the formula of Szego and Kolmogorov; the mean logarithm of a periodogram is low by Euler's constant.
    """
    return np.asarray(np.exp(np.euler_gamma + lines[:, LOWEST:-1].mean(axis=1)))


def _of_noise(counts: Array) -> float:
    """One sigma of the mean error, in steps, by how often counts (n,) leave their fullest level; zero where two do not hold them.

    Noise of more than .4 of a step leaves a hundredth of one, and the shares of what else is that wide are not those of noise.
    """
    times = np.unique(counts, return_counts=True)[1]
    fullest = np.argmax(times)
    below, above = float(times[:fullest].sum()) / len(counts), float(times[fullest + 1 :].sum()) / len(counts)
    two = times[fullest] + max((times[k] for k in (fullest - 1, fullest + 1) if 0 <= k < len(times)), default=0)
    return rounded(below, above) if two >= TWO * len(counts) else 0.0


def _of_sine(amplitude: Array) -> Array:
    """One sigma, in steps, of the mean error of sines of these amplitudes, in steps; zero beyond `LARGE`.

    The envelope of Bessel's function, ``sqrt(2 / (pi x))``: where the amplitude stands between its zeros is not known.
    """
    x = 2.0 * math.pi * np.maximum(amplitude, 1e-12)
    left = np.sqrt(2.0 / (math.pi * x)) / (math.pi * math.sqrt(2.0))
    return np.where(amplitude > LARGE, 0.0, np.minimum(left, 1.0 / math.sqrt(12.0)))
