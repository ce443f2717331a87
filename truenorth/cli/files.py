"""What a command may write over: never its own inputs, and no folder that holds a result of another kind, unless asked to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from truenorth.core.paths import is_folder

FORCE, LAYOUT = "--force", "--write-layout"
OUTPUTS = ("-o", "--output", "--plot", LAYOUT)
KINDS = {  # by command: the kind of result that it writes into its output folder
    "align": "Alignment",
    "live": "Alignment",
    "navigate": "Navigation",
    "advise": "Advice",
    "noise": "Noise",
    "simulate": "Simulation",
    "campaign": "Campaign",
    "reproduce": "Study",
    "tune": "Tuned",
    "faults": "Faults",
}
FIRST = {  # by kind: files that are written in any case, looked for before the work
    "Alignment": ("summary.json", "history.parquet", "report.html"),
    "Navigation": ("summary.json", "track.parquet", "report.html"),
    "Advice": ("advice.png",),
    "Noise": ("imu.yaml", "noise.svg"),
    "Simulation": ("scenario.yaml", "summary.json", "figure.png"),
    "Campaign": ("summary.csv", "comparison.csv", "report.html"),
    "Study": ("figures.csv", "report.html", "index.html"),
    "Tuned": ("trials.csv", "judged.csv", "search.png"),
    "Faults": ("faults.csv", "faults.md"),
}
READ_NO_FOLDER = (
    "simulate",
    "campaign",
    "reproduce",
    "tune",
    "faults",
    "advise",
)  # but files, and names of what is shipped
MARKERS = {  # by kind without a result.npz: files, or patterns of names, that stand together in such a folder only
    "Campaign": ("manifest.json", "plan.yaml"),
    "Study": ("claims.md",),
    "Simulation": ("truth.*", "scenario.yaml"),
    "Advice": ("advice.json",),
    "Noise": ("kalibr.yaml", "imu.yaml"),
    "Tuned": ("tuned.yaml", "trials.csv", "judged.csv"),
    "Faults": ("trials.csv",),
}
GROWN = {  # the same of a campaign that was ended early, and of all studies
    "Campaign": ("runs/case*.parquet",),
    "Study": ("index.html", "*/claims.md"),
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
        folder = command in READ_NO_FOLDER and is_folder(Path(name))
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


def check_output(words: Sequence[str]) -> list[Path]:
    """Refuse, before the work, an output folder that holds a result of another kind.

    Returns
    -------
    list of Path
        Where the folder holds no result of this kind either: its files, which are not to be replaced.

    Raises
    ------
    UsageError
        It names both kinds.
    """
    from truenorth.core.errors import UsageError

    command = next((word for word in words if word in KINDS), None)
    if command is None:
        return []
    kept, wanted = [], KINDS[command]
    for folder in _folders(words, command):
        found = kinds_in(folder)
        if found and wanted not in found:
            raise UsageError(
                f"{folder}: holds a result of another kind ({found[0]}, where {command} writes {wanted}) and would be "
                f"overwritten; name another folder with -o, or add {FORCE}"
            )
        if not found and not _holds(folder, GROWN.get(wanted, ())):
            kept += [path for path in folder.iterdir() if path.is_file()]
    return kept


def check_names(words: Sequence[str]) -> None:
    """Refuse, before the work, what would be refused after it: a file of a result that is to be kept.

    Raises
    ------
    UsageError
        It names the file.
    """
    from truenorth.core.atomic import check_free

    command = next((word for word in words if word in KINDS), "")
    for folder in {*map(Path, _outputs(words)), *_folders(words, command)}:
        for name in FIRST.get(KINDS.get(command, ""), ()):
            check_free(folder / name)


def kinds_in(folder: Path) -> list[str]:
    """The kinds of results that a folder holds: more than one where somebody has forced it, none where we know none."""
    found = [kind for kind, names in MARKERS.items() if _holds(folder, names)]
    archive = folder / "result.npz"
    if archive.is_file():
        from truenorth.core.archive import type_in

        found.append(type_in(archive).replace("ManoeuvreAdvice", "Advice"))
    return [kind for kind in found if kind]


def _holds(folder: Path, names: Sequence[str]) -> bool:
    return bool(names) and all(any(folder.glob(name)) for name in names)


def _folders(words: Sequence[str], command: str) -> Iterator[Path]:
    """The folders that are there and that a command writes into: with ``simulate --runs`` those of its runs as well."""
    several = command == "simulate" and any(word.partition("=")[0] == "--runs" for word in words)
    first, count = (_number(words, option) for option in ("--run", "--runs"))
    for folder in filter(is_folder, map(Path, _outputs(words))):
        yield folder
        for path in sorted(folder.glob("run_*")) if several else ():
            number = path.name.removeprefix("run_")
            if path.is_dir() and number.isdecimal() and int(number) in range(first, first + count):
                yield path


def _number(words: Sequence[str], option: str) -> int:
    """The whole number behind an option, as the next word or behind ``=``; 0 where there is none."""
    found = 0
    for word, following in zip(words, (*words[1:], "")):
        name, equals, value = word.partition("=")
        if name == option:
            number = value if equals else following
            found = int(number) if number.isdecimal() else 0
    return found


def _outputs(words: Sequence[str]) -> Iterator[str]:
    """The folder or file behind each option of an output: as the next word, behind ``=``, or right behind ``-o``."""
    for word, following in zip(words, (*words[1:], "")):
        option, equals, value = word.partition("=")
        if word.startswith("-o"):
            yield word[2:] or following
        elif option in OUTPUTS:
            yield value if equals else following
