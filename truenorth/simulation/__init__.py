"""Simulation: the truth and the measurements of a known motion."""

from __future__ import annotations

from truenorth.records.flexure import FlexureSpec
from truenorth.records.motion import MotionStates
from truenorth.simulation.aiding import Aided
from truenorth.simulation.axis_angles import Spin, Steps, Swing, scheme, steps
from truenorth.simulation.encoder import EncoderSpec, simulate_encoder
from truenorth.simulation.flexure import Flexed
from truenorth.simulation.gnss import GnssSpec, HeightSpec, simulate_gnss, simulate_height
from truenorth.simulation.ideal import IdealLog, ideal_log
from truenorth.simulation.indexer import Axis, Indexed, Indexer
from truenorth.simulation.master import MasterSpec, simulate_master
from truenorth.simulation.motion import Motion
from truenorth.simulation.odometer import OdometerSpec, simulate_odometer
from truenorth.simulation.runs import Simulation, simulate, simulate_runs
from truenorth.simulation.sway import Disturbed, Sway, rest
from truenorth.simulation.tones import Tone
from truenorth.simulation.true_errors import SensorErrors, TrueErrors, given_errors
from truenorth.simulation.velocity_log import VelocityLogSpec, simulate_velocity

__all__ = [
    "Aided",
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
    "simulate_encoder",
    "simulate_gnss",
    "simulate_height",
    "simulate_master",
    "simulate_odometer",
    "simulate_runs",
    "simulate_velocity",
    "steps",
]
