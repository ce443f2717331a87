"""`truenorth tune`: search the noise figures to give a method in a scenario, and judge them on fresh data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from truenorth.cli.console import bar, make_console, print_written
from truenorth.cli.options import argument, command, option

# The \b keeps the lines as they are, ready to be copied.
EXAMPLES = """
\b
A search:
  name: harbour
  scenario: quay
  method: kalman
  search: {accel.random_walk: [1 ug/sqrt(Hz), 1000 ug/sqrt(Hz)]}
  runs: 20
  trials: 40
\b
Examples:
  truenorth tune harbour.yaml -o harbour
  truenorth align ship.csv --lat 53.5 --imu harbour/tuned.yaml

Exit codes: 0 done; 2 wrong usage; 3 a search with a mistake, or one without an answer.
"""


@command(EXAMPLES)
def tune(
    search: Annotated[Path, argument("YAML file: scenario, method, ranges.")],
    output: Annotated[Path, option("Folder for the result.", "-o", "--output")],
) -> None:
    """Search for the specification with which a method errs least and says so honestly, with the extra 'tune'."""
    from truenorth.campaign.tuning import read_search
    from truenorth.campaign.tuning import tune as search_for
    from truenorth.core.atomic import writable_folder

    chosen = read_search(search)
    writable_folder(output)  # before the work, not after it
    with bar("trials") as progress:
        result = search_for(chosen, progress=progress)
    console = make_console()
    for row in result.judged.to_dict("records"):
        verdict = "honest" if row["in_band"] else "not honest"
        errors = f"RMS {row['rms']:.3g} arcmin ({row['rms_low']:.3g} to {row['rms_high']:.3g})"
        honesty = f"RMS/sigma {row['rms_over_sigma']:.2f}, NEES {row['nees']:.2f}: {verdict}"
        data = f"{row['answers']} runs of seed {row['seed']}, which the search never saw"
        console.print(f"{row['specification']}: {chosen.quantity} {errors}, {honesty}; {data}", soft_wrap=True)
    print_written(result.save(output))
