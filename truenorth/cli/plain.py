"""Options as the line has them: what is absent, a word, a number of ours or a path needs no schema of pydantic.

Typer makes a schema for each option of a command, also for those that a line does not name: to load pydantic and to make the
sixty of `align` took .1 s. What is left to Typer: everything else, and all that is to be refused.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from typer.core import TyperCommand, TyperGroup


class PlainCommand(TyperCommand):
    """A command whose options are taken so."""

    def get_params(self, ctx: Any) -> list[Any]:
        """Its options and arguments, that of its help too."""
        return [_taken_plainly(parameter) for parameter in super().get_params(ctx)]


class PlainGroup(TyperGroup):
    """The program, whose own options are taken so."""

    def get_params(self, ctx: Any) -> list[Any]:
        """What stands before the command."""
        return [_taken_plainly(parameter) for parameter in super().get_params(ctx)]


def _taken_plainly(parameter: Any) -> Any:
    if hasattr(parameter, "type_descriptor") and "process_value" not in vars(parameter):
        parameter.process_value = _plainly(parameter, parameter.process_value)
    return parameter


def _plainly(parameter: Any, by_typer: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """What makes the value of an option, in place of Typer's."""
    several = parameter.multiple or parameter.nargs != 1
    kind, parser = parameter.type_descriptor.annotation, parameter.type_descriptor.parameter_info.parser

    def value_of(context: Any, value: Any) -> Any:
        if value is None and not parameter.required:
            absent = () if several else None
            return absent if parameter.callback is None else parameter.callback(context, parameter, absent)
        if isinstance(value, str) and not several and parameter.callback is None:
            if parser is not None:
                return parser(value)
            if kind is str:
                return value
            if kind is Path and (not os.path.exists(value) or os.access(value, os.R_OK)) and _has_no_wish(parameter):
                return Path(value)
        elif isinstance(value, float) and parser is not None and parameter.callback is None:  # a default
            return parser(value)
        return by_typer(context, value)

    return value_of


def _has_no_wish(parameter: Any) -> bool:
    """Whether a path may be anything that can be read, or nothing yet."""
    info = parameter.type_descriptor.parameter_info
    wishes = info.exists, info.writable, info.resolve_path, info.allow_dash, not info.file_okay, not info.dir_okay
    return not any(wishes) and info.path_type is None
