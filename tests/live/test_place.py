"""Where `truenorth live` takes its place from."""

import numpy as np
import pytest
from typer.testing import CliRunner

from truenorth.cli import app


@pytest.mark.parametrize(("options", "asked"), [((), True), (("--master", "master.csv"), False)])
def test_a_master_says_where_it_is(tmp_path, monkeypatch, options, asked):
    """As in `align --master`: no place is asked for before its log is read."""
    monkeypatch.chdir(tmp_path)
    rows = np.column_stack([0.02 * np.arange(50), np.zeros((50, 5)), np.full(50, 9.8)])
    header = "time,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"
    np.savetxt("log.csv", rows, delimiter=",", header=header, comments="")
    result = CliRunner().invoke(app, ["live", "replay:log.csv@max", *options])
    assert result.exit_code != 0
    assert ("no place; expected" in result.output + str(result.exception)) is asked
