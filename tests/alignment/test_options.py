"""Options of `truenorth align` that do not go together: refused before a log is read."""

from itertools import combinations

import pytest
import typer
from click.testing import CliRunner

from truenorth.cli import app
from truenorth.cli.align_options import BELONGS, CLASHES, PROCEDURES
from truenorth.core.errors import UsageError

COMMANDS = typer.main.get_command(app)
VALUES = {
    "--positions": "auto",
    "--arm-sigma": "0.1",
    "--lever-arm-sigma": "0.5",
    "--offset": "2",
    "--odometer-noise": "0.1",
    "--latency": "0.1",
    "--mounting-sigma": "5",
    "--method": "oba",
    "--at": "50",
    "--advise": "0.1",
}


def said(*options):
    """What an alignment of a log that does not exist is refused with."""
    words = [word for option in options for word in (option, VALUES.get(option, "file.csv"))]
    result = CliRunner().invoke(COMMANDS, ["align", "none.csv", "--lat", "48", *words])
    assert isinstance(result.exception, UsageError), (words, result.output, result.exception)
    assert result.exception.exit_code == 2
    return str(result.exception)


@pytest.mark.parametrize(
    ("one", "other"), [pair for pair in combinations(PROCEDURES, 2) if PROCEDURES[pair[0]] != PROCEDURES[pair[1]]]
)
def test_two_procedures_are_refused(one, other):
    words = said(one, other)
    assert "are two procedures" in words
    assert one in words
    assert other in words
    assert said(other, one) == words


@pytest.mark.parametrize("option", BELONGS)
def test_an_option_of_another_procedure_is_refused(option):
    assert f"{option} belongs to {BELONGS[option][0]}" in said(option)
    elsewhere = next(name for name in PROCEDURES if name not in BELONGS[option])
    assert f"{option} belongs to" in said(option, elsewhere)
    home = BELONGS[option][0]
    assert "none.csv" in said(option, home, *BELONGS.get(home, ())[:1])


@pytest.mark.parametrize(("option", "procedure"), [(option, name) for option in CLASHES for name in CLASHES[option]])
def test_what_a_procedure_would_not_look_at_is_refused(option, procedure):
    assert f"{option} does not go with {procedure}" in said(option, procedure)


def test_what_goes_together_comes_to_the_log():
    assert "none.csv" in said("--odometer", "--gnss", "--offset", "--mounting")
    assert "none.csv" in said("--method")
    result = CliRunner().invoke(
        COMMANDS, ["align", "none.csv", "--lat", "48", "--positions", "auto", "--method", "auto"]
    )
    assert "none.csv" in str(result.exception)
