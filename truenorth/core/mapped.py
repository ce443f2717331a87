"""NumPy archives whose large arrays stay on the disk: the system reads what is used, and lets go of it where memory is short.

An array can be mapped where it is not packed and begins at a multiple of its elements' size. NumPy's own archives are not
packed, but begin where they happen to; :func:`write_mappable` puts a filling before each.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.typing import ArrayLike, NDArray

SMALLEST = 1 << 26  # bytes of an array that stays on the disk
LOCAL_HEADER, ZIP64 = 30, 20  # bytes before a member's name, and of the field for sizes beyond 4 GiB
FILLING = 0xD935  # kind of a field that holds nothing, as Android's zipalign writes it
ALIGNED = 64  # bytes, of which NumPy's header is a multiple, too


def write_mappable(path: Path, arrays: Mapping[str, ArrayLike]) -> None:
    """Write an npz file as :func:`numpy.savez` does, each array at a multiple of 64 bytes."""
    with path.open("wb") as file, ZipFile(file, "w", ZIP_STORED) as archive:
        for name, values in arrays.items():
            member = ZipInfo(f"{name}.npy")
            begin = file.tell() + LOCAL_HEADER + len(member.filename.encode()) + ZIP64 + 4
            filling = -begin % ALIGNED
            member.extra = struct.pack("<HH", FILLING, filling) + bytes(filling)
            with archive.open(member, "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.asanyarray(values), allow_pickle=False)


def read_mapped(path: Path, smallest: int = SMALLEST) -> dict[str, NDArray[Any]]:
    """The arrays of an npz file by name; those of `smallest` bytes and more read-only and on the disk, where they can be.

    Nothing else may write to the file meanwhile; a new one in its place is another file.

    Raises
    ------
    ValueError, OSError, KeyError, NotImplementedError, BadZipFile, zlib.error
        A damaged file.
    """
    arrays: dict[str, NDArray[Any]] = {}
    with np.load(path, allow_pickle=False) as archive, path.open("rb") as file:
        for member in archive.zip.infolist():
            name = member.filename.removesuffix(".npy")
            mapped = _mapped(path, file, member) if member.file_size >= smallest else None
            arrays[name] = archive[name] if mapped is None else mapped
    return arrays


def _mapped(path: Path, file: IO[bytes], member: ZipInfo) -> NDArray[Any] | None:
    if member.compress_type != ZIP_STORED or not member.filename.endswith(".npy"):
        return None
    file.seek(member.header_offset)
    name, extra = struct.unpack("<HH", file.read(LOCAL_HEADER)[26:])
    file.seek(name + extra, 1)
    version = np.lib.format.read_magic(file)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, by_columns, kind = read(file)
    if kind.hasobject or file.tell() % kind.itemsize:
        return None
    return np.memmap(path, kind, "r", file.tell(), shape, "F" if by_columns else "C")
