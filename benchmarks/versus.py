"""This checkout and an older one in one run, in turn: ``python -m benchmarks.versus OLD_CHECKOUT [REPEATS [ROWS]]``.

All rows take half an hour; ``ROWS`` are numbers of some of them, such as ``1,2,4``. ``parts`` in their place measures parts of
the library that both have (:mod:`benchmarks.parts`), each checkout in a process of its own, in turn.

Processor time of whole processes, children included, the least of the repetitions: what else the machine does counts
little. With it stand the medians, and the median of the ratios of the pairs. Each checkout runs with the interpreter of its own
``.venv`` (``make .venv/.ready`` there), or with this one where it has none.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

NEW = Path(__file__).parents[1]
WHERE = ["--lat", "40", "--lon", "118", "--imu", "navigation"]
EDITED = (
    "core/attitude.py",
    "attitude.py",
)  # where it stood or stands; holds compiled functions, and most others call one of them
PROGRAM = "from truenorth.cli import main; main()"
STEPS = """
import json, time
import numpy as np
from truenorth.filters import LinearSystem, kalman
n, K = 15, 20000
rng = np.random.default_rng(0)
A = rng.standard_normal((n, n))
Phi = np.eye(n) + 0.01 * (A - A.T)
H = rng.standard_normal((1, 3, n))
system = LinearSystem(Phi[None], 1e-4 * np.eye(n)[None], H, np.eye(3)[None], rng.standard_normal((K, 3)), np.zeros(n), np.eye(n))
took = []
for _ in range(9):
    begun = time.process_time()
    kalman(system, history="full")
    took.append(time.process_time() - begun)
print(json.dumps(min(took[1:]) / K * 1e6))
"""
CAMPAIGN = """
import json, time
from benchmarks.bench_campaign import PLAN
from truenorth.campaign.aligning import align_runs
from truenorth.campaign.plan import read_plan
plan = read_plan(PLAN)
align_runs(plan, plan.cases[0], range(2))
begun = time.process_time()
align_runs(plan, plan.cases[0], range(2, 22))
print(json.dumps((time.process_time() - begun) / 20 * 1000))
"""

WORKERS = """
import json, tempfile, time
from benchmarks.bench_campaign import PLAN
from truenorth.campaign import run_campaign
begun = time.perf_counter()
with tempfile.TemporaryDirectory() as folder:
    run_campaign({**PLAN, "runs": 1000}, folder, workers=2)
print(json.dumps(time.perf_counter() - begun))
"""


def interpreter(checkout: Path) -> str:
    """That of a checkout's own environment, or this one."""
    own = checkout / ".venv/bin/python"
    return str(own) if own.exists() else sys.executable


