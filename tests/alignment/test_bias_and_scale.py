"""Without a specification the vertical force shows a bias and a scale factor as one; each is stated with what hides it."""

from __future__ import annotations

import numpy as np
import pytest

import truenorth as tn
from tests.runs import some
from truenorth.alignment.inference import apart_from_axes
from truenorth.core.units import MICRO_G
from truenorth.records.specs import PRESETS, ImuSpec, imu_spec
from truenorth.simulation.scenario import read_scenario

GRAVITY = 9.81
PLACE = tn.Position.from_degrees(45.0, 10.0)
WORST = 4.5  # sigmas: of 6 logs and three axes of each, a normal variable is beyond in one set of 8,000
REST = {"name": "rest", "position": {"lat": "45 deg", "lon": "10 deg"}, "motion": {"kind": "rest"}}


@pytest.mark.parametrize("name", PRESETS)
def test_apart_from_axes_the_sum_is_what_the_log_has_shown(name: str) -> None:
    """Whatever the attitude; and in the ratio of the preset with such noise."""
    preset = imu_spec(name)
    shown = ImuSpec(accel_bias=3e-3, accel_bias_instability=1e-4, accel_random_walk=preset.accel_random_walk)
    apart = apart_from_axes(shown, GRAVITY)
    for up in np.random.default_rng(2).normal(size=(5, 3)):
        acting = apart.bias_variance[3:] + apart.acting_variance(GRAVITY * up / np.linalg.norm(up))
        np.testing.assert_allclose(acting, shown.bias_variance[3:])
    assert apart.accel_scale_factor / apart.accel_bias == pytest.approx(preset.accel_scale_factor / preset.accel_bias)


def test_scale_factors_that_a_filter_estimates_are_apart_already() -> None:
    spec = imu_spec("tactical")
    assert apart_from_axes(spec, GRAVITY) is spec


def _rest(imu: str, run: int, duration: str) -> tuple[tn.Alignment, np.ndarray]:
    drawn = read_scenario({**REST, "duration": duration, "imu": imu}).simulate(run=run)
    return tn.align(drawn.record, PLACE), drawn.errors.accel_bias


@pytest.mark.parametrize("run", some([2], [0, 1, 3, 4, 5]))
def test_a_scale_factor_is_not_stated_as_a_bias(run: int) -> None:
    """Of navigation grade it makes as much of the vertical force as the bias: the answer and its history were 7 sigmas off, RMS."""
    answer, drawn = _rest("navigation", run, "60 s")
    history = answer.history
    assert history is not None
    assert answer.imu.accel_scale_factor > 0.0
    assert np.all(np.abs(answer.accel_bias - drawn) < WORST * answer.accel_bias_sigma)
    assert np.all(np.abs(history.accel_bias - drawn) < WORST * history.accel_bias_sigma)


def test_level_is_known_as_well_as_the_sum() -> None:
    """What tilts is the bias and what misalignments make of gravity: of both the vertical force has shown the size."""
    answer, _ = _rest("navigation", 0, "60 s")
    acting = answer.imu.bias_variance[3] + answer.imu.acting_variance(np.array([0.0, 0.0, GRAVITY]))[0]
    assert answer.phi_floor[0, 0] >= 0.99 * acting / GRAVITY**2


@pytest.mark.slow
@pytest.mark.parametrize("run", some([0], [4]))
def test_navigation_keeps_them_apart(run: int) -> None:
    """It began with their sum as the bias of the vertical accelerometer, known to 1 to 4 ug, and was 8 to 64 sigmas off."""
    van = read_scenario("van").to_mapping()
    scenario = read_scenario(
        {**van, "motion": van["motion"] | {"wait": "150 s"}, "duration": "250 s", "imu": "navigation"}
    )
    driven, logs = scenario.simulate(run=run), scenario.simulate_aiding(run=run)
    start = tn.align(driven.record.between(None, 140.0), tn.Position.from_degrees(48.137, 11.575, 520.0))
    assert start.status == "aligned"
    frame = tn.navigate(driven.record, start, aid=tn.Gnss(logs["gnss"].record)).to_frame()
    for i, axis in enumerate("xyz"):
        own, sigma = frame[f"accel_bias_{axis}_ug"] * MICRO_G, frame[f"accel_bias_{axis}_sigma_ug"] * MICRO_G
        assert (np.abs(own - driven.errors.accel_bias[i]) < WORST * sigma).all(), axis
