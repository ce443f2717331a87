"""`truenorth imu`: presets with their values, one as a file that reads back."""

import json

import pytest
from typer.testing import CliRunner

from truenorth.cli import app
from truenorth.core.errors import UsageError
from truenorth.records.specs import PRESETS, imu_spec


def call(*arguments):
    return CliRunner().invoke(app, ["imu", *map(str, arguments)])


def test_the_list_has_all_presets_with_values():
    shown = call("--list").stdout
    for preset in PRESETS:
        assert preset in shown
    assert "0.01 deg/h" in shown
    assert set(json.loads(call("--list", "--json").stdout)) == set(PRESETS)


def test_a_preset_is_a_file_to_begin_from(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(call("tactical").stdout)
    assert imu_spec(path) == imu_spec("tactical")


@pytest.mark.parametrize("arguments", [[], ["tactical", "--list"], ["none"]])
def test_wrong_usage(arguments):
    assert isinstance(call(*arguments).exception, UsageError)
