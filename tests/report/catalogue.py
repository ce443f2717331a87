"""The texts that a reader may meet, out of the sources, and the catalogues brought up to them (``make messages``)."""

from __future__ import annotations

import io
from pathlib import Path

from babel.messages.catalog import Catalog
from babel.messages.extract import extract_from_dir
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po, write_po

import truenorth
from truenorth.core.language import FOLDER, LANGUAGES
from truenorth.report.words import WORDS
from truenorth.state.english import REMEDIES, SENTENCES, TERMS, TITLES

HOME = Path(truenorth.__file__).parent
METHODS = [
    ("report/**.py", "python"),
    ("cli/**.py", "python"),
    ("quality/inspection.py", "python"),
    ("state/wording.py", "python"),
    ("report/templates/**.html", "jinja2"),
]
KEYWORDS = {"_": None, "translated": None}
OTHERS = [code for code in LANGUAGES if code != "en"]


def texts() -> set[str]:
    """Every English text that can reach a reader through the catalogue."""
    found = {text for _, _, text, *_ in extract_from_dir(HOME, METHODS, keywords=KEYWORDS) if isinstance(text, str)}
    tables = {text for table in (SENTENCES, REMEDIES, TERMS, TITLES) for text in table.values()}
    return found | tables | set(WORDS)


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
