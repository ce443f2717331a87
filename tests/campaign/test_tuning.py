"""Tuning: what it searches, how it judges, what it refuses."""

import math

import numpy as np
import pandas as pd
import pytest
import yaml
from typer.testing import CliRunner

import truenorth as tn
from tests.campaign.test_plan import REST
from truenorth.campaign.tuning import Tuned, _score, read_search, tune
from truenorth.cli import app
from truenorth.core.errors import DataError
from truenorth.records.specs import imu_spec

STILL = REST | {"imu": {"gyro": {"bias": "0.01 deg/h", "random_walk": "0.003 deg/sqrt(h)"}, "accel": {"bias": "50 ug"}}}
SEARCH = {
    "name": "s",
    "scenario": STILL,
    "method": "oba",
    "search": {"gyro.bias": ["0.001 deg/h", "1 deg/h"]},
    "runs": 12,
    "trials": 6,
}


@pytest.mark.slow
def test_the_same_search_gives_the_same_answer_and_judges_on_other_data():
    pytest.importorskip("optuna")
    first, second = tune(SEARCH), tune(SEARCH)
    pd.testing.assert_frame_equal(first.trials, second.trials, check_exact=True)
    assert list(first.judged["seed"]) == [1, 1]
    assert list(first.judged["specification"]) == ["tuned", "simulated IMU's own"]
    assert len(first.trials) == 6
    scores = [_score(row, 12) for row in first.trials.to_dict("records")]
    best = first.trials.loc[scores.index(min(scores))]
    assert first.spec.gyro_bias == pytest.approx(best["gyro.bias"], rel=1e-3)
    assert first.spec.gyro_random_walk == pytest.approx(imu_spec(STILL["imu"]).gyro_random_walk)


def test_a_dishonest_or_silent_specification_scores_worse():
    honest = {"answers": 10, "rms": 5.0, "rms_over_sigma": 1.0, "ratio_low": 0.6, "ratio_high": 1.4}
    honest |= {"nees": 1.0, "nees_low": 0.7, "nees_high": 1.4}
    assert _score(honest, 10) == 5.0
    assert _score(honest | {"nees": 2.8}, 10) == pytest.approx(5.0 * (1 + 10 * math.log(2)))
    assert _score(honest | {"rms_over_sigma": 0.3}, 10) == pytest.approx(5.0 * (1 + 10 * math.log(2)))
    assert _score(honest | {"answers": 5}, 10) == pytest.approx(20.0)
    assert _score({"answers": 0}, 10) == math.inf


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"search": {"gyro.bais": ["1 deg/h", "2 deg/h"]}}, "'gyro.bais' is not known; did you mean 'gyro.bias'"),
        ({"search": {"gyro.bias": ["1 deg/h", "2 ug"]}}, "search.gyro.bias: '2 ug'"),
        ({"search": {"gyro.bias": ["2 deg/h", "1 deg/h"]}}, "the smaller first"),
        ({"search": {}}, "search"),
        ({"trials": 0}, "trials: 0"),
    ],
)
def test_a_mistake_is_named_by_its_key(change, words):
    with pytest.raises(DataError, match=words):
        read_search(SEARCH | change)


def test_the_command(tmp_path):
    pytest.importorskip("optuna")
    (tmp_path / "s.yaml").write_text(yaml.safe_dump(SEARCH | {"trials": 2, "runs": 4}))
    result = CliRunner().invoke(app, ["tune", str(tmp_path / "s.yaml"), "-o", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    assert "which the search never saw" in result.output
    assert imu_spec(tmp_path / "out" / "tuned.yaml").name == "tuned"
    assert len(pd.read_csv(tmp_path / "out" / "trials.csv")) == 2
    assert (tmp_path / "out" / "search.png").stat().st_size > 10_000


def test_the_figure_shows_every_trial_that_has_an_answer():
    bands = {"rms_low": 1.5, "rms_high": 3.0, "ratio_low": 0.6, "ratio_high": 1.4}
    rows = [
        {"gyro.bias": value, "answers": 12, "rms": 2.0, "rms_over_sigma": ratio, "in_band": ratio < 1.4} | bands
        for value, ratio in ((1e-8, 3.0), (1e-7, 1.1), (1e-6, 0.9))
    ]
    silent = {"gyro.bias": 5e-6, "answers": 0, "rms": math.inf, "in_band": False}
    found = Tuned(
        read_search(SEARCH), imu_spec({"gyro": {"bias": "0.02 deg/h"}}), pd.DataFrame([*rows, silent]), pd.DataFrame()
    )
    above, below = tn.plot(found).axes
    drawn = [np.asarray(line.get_xdata()) for line in below.lines if line.get_linestyle() == "None"]
    unit = np.radians(1.0) / 3600
    assert sorted(np.concatenate(drawn)) == pytest.approx([1e-8 / unit, 1e-7 / unit, 1e-6 / unit])
    assert above.get_ylabel() == "RMS of phi_u, arcmin"
    assert below.get_xlabel() == "gyro.bias, deg/h"
