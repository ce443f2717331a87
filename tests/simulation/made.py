"""Motions and specifications that the tests of simulated sensors share."""

from dataclasses import replace

import numpy as np

from truenorth.core.position import Position
from truenorth.simulation import GnssSpec, HeightSpec, MasterSpec, OdometerSpec, Sway, Tone, VelocityLogSpec
from truenorth.simulation.course import Leg, course

PLACE = Position.from_degrees(48.0, 11.0, 500.0)
ARM = (0.4, -1.3, -0.6)
DRIVE = course(
    PLACE,
    [
        Leg(10.0),
        Leg(8.0, speed=12.0, slope=np.radians(2.0)),
        Leg(12.0, turn=np.radians(100.0)),
        Leg(15.0, slope=np.radians(-3.0)),
        Leg(10.0, turn=np.radians(-60.0), bank=0.05),
        Leg(8.0, speed=0.0),
    ],
    heading=0.7,
)
FERRY = Sway(  # to and fro
    PLACE,
    heading=0.3,
    heading_tones=(Tone(0.1, 11.0, 0.2),),
    pitch_tones=(Tone(0.05, 7.0, 0.0),),
    roll_tones=(Tone(0.1, 6.0, 1.0),),
    east_tones=(Tone(6.0, 40.0, 0.1),),
    north_tones=(Tone(20.0, 40.0, 0.1),),
    up_tones=(Tone(0.8, 8.0, 2.0),),
)
SENSORS = {
    "odometer": OdometerSpec,
    "velocity": VelocityLogSpec,
    "gnss": GnssSpec,
    "height": HeightSpec,
    "master": MasterSpec,
}
NOISY_MASTER = MasterSpec(
    level=1e-4,
    heading=1e-3,
    attitude_drift=2e-4,
    attitude_noise=1e-4,
    velocity=0.1,
    velocity_drift=0.05,
    velocity_noise=0.02,
    position=5.0,
    schuler=0.01,
    jumps=((30.0, 0.5, -0.2),),
    jump_rate=0.05,
)
LOADED = {
    "odometer": OdometerSpec(
        scale_sigma=0.01, mounting_sigma=0.01, noise=0.1, slip_rate=0.1, output="pulses", lost=0.01
    ),
    "velocity": VelocityLogSpec(
        bias_sigma=0.1,
        drift=0.1,
        noise=0.1,
        scale_sigma=0.1,
        misalignment_sigma=0.1,
        outlier_rate=0.1,
        outage_rate=0.02,
    ),
    "gnss": GnssSpec(
        position_noise=1, position_drift=1, velocity_noise=1, velocity_drift=1, outlier_rate=0.1, outage_rate=0.02
    ),
    "height": HeightSpec(bias_sigma=1.0, drift=1.0, noise=1.0, outlier_rate=0.1, outage_rate=0.02),
    "master": replace(NOISY_MASTER, outage_rate=0.02),
}