def spent(
    checkout: Path, command: list[str], folder: Path, cache: Path | None = None, package: Path | None = None
) -> float:
    """Processor time of a command of Python, s; with the kernels of a cache of its own, where one is given."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    environment |= {"PYTHONPATH": str(package or checkout)} | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})
    before = os.times()
    subprocess.run([interpreter(checkout), *command], env=environment, cwd=folder, check=True, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def said(checkout: Path, program: str) -> Any:
    """What a program prints, as JSON; it imports what stands in the checkout."""
    python, environment = interpreter(checkout), {**os.environ, "PYTHONPATH": str(checkout)}
    done = subprocess.run(
        [python, "-c", program], cwd=checkout, check=True, capture_output=True, text=True, env=environment
    )
    return json.loads(done.stdout)


def parts(old: Path, repeats: int) -> None:
    """Print the table of the parts, the least of the repetitions."""
    program = (NEW / "benchmarks" / "parts.py").read_text(encoding="utf-8")
    rounds = [[said(checkout, program) for checkout in (old, NEW)] for _ in range(repeats)]
    for what in rounds[0][0]:
        before, now = (min(both[i][what] for both in rounds) for i in (0, 1))
        print(f"| {what} | {before:.3g} | {now:.3g} | {before / now:.2f} |")


def main() -> None:
    """Print the table, one row for each thing that is measured."""
    old, repeats = Path(sys.argv[1]).resolve(), int(sys.argv[2]) if len(sys.argv) > 2 else 3
    head = "| what | before | now | ratio |\n| --- | ---: | ---: | ---: |"
    if sys.argv[3:] == ["parts"]:
        print(head, flush=True)
        parts(old, repeats)
        return
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # The demo's own ship, which rolls, pitches, yaws and goes to and fro: half of the time is the fit of her motion.
        spent(NEW, [str(NEW / "examples/demo.py")], folder)
        log = folder / "demo" / "ship.csv"
        caches = {checkout: folder / f"cache {i}" for i, checkout in enumerate((old, NEW))}

        def both(measure: Callable[[Path], float], times: int) -> list[float]:
            rounds = [[measure(checkout) for checkout in (old, NEW)] for _ in range(times)]
            before, now = np.transpose(rounds)
            least, middle = np.min(rounds, axis=0), np.median(rounds, axis=0)
            return [*least, *middle, float(np.median(now / before))]

        command = ["-c", PROGRAM, "align", str(log), *WHERE]

        def align(checkout: Path) -> float:
            return spent(checkout, command, folder)

        def first(checkout: Path) -> float:
            return spent(checkout, command, folder, caches[checkout])

        def with_report(checkout: Path) -> float:
            return spent(checkout, [*command, "-o", str(out(checkout))], folder)

        def demo(checkout: Path, cache: Path | None = None) -> float:
            place = folder / f"demo {'new' if checkout is NEW else 'old'}"
            place.mkdir(exist_ok=True)
            return spent(checkout, [str(checkout / "examples/demo.py")], place, cache)

        def first_demo(checkout: Path) -> float:
            return demo(checkout, folder / f"demo cache {'new' if checkout is NEW else 'old'}")

        def out(checkout: Path) -> Path:
            return folder / f"result {'new' if checkout is NEW else 'old'}"

        def after_an_edit(checkout: Path) -> float:
            copy = folder / f"copy {'new' if checkout is NEW else 'old'}"
            shutil.copytree(checkout / "truenorth", copy / "truenorth", ignore=shutil.ignore_patterns("__pycache__"))
            edited = next(copy / "truenorth" / name for name in EDITED if (copy / "truenorth" / name).exists())
            spent(checkout, command, copy, caches[checkout], copy)  # bytecode, and this copy's kernels
            with edited.open("a") as file:
                file.write("\n# An edit.\n")
            return spent(checkout, command, copy, caches[checkout], copy)

        def sizes() -> list[float]:
            return [(out(checkout) / "report.html").stat().st_size / 1e6 for checkout in (old, NEW)]

        rows: list[tuple[str, Callable[[], list[float]]]] = [
            ("`align` of the demo's 600 s, compiled, s", lambda: both(align, repeats)),
            ("the same with report, s", lambda: both(with_report, repeats)),
            ("size of the report, MB", sizes),
            (
                "15-state step, update and covariance at every sample, us",
                lambda: both(lambda c: said(c, STEPS), repeats),
            ),
            ("1000 static alignments of 600 s at 100 Hz, one worker, s", lambda: both(lambda c: said(c, CAMPAIGN), 2)),
            ("the demo, compiled, s", lambda: both(demo, repeats)),
            ("the demo, nothing compiled, s", lambda: both(first_demo, 1)),
            ("first `align`, nothing compiled, s", lambda: both(first, 1)),
            (f"`align` after a comment was added to {EDITED[0]}, s", lambda: both(after_an_edit, 1)),
            (
                "1000 static alignments of 600 s at 100 Hz, two workers, s on the clock",
                lambda: both(lambda c: said(c, WORKERS), repeats),
            ),
        ]
        asked = [int(number) for number in sys.argv[3].split(",")] if len(sys.argv) > 3 else range(1, len(rows) + 1)
        for number, once in ((1, align), (2, with_report), (3, with_report), (6, demo)):
            if number in asked:
                both(once, 1)  # what is not compiled yet
        print(
            "| what | before | now | medians | median of now / before |\n| --- | ---: | ---: | ---: | ---: |",
            flush=True,
        )
        for what, measured in (rows[number - 1] for number in asked):
            before, now, *others = measured()
            medians, ratio = (f"{others[0]:.2f}, {others[1]:.2f}", others[2]) if others else ("", now / before)
            print(f"| {what} | {before:.2f} | {now:.2f} | {medians} | {ratio:.2f} |", flush=True)


if __name__ == "__main__":
    main()
