"""JSON from anybody: an object, or one message."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from truenorth.core.errors import DataError

LARGEST = 64 << 20  # bytes


def read_object(path: Path) -> dict[str, Any]:
    """The object that a file holds.

    Raises
    ------
    DataError
        The file cannot be read, is no file or too large, holds no JSON, or JSON that is no object.
    """
    if not path.is_file():
        raise DataError(f"{path}: cannot be read (no such file, or not a regular one)")
    try:
        with path.open("rb") as file:
            raw = file.read(LARGEST + 1)
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from None
    if len(raw) > LARGEST:
        raise DataError(f"{path}: larger than {LARGEST >> 20} MiB")
    try:
        content = json.loads(raw.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # decoding raises the first, brackets without end the second
        raise DataError(f"{path}: not JSON ({error})") from None
    if not isinstance(content, dict):
        raise DataError(f"{path}: holds no object of JSON")
    return content
