"""Options in groups: a frozen dataclass declares the options of one panel, and builds what they mean.

A command is a function whose parameters may be such groups; :func:`command` lays their fields out as options.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from copy import copy
from dataclasses import fields, is_dataclass
from functools import wraps
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import typer
from typer.models import ArgumentInfo, OptionInfo


def _number(text: str | float) -> float:
    """A number; what is none is shown, with a point in place of a comma where that makes it one."""
    try:
        return float(text)
    except ValueError:
        pass
    try:
        meant = f"{float(str(text).replace(',', '.')):g}, with a decimal point"
    except ValueError:
        meant = "a number, such as 48.1"
    raise typer.BadParameter(f"found {str(text)!r}; expected {meant}")


def option(help: str, *names: str, panel: str | None = None, **more: Any) -> Any:
    """An option; its names are made from the parameter's where none is given."""
    return typer.Option(*names, help=help, rich_help_panel=panel, **more)


def argument(help: str) -> Any:
    """An argument; its default speaks in the help."""
    return typer.Argument(help=help, show_default=False)


AsJson = Annotated[bool, option("Print one JSON object and nothing else.", "--json")]


def command(examples: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a command of a function; its help is the docstring, then the examples."""

    def made(run: Callable[..., None]) -> Callable[..., None]:
        run.__doc__ = f"{run.__doc__}\n{examples}"
        return _grouped(run)

    return made


def _grouped(run: Callable[..., None]) -> Callable[..., None]:
    """A command of a function whose parameters are options, arguments or groups of options.

    Each field of a group is ``name: Annotated[type, option("help")] = default``; its panel is the group's `PANEL`. A default
    of None is not shown.
    """
    hints = get_type_hints(run, include_extras=True)
    groups: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(run).parameters.items():
        kind = hints[name]
        if is_dataclass(kind):
            groups[name] = kind
            parameters += _laid_out(kind)
        else:
            shown = _in_panel(kind, None, None if parameter.default is inspect.Parameter.empty else parameter.default)
            parameters.append(parameter.replace(annotation=shown, kind=inspect.Parameter.KEYWORD_ONLY))

    @wraps(run)
    def command(**given: Any) -> None:
        for name, kind in groups.items():
            given[name] = kind(**{field.name: given.pop(field.name) for field in fields(kind)})
        run(**given)

    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # which typer reads
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    return command


def _laid_out(group: Any) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=field.default,
            annotation=_in_panel(hints[field.name], getattr(group, "PANEL", None), field.default),
        )
        for field in fields(group)
    ]


def _in_panel(hint: Any, panel: str | None, default: Any) -> Any:
    kind, *marks = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    infos = [copy(mark) for mark in marks if isinstance(mark, OptionInfo | ArgumentInfo)]
    for info in infos:
        if kind in (float, float | None):
            info.parser = _number
            info.metavar = info.metavar or "<float>"
        info.rich_help_panel = info.rich_help_panel or panel
        info.show_default = info.show_default and default is not None
    return Annotated[kind, *infos] if infos else hint
