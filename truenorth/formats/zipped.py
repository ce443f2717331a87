"""A zip archive as phones write it, one text file for each sensor: unpacked into a folder for as long as it is read.

The archive of one log (``recording.zip`` with ``Gyroscope.csv``, ``Accelerometer.csv`` and ``Location.csv`` in it, or with a folder
that holds them) is read as that folder would be. Only text is unpacked, and no more than memory can take.
"""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from truenorth.core.errors import DataError
from truenorth.formats.content import LARGEST

BEGINNING = b"PK\x03\x04"


@contextmanager
def unpacked(path: Path, part: str = "imu") -> Iterator[Path]:
    """What there is to read: the folder of sensors in an archive, the file of the receiver, or the only text in it.

    Parameters
    ----------
    path : Path
        A log of any format; one that is no such archive is given back as it is.
    part : str
        What is read: ``imu``, ``gnss`` or ``odometer``.

    Yields
    ------
    Path
        Below a temporary folder, which is gone afterwards.

    Raises
    ------
    DataError
        An archive that is damaged, locked by a password, or holds more than memory can take.
    """
    texts = _texts(path)
    if not texts:
        yield path
        return
    with tempfile.TemporaryDirectory() as temporary:
        top = Path(temporary) / path.name  # messages name the archive
        (Path(temporary) / "log").mkdir()
        _unpack(path, texts, top)
        yield _chosen(top, part) or path


def of_folder(folder: Path, part: str) -> Path:
    """The file of a sensor (``gnss``, ``odometer``) in a folder; else the folder, which is refused by what reads it.

    Raises
    ------
    DataError
        Several such files.
    """
    from truenorth.formats.sensor_folder import files_of

    files = files_of(folder).get(part, []) if folder.is_dir() else []
    if len(files) > 1:
        names = ", ".join(path.name for path in files)
        raise DataError(f"{folder.name}: {len(files)} files of one sensor: {names}; expected one: name the file")
    return files[0] if files else folder


def is_archive(path: Path) -> bool:
    """Whether a file is a zip archive, or begins as one."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(BEGINNING)) == BEGINNING


def _texts(path: Path) -> list[zipfile.ZipInfo]:
    """Text files of an archive; none of what is no archive, or of a NumPy archive that is cut short: its reader says so."""
    if not is_archive(path):
        return []
    from truenorth.formats.sensor_folder import SUFFIXES  # which reads tables of sensors: not for a file alone

    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except zipfile.BadZipFile as error:
        if path.suffix.lower() == ".zip":
            raise _damaged(path, error) from None
        return []
    return [m for m in members if Path(m.filename).suffix.lower() in SUFFIXES and not m.filename.startswith("__MACOSX")]


def _unpack(path: Path, members: list[zipfile.ZipInfo], top: Path) -> None:
    if sum(member.file_size for member in members) > LARGEST:
        raise DataError(
            f"{path.name}: holds more than {LARGEST >> 30} GiB; expected a log that fits into memory: cut it into parts"
        )
    if any(member.flag_bits & 0x1 for member in members):
        raise DataError(f"{path.name}: a zip archive that is locked by a password; unpack it, and name the folder")
    try:
        with zipfile.ZipFile(path) as archive:
            archive.extractall(top, members)
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib, lzma and bz2 have errors of their own
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> DataError:
    return DataError(f"{path.name}: the zip archive is damaged or cut short ({error}); write it anew")


def _chosen(top: Path, part: str) -> Path | None:
    from truenorth.formats.sensor_folder import is_one

    folders = sorted([top, *(p for p in top.rglob("*") if p.is_dir())], key=lambda p: len(p.parts))
    for folder in folders:
        if part != "imu" and (found := of_folder(folder, part)) != folder:
            return found
        if part == "imu" and is_one(folder):
            return folder if folder == top else folder.rename(top.with_name("log") / top.name)
    files = [p for p in top.rglob("*") if p.is_file()]
    return files[0] if len(files) == 1 else None
