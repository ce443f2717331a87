"""`truenorth imu`: the specifications that ship with the library, or one of them as a file to begin one's own from."""

from __future__ import annotations

import json
import sys
from typing import Annotated, Any

from truenorth.cli.console import make_console
from truenorth.cli.options import AsJson, argument, command, option

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Examples:
  truenorth imu --list
  truenorth imu tactical > my_imu.yaml
  truenorth imu my_imu.yaml --json
"""


@command(EXAMPLES)
def imu(
    name: Annotated[str | None, argument("A preset or a YAML file; printed as YAML.")] = None,
    listed: Annotated[bool, option("All presets with their values.", "--list")] = False,
    as_json: AsJson = False,
) -> None:
    """Show specifications of IMUs: the presets, or one of them as a YAML file."""
    import yaml

    from truenorth.core.errors import UsageError
    from truenorth.records.specs import PRESETS, imu_spec

    if (name is None) != listed:
        raise UsageError("expected the name of a preset or a file, or --list")
    content = {
        one: {"name": one, **PRESETS[one]} if one in PRESETS else imu_spec(one).to_mapping()
        for one in (PRESETS if name is None else [name])
    }
    if as_json:
        print(json.dumps(content if name is None else content[name], allow_nan=False))
    elif name is not None:
        yaml.safe_dump(content[name], sys.stdout, sort_keys=False, allow_unicode=True)
    else:
        _print(content)


def _print(presets: dict[str, Any]) -> None:
    from rich.table import Table

    table = Table(box=None, pad_edge=False, padding=(0, 3, 0, 0))
    for title in ("one sigma", *presets):
        table.add_column(title)
    flat = {preset: dict(_terms(content)) for preset, content in presets.items()}
    for term in dict.fromkeys(term for terms in flat.values() for term in terms):
        table.add_row(term.replace("_", " "), *(terms.get(term, "") for terms in flat.values()))
    make_console().print(table)


def _terms(content: dict[str, Any], before: str = "") -> list[tuple[str, str]]:
    found: list[tuple[str, str]] = []
    for key, value in content.items():
        if isinstance(value, dict):
            found += _terms(value, f"{before}{key} ")
        elif key != "name":
            found.append((f"{before}{key}", str(value)))
    return found
