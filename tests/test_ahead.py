"""What is compiled by a second process is what the first one will ask for."""

import subprocess
import sys

import pytest

from tests.campaign.test_plan import REST
from truenorth import align
from truenorth.alignment.matched import _sum_back
from truenorth.cli import ahead
from truenorth.core import kernel_store
from truenorth.core.position import Position
from truenorth.filters.linear import linear_runs
from truenorth.simulation.scenario import read_scenario

STILL = REST | {"duration": "60 s", "rate": "20 Hz", "imu": "navigation"}


def test_its_kernels_are_those_of_an_alignment():
    scenario = read_scenario(STILL)
    align(scenario.simulate(seed=1).record, Position.from_degrees(45.0, 0.0), scenario.imu_spec, method="kalman")
    matches, filters = kinds(_sum_back), kinds(linear_runs)
    ahead.call_last()
    assert kinds(_sum_back) == matches
    assert kinds(linear_runs) == filters


def kinds(kernel):
    """Signatures but for the size, the first."""
    return {signature[1:] for signature in kernel.signatures}


def test_it_starts_where_the_kernels_are_not_on_the_disk(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr(kernel_store, "write_folder", lambda: tmp_path)
    monkeypatch.setattr(ahead.os, "cpu_count", lambda: 2)
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **options: started.append(command))
    ahead.compile_ahead()
    assert [command[-1] for command in started] == [ahead.CODE]
    (tmp_path / f"{ahead.LAST}-0123.kernel").touch()
    ahead.compile_ahead()
    assert len(started) == 1


@pytest.mark.slow
def test_it_ends_with_the_first_process():
    process = subprocess.Popen([sys.executable, "-c", ahead.CODE], stdin=subprocess.PIPE)
    process.stdin.close()
    assert process.wait(60) == 0
