"""`truenorth warm`: what it runs are commands that work, and a second call finds all done."""

from __future__ import annotations

import importlib

import pytest

from truenorth.core import kernel_store
from truenorth.simulation.scenario import shipped

commands = importlib.import_module("truenorth.cli.warm")  # the package holds the function of this name
TASKS, run_task, warm = commands.TASKS, commands.run_task, commands.warm


def test_each_task_is_a_scenario_that_ships():
    assert set(TASKS) <= set(shipped())


def test_what_is_done_is_not_done_again(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(kernel_store, "write_folder", lambda: tmp_path)
    ran = []
    monkeypatch.setattr(commands, "_show", lambda pool, tasks: ran.append(tasks))
    warm(workers=1)
    warm(workers=1)
    assert ran == [list(commands.TASKS)]
    assert "warm already" in capsys.readouterr().out


def test_without_a_folder_it_says_so(monkeypatch, capsys):
    monkeypatch.setattr(kernel_store, "write_folder", lambda: None)
    warm()
    assert "no cache folder can be written to" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("task", list(TASKS))
def test_every_task_runs(task):
    run_task(task)
