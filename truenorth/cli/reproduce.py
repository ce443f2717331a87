"""`truenorth reproduce`: a published system, its figures and its claims, settled."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from truenorth.cli.console import make_console, print_written, stages
from truenorth.cli.options import argument, command, option

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
Studies:
  rotary     Self-alignment of a rotary SINS on a swaying ship
  transfer   Transfer alignment with residual time delay and lever arm
  damping    Double-filter external damping of a marine INS over 48 h
  static     Kalman filters for static alignment, ten and eight states
  odometer   Odometer-aided alignment on the move, azimuth off by 1 to 60 deg
  networks   Damping networks by design, fuzzy damping (related work)
  gyro_free  Angular rate from twelve accelerometers (related work)
  in_flight  A slave calibrated in the air, then released (related work)
  lag_fusion Late, asynchronous sensors in one filter (related work)
  all        All of them, and index.html: which claims hold, in part, or not
\b
Examples:
  truenorth reproduce static -o static
  truenorth reproduce static --runs 50 --seed 3 -o static50
  truenorth reproduce all --runs 20 -o papers
\b
Exit codes: 0 done; 2 wrong usage.
"""


@command(EXAMPLES)
def reproduce(
    name: Annotated[str, argument("The study.")],
    output: Annotated[Path, option("Folder for the results.", "-o", "--output")],
    runs: Annotated[int | None, option("Of each case; the study's own without it.", min=2, panel="Runs")] = None,
    seed: Annotated[int, option("Of all random numbers.", min=0, panel="Runs")] = 0,
    workers: Annotated[int, option("That share the runs.", min=1, panel="Runs")] = 1,
    full: Annotated[
        bool, option("The paper's own lengths, where the study shortens them.", "--full", panel="Runs")
    ] = False,
) -> None:
    """Reproduce a published system: figures.csv, the paper's figures, and claims.md with what holds."""
    from truenorth.core.atomic import writable_folder
    from truenorth.core.errors import UsageError
    from truenorth.core.shown import NO_FIGURES, can_draw
    from truenorth.papers import STUDIES, save_all
    from truenorth.papers import reproduce as reproduced

    if not can_draw():
        raise UsageError(f"a study draws its figures: {NO_FIGURES}")
    writable_folder(output)  # before the work, not after it
    names = list(STUDIES) if name == "all" else [name]
    with stages(False) as progress:
        studies = {
            each: reproduced(each, runs=runs, seed=seed, full=full, workers=workers, progress=progress)
            for each in names
        }
    console = make_console()
    for study in studies.values():
        for claim in study.claims:
            console.print(f"{claim.verdict}: {claim.text}", soft_wrap=True)
    print_written(save_all(studies, output) if name == "all" else studies[name].save(output))
