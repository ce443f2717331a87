"""Simulation: the truth and the measurements of a known motion."""

from __future__ import annotations

from truenorth.simulation.ideal import IdealLog, ideal_log
from truenorth.simulation.imu_errors import TrueErrors
from truenorth.simulation.motion import Motion, MotionStates
from truenorth.simulation.runs import Simulation, simulate
from truenorth.simulation.sway import Disturbed, Sway, rest
from truenorth.simulation.tones import Tone

__all__ = [
    "Disturbed",
    "IdealLog",
    "Motion",
    "MotionStates",
    "Simulation",
    "Sway",
    "Tone",
    "TrueErrors",
    "ideal_log",
    "rest",
    "simulate",
]
