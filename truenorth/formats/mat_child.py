"""A program of its own: reads a MATLAB file and writes its arrays of numbers to standard output as an .npz archive.

Imports nothing of Truenorth, so that it starts quickly; see :mod:`truenorth.formats.mat`.
"""

from __future__ import annotations

import sys
from typing import Any

TOO_NEW = 3


def main() -> int:
    """Read the file that the first argument names, of at most so many bytes as the second one says."""
    import io

    import numpy as np
    from scipy.io import loadmat, whosmat

    path, largest = sys.argv[1], int(sys.argv[2])
    try:
        size = sum(int(np.prod(shape, dtype=float)) for _, shape, _ in whosmat(path)) * 8
        if size > largest:
            print(f"its arrays hold {size / 2**30:.3g} GiB", file=sys.stderr)
            return 1
        content = loadmat(path, simplify_cells=True)
    except NotImplementedError:
        return TOO_NEW
    except Exception as error:  # whatever a damaged file provokes
        opaque = "'NoneType' object is not iterable" in str(error)  # SciPy's, of a shape that an object does not have
        print("or it holds an object, such as a port: save the arrays alone" if opaque else error, file=sys.stderr)
        return 1
    arrays = _flat({name: value for name, value in content.items() if not name.startswith("__")})
    file = io.BytesIO()
    np.savez(file, **arrays)
    sys.stdout.buffer.write(file.getvalue())
    return 0


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    import numpy as np

    flat: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": inner for key, inner in _flat(value).items()}
        elif np.asarray(value).dtype.kind in "fiub":
            flat[name] = value
    return flat


if __name__ == "__main__":
    sys.exit(main())
