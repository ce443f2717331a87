"""Simulation: the truth and the measurements of a known motion."""

from __future__ import annotations

from truenorth.simulation.ideal import IdealLog, ideal_log
from truenorth.simulation.motion import Motion, MotionStates
from truenorth.simulation.runs import Simulation, simulate, simulate_runs
from truenorth.simulation.sway import Disturbed, Sway, rest
from truenorth.simulation.tones import Tone
from truenorth.simulation.true_errors import SensorErrors, TrueErrors, given_errors

__all__ = [
    "Disturbed",
    "IdealLog",
    "Motion",
    "MotionStates",
    "SensorErrors",
    "Simulation",
    "Sway",
    "Tone",
    "TrueErrors",
    "given_errors",
    "ideal_log",
    "rest",
    "simulate",
    "simulate_runs",
]
