"""What machine code is made for: the processor at hand, or a level that many processors have.

Code that comes with the package is made for a level, as it cannot be made for each processor. Of the code that was made for a
processor of the highest level it differs in the order of instructions, not in the bits of its answers.

Source: System V Application Binary Interface, AMD64 Architecture Processor Supplement, version 1.0, section 3.1.1.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from pathlib import Path

SAYS = Path("/proc/cpuinfo")
SAID = ("vendor_id", "cpu family", "model", "model name", "stepping", "flags")  # of what a processor is, there
V3 = frozenset((
    *("avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe", "xsave"),
    *("sse4_1", "sse4_2", "ssse3", "popcnt", "cx16", "lahf_lm"),
))  # fmt: skip
V4 = V3 | {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}
LEVELS = {"x86-64-v4": V4, "x86-64-v3": V3}  # flags of the system that each asks for, the highest level first
NAME, FEATURES = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"  # Numba's settings of what it compiles for
SHIPPED = Path(__file__).parents[1] / "kernels"


@cache
def said_of_processor() -> str:
    """Lines in which the system describes the first processor.

    Raises
    ------
    OSError
        A system that does not.
    """
    with SAYS.open("rb", buffering=0) as file:  # of many processors the first is enough
        lines = os.read(file.fileno(), 8192).decode("utf-8", "replace").split("\n\n")[0].splitlines()
    return repr([line for line in lines if line.partition(":")[0].strip() in SAID])


@cache
def levels() -> tuple[str, ...]:
    """Levels that this processor has, the highest first; none where the system does not describe it."""
    try:
        words = set(said_of_processor().replace("'", " ").split())
    except OSError:
        return ()
    return tuple(level for level, flags in LEVELS.items() if flags <= words)


def level_asked_for() -> str:
    """The level that the environment asks Numba to compile for, where this processor has it; else an empty string."""
    asked = os.environ.get(NAME, "")
    return asked if asked in levels() and os.environ.get(FEATURES) == "" else ""


def compiled_for() -> str:
    """What kernels are compiled for here: the level that is asked for, else the processor as the system describes it.

    Raises
    ------
    OSError
        A system that does not.
    """
    return level_asked_for() or said_of_processor()


def folder_of(level: str) -> Path:
    """Where kernels of a level come with the package, for this version of Python."""
    return SHIPPED / f"{sys.implementation.cache_tag}-{level}"


@cache
def shipped_level() -> str:
    """The level whose kernels come with the package and run here; an empty string where there are none."""
    level = level_asked_for() or next(iter(levels()), "")
    return level if level and folder_of(level).is_dir() else ""
