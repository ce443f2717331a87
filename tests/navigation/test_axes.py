"""Cars and ships with GNSS whose IMU's axes are off by what its specification says: sigma is honest, of each grade."""

import numpy as np
import pytest

from benchmarks.honesty import driving
from benchmarks.honesty.driving import GRADES, VEHICLES, driven
from benchmarks.honesty.frame import Case, run_case
from tests.runs import some


def line_of(name, grade, runs, seed, wrong="both"):
    run = driven(*VEHICLES[name], grade, wrong, check_clocks=False)
    return run_case(Case("navigation, GNSS", f"{grade} IMU, {name}, {wrong}", run), seed, runs)


@pytest.mark.slow
@pytest.mark.parametrize("name", VEHICLES)
def test_a_consumer_imu_in_a_few_drives(name):
    """Without states for its axes the level was off by 4.4 sigma RMS, worst 12."""
    line = line_of(name, "consumer", 3, 5)
    assert not line.refused
    assert line.worst < 4.0
    assert max(line.rms.values()) < 1.7  # of 24 ratios and more, correlated along each drive


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["both", "gyros", "accelerometers"])
@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("name", VEHICLES)
def test_sigma_is_honest(name, grade, wrong):
    """Sixty drives, as the level of twenty scatters by 15 %.

    With the axes of one sort alone off sigma allows for both, and may be too large.
    """
    line = line_of(name, grade, 60, 11, wrong)
    assert not line.refused
    assert line.worst < 4.0
    rms = np.array(list(line.rms.values()))
    assert np.all(rms < 1.25), line.rms
    assert np.all(rms > (0.8 if wrong == "both" else 0.5)), line.rms


@pytest.mark.parametrize("number", some([2], range(12)))
def test_a_heading_that_gyros_turn_by_degrees(number, monkeypatch):
    """A ship in calm water, gyros off by 1000 deg/h: level was 1.6 sigmas off, RMS of these twelve, 6.0 at the worst; now 1.2, 4.1.

    Corrections of attitude turn velocity with it. What is left are biases that a wrong heading has turned.
    """
    monkeypatch.setattr(driving, "_tone", lambda rng, amplitude, period: ())
    found = driven(*VEHICLES["ship"], "consumer", check_clocks=False)(11, number)
    assert not found.refused
    assert np.abs(found.ratios["level"]).max() < 4.5
