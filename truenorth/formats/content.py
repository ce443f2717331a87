"""The bytes of a log: unpacked where it is compressed, as UTF-8 where it is text, and never more than memory can take."""

from __future__ import annotations

import os
from pathlib import Path

from truenorth.core.errors import DataError, UsageError

LARGEST = 4 << 30  # bytes of a log that is unpacked or read into memory whole
HEAD = 1 << 16
PIECE = 1 << 20
REMARKS = ("#", "%", "//")  # at the beginning of a line that is no row
REMARKS_BYTES = tuple(mark.encode() for mark in REMARKS)
PACKED = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd", b"BZh": "bz2", b"\x04\x22\x4d\x18": "lz4"}
PACKED_SUFFIXES = (".gz", ".zst", ".zstd", ".bz2", ".lz4")


def packing(head: bytes) -> str | None:
    """How a file that begins so is compressed; None where it is not."""
    return next((name for beginning, name in PACKED.items() if head.startswith(beginning)), None)


def suffix_of(path: Path) -> str:
    """The suffix that names the format: ``.csv`` of ``log.csv.gz``."""
    plain = path.with_suffix("") if path.suffix.lower() in PACKED_SUFFIXES else path
    return plain.suffix.lower()


def check_regular(path: Path) -> None:
    """Refuse devices and pipes, which have no end or cannot be read twice.

    Raises
    ------
    UsageError
        Not a file, or no such file.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        raise UsageError(f"{path}: not a regular file; save the log to a file and name that")


def first_bytes(path: Path) -> bytes:
    """The first bytes of a log, unpacked.

    Raises
    ------
    DataError
        A damaged archive.
    """
    return _bytes(path, HEAD)


def first_piece(path: Path) -> bytes:
    """What a text begins with, unpacked, to be looked at before all of it is unpacked; nothing of UTF-16.

    Raises
    ------
    DataError
        A damaged archive.
    """
    piece = _bytes(path, PIECE)
    return b"" if piece.startswith((b"\xff\xfe", b"\xfe\xff")) else piece.rstrip(b"\0")


def all_bytes(path: Path) -> bytes:
    """The bytes of a log, unpacked.

    Raises
    ------
    DataError
        A damaged archive, or more than `LARGEST` bytes.
    """
    content = _bytes(path, LARGEST + 1)
    if len(content) > LARGEST:
        raise DataError(
            f"{path.name}: holds more than {LARGEST >> 30} GiB; expected a log that fits into memory: cut it into parts"
        )
    return content


def _bytes(path: Path, most: int) -> bytes:
    check_regular(path)
    with path.open("rb") as file:
        how = packing(file.read(4))
        file.seek(0)
        if how is None:  # a buffer of the most that is taken would be asked of the system at once
            return file.read(min(most, os.fstat(file.fileno()).st_size + 1))
    import pyarrow as pa

    parts, left = [], most
    try:
        with pa.OSFile(str(path)) as raw, pa.CompressedInputStream(raw, how) as stream:
            while left > 0 and (part := stream.read(min(left, 1 << 24))):
                parts.append(part)
                left -= len(part)
    except MemoryError:  # Arrow's own is an ArrowException, too
        raise
    except (OSError, pa.ArrowException) as error:
        raise DataError(f"{path.name}: the {how} archive is damaged or cut short ({error}); write it anew") from None
    return b"".join(parts)


def text_of(path: Path) -> tuple[bytes, str | None]:
    """The bytes of a text in UTF-8, without a byte order mark; also what was changed, in words.

    Raises
    ------
    DataError
        A damaged archive, more than `LARGEST` bytes, or UTF-16 that is cut short.
    """
    content = all_bytes(path)
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            return content.decode("utf-16").encode(), "UTF-16 text"
        except UnicodeDecodeError as error:
            raise DataError(f"{path.name}: UTF-16 text that is damaged ({error.reason}); save it as UTF-8") from None
    ended = content.rstrip(b"\0")
    if len(ended) < len(content):
        return ended, f"{len(content) - len(ended)} empty bytes at the end of the file left out"
    return content.removeprefix(b"\xef\xbb\xbf"), None
