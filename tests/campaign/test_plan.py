"""Plans: what they expand to, and what is refused with which words."""

from typing import get_args

import pytest

from truenorth.alignment.assumptions import MOVING
from truenorth.alignment.azimuth import AZIMUTH_METHODS
from truenorth.alignment.procedure import Method
from truenorth.campaign import read_plan
from truenorth.campaign.tuning import Search
from truenorth.core.errors import DataError, UsageError

REST = {
    "name": "rest",
    "duration": "40 s",
    "rate": "50 Hz",
    "position": {"lat": "45 deg"},
    "motion": {"kind": "rest", "heading": "40 deg"},
    "imu": "navigation",
}
PLAN = {"name": "p", "runs": 6, "block": 2, "scenarios": [REST], "methods": ["inertial", "oba"]}


def test_a_plan_is_scenarios_times_the_grid():
    grid = {"imu.gyro.bias": ["0.01 deg/h", "0.1 deg/h"], "motion.heading": ["0 deg", "90 deg", "180 deg"]}
    plan = read_plan(PLAN | {"scenarios": [REST, "static_kalman"], "grid": grid})
    assert len(plan.cases) == 2 * 2 * 3
    assert [case.number for case in plan.cases] == list(range(12))
    assert [case.scenario_number for case in plan.cases] == [0] * 6 + [1] * 6
    assert plan.cases[1].name == "rest, bias 0.01 deg/h, heading 90 deg"
    assert plan.cases[1].built.motion.heading == pytest.approx(1.5707963267948966)
    assert plan.cases[3].built.imu_spec.gyro_bias == 10 * plan.cases[0].built.imu_spec.gyro_bias


def test_a_grid_reaches_into_lists():
    legs = [{"kind": "straight", "duration": "9 s"}, {"kind": "turn", "angle": "90 deg", "rate": "3 deg/s"}]
    grid = {"motion.legs[2].rate": ["3 deg/s", "6 deg/s"], "lever_arm[1]": ["0 m", "2 m"]}
    plan = read_plan(PLAN | {"scenarios": [REST | {"motion": {"kind": "legs", "legs": legs}}], "grid": grid})
    assert [case.built.lever_arm[0] for case in plan.cases] == [0.0, 2.0, 0.0, 2.0]
    assert plan.cases[2].built.motion.legs[1].rate == 2 * plan.cases[0].built.motion.legs[1].rate
    assert plan.cases[3].name == "rest, rate 6 deg/s, lever_arm[1] 2 m"


def test_every_method_of_align_can_be_planned():
    plan = read_plan(PLAN | {"methods": list(get_args(Method))})
    assert "swaying" in [method.method for method in plan.methods]
    assert Search.model_fields["method"].annotation == Method


def test_published_methods_on_the_move_are_known_without_their_filters():
    assert tuple(MOVING) == AZIMUTH_METHODS


def test_the_resolved_plan_is_the_same_plan():
    plan = read_plan(PLAN | {"scenarios": ["quay"], "times": ["20 s"]})
    again = read_plan(plan.to_mapping())
    assert again.fingerprint == plan.fingerprint
    assert plan.with_runs(99).fingerprint == plan.fingerprint
    assert read_plan(PLAN | {"seed": 1}).fingerprint != read_plan(PLAN).fingerprint


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"runs": 0}, "runs: 0; expected greater than or equal to 1"),
        ({"method": ["oba"]}, "'method' is not known; did you mean 'methods'"),
        ({"methods": ["klaman"]}, r"methods\[1\].method: 'klaman'; expected 'auto'"),
        ({"methods": ["oba", "oba"]}, "two are named 'oba'"),
        ({"methods": "oba"}, "expected a list of methods"),
        ({"methods": ["in_motion"]}, "'in_motion' aligns in motion, and rest has neither odometer nor gnss"),
        (
            {"scenarios": ["van"], "methods": [{"name": "bare", "method": "in_motion", "imu": "none"}]},
            "'bare' aligns in motion without a specification",
        ),
        ({"scenarios": ["quai"]}, "did you mean 'quay'"),
        ({"grid": {"imu.gyro.bias": []}}, "imu.gyro.bias has no values"),
        ({"grid": {"imu.gyroo.bias": ["1 deg/h"]}}, "'imu.gyroo.bias' leads nowhere"),
        (
            {"grid": {"lever_arm[4]": ["1 m"]}},
            r"'lever_arm\[4\]' leads nowhere .* there is no entry \[4\] in a list of 3",
        ),
        ({"grid": {"lever_arm[0]": ["1 m"]}}, r"there is no entry \[0\]"),
        ({"grid": {"motion[1]": ["1 m"]}}, r"there is no entry \[1\] in that mapping"),
        ({"grid": {"lever_arm.x": ["1 m"]}}, r"there is no 'x' in a list of 3"),
        ({"grid": {"imu..bias": ["1 m"]}}, r"'imu\.\.bias' is no path; expected keys such as motion"),
        ({"grid": {"imu.gyro.bias": ["1 deg"]}}, "rest, bias 1 deg: scenario: imu: .*gyro.bias: '1 deg'"),
        ({"times": ["50 s"]}, "times: 50 s; expected a time within the 40 s of rest"),
    ],
)
def test_a_mistake_is_named_by_its_key(change, words):
    with pytest.raises(DataError, match=words):
        read_plan(PLAN | change)


def test_a_plan_that_is_not_there(tmp_path):
    with pytest.raises(UsageError, match="cannot be read"):
        read_plan(tmp_path / "none.yaml")
