"""Single modules of Numba, without the rest of it, which takes .2 s to load."""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from typing import Any


@cache
def numba_part(name: str) -> Any:
    """A module of Numba that needs no other of it; the one of this process where Numba is loaded.

    Parameters
    ----------
    name : str
        Without the name of the package, such as ``"_dynfunc"``.

    Raises
    ------
    ImportError
        There is none.
    """
    full = f"numba.{name}"
    if full in sys.modules:
        return sys.modules[full]
    package = find_spec("numba")
    for folder in (package and package.submodule_search_locations) or ():
        for suffix in (*EXTENSION_SUFFIXES, *SOURCE_SUFFIXES):
            path = os.path.join(folder, *name.split(".")) + suffix
            spec = spec_from_file_location(full, path) if os.path.exists(path) else None
            if spec is not None and spec.loader is not None:
                module = module_from_spec(spec)
                spec.loader.exec_module(module)
                return module
    raise ImportError(f"there is no {full}")
