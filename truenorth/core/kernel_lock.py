"""One process compiles a kernel, the others wait for it: a lock on a file next to where the kernel will be.

The system lets go of the lock of a process that ends. Where there are no such locks, as on some network folders, each process
compiles for itself. Nobody waits for one that waits for him: a process that holds a kernel waits only for those that it calls.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # not a Unix
    fcntl = None  # type: ignore[assignment]

SUFFIX = ".lock"
_held: set[Path] = set()  # by this process, which does not wait for itself


class KernelLock:
    """The right to compile what a file will hold, for this process.

    Parameters
    ----------
    kernel : Path
        The file.
    """

    def __init__(self, kernel: Path) -> None:
        self.path = kernel.with_name(kernel.name + SUFFIX)
        self.handle = -1

    def take(self) -> None:
        """Wait until nobody else has it."""
        while fcntl is not None and self.path not in _held:
            try:
                handle = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
            except OSError:
                return
            try:
                fcntl.flock(handle, fcntl.LOCK_EX)
                if self._is_file_of(handle):
                    self.handle = handle
                    _held.add(self.path)
                    return
            except OSError:
                return
            finally:
                if self.handle != handle:
                    os.close(handle)

    def _is_file_of(self, handle: int) -> bool:
        """Whether the file still is what was opened: who had the lock takes the file away with it."""
        try:
            return os.fstat(handle).st_ino == os.stat(self.path).st_ino
        except FileNotFoundError:
            return False

    def release(self) -> None:
        """Let others have it."""
        if self.handle >= 0:
            self.path.unlink(missing_ok=True)
            os.close(self.handle)
            self.handle = -1
            _held.discard(self.path)

    def taken(self) -> bool:
        """Whether somebody has it now."""
        if fcntl is None:
            return False
        with _opened(self.path) as handle:
            if handle < 0:
                return False
            try:
                fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return True
            except OSError:
                return False
        return False


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        yield -1
        return
    try:
        yield handle
    finally:
        os.close(handle)
