"""Results are written whole or not at all: to a temporary name in the same folder, onto the disk, then renamed.

What a command reads it does not write over: the command line names its inputs by :func:`protected`.
"""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from truenorth.core.errors import UsageError

_inputs: set[Path] = set()


@contextmanager
def protected(inputs: Iterable[str | os.PathLike[str]]) -> Iterator[None]:
    """Refuse to replace these files, and all files in these folders, as long as the block runs.

    Parameters
    ----------
    inputs : iterable of paths
        Those that do not exist are ignored.
    """
    before = set(_inputs)
    for path in map(Path, inputs):
        with suppress(OSError):
            if path.is_file():
                _inputs.add(path.resolve())
            elif path.is_dir():
                _inputs.update(file.resolve() for file in path.iterdir() if file.is_file())
    try:
        yield
    finally:
        _inputs.clear()
        _inputs.update(before)


def writable_folder(folder: str | os.PathLike[str]) -> Path:
    """Make `folder` where it is missing and check that files can be created in it.

    Raises
    ------
    UsageError
        The folder cannot be made or written to; the message names it and the system's reason.
    """
    path = Path(folder)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise UsageError(
            f"{path}: cannot write to this output folder ({error.strerror}); expected a folder that takes new files"
        ) from None
    return path


@contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path in the folder of `target`; rename it to `target` on success, remove it on any failure.

    Raises
    ------
    UsageError
        The folder of `target` does not take the file, or `target` is an input of the running command.
    """
    with atomic_files() as temporary:
        yield temporary(target)


@contextmanager
def atomic_files() -> Iterator[Callable[..., Path]]:
    """Write several files that belong together: all of them stand at the end, or what stood there before.

    Gives a function from a target to the temporary path to write to. A temporary name keeps the suffix of its target, since some
    writers choose their format by it, and is another one for each writer, so that two threads or processes can write the same
    files: the last one to finish wins. A target with
    `gone` is removed as the others take their names: the new set has no such file.

    Raises
    ------
    UsageError
        A folder does not take a file, or a target is an input of the running command.
    """
    written: dict[Path, Path] = {}
    removed: set[Path] = set()

    def temporary(target: str | os.PathLike[str], *, gone: bool = False) -> Path:
        path = Path(target)
        folder = writable_folder(path.parent)
        if _inputs and path.resolve() in _inputs:
            raise UsageError(
                f"{path}: this file is an input of the command and would be overwritten; expected another output folder"
            )
        if gone:
            removed.add(path)
            return path
        written[path] = _nameless(folder, path, "part")
        return written[path]

    try:
        yield temporary
        _put_in_place(written, removed)
    except OSError as error:
        where = next(iter(written), "output") if len(written) < 2 else f"results in {next(iter(written)).parent}"
        raise UsageError(f"{where}: could not be written ({error.strerror or error})") from error
    finally:
        for path in written.values():
            with suppress(OSError):
                path.unlink(missing_ok=True)


def _put_in_place(written: Mapping[Path, Path], removed: Iterable[Path]) -> None:
    """Rename all temporary files to their targets; where one cannot be renamed, put back what stood at the others."""
    for path in written.values():
        _onto_disk(path)
    old: dict[Path, Path | None] = {}
    try:
        for target in (*written, *removed):
            old[target] = _second_name(target) if target.is_file() else None
            if target in written:
                os.replace(written[target], target)
            else:
                target.unlink(missing_ok=True)
        for folder in {target.parent for target in old}:
            _onto_disk(folder)
    except BaseException:
        for target, kept in old.items():
            if kept is not None:
                os.replace(kept, target)
                kept.unlink(missing_ok=True)  # renaming one name of a file to its other name does nothing
            elif target in written and not written[target].exists():  # it was renamed, and nothing stood there before
                target.unlink(missing_ok=True)
        raise
    for kept in old.values():
        if kept is not None:
            with suppress(OSError):  # the new set stands: a hidden second name that cannot go is no failure
                kept.unlink(missing_ok=True)


def _second_name(target: Path) -> Path:
    """The file under one more name, by which it can be put back; `target` itself stands all the time."""
    kept = _nameless(target.parent, target, "old")
    try:
        os.link(target, kept)
    except OSError:  # a file system without hard links
        shutil.copy2(target, kept)
    return kept


def _nameless(folder: Path, target: Path, what: str) -> Path:
    """A hidden name that nobody else has."""
    return folder / f".{target.stem}.{os.getpid()}-{secrets.token_hex(4)}.{what}{target.suffix}"


def _onto_disk(path: Path) -> None:
    """Have the system write out a file, or the names in a folder, where the system can: a power cut then loses neither."""
    folder = path.is_dir()
    if folder and os.name == "nt":
        return
    number = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    try:
        os.fsync(number)
    except OSError:
        if not folder:  # a full disk is found here at the latest; some file systems know no fsync of a folder
            raise
    finally:
        os.close(number)
