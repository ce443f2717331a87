"""Advice on manoeuvres: what the theory of transfer alignment says of each."""

import math

import pytest

from truenorth.advice.manoeuvres import advise_manoeuvre
from truenorth.core.errors import UsageError
from truenorth.core.position import Position

HERE, ARCMIN = Position(math.radians(34.0), 0.0, 5000.0), math.radians(1.0 / 60.0)


@pytest.fixture(scope="module")
def velocity():
    return advise_manoeuvre("tactical", HERE, 200.0, 10 * ARCMIN)


def test_velocity_matching_needs_horizontal_acceleration(velocity):
    """Straight on and wing rock tell no heading; turns do within seconds of their onset."""
    for name in ("straight", "wing rock"):
        assert math.isinf(velocity.reached[name])
        assert velocity.heading_sigma[name][-1] > 0.8 * math.radians(1.0)
    assert velocity.best in ("flat turn", "banked turn", "S-turn")
    assert 20.0 < velocity.reached[velocity.best] < 40.0
    assert velocity.reached["acceleration"] > velocity.reached["flat turn"]


def test_with_attitude_wing_rock_tells_it_too():
    both = advise_manoeuvre("tactical", HERE, 200.0, 10 * ARCMIN, attitude_noise=ARCMIN)
    assert both.reached["wing rock"] < 40.0
    assert math.isinf(both.reached["straight"])


def test_in_words_and_drawn(velocity):
    assert str(velocity).startswith(f"{velocity.best} brings heading to 10 arcmin after")
    assert "straight never" in str(velocity)
    assert velocity.plot() is not None
    far = advise_manoeuvre("consumer", HERE, 20.0, 0.01 * ARCMIN, manoeuvres=("flat turn",))
    assert far.best is None
    assert "none of the manoeuvres" in str(far)
    assert "what would reach it" in far.words[1]


def test_bad_requests():
    with pytest.raises(UsageError, match="speed is -1"):
        advise_manoeuvre("tactical", HERE, -1.0, ARCMIN)
    with pytest.raises(UsageError, match="choose of straight"):
        advise_manoeuvre("tactical", HERE, 10.0, ARCMIN, manoeuvres=("loop",))
