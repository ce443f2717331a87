"""Options taken without a schema have the values, and the refusals, that Typer gives."""

import subprocess
import sys

import pytest
import typer

from truenorth.cli import COMMANDS, program
from truenorth.cli.plain import PlainCommand

WORDS = ("3", "4.5", "x y", "", "-", ".", "/", "navigation", "missing/file.csv", "1,5", "nan")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_value_of_every_option_is_that_of_typer(name):
    command = typer.main.get_command(program([name])).commands[name]
    assert isinstance(command, PlainCommand)
    context = command.context_class(command)
    for parameter in command.get_params(context):
        if parameter.name == "help":
            continue
        for value in (None, *WORDS):
            assert _outcome(parameter.process_value, context, value) == _outcome(
                lambda c, v, p=parameter: type(p).process_value(p, c, v), context, value
            ), (parameter.name, value)
        if parameter.required:
            continue
        default = parameter.get_default(context)
        assert parameter.process_value(context, default) == type(parameter).process_value(parameter, context, default)


def _outcome(process, context, value):
    try:
        found = process(context, value)
    except Exception as error:
        return type(error), str(error)
    return type(found), repr(found)


def test_a_file_that_nobody_may_read_is_left_to_typer(tmp_path, monkeypatch):
    command = typer.main.get_command(program(["inspect"])).commands["inspect"]
    context = command.context_class(command)
    log = next(p for p in command.get_params(context) if p.name == "log")
    file = tmp_path / "log.csv"
    file.touch()
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(Exception, match="is not readable"):
        log.process_value(context, str(file))


def test_a_line_of_words_numbers_and_paths_loads_no_pydantic():
    line = ["truenorth", "align", "none.csv", "--lat", "40", "--imu", "navigation", "--at", "3", "-o", "out"]
    code = f"import sys\nsys.argv = {line}\nfrom truenorth.cli import main\ntry: main()\nexcept SystemExit as end: print(end.code)"
    shown = subprocess.run(
        [sys.executable, "-c", f"{code}\nprint('pydantic' in sys.modules)"], capture_output=True, text=True, check=True
    ).stdout
    assert shown.split() == ["2", "False"]
