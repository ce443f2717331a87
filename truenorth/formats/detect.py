"""What format a file is of: its suffix says, what it begins with must agree."""

from __future__ import annotations

import re
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path

from truenorth.core.errors import DataError, UsageError
from truenorth.formats import devices
from truenorth.formats.content import check_regular, first_bytes, suffix_of
from truenorth.formats.parquet import parts_of

SUFFIXES = {
    ".csv": "csv",
    ".tsv": "csv",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".npz": "npz",
    ".mat": "mat",
    ".imu": "psins",
    ".feather": "feather",
    ".arrow": "feather",
    ".txt": "csv",
    ".asc": "csv",
    ".bin": "kf-gins-binary",
    **devices.SUFFIXES,
}
FORMATS = tuple(dict.fromkeys((*SUFFIXES.values(), "kf-gins", "sensor-folder", *devices.DEVICES)))
AIDING_SUFFIXES = {
    ".csv": "csv",
    ".tsv": "csv",
    ".txt": "csv",
    ".parquet": "parquet",
    ".pq": "parquet",
    ".feather": "feather",
    ".arrow": "feather",
    ".npz": "npz",
    ".mat": "mat",
    **devices.SUFFIXES,
}
ANYTHING = (".bin", ".txt", ".asc", ".log", ".dat", "")  # suffixes that say little: the content decides
BEGINNINGS = {
    b"PAR1": "parquet",
    b"ARROW1": "feather",
    b"PK\x03\x04": "npz",
    b"MATLAB": "mat",
    **devices.BEGINNINGS,
}
FOREIGN = {
    b"\x89HDF": "HDF5 data; save it as .npz, .mat (version 7), .csv or .parquet",
    b"\xd0\xcf\x11\xe0": "an Excel workbook; save its sheet as CSV",
    b"7z\xbc\xaf": "a 7z archive; unpack it",
    b"\xfd7zXZ": "xz data; unpack it",
    b"%PDF": "a PDF document",
    **dict.fromkeys(
        (b"#CORRIMU", b"%CORRIMU", b"#IMURATECORRIMU", b"%IMURATECORRIMU"),
        "NovAtel's corrected IMU data, without gravity and the earth's rotation; log RAWIMUSX or RAWIMUS",
    ),
}
SENTENCE = re.compile(rb"\s*\$(?:G[ABLNPQ]|BD)[A-Z]{3},")  # of a receiver
TEXT = ("csv", "psins", "kf-gins")
ANYWHERE = ("novatel", "ubx", "sbf", "vectornav", "gnsslogger")  # whose messages may follow something else


