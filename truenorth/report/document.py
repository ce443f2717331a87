"""What all pages share: the template's environment, one script, charts, tables, severities and their order."""

from __future__ import annotations

import re
import zlib
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from truenorth.core.language import language, retold, translated
from truenorth.core.version import __version__
from truenorth.report.chart import Chart

ASSETS = Path(__file__).resolve().parent / "assets"


@dataclass(frozen=True)
class Panel:
    """A chart with its title and what to see in it."""

    title: str
    caption: str
    chart: Chart

    @property
    def key(self) -> str:
        """Anchor of the section, from its title."""
        return anchor(self.title)


@dataclass(frozen=True)
class Table:
    """A table: headings, rows of cells, and whether the first cell of a row names it."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    words: frozenset[int] = frozenset()
    """Columns of text, which may break; the others hold figures."""

    @property
    def key(self) -> str:
        """Anchor of the section, from its title."""
        return anchor(self.title)


class Warned(NamedTuple):
    """A line of the verdict that is a warning or an error."""

    severity: str
    message: str


def verdict_lines(reasons: Sequence[str]) -> tuple[list[str], list[Warned]]:
    """Reasons without and with a warning, in their order; those that begin with the word are warnings."""
    mark = "warning: "
    plain = [reason for reason in reasons if not reason.startswith(mark)]
    return plain, [Warned("warning", reason.removeprefix(mark)) for reason in reasons if reason.startswith(mark)]


def anchor(title: str) -> str:
    """A title as the name of a place in the page."""
    return "".join(c.lower() if c.isalnum() else "-" for c in title).strip("-")


def render(template: str, *, interactive: bool, **context: Any) -> str:
    """HTML text of a page; style, script and (where `interactive`) the charts' library are inside it."""
    return str(
        _environment()
        .get_template(template)
        .render(
            **context,
            style=_asset("page.css"),
            script=_asset("page.js"),
            plotly=_library() if interactive else "",
            language=language(),
            version=__version__,
        )
    )


@cache
def _environment() -> Any:
    from jinja2 import Environment, PackageLoader

    environment = Environment(
        loader=PackageLoader("truenorth.report", "templates"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.globals |= {"_": translated, "retold": retold, "anchor": anchor, "packed": packed}
    environment.filters["coded"] = coded
    return environment


def coded(text: str) -> Any:
    """Text whose `names` in backticks are set as code; all else is escaped."""
    from markupsafe import Markup, escape

    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def packed(text: str) -> str:
    """Text deflated (zlib's format), as base64: what the page's script unpacks before it draws."""
    return b64encode(zlib.compress(text.encode(errors="backslashreplace"), 9)).decode()


@cache
def _library() -> str:
    return b64encode((ASSETS / "plotly-cartesian.min.js.zz").read_bytes()).decode()


@cache
def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")
