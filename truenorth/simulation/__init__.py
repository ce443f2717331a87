"""Simulation: the truth and the measurements of a known motion."""

from __future__ import annotations

from truenorth.records.flexure import FlexureSpec
from truenorth.records.motion import MotionStates
from truenorth.simulation.aiding import Aided, AidingSpec, simulate_sensor
from truenorth.simulation.axis_angles import Spin, Steps, Swing, scheme, steps
from truenorth.simulation.encoder import EncoderSpec
from truenorth.simulation.flexure import Flexed
from truenorth.simulation.gnss import GnssSpec, HeightSpec
from truenorth.simulation.ideal import IdealLog, ideal_log
from truenorth.simulation.indexer import Axis, Indexed, Indexer
from truenorth.simulation.master import MasterSpec
from truenorth.simulation.motion import Motion
from truenorth.simulation.odometer import OdometerSpec
from truenorth.simulation.runs import Simulation, simulate, simulate_runs
from truenorth.simulation.sway import Disturbed, Sway, rest
from truenorth.simulation.tones import Tone
from truenorth.simulation.true_errors import SensorErrors, TrueErrors, given_errors
from truenorth.simulation.velocity_log import VelocityLogSpec

__all__ = [
    "Aided",
    "AidingSpec",
    "Axis",
    "Disturbed",
    "EncoderSpec",
    "Flexed",
    "FlexureSpec",
    "GnssSpec",
    "HeightSpec",
    "IdealLog",
    "Indexed",
    "Indexer",
    "MasterSpec",
    "Motion",
    "MotionStates",
    "OdometerSpec",
    "SensorErrors",
    "Simulation",
    "Spin",
    "Steps",
    "Sway",
    "Swing",
    "Tone",
    "TrueErrors",
    "VelocityLogSpec",
    "given_errors",
    "ideal_log",
    "rest",
    "scheme",
    "simulate",
    "simulate_runs",
    "simulate_sensor",
    "steps",
]
