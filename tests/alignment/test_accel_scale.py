"""Scale factors of accelerometers that an indexer turns about: found in size and sign, refused by what they do."""

from dataclasses import replace

import numpy as np
import pytest

from tests.runs import some
from truenorth.alignment import rotary
from truenorth.campaign.fault_benches import BENCHES
from truenorth.campaign.faults import run_faults
from truenorth.core.position import Position
from truenorth.simulation.scenario import read_scenario

SEED = 771235


def answer_with(inputs, axis, scale):
    accel = inputs["record"].accel.copy()
    accel[:, axis] *= 1.0 + scale
    return BENCHES["rotary"].align(inputs | {"record": replace(inputs["record"], accel=accel)})


def found_in(answer):
    return next((item for item in answer.evidence if item.key == "bias.accel_scale"), None)


@pytest.mark.parametrize(
    ("run", "scale"), some([], [(0, -0.05), (0, 0.05), (1, 0.05), (1, -0.05), (3, 0.1), (3, -0.1)])
)
def test_the_size_along_the_inner_axis_is_that_of_the_scale_factor(run, scale):
    """To a quarter: the fit of the base's motion takes up a part (of other axes, which gravity turns through, a half and more)."""
    inputs, _ = BENCHES["rotary"].draw(SEED, run)
    item = found_in(answer_with(inputs, 0, scale))
    assert item.figures["axis"] == "x"
    assert item.figures["scale"] == pytest.approx(scale, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_small_one_that_no_specification_names_refuses_nothing(axis):
    """100 ppm are usual; what they do is far below sigma."""
    inputs, _ = BENCHES["rotary"].draw(SEED, 0)
    assert answer_with(inputs, axis, 1e-4).status == "aligned"


@pytest.mark.slow
def test_a_scale_factor_that_the_specification_names_is_a_state_and_no_fault():
    inputs, _ = BENCHES["rotary"].draw(SEED, 0)
    named = inputs | {"imu": replace(inputs["imu"], accel_scale_factor=2e-3)}
    answer = answer_with(named, 2, 2e-3)
    assert answer.status == "aligned"
    assert found_in(answer) is None


@pytest.mark.slow
def test_one_along_the_inner_axis_is_refused():
    """Once silent: heading 3.9 sigmas off, level 3.4."""
    (trial,) = run_faults(["rotary"], ["accel scale"], runs=1, seed=771204)
    assert trial.outcome == "flagged", trial


@pytest.mark.parametrize("seed", some([0], [1, 2, 3, 4, 5]))
def test_noise_alone_is_no_scale_factor(seed):
    """At rest no gravity reaches the axis of the inner turns: its noise, in readings and innovations, was one of 100 %."""
    of = {
        "name": "still",
        "duration": "480 s",
        "rate": "20 Hz",
        "position": {"lat": "40 deg", "lon": "10 deg"},
        "motion": {"kind": "rest", "heading": "30 deg"},
        "imu": "tactical",
        "indexer": {"scheme": "8", "dwell": "40 s", "encoder": {"resolution": "1 arcsec"}},
    }
    still = read_scenario(of)
    encoder = still.simulate_aiding(seed=seed, run=0)["encoder"].record
    place = Position.from_degrees(40.0, 10.0)
    answer = rotary.align_rotary(still.simulate(seed=seed, run=0).record, encoder, place, "tactical", axes=("z", "x"))
    assert answer.status == "aligned"
    assert found_in(answer) is None


def test_a_sound_log_has_none(monkeypatch):
    inputs, _ = BENCHES["rotary"].draw(SEED, 2)
    asked = []
    of = rotary.accel_scale_evidence
    monkeypatch.setattr(rotary, "accel_scale_evidence", lambda *given: asked.append(of(*given)) or asked[-1])
    answer = BENCHES["rotary"].align(inputs)
    assert answer.status == "aligned"
    assert not [item for item in answer.evidence if item.key.startswith("tilt.")]
    assert np.all([item == [] for item in asked])
    assert asked
