"""Results are written whole or not at all: to a temporary name in the same folder, onto the disk, then renamed.

What a command reads it does not write over: the command line names its inputs by :func:`protected`.
"""

from __future__ import annotations

import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from truenorth.core.errors import UsageError

_renaming = threading.RLock()  # a set of several folders takes it for each
# What the running command does not replace, and whether it reads it; None outside of one.
_kept: dict[Path, bool] | None = None


@contextmanager
def protected(
    inputs: Iterable[str | os.PathLike[str]], others: Iterable[str | os.PathLike[str]] = ()
) -> Iterator[None]:
    """Refuse to replace these files, all files in these folders, and what is :func:`noted`, as long as the block runs.

    Parameters
    ----------
    inputs : iterable of paths
        Those that do not exist are ignored.
    others : iterable of paths
        Files that are somebody else's.
    """
    global _kept
    before = _kept
    _kept = {} if before is None else dict(before)
    _kept.update({Path(path).resolve(): False for path in others})
    for name in inputs:
        noted(name)
    try:
        yield
    finally:
        _kept = before


def noted(path: str | os.PathLike[str]) -> None:
    """Say that a running command reads this file, or all files in this folder: it is not to write over them."""
    if _kept is None:
        return
    given = Path(path)
    with suppress(OSError, ValueError):
        files = given.iterdir() if given.is_dir() else (given,)
        _kept.update({file.resolve(): True for file in files if file.is_file()})


def check_free(path: Path) -> None:
    """Refuse to replace a file that the running command is to keep.

    Raises
    ------
    UsageError
        It is an input, or somebody else's.
    """
    reads = None if _kept is None else _kept.get(path.resolve())
    if reads:
        raise UsageError(
            f"{path}: this file is an input of the command and would be overwritten; expected another output folder"
        )
    if reads is False:
        raise UsageError(
            f"{path}: is there already, of no such result, and would be overwritten; expected another output folder, or "
            "`replace=True`"
        )


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


def write_text(path: Path, text: str) -> None:
    """Write text as UTF-8; other bytes of a file's name are shown by their numbers."""
    path.write_text(text, encoding="utf-8", errors="backslashreplace")


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
    files: the last one to finish wins, with its whole set. A target with
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
        check_free(path)
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
    """Write all temporary files out, then rename them to their targets."""
    for path in written.values():
        _onto_disk(path)
    folders = {target.resolve().parent for target in (*written, *removed)}
    with ExitStack() as locks:
        for folder in sorted(folders):  # one order: none waits for another
            locks.enter_context(_alone(folder))
        _rename(written, removed)


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold back the other threads and processes that put their set into this folder: it ends with one whole set of either."""
    with _renaming:
        number = None
        # On Windows, and on file systems without locks, the threads of this process are held back at least.
        with suppress(ImportError, OSError):
            import fcntl

            number = os.open(folder, os.O_RDONLY)
            fcntl.flock(number, fcntl.LOCK_EX)
        try:
            yield
        finally:
            if number is not None:
                os.close(number)


def _rename(written: Mapping[Path, Path], removed: Iterable[Path]) -> None:
    """Rename all temporary files to their targets; where one cannot be renamed, put back what stood at the others."""
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
    return folder / f".{target.stem}.{os.getpid()}-{os.urandom(4).hex()}.{what}{target.suffix}"


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
