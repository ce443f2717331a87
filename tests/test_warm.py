"""`truenorth warm`: what it runs are commands that work, and a second call finds all done."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import truenorth
from truenorth import papers
from truenorth.aiding.magnetometer import FIELD
from truenorth.cli import warm as commands
from truenorth.cli.warm import STUDIES, TASKS, run_task, warm
from truenorth.core import kernel_folder
from truenorth.core.processor import shipped_level
from truenorth.simulation.scenario import shipped
from truenorth.strapdown.level import mechanise_increments

ROOT = Path(__file__).parents[1]


def test_each_task_is_a_scenario_that_ships():
    assert set(TASKS) <= set(shipped())


def test_what_is_done_is_not_done_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(kernel_folder, "write_folder", lambda: tmp_path)
    ran = []
    monkeypatch.setattr(commands, "_show", lambda pool, tasks: ran.append(tasks))
    warm(workers=1)
    warm(workers=1)
    assert ran == [list(commands.TASKS)]
    assert "warm already" in capsys.readouterr().out


def test_studies_are_compiled_where_they_are_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(kernel_folder, "write_folder", lambda: tmp_path)
    ran = []
    monkeypatch.setattr(commands, "_show", lambda pool, tasks: ran.append(tasks))
    warm(workers=1)
    warm(workers=1, studies=True)
    warm(workers=1, studies=True)
    assert ran == [list(TASKS), list(STUDIES)]
    assert set(STUDIES) <= set(papers.STUDIES)


def test_what_no_scenario_asks_for(tmp_path, monkeypatch):
    """A magnetometer's measurement, and the mechanisation by itself: what is compiled is there for others."""
    monkeypatch.chdir(tmp_path)
    truenorth.write_imu(
        truenorth.ImuRecord(0.01 * np.arange(1, 201), np.zeros((200, 3)), np.tile([0.0, 0.0, 9.8], (200, 1))),
        "imu.parquet",
    )
    FIELD.function.__dict__.pop("address", None)
    monkeypatch.setattr(mechanise_increments, "_ready", {})
    commands._beyond_commands()
    assert "address" in FIELD.function.__dict__
    assert len(mechanise_increments.signatures) == 1


def test_without_a_folder_it_says_so(monkeypatch, capsys):
    monkeypatch.setattr(kernel_folder, "write_folder", lambda: None)
    warm()
    assert "no cache folder can be written to" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(not shipped_level(), reason="no kernels come with the package for this processor and Python")
def test_the_demo_compiles_nothing(tmp_path):
    """Where a kernel was edited, the one that comes with the package is of older sources: run make kernels."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_")}
    environment |= {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, str(ROOT / "examples/demo.py")], cwd=tmp_path, env=environment, check=True)
    assert [file.name for file in (tmp_path / "cache").rglob("*.code")] == [], "run make kernels"


@pytest.mark.slow
@pytest.mark.parametrize("task", [*TASKS, *STUDIES])
def test_every_task_runs(task):
    run_task(task)
