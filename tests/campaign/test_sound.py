"""A campaign does not look for faults in logs that cannot have any; the answers are those of a plain `align`."""

import numpy as np
import pytest

from tests.campaign.test_plan import REST
from tests.runs import some
from truenorth import align
from truenorth.campaign import aligning
from truenorth.campaign.plan import read_plan
from truenorth.core.position import Position
from truenorth.quality.density import bursts
from truenorth.quality.sampling import check_sampling
from truenorth.simulation.scenario import read_scenario

STILL = REST | {"duration": "100 s", "rate": "20 Hz", "imu": "tactical"}


def plan_of(scenario, runs, methods=("kalman",)):
    return read_plan({"name": "sound", "runs": runs, "scenarios": [scenario], "methods": list(methods)})


@pytest.mark.parametrize(
    ("runs", "change"),
    some(
        [(2, {})],
        [(40, {"duration": "300 s"}), (40, {"imu": "navigation", "rate": "100 Hz"}), (20, {"imu": "industrial"})],
    ),
)
def test_rows_are_those_of_a_plain_alignment(monkeypatch, runs, change):
    plan = plan_of(STILL | change, runs)
    rows = aligning.align_runs(plan, plan.cases[0], range(runs))
    assert not any(row.status == "failed" for row in rows)
    monkeypatch.setattr(aligning, "_is_sound", lambda scenario: False)
    for row, plain in zip(rows, aligning.align_runs(plan, plan.cases[0], range(runs)), strict=True):
        np.testing.assert_equal(tuple(row), tuple(plain))


def test_a_row_is_that_of_align():
    plan = plan_of(STILL, 1)
    scenario = plan.cases[0].built
    record = scenario.simulate(seed=plan.seed, run=0).record
    alone = align(record, Position(scenario.position.lat), scenario.imu_spec, method="kalman")
    rows = {row.quantity: row for row in aligning.align_runs(plan, plan.cases[0], [0])}
    assert rows["outcome"].status == alone.status
    assert rows["outcome"].reason == "; ".join(alone.reasons)
    minutes = np.degrees(np.sqrt(alone.phi_covariance[0, 0])) * 60.0
    assert rows["phi_e"].sigma == pytest.approx(minutes, rel=1e-14)


@pytest.mark.parametrize("run", range(3))
def test_in_such_a_log_is_nothing_to_be_found(run):
    record = read_scenario(STILL).simulate(seed=9, run=run).record
    assert not check_sampling(record)[1]
    assert not bursts(record)[1].any()


@pytest.mark.parametrize(
    "change",
    [
        {"imu": {"gyro": {"random_walk": "0.1 deg/sqrt(h)"}}},  # accelerometers without noise repeat
        {
            "imu": {
                "gyro": {"random_walk": "0.1 deg/sqrt(h)"},
                "accel": {"random_walk": "9 ug/sqrt(Hz)", "range": "2 g"},
            }
        },
        {
            "imu": {
                "gyro": {"random_walk": "1 deg/sqrt(h)", "quantisation": "1 arcsec"},
                "accel": {"random_walk": "9 ug/sqrt(Hz)"},
            }
        },
        {"disturbances": [{"kind": "vibration", "sines": [{"frequency": "2 Hz", "acceleration": ["1 mg"] * 3}]}]},
    ],
)
def test_other_logs_are_looked_at(change):
    assert aligning._is_sound(read_scenario(STILL))
    assert not aligning._is_sound(read_scenario(STILL | change))
