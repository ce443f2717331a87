"""`truenorth warm`: compile what the other commands need, once, so that the first of them does not wait."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from truenorth.cli.console import make_console
from truenorth.cli.options import command, option

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

PACKAGE = Path(__file__).parents[1]
EXAMPLES = """
\b
Examples:
  truenorth warm
  truenorth warm --workers 1
  truenorth warm --studies

Exit codes: 0 done; 2 wrong usage.
"""

# Each task simulates a scenario that ships with us and runs the commands on its logs: what they compile is what a
# user's own commands will ask for. The longest first, but no two that begin with the same kernels: at once, both would
# compile them.
TASKS: dict[str, tuple[str, ...]] = {
    "odometer_ring": (
        "align imu.parquet --odometer odometer.parquet --lat 39.9 --lon 116.3 --alt 50 --imu navigation --to 300 -o start",
        "navigate imu.parquet --start start --odometer odometer.parquet",
    ),
    "transfer_flat_turn": (
        "align imu.parquet --master master.parquet --lat 34 --alt 5000 --imu tactical",
        "advise --lat 34 --imu tactical --heading 0.2 --speed 200",
    ),
    "quay": (
        # Of its 900 s, in which this ship swings on lines, too.
        "align imu.parquet --lat 53.54 --lon 9.97 --imu navigation --at 600 -o start",
        "navigate imu.parquet --start start",
    ),
    "rotary_ship": ("align imu.parquet --indexer encoder.parquet --lat 40 --lon 118 --imu navigation",),
    "table": ("align imu.parquet --positions auto --lat 40 --lon 116 --imu tactical",),
    "van": (
        "align imu.parquet --gnss gnss.parquet --imu industrial --to 300 -o start",
        "navigate imu.parquet --start start --gnss gnss.parquet",
    ),
    "static_kalman": (
        "align imu.parquet --lat 45 --imu navigation",
        "align imu.parquet --lat 45",
        "align imu.parquet --lat 45 --imu navigation --to 120",  # force is white there, and is measured
        "inspect imu.parquet",
    ),
}


STUDIES = ("transfer", "static", "rotary", "odometer", "damping")  # of papers; the longest first


@command(EXAMPLES)
def warm(
    workers: Annotated[int | None, option("Processes at once; one a core without it.", min=1)] = None,
    studies: Annotated[
        bool, option("Also what `truenorth reproduce` needs, which takes minutes.", "--studies")
    ] = False,
) -> None:
    """Compile what the other commands need and keep it for all that follow; a second call finds it done."""
    from truenorth.campaign.execution import pool_of
    from truenorth.core.kernel_folder import write_folder

    folder = write_folder()
    if folder is None:
        print("truenorth: no cache folder can be written to; each command compiles for itself", file=sys.stderr)
        return
    digest = _digest()
    wanted = {folder / f"warm-{digest}": list(TASKS)}
    if studies:
        wanted[folder / f"warm-studies-{digest}"] = list(STUDIES)
    tasks = [task for stamp, some in wanted.items() if not stamp.exists() for task in some]
    if not tasks:
        print(f"warm already: {folder}")
        return
    begun = time.monotonic()
    count = min(workers or os.cpu_count() or 1, len(tasks))
    with pool_of(count) as pool:
        _show(pool, tasks)
    for stamp in wanted:
        stamp.touch()
    number = sum(1 for _ in folder.glob("*.kernel"))
    print(f"{number} kernels in {folder} after {time.monotonic() - begun:.0f} s")


def _digest() -> str:
    """Of all sources and of Numba: what was compiled for these is there."""
    import hashlib
    from importlib.metadata import version

    text = hashlib.sha256(version("numba").encode())
    for file in sorted(PACKAGE.rglob("*.py")):
        text.update(file.read_bytes())
    return text.hexdigest()[:32]


def _show(pool: ProcessPoolExecutor, tasks: list[str]) -> None:
    """Run the tasks with a bar on standard error."""
    from concurrent.futures import as_completed

    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("compiling"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=make_console(stderr=True), disable=not sys.stderr.isatty()) as bar:
        shown = bar.add_task("compiling", total=len(tasks))
        for done in as_completed([pool.submit(run_task, task) for task in tasks]):
            done.result()
            bar.advance(shown)


def run_task(name: str) -> None:
    """Simulate a scenario into a folder of its own and run its commands there; what they print is dropped.

    Parameters
    ----------
    name : str
        A key of `TASKS`; or one of `STUDIES`, of which two runs are made.

    Raises
    ------
    TruenorthError
        A command failed; that the data cannot be aligned is no failure here.
    """
    from truenorth.cli import app
    from truenorth.filters.linear import always_own_size
    from truenorth.papers import reproduce

    always_own_size()
    before = Path.cwd()
    silent = io.StringIO()
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.redirect_stdout(silent),
        contextlib.redirect_stderr(silent),
    ):
        os.chdir(folder)
        try:
            if name in STUDIES:
                reproduce(name, runs=2)
                return
            for command in (f"simulate {name} -o . --no-plot", *TASKS[name]):
                app(command.split(), standalone_mode=False)
            if name == "van":
                _beyond_commands()
        finally:
            os.chdir(before)


def _beyond_commands() -> None:
    """What a scenario does not ask for: a magnetometer's measurement, and the mechanisation by itself, of a log that lies here."""
    import numpy as np

    from truenorth.aiding.magnetometer import FIELD
    from truenorth.formats import read_imu
    from truenorth.state import State
    from truenorth.strapdown import mechanise

    _ = FIELD.function.address
    mechanise(read_imu(Path("imu.parquet")).between(None, 1.0), State.at(np.eye(3), 0.8, 0.0), every=2)
