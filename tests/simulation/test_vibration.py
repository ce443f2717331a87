"""Vibration of the mount: what the accelerometers feel is what was asked for."""

import itertools
import math

import numpy as np
import pytest

from truenorth.core.errors import UsageError
from truenorth.core.units import STANDARD_GRAVITY as G
from truenorth.simulation.scenario import read_scenario
from truenorth.simulation.vibration import random_vibration

BASE = {"name": "engine", "duration": "60 s", "position": {"lat": "45 deg"}, "motion": {"kind": "rest"}}


def felt(vibration, rate, duration):
    """Specific force minus that of a base at rest, m/s^2, at sample times."""
    t = np.arange(round(rate * duration)) / rate
    still = read_scenario(BASE).build_motion().states(t)
    shaken = read_scenario(BASE | {"disturbances": [{"kind": "vibration", **vibration}]}).build_motion().states(t)
    return t, shaken.f_b - still.f_b


def test_an_engine_has_its_peak_acceleration_on_each_axis():
    sines = [
        {"frequency": "28 Hz", "acceleration": ["0.02 g", "0.03 g", "0.05 g"]},
        {"frequency": "56 Hz", "acceleration": ["0 g", "0.01 g", "0 g"]},
    ]
    t, f = felt({"sines": sines}, 400.0, 10.0)
    for frequency, peaks in ((28.0, (0.02, 0.03, 0.05)), (56.0, (0.0, 0.01, 0.0))):
        w = 2 * np.pi * frequency
        found = np.hypot(*(2 * np.mean(f * wave(w * t)[:, None], axis=0) for wave in (np.cos, np.sin)))
        np.testing.assert_allclose(found / G, peaks, atol=1e-6)


SPECTRUM = [(15.0, 0.0004), (45.0, 0.0001), (90.0, 0.0016)]  # Hz, g^2/Hz


def energy(low, high):
    """Integral of the spectrum, g^2: on each part a power of frequency, in closed form."""
    total = 0.0
    for (f1, d1), (f2, d2) in itertools.pairwise(SPECTRUM):
        m = math.log(d2 / d1) / math.log(f2 / f1) + 1.0
        a, b = min(max(low, f1), f2), min(max(high, f1), f2)
        total += d1 * f1 / m * ((b / f1) ** m - (a / f1) ** m)
    return total


def test_random_vibration_has_its_spectrum():
    """64 lines of equal energy, each at random in its share of the band: no part of the band is wrong by more than two of them."""
    points = [{"frequency": f"{f} Hz", "density": f"{d} g^2/Hz"} for f, d in SPECTRUM]
    _, f = felt({"random": points}, 500.0, 60.0)
    whole = energy(0.0, 1e3)
    power = 2 * np.abs(np.fft.rfft(f / G, axis=0) / len(f)) ** 2
    frequency = np.fft.rfftfreq(len(f), 1 / 500.0)
    np.testing.assert_allclose(power.sum(axis=0), whole, rtol=0.01)
    for low, high in ((14.0, 25.0), (25.0, 45.0), (45.0, 70.0), (70.0, 91.0)):
        inside = (frequency >= low) & (frequency < high)
        np.testing.assert_allclose(power[inside].sum(axis=0), energy(low, high), atol=2.2 / 64 * whole)
    assert np.max(np.abs(np.corrcoef(f.T) - np.eye(3))) < 0.3  # the axes are drawn apart


@pytest.mark.parametrize(
    ("spectrum", "words"),
    [([(10, 1)], "two points or more"), ([(10, 1), (9, 1)], "increase"), ([(10, 1), (20, 0)], "positive")],
)
def test_a_spectrum_that_makes_no_sense(spectrum, words):
    with pytest.raises(UsageError, match=words):
        random_vibration(spectrum, np.random.default_rng(0))
