"""Indexers, their encoders and given errors in scenario files."""

import re

import numpy as np
import pandas as pd
import pytest

from tests.simulation.test_scenario import BASE
from truenorth.core.errors import DataError
from truenorth.core.indexing import C_bs_from_angles
from truenorth.simulation.folder import save_run
from truenorth.simulation.scenario import read_scenario

STEPS = {"scheme": "8", "dwell": "1 s", "rate": "90 deg/s"}


def test_system_1_turns_and_its_folder_tells_how(tmp_path):
    scenario = read_scenario("rotary_ship").model_copy(update={"duration": 10.0})
    simulation = scenario.simulate(run=3)
    np.testing.assert_allclose(simulation.errors.gyro_bias, np.radians([0.01] * 3) / 3600, rtol=1e-14)
    save_run(scenario, simulation, tmp_path, seed=0, run=3, plot=False)
    angles = pd.read_parquet(tmp_path / "encoder.parquet").to_numpy()[-1, -2:]
    t = simulation.record.time[-1]
    np.testing.assert_allclose(angles, [6 * t, 18 * t], atol=0.5001 / 3600)  # steps of 1 arcsec
    body = simulation.motion.motion.states(t)
    C_ns = body.C_nb @ C_bs_from_angles("zx", np.radians(angles))
    np.testing.assert_allclose(simulation.truth.C_nb[-1], C_ns, atol=5e-6)


def test_a_late_encoder_of_its_own_rate():
    content = STEPS | {"encoder": {"rate": "10 Hz", "latency": "50 ms", "offset": "1 deg"}}
    scenario = read_scenario(BASE | {"indexer": content})
    log = scenario.simulate_aiding(run=1)["encoder"]
    true = scenario.indexer.build(20.0).angles(log.record.time - 0.05)
    np.testing.assert_allclose(log.record.angles, true + log.errors["offset"], atol=1e-12)
    assert log.record.interval == pytest.approx(0.1)
    assert scenario == read_scenario(BASE | {"indexer": content | {"scheme": 8}})  # as YAML reads a bare 8
    # After a dwell of 1 s and a slew of 2.5 s the outer axis stands at 180 deg, the inner one still at 0.
    np.testing.assert_allclose(scenario.indexer.build(20.0).angles(4.0), [np.pi, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"indexer": STEPS | {"dwell": "1 m"}}, "indexer.dwell: '1 m'"),
        (
            {"indexer": STEPS | {"encoder": {"noise": "-1 arcsec"}}},
            "indexer.encoder: noise: '-1 arcsec'; expected zero or more",
        ),
        ({"indexer": STEPS | {"encoder": {"nose": "1 arcsec"}}}, "did you mean 'noise'"),
        ({"indexer": STEPS | {"encoder": {"noise": "1 m"}}}, "indexer.encoder: noise: '1 m'"),
        ({"errors": {"gyro": {"bias": ["1 deg/h", "1 deg", "1 deg/h"]}}}, "errors: gyro.bias[2]: '1 deg'"),
        ({"errors": {"gyro": {"bais": "1 deg/h"}}}, "did you mean 'gyro.bias'"),
        ({"imu": {"temperature": {"rate": "1 K"}}}, "temperature.rate: '1 K'"),
    ],
)
def test_a_mistake_is_named_by_the_path_of_its_key(change, words):
    with pytest.raises(DataError, match=re.escape(words)):
        read_scenario(BASE | change)
