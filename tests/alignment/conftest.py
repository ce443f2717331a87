"""Motions that several files align on."""

import numpy as np
import pytest

from truenorth.core.position import Position
from truenorth.simulation import ideal_log
from truenorth.simulation.course import course
from truenorth.simulation.manoeuvres import s_turn, straight

DEG = np.radians(1.0)


@pytest.fixture(scope="session")
def flight():
    """A minute with a banked S-turn at 60 m/s: all states of transfer alignment can be separated."""
    legs = [*straight(10.0), *s_turn(25 * DEG, 4 * DEG), *straight(40.0)]
    return course(Position(np.radians(45.0), 0.2, 500.0), legs, heading=0.5, speed=60.0)


@pytest.fixture(scope="session")
def ideal(flight):
    return ideal_log(flight, rate=100.0, duration=60.0)
