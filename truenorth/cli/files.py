"""What a command may write over: never its own inputs, and no folder that holds a result of another kind, unless asked to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

FORCE, LAYOUT = "--force", "--write-layout"
OUTPUTS = ("-o", "--output", "--plot", LAYOUT)
KINDS = {  # by command: the kind of result that it writes into its output folder
    "align": "Alignment",
    "live": "Alignment",
    "navigate": "Navigation",
    "advise": "Advice",
    "simulate": "Simulation",
    "campaign": "Campaign",
    "reproduce": "Study",
    "tune": "Tuned",
    "faults": "Faults",
}
READ_NO_FOLDER = (
    "simulate",
    "campaign",
    "reproduce",
    "tune",
    "faults",
    "advise",
)  # but files, and names of what is shipped
MARKERS = {  # names of files, of results that keep no result.npz
    "manifest.json": "Campaign",
    "claims.md": "Study",
    "truth.*": "Simulation",
}


def inputs(words: Sequence[str]) -> Iterator[str]:
    """What on the command line may name an input: every word but those that name the command or an output.

    A command that reads no folder takes no word for one: ``reproduce static -o static`` may be run again.
    """
    before, command = "", next((word for word in words if word in (*KINDS, "noise", "example")), "")
    first = words.index(command) if command else -1
    for at, word in enumerate(words):
        option, _, value = word.partition("=")
        name = value or word
        folder = command in READ_NO_FOLDER and Path(name).is_dir()
        if at != first and before not in OUTPUTS and option not in OUTPUTS and not folder:
            yield name
        before = word


def with_layout_name(words: Sequence[str]) -> list[str]:
    """The command line with ``--write-layout``, whose file need not be named, as one word with its file.

    Only a word that ends in .yaml is its file: the word behind it may as well be the log.
    """
    found: list[str] = []
    for word in words:
        if found and found[-1] == f"{LAYOUT}=" and word.lower().endswith(".yaml"):
            found[-1] += word
        else:
            found.append(f"{word}=" if word == LAYOUT else word)
    return found


def check_output(words: Sequence[str]) -> None:
    """Refuse, before the work, an output folder that holds a result of another kind.

    Raises
    ------
    UsageError
        It names both kinds.
    """
    from truenorth.core.errors import UsageError

    command = next((word for word in words if word in KINDS), None)
    folder = next((Path(value) for value in _outputs(words)), None)
    if command is None or folder is None or not folder.is_dir():
        return
    found, wanted = kind_in(folder), KINDS[command]
    if found is not None and found != wanted:
        raise UsageError(
            f"{folder}: holds a result of another kind ({found}, where {command} writes {wanted}) and would be overwritten; "
            f"name another folder with -o, or add {FORCE}"
        )


def kind_in(folder: Path) -> str | None:
    """The kind of result that a folder holds; None where it holds none that we know."""
    for name, kind in MARKERS.items():
        if any(folder.glob(name)):
            return kind
    archive = folder / "result.npz"
    if not archive.is_file():
        return None
    from truenorth.core.archive import type_in

    return type_in(archive).replace("ManoeuvreAdvice", "Advice") or None


def _outputs(words: Sequence[str]) -> Iterator[str]:
    for word, following in zip(words, (*words[1:], "")):
        option, equals, value = word.partition("=")
        if option in OUTPUTS:
            yield value if equals else following
