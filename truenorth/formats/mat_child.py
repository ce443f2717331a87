"""A program of its own: reads a MATLAB file and writes its arrays of numbers to standard output as an .npz archive.

Imports nothing of Truenorth, so that it starts quickly; see :mod:`truenorth.formats.mat`.
"""

from __future__ import annotations

import sys
from typing import Any

TOO_NEW, NOTHING = 3, 4
OBJECT = "None"  # SciPy's name of an object, which has none
PACKED = 1032  # times as much as it is: the most that zlib takes together
LONGEST_FIELD = 16  # numbers of one field of a record: a vector, a quaternion, a matrix of 4 by 4


def main() -> int:
    """Read the file that the first argument names, of at most so many bytes as the second one says."""
    import io

    import numpy as np
    from scipy.io import loadmat

    path, largest = sys.argv[1], int(sys.argv[2])
    try:
        size = _size(path)
        if size > largest:
            print(f"its arrays hold {size / 2**30:.3g} GiB", file=sys.stderr)
            return 1
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        return TOO_NEW
    except Exception as error:  # whatever a damaged file provokes
        print(error, file=sys.stderr)
        return 1
    own = {name: value for name, value in content.items() if not name.startswith("__") and name != OBJECT}
    if not (arrays := _flat(own)):
        print(", ".join(f"{name} ({kind})" for name, kind in _kinds(path, list(own))) or "nothing", file=sys.stderr)
        return NOTHING
    file = io.BytesIO()
    np.savez(file, **arrays)
    sys.stdout.buffer.write(file.getvalue())
    return 0


def _size(path: str) -> int:
    """Bytes of the arrays; of a file with an object, such as a port, whose shape SciPy does not know, what it may hold unpacked."""
    import os

    import numpy as np
    from scipy.io import whosmat

    try:
        return sum(int(np.prod(shape, dtype=float)) for _, shape, _ in whosmat(path)) * 8
    except TypeError:
        return os.path.getsize(path) * PACKED


def _kinds(path: str, names: list[str]) -> list[tuple[str, str]]:
    """The variables and MATLAB's words for what they are."""
    from scipy.io import whosmat

    try:
        return [(name, kind) for name, _, kind in whosmat(path)]
    except TypeError:
        return [*((name, "no numbers") for name in names), ("one more", "object")]


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    """Arrays of numbers by name: the fields of a struct as ``s.field``, those of a struct array as :func:`_of_records`."""
    import numpy as np

    flat: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": inner for key, inner in _flat(value).items()}
        elif isinstance(value, list):  # a struct array; a cell array with a struct in it comes as a list, too
            if value and all(isinstance(element, dict) for element in value):
                flat |= _of_records(name, value)
        elif np.asarray(value).dtype.kind in "fiub":
            flat[name] = value
    return flat


def _of_records(name: str, elements: list[dict[str, Any]]) -> dict[str, Any]:
    """A struct array: a field that is one number, or a short vector, in each of its records is a column.

    Where each element holds arrays, it is no record but a log of its own, and has its number as MATLAB counts: ``imu(2).t``. An
    empty field among numbers is NaN. Fields that are now one size, now another, are left out.
    """
    import numpy as np

    records = [_flat(element) for element in elements]
    fields = list(dict.fromkeys(key for record in records for key in record))
    sizes = {key: {np.size(record.get(key, ())) for record in records} for key in fields}
    if all(max(size) > LONGEST_FIELD for size in sizes.values()):
        return {f"{name}({k}).{key}": value for k, record in enumerate(records, 1) for key, value in record.items()}
    flat: dict[str, Any] = {}
    for key in fields:
        size = max(sizes[key])
        if sizes[key] <= {0, size} and 0 < size <= LONGEST_FIELD:
            absent = np.full(size, np.nan)
            rows = [np.ravel(record[key]) if np.size(record.get(key, ())) else absent for record in records]
            flat[f"{name}.{key}"] = np.array(rows) if size > 1 else np.concatenate(rows)
    return flat


if __name__ == "__main__":
    sys.exit(main())
