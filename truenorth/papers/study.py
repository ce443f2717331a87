"""A reproduced study: its table, its figures and its settled claims, and the folder that they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from truenorth.core.atomic import atomic_files, writable_folder
from truenorth.core.errors import UsageError
from truenorth.papers.claims import Claim, markdown
from truenorth.papers.table import Figure, Table, write_figures

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as Drawing

# What can be reproduced, and where each study stands: RULES, and `reproduce(runs, seed, full, workers, progress) -> Study`.
STUDIES = {
    "static": "truenorth.papers.static.study",
    "rotary": "truenorth.papers.rotary.study",
    "transfer": "truenorth.papers.transfer.study",
    "damping": "truenorth.papers.damping.study",
    "odometer": "truenorth.papers.odometer.study",
    "networks": "truenorth.papers.related.networks",
    "gyro_free": "truenorth.papers.related.gyro_free",
    "in_flight": "truenorth.papers.related.in_flight",
    "lag_fusion": "truenorth.papers.related.lag_fusion",
}
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Study:
    """What the reproduction of a paper found.

    Attributes
    ----------
    title : str
    table : Table
        Numbers, for figures.csv.
    claims : sequence of Claim
    drawings : mapping of name to matplotlib figure
        Those of the paper's own figures and tables are named ``figure...`` and ``table...``.
    captions : mapping of name to str
        What a drawing shows, and what it does not.
    remarks : sequence of str
    """

    title: str
    table: Table
    claims: Sequence[Claim]
    drawings: Mapping[str, Drawing]
    captions: Mapping[str, str] = field(default_factory=dict)
    remarks: Sequence[str] = ()

    @property
    def figures(self) -> list[Figure]:
        """Of the table."""
        return self.table.figures

    def save(self, folder: str | PathLike[str]) -> list[Path]:
        """Write figures.csv, claims.md, each drawing as PNG, and report.html.

        Raises
        ------
        UsageError
            The folder cannot be written to.
        """
        with atomic_files() as file:
            return self.write(writable_folder(folder), file)

    def write(self, folder: Path, file: Callable[[Path], Path]) -> list[Path]:
        """The same into files of a larger set, whose temporary paths `file` gives."""
        paths: list[Path] = []

        def place(name: str) -> Path:
            paths.append(folder / name)
            return file(paths[-1])

        write_figures(self.figures, place("figures.csv"))
        place("claims.md").write_text(markdown(self.title, self.claims, self.remarks), encoding="utf-8")
        for name, drawing in self.drawings.items():
            drawing.savefig(place(f"{name}.png"))
        place("report.html").write_text(self._page(), encoding="utf-8")
        return paths

    def _page(self) -> str:
        from truenorth.report.study import study_page

        def shown(own: bool) -> list[str]:
            return [name for name in self.drawings if name.startswith(("figure", "table")) == own]

        return study_page(self, self._compared(), shown(True), shown(False), self.table.to_frame())

    def _compared(self) -> pd.DataFrame:
        """Every figure that the paper gives, ours next to it."""
        frame = self.table.to_frame()
        columns = ["case", "method", "quantity", "statistic", "time_s", "value", "paper", "unit", "runs"]
        return frame.loc[frame["paper"].notna(), columns].rename(columns={"value": "ours", "paper": "the paper's"})


def reproduce(
    name: str,
    *,
    runs: int | None = None,
    seed: int = 0,
    full: bool = False,
    workers: int = 1,
    progress: Progress | None = None,
) -> Study:
    """Reproduce a published system.

    Parameters
    ----------
    name : str
        A key of `STUDIES`.
    runs : int, optional
        Of each case; the study's own number when left out.
    seed : int
    full : bool
        The paper's own length and number of runs, where the study shortens them.
    workers : int
        That share the runs; the numbers do not depend on it.
    progress : callable, optional
        Called with a word about each part.

    Raises
    ------
    UsageError
        A system that is not known, or fewer than two runs.
    """
    if name not in STUDIES:
        raise UsageError(f"study {name!r} is not known; choose one of {', '.join(STUDIES)}")
    if runs is not None and runs < 2:
        raise UsageError(f"{runs} run(s); a statistic needs two at least")
    if workers < 1:
        raise UsageError(f"workers {workers}; expected 1 or more")
    study: Study = import_module(STUDIES[name]).reproduce(runs, seed, full, workers, progress or (lambda stage: None))
    return study


def save_all(studies: Mapping[str, Study], folder: str | PathLike[str]) -> list[Path]:
    """Write each study to a folder of its name, and index.html: every claim of every study on one page, with its verdict.

    Raises
    ------
    UsageError
        The folder cannot be written to.
    """
    from truenorth.report.study import index_page

    target = writable_folder(folder)
    with atomic_files() as file:
        paths = [path for name, study in studies.items() for path in study.write(target / name, file)]
        file(target / "index.html").write_text(index_page(studies), encoding="utf-8")
    return [*paths, target / "index.html"]
