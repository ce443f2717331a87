"""A sensor whose angles come out far from what was said of them, and headings that are all turned by one angle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from truenorth.quality.innovations import innovation_evidence
from truenorth.quality.mounting import mounting_evidence
from truenorth.state.evidence import Effect
from truenorth.state.layout import Layout
from truenorth.state.track import Residuals, Track

DEGREE = math.radians(1.0)
SIGMA = Effect(heading=DEGREE, level=DEGREE, velocity=0.1, position=1.0)


def _found(name: str, pitch: float, yaw: float) -> Track:
    layout = Layout((f"{name} mounting",), ((3.0 * DEGREE, DEGREE),))
    sensors = np.zeros((2, layout.states))
    sensors[-1, layout.slice_of(f"{name} mounting")] = pitch * DEGREE, yaw * DEGREE
    nothing = np.zeros((2, 3))
    return replace(
        Track.of_motion(np.arange(2.0), np.array([np.eye(3)] * 2), nothing, nothing), sensors=sensors, layout=layout
    )


@pytest.mark.parametrize(("name", "key"), [("GNSS", "mounting.baseline"), ("odometer", "mounting.missed")])
def test_angles_beyond_five_of_their_own_sigmas_contradict_what_was_said(name: str, key: str) -> None:
    """A baseline said to 1 deg that came out 8.3 deg off was `navigated`, its heading 7 sigmas off on the way."""
    for pitch, yaw in ((0.0, 4.9), (14.0, -4.9), (-14.0, 0.0)):
        assert mounting_evidence(_found(name, pitch, yaw), [name]) == []
    (item,) = mounting_evidence(_found(name, -14.0, 8.3), [name])
    assert item.key == key
    assert item.kind == "unknown"
    assert item.figures["miss"] == pytest.approx(8.3 * DEGREE)
    assert item.figures["prior"] == pytest.approx(DEGREE)
    assert mounting_evidence(_found(name, -16.0, 0.0), [name])[0].figures["miss"] == pytest.approx(16.0 * DEGREE)
    assert mounting_evidence(_found(name, 0.0, 8.3), ["velocity log"]) == []


def _headings(off: np.ndarray) -> Residuals:
    """Headings (rad) that are all rejected, measured less predicted."""
    count, none = len(off), np.zeros(len(off), dtype=bool)
    innovation = np.remainder(-off + math.pi, 2.0 * math.pi)[:, None] - math.pi
    time = np.arange(float(count))
    sigma, nis = np.full((count, 1), 0.01), np.full(count, 100.0)
    return Residuals("GNSS heading", time, innovation, sigma, nis, none, 0, time, none, "rad", ("heading",))


@pytest.mark.parametrize("turned", [-90.0, 8.0, 179.9])
def test_headings_that_are_all_turned_by_one_angle_name_it(turned: float) -> None:
    """They were 'rejected, half of them by more than 1.58 rad'."""
    noise = np.random.default_rng(4).normal(size=30)
    (item,) = innovation_evidence([_headings((turned + 0.2 * noise) * DEGREE)], SIGMA)
    assert item.key == "innovations.turned"
    assert item.remedies[0] == "baseline"
    assert math.remainder(item.figures["distance"] - turned * DEGREE, 2.0 * math.pi) == pytest.approx(
        0.0, abs=0.2 * DEGREE
    )
    (scattered,) = innovation_evidence([_headings((turned + 60.0 * noise) * DEGREE)], SIGMA)
    assert scattered.key == "innovations.rejected"
