"""The folder of compiled kernels on the disk: where it is, how files in it are read and written, and how long they stay.

A file never changes what it means, so that any number of processes and checkouts read and write one folder at once: a file
is written aside and renamed, and two processes that make the same kernel write the same file.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

from truenorth.core.kernel_lock import SUFFIX

PACKAGE = Path(__file__).parents[1]
BOUND = 512 * 2**20  # bytes that the kernels of all versions may take, before the longest unused go
DAY = 86400.0  # s
SUM = 32  # bytes of the checksum that a file begins with


@cache
def folders() -> tuple[Path, ...]:
    """Where kernels are looked for: the environment's own choice alone; else the user's cache, then the package's."""
    chosen = os.environ.get("NUMBA_CACHE_DIR", "")
    if chosen:
        return (Path(chosen) / "truenorth",)
    places = (_user_cache, lambda: PACKAGE / "__pycache__")
    found = []
    for place in places:
        try:
            found.append(place() / "kernels")
        except RuntimeError:  # a user without a home
            continue
    return tuple(found)


def _user_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "truenorth"


@cache
def write_folder() -> Path | None:
    """The first of the folders that can be written to; without any, each process compiles for itself."""
    for folder in folders():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                return folder
        except OSError:
            continue
    return None


def read(path: Path) -> bytes | None:
    """What a file of the cache holds; None where it is missing, or was torn by a loss of power."""
    content = content_of(path)
    with suppress(OSError):  # gone since, or of another user
        if content is not None and time.time() - path.stat().st_mtime > DAY:
            os.utime(path)  # used today: the last to be pruned
    return content


def content_of(path: Path) -> bytes | None:
    """The same, without a note that it was used."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    return content[SUM:] if hashlib.sha256(content[SUM:]).digest() == content[:SUM] else None


def write(path: Path, content: bytes) -> None:
    """Write a file with its checksum.

    Raises
    ------
    OSError
        A full disk, or a folder that cannot be written to any more.
    """
    handle, aside = tempfile.mkstemp(dir=path.parent, suffix=".aside")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        os.chmod(aside, 0o644)
        os.replace(aside, path)
    except BaseException:
        Path(aside).unlink(missing_ok=True)
        raise


@cache
def prune_once(folder: Path) -> None:
    """Once in a process that compiles: keep the folder within its bound."""
    prune(folder, BOUND)


def prune(folder: Path, bound: int) -> None:
    """Delete the kernels that were used longest ago until the others take three quarters of `bound` bytes.

    What was left aside by a process that was killed goes after a day.
    """
    kept = sorted(_aged(folder), reverse=True)
    total = sum(size for _, size, _ in kept)
    room = bound * 3 // 4 if total > bound else total
    for used, size, path in kept:
        room -= size
        if room < 0 or (path.suffix in (".aside", SUFFIX) and time.time() - used > DAY):
            path.unlink(missing_ok=True)


def _aged(folder: Path) -> Iterator[tuple[float, int, Path]]:
    for path in folder.iterdir():
        with suppress(OSError):  # another process prunes
            status = path.stat()
            yield status.st_mtime, status.st_size, path
