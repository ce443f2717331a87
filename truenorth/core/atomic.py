"""Results are written whole or not at all: to a temporary name in the same folder, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from truenorth.core.errors import UsageError


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
            f"{path}: cannot write to this output folder ({error.strerror}); name another one with -o"
        ) from None
    return path


@contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path beside `target`; rename it to `target` on success, remove it on any failure.

    The temporary name keeps the suffix of `target`, since some writers choose their format by it.

    Raises
    ------
    UsageError
        The folder of `target` does not take the file.
    """
    target = Path(target)
    folder = writable_folder(target.parent)
    temporary = folder / f".{target.stem}.{os.getpid()}.part{target.suffix}"
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        raise UsageError(f"{target}: could not be written ({error.strerror or error})") from error
    finally:
        temporary.unlink(missing_ok=True)
