"""The texts that a reader may meet, out of the sources, and the catalogues brought up to them (``make messages``)."""

from __future__ import annotations

import ast
import io
import re
from functools import cache
from itertools import count
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

import truenorth
from tests.sources import nodes_of, text_of
from truenorth.core.language import FOLDER, FRAME, LANGUAGES
from truenorth.report.words import WHY, WORDS
from truenorth.state.english import SENTENCES
from truenorth.state.remedies import REMEDIES, TERMS
from truenorth.state.titles import TITLES

HOME = Path(truenorth.__file__).parent
# Arrays and models of one's own code: their messages are for those who write Python, and stay English.
NOT_SPOKEN = ("filters", "analysis")
RAISED = re.compile(
    r"(?!CannotLink|Import|UnknownValue)\w*Error|Finding|_missing|_damaged"
)  # those are caught: a kernel left to Numba
METHODS = [
    ("report/**.py", "python"),
    ("cli/**.py", "python"),
    ("quality/inspection.py", "python"),
    ("state/wording.py", "python"),
    ("report/templates/**.html", "jinja2"),
]
KEYWORDS = {"_": None, "translated": None}
OTHERS = [code for code in LANGUAGES if code != "en"]


@cache
def texts() -> set[str]:
    """Every English text that can reach a reader through the catalogue."""
    found = {text for _, _, text, *_ in extract_from_dir(HOME, METHODS, keywords=KEYWORDS) if isinstance(text, str)}
    tables = {text for table in (SENTENCES, REMEDIES, TERMS, TITLES) for text in table.values()}
    return found | tables | set(WORDS) | set(WHY) | messages() | {FRAME, "; "}


@cache
def messages() -> set[str]:
    """Templates of what is raised or found anywhere in the package, their figures as ``{0}``, ``{1}``, .."""
    found: set[str] = set()
    for file in sorted(HOME.rglob("*.py")):
        if file.relative_to(HOME).parts[0] in NOT_SPOKEN:
            continue
        if not RAISED.search(text_of(file)):
            continue
        nodes = nodes_of(file)
        named: dict[str, list[ast.expr]] = {}
        for node in nodes:
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                named.setdefault(node.targets[0].id, []).append(node.value)
        for node in nodes:
            if isinstance(node, ast.Call) and RAISED.fullmatch(_name(node.func)):
                said = node.args[2:3] if _name(node.func) == "Finding" else node.args[:1]
                found |= {_template(pieces) for value in said for pieces in _pieces(value, named) if any(pieces)}
    return found


def _name(function: ast.expr) -> str:
    return function.id if isinstance(function, ast.Name) else getattr(function, "attr", "")


def _pieces(node: ast.expr, named: dict[str, list[ast.expr]]) -> list[list[str | None]]:
    """What a text is made of, in each way it may come out: fixed words, and None for a figure."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [[node.value]]
    if isinstance(node, ast.JoinedStr):
        return [[piece.value if isinstance(piece, ast.Constant) else None for piece in node.values]]
    if isinstance(node, ast.Name):
        return [pieces for value in named.get(node.id, []) for pieces in _pieces(value, {})] or [[None]]
    if isinstance(node, ast.IfExp):
        return _pieces(node.body, named) + _pieces(node.orelse, named)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return [[*left, *right] for left in _pieces(node.left, named) for right in _pieces(node.right, named)]
    return [[None]]


def _template(pieces: list[str | None]) -> str:
    numbers = count()
    return "".join(
        f"{{{next(numbers)}}}" if piece is None else piece.replace("{", "{{").replace("}", "}}") for piece in pieces
    )


def path(code: str, suffix: str) -> Path:
    """The file of a catalogue: .po to read and edit, .mo for the program."""
    return FOLDER / code / "LC_MESSAGES" / f"truenorth.{suffix}"


def catalogue(code: str) -> Catalog:
    """The catalogue of a language."""
    with path(code, "po").open("rb") as file:
        return read_po(file, locale=code)


def compiled(content: Catalog) -> bytes:
    """What the program reads."""
    buffer = io.BytesIO()
    write_mo(buffer, content)
    return buffer.getvalue()


def main() -> None:
    """Add texts that are new, without a translation; take out those that are gone; compile."""
    for code in OTHERS:
        old, new = catalogue(code), Catalog(locale=code, project="truenorth", fuzzy=False)
        for text in sorted(texts()):
            known = old.get(text)
            new.add(text, known.string if known else "")
            if not (known and known.string):
                print(f"{code}: no translation yet: {text}")
        new.creation_date, new.revision_date = old.creation_date, old.revision_date
        with path(code, "po").open("wb") as file:
            write_po(file, new, width=0, omit_header=False)
        path(code, "mo").write_bytes(compiled(catalogue(code)))


if __name__ == "__main__":
    main()
