"""Compile the kernels that come with the package, for this version of Python and each level that this processor has.

``python .ci/kernels.py`` compiles what `make demo` and alignments at rest call, ``python .ci/kernels.py all`` what `truenorth warm`
compiles. Nothing of an older version stays. Code of the highest level needs a processor that has it. Run by ``make kernels``.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from truenorth.core.processor import FEATURES, NAME, folder_of, levels
from truenorth.core.ready import SUFFIX

ROOT = Path(__file__).resolve().parent.parent
AT_REST = "from truenorth.cli.warm import run_task; run_task('static_kalman')"
FIRST = ([str(ROOT / "examples" / "demo.py")], ["-c", AT_REST])
ALL = (*FIRST, ["-m", "truenorth", "warm"])
FOLDER = "truenorth"  # in the folder that NUMBA_CACHE_DIR names


def compile_for(level: str, commands: tuple[list[str], ...]) -> tuple[int, int]:
    """Run commands from an empty cache and keep what they compiled: number of files, and their bytes."""
    target = folder_of(level)
    shutil.rmtree(target, ignore_errors=True)  # what is there would not be compiled
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {NAME: level, FEATURES: "", "NUMBA_CACHE_DIR": folder}
        for command in commands:
            subprocess.run(
                [sys.executable, *command], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL
            )
        target.mkdir(parents=True)
        files = sorted((Path(folder) / FOLDER).glob(f"*{SUFFIX}"))
        for file in files:
            shutil.copy(file, target / file.name)
    return len(files), sum(file.stat().st_size for file in target.iterdir())


def main() -> None:
    """Compile for each level; print what there is now."""
    commands = ALL if sys.argv[1:] == ["all"] else FIRST
    if not levels():
        raise SystemExit("this system does not describe its processor, or it is of no level that kernels ship for")
    for level in levels():
        number, size = compile_for(level, commands)
        print(f"{number} kernels, {size / 1e3:.0f} kB: {folder_of(level).relative_to(ROOT)}", flush=True)


if __name__ == "__main__":
    main()
