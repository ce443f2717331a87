"""The command line: one command for each thing to do (`align`, `inspect`, `navigate`, `simulate`, ...).

Each command stands in a module of its own and imports its work when it runs, so that ``--help`` is quick.
"""

from __future__ import annotations

import atexit
import functools
import gc
import io
import os
import re
import sys
from collections.abc import Iterable
from contextlib import nullcontext
from importlib import import_module

import typer

from truenorth.cli.console import explain_compiling
from truenorth.cli.files import FORCE, check_names, check_output, inputs, with_layout_name
from truenorth.cli.plain import PlainCommand, PlainGroup
from truenorth.cli.wording import in_options
from truenorth.core.atomic import protected
from truenorth.core.errors import DataError, TruenorthError
from truenorth.core.language import LANGUAGES, retold, speak
from truenorth.core.version import __version__

INTERRUPTED = 130
# Objects made before Python looks for garbage, and rounds before it looks at old ones: `align` makes 200,000 that stay (modules,
# types), and with Python's own numbers (700, 10, 10) it looks through them again and again, a twentieth of its time.
GARBAGE = (300_000, 50, 100)

# In the order of the help; each is the function of that name in the module of that name.
COMMANDS = (
    "align",
    "advise",
    "imu",
    "example",
    "inspect",
    "live",
    "navigate",
    "noise",
    "simulate",
    "campaign",
    "faults",
    "tune",
    "warm",
    "reproduce",
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"truenorth {__version__}")
        raise typer.Exit


def _main(
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
    lang: str = typer.Option("en", "--lang", help="Language of verdicts and reports: en or zh; anywhere on the line."),
    force: bool = typer.Option(  # put first by main
        False, FORCE, help="Write over inputs, and into a folder with a result of another kind; anywhere on the line."
    ),
) -> None:
    speak(lang)


def program(commands: Iterable[str] = COMMANDS) -> typer.Typer:
    """The program with all its commands, or with some: to load and to read the options of all takes a twentieth of `align`."""
    made = typer.Typer(
        name="truenorth",
        cls=PlainGroup,
        help="Find level and true north from an IMU log, and say how far the answer can be trusted.",
        no_args_is_help=True,
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    made.callback()(_main)
    for name in commands:
        made.command(name, cls=PlainCommand)(getattr(import_module(f"truenorth.cli.{name}"), name))
    return made


def __getattr__(name: str) -> typer.Typer:
    """The whole program, `app`, for those that ask for it."""
    if name != "app":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()["app"] = made = program()
    return made


def _asked(words: list[str]) -> Iterable[str]:
    """The command of a line, as :func:`_language_first` leaves it, alone; all of them where another word stands there."""
    first, *rest = [*words, ""]
    command = rest[1] if first == "--lang" and len(rest) > 1 else rest[0] if first.startswith("--lang=") else first
    return (command,) if command in COMMANDS else COMMANDS


def _language_first(arguments: list[str]) -> list[str]:
    """``--lang zh`` may stand anywhere: it is moved to where the program reads it, before the command."""
    for i, word in enumerate(arguments):
        count = 2 if word == "--lang" else 1 if word.startswith("--lang=") else 0
        if count:
            return [*arguments[i : i + count], *arguments[:i], *arguments[i + count :]]
    return arguments


def _speak_early(arguments: list[str]) -> None:
    """The language of messages that come before the line is read; one that is not known is refused by then."""
    first, *rest = [*_language_first(arguments), ""]
    asked = rest[0] if first == "--lang" else first.removeprefix("--lang=")
    if asked in LANGUAGES:
        speak(asked)


def _out_of_memory(commands: Iterable[str], error: MemoryError) -> TruenorthError:
    """What was asked for and could not be had, in one message; NumPy and Arrow say how much."""
    command, *others = commands
    what = f"`{'truenorth' if others else command}`"
    size = re.search(r"[\d.]+ [KMGT]iB", str(error)) or re.search(r"\bsize (\d+)", str(error))
    if size is None:
        return DataError(
            f"{what} needs more memory than is free; expected a shorter log or scenario, a lower rate, or a computer with more "
            "free memory"
        )
    amount = size.group().replace(". ", " ") if size.re.groups == 0 else f"{int(size.group(1)) / 2**30:.3g} GiB"
    return DataError(
        f"{what} asked for {amount} of memory, and less is free; expected a shorter log or scenario, a lower rate, or a computer "
        "with more free memory"
    )


@functools.cache
def _leave_quickly() -> None:
    """Once in a process: else Python looks through all that is left before it ends, a tenth of `align`."""
    atexit.register(gc.freeze)


def main() -> None:
    """Run the program; errors of ours end in one message and their exit code, an interrupt in 130."""
    # Nothing here is a matrix large enough to share: threads of BLAS would only spin. Set before NumPy is loaded.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(*GARBAGE)
    _leave_quickly()
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed by the shell, as by `>&-`
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a terminal that has no ± shows ?, and the answer is still printed
            stream.reconfigure(errors="replace")
    explain_compiling()
    try:
        words = sys.argv[1:]
        _speak_early(words)
        forced = FORCE in words
        words = with_layout_name([word for word in words if word != FORCE])
        with nullcontext() if forced else protected(inputs(words), check_output(words)):
            check_names(words)
            words = _language_first(words)
            program(_asked(words))(args=[*([FORCE] if forced else []), *words])
    except TruenorthError as error:
        print(f"truenorth: {in_options(retold(str(error)))}", file=sys.stderr)
        sys.exit(error.exit_code)
    except MemoryError as error:
        short = _out_of_memory(_asked(sys.argv[1:]), error)
        print(f"truenorth: {retold(str(short))}", file=sys.stderr)
        sys.exit(short.exit_code)
    except SystemExit as stop:
        if stop.code == INTERRUPTED:  # typer has turned the interrupt into this
            print("truenorth: interrupted; nothing half-written is left", file=sys.stderr)
        raise
