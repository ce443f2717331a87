"""`run_campaign`: work on what is left of a plan, write it block by block, and give back the campaign."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truenorth.campaign.execution import in_processes, in_this_process, on_cluster
from truenorth.campaign.plan import Plan, read_plan
from truenorth.campaign.store import opened, read_table
from truenorth.core.errors import UsageError
from truenorth.core.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

Progress = Callable[[int, int], None]


@dataclass(frozen=True, repr=False)
class Campaign(Shown):
    """A campaign's folder, read.

    Attributes
    ----------
    plan : Plan
    folder : Path
    """

    plan: Plan
    folder: Path

    @cached_property
    def table(self) -> pd.DataFrame:
        """Every row: case, method, run, time_s, quantity, value (estimated minus true), sigma, unit, status, reason."""
        return read_table(self.folder, self.plan.runs)

    @cached_property
    def summary(self) -> pd.DataFrame:
        """Statistics over runs of each quantity; see :func:`truenorth.campaign.summarise`.

        Next to the attitude errors on a base at rest stands the Cramer-Rao ``bound`` of the case, see
        :mod:`truenorth.campaign.bound`, and how many times as large the RMS is, ``rms_over_bound``.
        """
        from truenorth.campaign.bound import bounds
        from truenorth.campaign.summary import summarise

        table = summarise(self.table, names=self.case_names)
        table = table.merge(bounds(self.plan), how="left", on=["case", "time_s", "quantity"])
        return table.assign(rms_over_bound=table["rms"] / table["bound"])

    @cached_property
    def comparison(self) -> pd.DataFrame:
        """Methods in pairs on the same data; see :func:`truenorth.campaign.compare`."""
        from truenorth.campaign.comparison import compare

        return compare(self.table, names=self.case_names, methods=self.plan.method_names)

    @cached_property
    def convergence(self) -> pd.DataFrame:
        """How long the log must be for the heading error to come, and stay, within the plan's limit: one row a method.

        Among the planned times only; ``converged`` is the share of runs that do, ``median_s`` and ``p95_s`` are infinite where
        too few do.
        """
        from truenorth.campaign.aligning import ARCMIN
        from truenorth.campaign.summary import time_to_converge

        times = time_to_converge(self.table, "phi_u", self.plan.converged / ARCMIN)
        groups = times.groupby(["case", "method"], observed=True, sort=False)["time_s"]
        result = groups.agg(
            runs="size",
            converged=lambda t: float((t < float("inf")).mean()),
            median_s=lambda t: float(t.quantile(0.5, interpolation="higher")),
            p95_s=lambda t: float(t.quantile(0.95, interpolation="higher")),
        ).reset_index()
        result.insert(1, "name", result["case"].map(self.case_names))
        return result

    @property
    def case_names(self) -> dict[int, str]:
        """Names of the cases by their number."""
        return {case.number: case.name for case in self.plan.cases}

    def in_brief(self) -> dict[str, str]:
        """Name, cases, methods and runs of the plan."""
        plan = self.plan
        methods = ", ".join(plan.method_names)
        return {"name": plan.name, "cases": str(len(plan.cases)), "methods": methods, "runs": str(plan.runs)}

    def to_frame(self) -> pd.DataFrame:
        """Statistics over runs; see `summary`."""
        return self.summary

    def save(self, folder: str | PathLike[str] | None = None) -> list[Path]:
        """Write tables, figures and report.html into the campaign's own folder, or another; see :func:`truenorth.save`."""
        return super().save(self.folder if folder is None else folder)


def run_campaign(
    plan: Plan | str | PathLike[str] | Mapping[str, Any],
    folder: str | PathLike[str],
    *,
    workers: int = 1,
    scheduler: str | None = None,
    resume: bool = True,
    progress: Progress | None = None,
) -> Campaign:
    """Work on a plan; what a folder already holds of it is not done again.

    Parameters
    ----------
    plan : Plan, path or mapping
    folder : path
    workers : int
        1 works in this process; more are processes of this machine. (They are spawned: a script that asks for them needs
        ``if __name__ == "__main__":``.)
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:port``; its workers are used instead.
    resume : bool
        Go on with the runs that the folder holds; without it they are removed and all are done.
    progress : callable, optional
        Called with the runs done and the runs in all, cases counted apart.

    Raises
    ------
    UsageError
        A folder of another plan, of other versions or under work by another process, no cluster, a disk that is full: what is
        done stays.
    DataError
        A plan with a mistake.
    """
    if workers < 1:
        raise UsageError(f"workers {workers}; expected 1 or more")
    plan = read_plan(plan)
    tell = progress or (lambda done, total: None)
    total = plan.runs * len(plan.cases)
    with opened(folder, plan, resume=resume) as store:
        blocks = store.missing(len(plan.cases), plan.runs, plan.block)
        done = total - sum(block.last - block.first + 1 for block in blocks)
        tell(done, total)
        if scheduler is not None:
            results = on_cluster(plan, blocks, scheduler)
        elif workers == 1:
            results = in_this_process(plan, blocks)
        else:
            results = in_processes(plan, blocks, min(workers, max(1, len(blocks))))
        with closing(results):
            for block, table in results:
                store.write(block, table)
                done += block.last - block.first + 1
                tell(done, total)
    return Campaign(plan, Path(folder))


def read_campaign(folder: str | PathLike[str]) -> Campaign:
    """A campaign from its folder, as far as it has been worked on.

    Raises
    ------
    UsageError
        The folder holds no plan.yaml.
    """
    return Campaign(read_plan(Path(folder) / "plan.yaml"), Path(folder))
