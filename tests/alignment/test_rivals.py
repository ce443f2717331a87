"""Two headings that explain a log alike: an IMU that is turned on and on one way about a level axis."""

from __future__ import annotations

import numpy as np
import pytest

from truenorth import Indexer, align
from truenorth.core.attitude import rotation_vector_from_dcm
from truenorth.simulation.scenario import read_scenario

NORTH = 337.188  # deg: 23 deg to one side of the axis, which points east of it


def answered(imu, heading, *, encoder, axis="x", rate="15 deg/s", duration="600 s", seed=901, disturbances=()):
    """An IMU whose outer axis turns on and on; and by how much the answer is off, over sigma."""
    axes = [{"kind": "spin", "direction": axis, "rate": rate}]
    axes += [{"kind": "spin", "direction": "z", "rate": "6 deg/s"}] if encoder else []
    scenario = read_scenario(
        {
            "name": "turned",
            "duration": duration,
            "position": {"lat": "45.3157 deg", "lon": "10 deg"},
            "motion": {"kind": "rest", "heading": f"{heading} deg", "pitch": "-0.889 deg", "roll": "2.125 deg"},
            "imu": imu,
            "disturbances": list(disturbances),
            "indexer": {"axes": axes} | ({"encoder": {"resolution": "1 arcsec"}} if encoder else {}),
        }
    )
    simulation = scenario.simulate(seed=seed)
    aid = Indexer(scenario.simulate_aiding(seed=seed)["encoder"].record, ("x", "z")) if encoder else ()
    answer = align(simulation.record, (45.3157, 10.0), imu, aid=aid)
    moved = simulation.motion.motion if encoder else simulation.motion
    phi = -rotation_vector_from_dcm(answer.C_nb @ moved.states(np.array(answer.time)).C_nb.T)
    return answer, phi / np.sqrt(np.diag(answer.phi_covariance))


def has_rival(answer):
    return any(item.key == "heading.rivals" for item in answer.evidence)


@pytest.mark.slow
@pytest.mark.parametrize("heading", [NORTH, -NORTH])
def test_a_scale_factor_that_makes_up_for_another_heading_is_in_sigma(heading):
    """The one that a filter found was 49 deg off, `aligned`, and known to 1.5 deg."""
    answer, off = answered("tactical", heading, encoder=True)
    assert has_rival(answer)
    assert answer.status == "not_converged", answer.reasons
    assert np.degrees(np.sqrt(answer.phi_covariance[2, 2])) > 40.0
    assert np.abs(off).max() < 4.0


@pytest.mark.slow
def test_an_imu_whose_scale_factors_are_known_has_one_heading():
    answer, off = answered("navigation", NORTH, encoder=True, duration="300 s")
    assert not has_rival(answer)
    assert answer.status == "aligned", answer.reasons
    assert np.abs(off).max() < 4.0


@pytest.mark.parametrize("imu", ["navigation", "tactical"])
def test_an_imu_that_tumbles_without_an_encoder(imu):
    """A filter without scale factors carries no attitude through it: its mean force missed gravity by 65 mg, and it was refused."""
    answer, off = answered(imu, 127.0, encoder=False, rate="21 deg/s", duration="300 s")
    assert has_rival(answer) == (imu == "tactical")
    assert answer.status == ("aligned" if imu == "navigation" else "not_converged"), answer.reasons
    assert np.abs(off).max() < 4.0


@pytest.mark.parametrize(("rate", "duration"), [("3 deg/s", "120 s"), ("12 deg/s", "45 s")])
def test_one_turn_about_the_vertical_leaves_one_heading(rate, duration):
    """A misalignment makes a tilt that goes round with the IMU once: its mean over the log was taken for a rate."""
    answer, off = answered("tactical", 40.0, encoder=False, axis="z", rate=rate, duration=duration)
    assert not has_rival(answer)
    assert answer.status == "aligned", answer.reasons
    assert np.abs(off).max() < 4.0


def test_vibration_of_an_imu_that_turns_is_no_bias():
    """The size of each row's force has the square of what is across gravity in it: 4 mg of .1 g, and a sound log was refused."""
    shakes = [{"kind": "vibration", "sines": [{"frequency": "28 Hz", "acceleration": ["0.1 g", "0.1 g", "0.1 g"]}]}]
    answer, off = answered(
        "navigation", 40.0, encoder=False, axis="z", rate="12 deg/s", duration="150 s", disturbances=shakes
    )
    assert answer.status == "aligned", answer.reasons
    assert np.abs(off[:2]).max() < 4.0
