"""A result as one file that reads back to the same bits: arrays of NumPy's npz, the rest as JSON among them.

Dataclasses, named tuples, containers, numbers, texts, arrays and tables are kept. A symmetric stack of matrices, such as
covariances, is kept as its lower triangle. Nothing is executed on reading: only dataclasses and named tuples of Truenorth, or
registered ones, are made again. A field with ``metadata={"archive": False}`` is left out and is None after reading.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Collection, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from truenorth.core.errors import DataError

SMALLEST_PACKED = 6  # columns of a symmetric matrix, below which packing saves little
TREE = "tree"
LARGEST = 4 << 30  # bytes of arrays that are unpacked into memory


def write_archive(value: Any, path: str | PathLike[str] | IO[bytes]) -> None:
    """Write a value to an npz file, or to an open one.

    Raises
    ------
    TypeError
        It holds something that cannot be kept, such as a function; the message names where.
    """
    arrays: dict[str, NDArray[Any]] = {}
    tree = json.dumps(_packed(value, arrays, type(value).__name__))
    arrays[TREE] = np.frombuffer(tree.encode(), dtype=np.uint8)
    np.savez(path, allow_pickle=False, **arrays)


def read_archive(path: str | PathLike[str], more: Collection[str] = ()) -> Any:
    """What :func:`write_archive` wrote.

    Parameters
    ----------
    more : collection of str
        ``module:name`` of types that may be made besides those of Truenorth.

    Raises
    ------
    DataError
        No such file, one that is damaged, or one of another version, whose types are not these.
    """
    try:
        check_size(path)
        with np.load(path, allow_pickle=False) as file:
            tree = json.loads(file[TREE].tobytes())
            return _unpacked(tree, file, more)
    except DataError:
        raise
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, TypeError, AttributeError, ImportError, EOFError) as error:
        raise DataError(
            f"{path}: not a result of this version of Truenorth ({error}); write it again with this version"
        ) from None
    except Exception as error:  # a damaged zip file has errors of its own
        raise DataError(f"{path}: damaged ({error})") from None


def check_size(path: str | PathLike[str]) -> None:
    """Refuse an npz file whose headers promise more than memory takes, before anything is unpacked.

    Raises
    ------
    DataError
        More than `LARGEST` bytes. What a damaged file raises passes through.
    """
    total = 0
    with ZipFile(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as file:
                version = np.lib.format.read_magic(file)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                shape, _, dtype = read(file)
            total += math.prod(shape) * dtype.itemsize
    if total > LARGEST:
        raise DataError(f"{path}: its arrays hold {total / 2**30:.3g} GiB; expected at most {LARGEST >> 30}")


def type_in(path: str | PathLike[str]) -> str:
    """The name of the type that an archive holds, such as ``Alignment``; empty where it cannot be read."""
    try:
        check_size(path)
        with np.load(path, allow_pickle=False) as file:
            return str(json.loads(file[TREE].tobytes())["type"]).rpartition(":")[2]
    except Exception:  # whatever a damaged or foreign file raises: it holds no result of ours
        return ""


def _packed(value: Any, arrays: dict[str, NDArray[Any]], where: str) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        value = value.item()
        return _packed(value, arrays, where) if isinstance(value, complex) else value
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if isinstance(value, np.ndarray):
        return _packed_array(value, arrays, where)
    if isinstance(value, slice):
        return {"slice": [value.start, value.stop, value.step]}
    if isinstance(value, Path):
        return {"path": str(value)}
    if is_dataclass(value) and not isinstance(value, type):
        kept = [f for f in fields(value) if f.init]
        each = {
            f.name: _packed(getattr(value, f.name), arrays, f"{where}.{f.name}")
            if f.metadata.get("archive", True)
            else None
            for f in kept
        }
        return {"type": _name(type(value)), "fields": each}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        each = {name: _packed(getattr(value, name), arrays, f"{where}.{name}") for name in value._fields}
        return {"type": _name(type(value)), "fields": each}
    if isinstance(value, tuple | list):
        kind = "tuple" if isinstance(value, tuple) else "list"
        return {kind: [_packed(item, arrays, f"{where}[{i}]") for i, item in enumerate(value)]}
    if isinstance(value, Mapping):
        return {
            "mapping": [[_packed(k, arrays, where), _packed(v, arrays, f"{where}[{k!r}]")] for k, v in value.items()]
        }
    if hasattr(value, "to_parquet"):
        buffer = io.BytesIO()
        value.to_parquet(buffer)
        return {"table": _stored(np.frombuffer(buffer.getvalue(), dtype=np.uint8), arrays)}
    raise TypeError(f"{where}: {type(value).__name__} cannot be kept in a file")


def _packed_array(value: NDArray[Any], arrays: dict[str, NDArray[Any]], where: str) -> dict[str, Any]:
    if value.dtype == object:
        raise TypeError(f"{where}: an array of objects cannot be kept in a file")
    n = value.shape[-1] if value.ndim >= 2 else 0
    if n >= SMALLEST_PACKED and value.shape[-2] == n and np.array_equal(value, np.swapaxes(value, -1, -2)):
        return {"symmetric": _stored(value[(..., *np.tril_indices(n))], arrays), "n": n}
    return {"array": _stored(value, arrays)}


def _stored(value: NDArray[Any], arrays: dict[str, NDArray[Any]]) -> str:
    key = f"a{len(arrays)}"
    arrays[key] = value
    return key


def _unpacked(tree: Any, arrays: Mapping[str, NDArray[Any]], more: Collection[str]) -> Any:
    if not isinstance(tree, dict):
        return tree

    def down(item: Any) -> Any:
        return _unpacked(item, arrays, more)

    if "complex" in tree:
        return complex(*tree["complex"])
    if "type" in tree:
        return _type(tree["type"], more)(**{name: down(item) for name, item in tree["fields"].items()})
    (kind, content), *rest = tree.items()
    if kind == "symmetric":
        n, lower = int(rest[0][1]), arrays[content]
        full = np.empty((*lower.shape[:-1], n, n), dtype=lower.dtype)
        rows, columns = np.tril_indices(n)
        full[..., rows, columns] = full[..., columns, rows] = lower
        return full
    if kind == "table":
        import pandas as pd

        return pd.read_parquet(io.BytesIO(arrays[content].tobytes()))
    if kind == "mapping":
        return {down(k): down(v) for k, v in content}
    simple = {"array": lambda c: arrays[c], "slice": lambda c: slice(*c), "path": Path}
    if kind in simple:
        return simple[kind](content)
    return {"tuple": tuple, "list": list}[kind](down(item) for item in content)


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _type(name: str, more: Collection[str]) -> Any:
    if not name.startswith("truenorth.") and name not in more:
        raise ValueError(f"{name!r} is not a registered type")
    module, _, path = name.partition(":")
    found: Any = import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    if not (isinstance(found, type) and (is_dataclass(found) or hasattr(found, "_fields"))):
        raise ValueError(f"{name!r} is no type of a result")
    return found
