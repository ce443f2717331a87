"""Options in ``--help``: in groups, and with the defaults of the models that they are for."""

from __future__ import annotations

import inspect

import pytest
import typer

from truenorth.cli import app, main
from truenorth.damping.options import Damper
from truenorth.live.session import Session

COMMANDS = typer.main.get_command(app).commands
ALONE = {"help", "output", "as_json"}  # of every command, and not in a group


def options(name):
    return [p for p in COMMANDS[name].params if p.param_type_name == "option" and p.name not in ALONE]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_many_options_stand_in_groups(name):
    found = options(name)
    loose = [p.opts[0] for p in found if not getattr(p, "rich_help_panel", None)]
    assert len(loose) <= (7 if name in ("align", "navigate") else 2)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_option_says_what_it_is(name):
    assert all(p.help for p in options(name))


@pytest.mark.parametrize(
    ("command", "model", "names"),
    [
        ("live", Session, {"share": "share", "every": "every", "method": "method"}),
        (
            "navigate",
            Damper,
            {
                "damping_ratio": "ratio",
                "damping_order": "order",
                "azimuth_damping": "azimuth",
                "damping_start": "start",
                "damping_ramp": "ramp",
            },
        ),
    ],
)
def test_defaults_are_those_of_the_model(command, model, names):
    usual = {name: p.default for name, p in inspect.signature(model).parameters.items()}
    given = {p.name: p.default for p in COMMANDS[command].params}
    assert {option: given[option] for option in names} == {option: usual[name] for option, name in names.items()}


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_lines_to_copy_fit_a_terminal_of_eighty_columns(name):
    """What is kept as it is written (``\\b``) is broken where it is longer, and a command is then no line to copy."""
    text = f"{COMMANDS[name].help}\n\n{COMMANDS[name].epilog or ''}"
    kept = [part for part in text.split("\n\n") if "\b" in part]
    assert kept
    assert [line for part in kept for line in part.splitlines() if len(line) > 78] == []


@pytest.mark.parametrize(
    ("given", "meant"),
    [("48,1", "expected 48.1, with a decimal point"), ("north", "expected a number"), ("1,2,3", "such as 48.1")],
)
def test_a_number_that_is_none_says_what_was_meant(given, meant, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("sys.argv", ["truenorth", "align", "log.csv", "--lat", given])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert f"found '{given}'" in said
    assert meant in said