def format_of(
    path: Path, given: str | None = None, suffixes: Mapping[str, str] = SUFFIXES, what: str = "an IMU log"
) -> str:
    """The format of a log, one of those that `suffixes` name.

    Parameters
    ----------
    path : Path
        An existing file, or a folder (a ROS 2 bag, the rows of a live run).
    given : str, optional
        What the caller says; the content must still agree.
    suffixes : mapping
        Formats by suffix.
    what : str
        Is expected, in words.

    Raises
    ------
    UsageError
        A format that does not exist, or a suffix that names none and a content that shows none.
    DataError
        An empty file, or one that is not what its suffix says.
    """
    formats = FORMATS if suffixes is SUFFIXES else tuple(dict.fromkeys((*suffixes.values(), *devices.DEVICES)))
    check_regular(path)
    if given is not None and given not in formats:
        raise UsageError(f"format {given!r} is not known; choose one of {', '.join(formats)}")
    if path.is_dir() and "ros" not in formats:
        raise UsageError(f"{path}: a folder; name a file")
    if path.is_dir():
        if given in (None, "parquet") and suffixes is SUFFIXES and parts_of(path):
            return "parquet"
        if given in (None, "sensor-folder") and suffixes is SUFFIXES and _has_sensors(path):
            return "sensor-folder"
        found = devices.of_folder(path)
        if found is None or given not in (None, found):
            raise UsageError(
                f"{path}: a folder; expected a ROS 2 bag (with metadata.yaml in it), KITTI's oxts (with timestamps.txt and "
                "data), one file for each sensor (such as Gyroscope.csv and Accelerometer.csv), or the rows of a live run; else "
                "name a file"
            )
        return found
    head = first_bytes(path)
    if not head:
        raise DataError(f"{path.name}: the file is empty; expected {what}")
    found = next((name for beginning, name in BEGINNINGS.items() if head.startswith(beginning)), None)
    if found is None and "mat" in (given, suffixes.get(suffix_of(path))) and _is_old_matlab(head):
        found = "mat"
    says_little = suffix_of(path) in ANYTHING or suffixes.get(suffix_of(path)) == "csv"
    by_content = found if says_little and found in devices.DEVICES else None
    chosen = given or by_content or suffixes.get(suffix_of(path)) or found
    foreign = next((what for beginning, what in FOREIGN.items() if head.startswith(beginning)), None)
    if found == "npz" and not _is_npz(path):
        found, foreign = (
            None,
            "a zip archive without one log in it (of an Excel workbook save the sheet as CSV); unpack it",
        )
    if (
        suffixes is SUFFIXES
        and given is None
        and _holds_sentences(head)
        and chosen in (None, "csv")
        and b"$VN" not in head
    ):
        raise DataError(
            f"{path.name}: holds sentences of a receiver (NMEA 0183); expected {what}: name the IMU's log, and give this one as "
            "the receiver's"
        )
    if foreign is not None and not (chosen == "kf-gins-binary" and len(head) % 56 == 0):
        raise DataError(f"{path.name}: holds {foreign}")
    if chosen is None and b"\0" not in head and "csv" in formats:
        chosen = "csv"  # text under a suffix that names nothing
    if chosen is None:
        raise UsageError(
            f"{path.name}: the suffix {path.suffix or '(none)'} names no format; give one of {', '.join(formats)}"
        )
    if chosen not in formats:
        raise DataError(f"{path.name}: holds {chosen} data; expected {what}: {', '.join(formats)}")
    _check_content(path.name, head, chosen, found)
    return chosen


def _holds_sentences(head: bytes) -> bool:
    """Whether a log begins with sentences of a receiver and most of its first lines are such: no table follows."""
    lines = [line for line in head.splitlines() if line.strip()]
    return SENTENCE.match(head) is not None and 2 * sum(SENTENCE.match(line) is not None for line in lines) > len(lines)


def _check_content(source: str, head: bytes, chosen: str, found: str | None) -> None:
    if found is not None and found != chosen:
        raise DataError(
            f"{source}: read as {chosen}, but it holds {found} data; rename the file, or read it as {found}"
        )
    if chosen in BEGINNINGS.values() and found is None and chosen not in ANYWHERE:
        raise DataError(
            f"{source}: read as {chosen}, but it does not begin as such a file does; it is damaged, or of another format: "
            "name that"
        )
    if chosen in TEXT and b"\0" in head.rstrip(b"\0") and not head.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise DataError(f"{source}: read as {chosen}, which is text, but it holds binary data; name its format")
    if chosen == "kf-gins-binary" and all(byte in b"\t\n\r" or 32 <= byte < 127 for byte in head):
        raise DataError(f"{source}: read as binary, but it holds text; name the format kf-gins or csv")


def _has_sensors(folder: Path) -> bool:
    from truenorth.formats.sensor_folder import is_one  # which reads tables: not for every start of the command line

    return is_one(folder)


def _is_old_matlab(head: bytes) -> bool:
    """Whether a file begins as MATLAB's version 4 does: five whole numbers of either byte order."""
    if len(head) < 20:
        return False
    for order, machine in (("<", 0), (">", 1)):
        kind, *sizes, is_complex, name = struct.unpack(f"{order}5i", head[:20])
        thousands, rest = divmod(kind, 1000)  # MOPT: machine, zero, precision, matrix
        digits = rest // 100 == 0 and rest // 10 <= 5 and rest % 10 <= 2
        if thousands == machine and digits and min(sizes) >= 0 and is_complex in (0, 1) and 1 < name <= 64:
            return True
    return False


def _is_npz(path: Path) -> bool:
    try:
        with zipfile.ZipFile(path) as archive:
            return all(name.endswith(".npy") for name in archive.namelist())
    except zipfile.BadZipFile:  # cut short: what the reader says about it is better
        return True
