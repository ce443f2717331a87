"""The folder of a campaign: Parquet shards, each written whole; a lock; the plan and where the numbers came from.

plan.yaml       the plan with its scenarios written out
manifest.json   fingerprint of the plan, versions, platform
runs/           case0000_run000000-000019.parquet ...: which runs are done is what stands there
"""

from __future__ import annotations

import json
import os
import platform
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from truenorth.core.arrow import arrow_file
from truenorth.core.atomic import atomic_path, writable_folder, write_text
from truenorth.core.errors import DataError, UsageError
from truenorth.core.json_file import read_object
from truenorth.core.version import __version__

if TYPE_CHECKING:
    import pandas as pd

    from truenorth.campaign.plan import Plan

_SHARD = re.compile(r"case(\d+)_run(\d+)-(\d+)\.parquet")


class Block(NamedTuple):
    """Runs of a case that are worked on together: `first` to `last`, both included."""

    case: int
    first: int
    last: int

    @property
    def shard(self) -> str:
        """Name of its file."""
        return f"case{self.case:04d}_run{self.first:06d}-{self.last:06d}.parquet"

    def __len__(self) -> int:
        return self.last - self.first + 1


class Store:
    """The folder of one campaign; make it by :func:`opened`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs = folder / "runs"

    def done(self) -> set[tuple[int, int]]:
        """Pairs of case and run whose shard stands."""
        pairs: set[tuple[int, int]] = set()
        for path in self.shards():
            case, first, last = map(int, _SHARD.fullmatch(path.name).groups())  # type: ignore[union-attr]
            pairs.update((case, run) for run in range(first, last + 1))
        return pairs

    def shards(self) -> list[Path]:
        """The files of runs that are done."""
        return [path for path in self.runs.glob("case*.parquet") if _SHARD.fullmatch(path.name)]

    def missing(self, cases: int, runs: int, block: int) -> list[Block]:
        """What is left to do, in blocks of neighbouring runs."""
        done = self.done()
        blocks: list[Block] = []
        for case in range(cases):
            for first in range(0, runs, block):
                left = [run for run in range(first, min(first + block, runs)) if (case, run) not in done]
                edges = np.flatnonzero(np.diff(left) > 1) + 1
                blocks += [Block(case, int(p[0]), int(p[-1])) for p in np.split(np.array(left), edges) if p.size]
        return blocks

    def write(self, block: Block, table: Any) -> None:
        """Write a block's rows, whole or not at all."""
        import pyarrow.parquet as pq

        with atomic_path(self.runs / block.shard) as temporary, arrow_file(temporary, "wb") as file:
            pq.write_table(table, file)

    def table(self, runs: int | None = None) -> pd.DataFrame:
        """All rows, in the order of cases, runs, methods and times as they were planned; those of the first `runs` runs.

        Raises
        ------
        DataError
            A shard that is damaged: the message names it.
        """
        return read_table(self.folder, runs)


@contextmanager
def opened(folder: str | os.PathLike[str], plan: Plan, *, resume: bool = True) -> Iterator[Store]:
    """The store of a plan, locked for this process.

    Parameters
    ----------
    resume : bool
        Keep the runs that are there; without it they are removed, whosever plan they are of.

    Raises
    ------
    UsageError
        Another process works on the folder; it holds another plan; or runs are missing, and those that are there were made with
        other versions or on another platform.
    """
    target = writable_folder(folder)
    with _locked(target / ".lock"):
        store = Store(target)
        for stray in store.runs.glob(".*.part.parquet"):  # of a process that was killed
            stray.unlink(missing_ok=True)
        if not resume:
            for shard in store.shards():
                shard.unlink()
            (target / "manifest.json").unlink(missing_ok=True)
        _claim(store, plan)
        writable_folder(store.runs)
        yield store


def versions() -> dict[str, str]:
    """What the numbers come from besides the plan: with all of it alike they are the same to the bit."""
    from importlib.metadata import version

    return {
        "truenorth": __version__,
        "numpy": np.__version__,
        "scipy": version("scipy"),
        "numba": version("numba"),
        "platform": f"{platform.system()} {platform.machine()}",
    }


def other_versions(wanted: Mapping[str, str]) -> str:
    """In words what is not here as it is wanted, such as ``numpy 2.4.5 (here 2.4.6)``; empty where all is."""
    here = versions()
    return ", ".join(f"{name} {value} (here {here[name]})" for name, value in wanted.items() if here[name] != value)


def _claim(store: Store, plan: Plan) -> None:
    """Check that the folder is this plan's, or make it so."""
    import yaml

    folder, manifest = store.folder, store.folder / "manifest.json"
    if manifest.is_file():
        held = read_object(manifest)
        if held.get("plan_sha256") != plan.fingerprint:
            raise UsageError(
                f"{folder}: holds the runs of another plan (see its plan.yaml); name another folder, or begin anew "
                "with `resume=False`"
            )
        other = other_versions({name: held[name] for name in versions() if name in held})
        if other and store.missing(len(plan.cases), plan.runs, plan.block):
            raise UsageError(
                f"{folder}: was begun with {other}, and runs of both would not be alike to the bit; finish it with what it was "
                "begun with, name another folder, or begin anew with `resume=False`"
            )
    text = yaml.safe_dump(plan.to_mapping(), sort_keys=False, allow_unicode=True, width=110)
    kept = folder / "plan.yaml"
    if not (kept.is_file() and kept.read_text(encoding="utf-8") == text):  # it may be the plan that was read
        with atomic_path(kept) as temporary:
            write_text(temporary, text)
    if not manifest.is_file():
        facts = {
            "plan_sha256": plan.fingerprint,
            "seed": plan.seed,
            **versions(),
            "python": platform.python_version(),
        }
        with atomic_path(manifest) as temporary:
            temporary.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold a lock that the system takes back when the process ends, however it ends."""
    lock = _system_lock()
    try:
        # Not "w": on Windows emptying a file that another process has locked would fail with a message of its own.
        opened = path.open("a")
    except OSError as error:
        raise UsageError(f"{path}: could not be written ({error.strerror})") from None
    with opened as file:
        try:
            lock(file.fileno())
        except OSError:
            raise UsageError(
                f"{path.parent}: another process works on this folder; wait for it, or name another"
            ) from None
        yield


def _system_lock() -> Callable[[int], None]:
    """Locks an open file, or raises OSError at once: flock where there is one, a lock of the first byte on Windows."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        def lock_first_byte(file: int) -> None:
            os.lseek(file, 0, os.SEEK_SET)  # msvcrt locks from where the file stands
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]

        return lock_first_byte
    return lambda file: fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def read_table(folder: str | os.PathLike[str], runs: int | None = None) -> pd.DataFrame:
    """The rows of a campaign's folder; see :meth:`Store.table`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from truenorth.campaign.rows import SCHEMA

    tables = []
    for path in sorted((Path(folder) / "runs").glob("case*.parquet")):
        try:
            with arrow_file(path) as file:
                tables.append(pq.read_table(file).cast(SCHEMA))
        except MemoryError:  # Arrow's own is an ArrowException, too
            raise
        except (pa.ArrowException, OSError) as error:
            raise DataError(f"{path}: the shard is damaged ({error}); remove it and run the campaign again") from None
    if not tables:
        raise DataError(f"{folder}: no runs; expected a campaign's folder with runs/case....parquet")
    table = pa.concat_tables(tables, promote_options="default").unify_dictionaries().to_pandas()
    table = table if runs is None else table[table["run"] < runs]
    order = table["case"].to_numpy(np.int64) * (int(table["run"].max()) + 1) + table["run"].to_numpy(np.int64)
    return table.iloc[np.argsort(order, kind="stable")].reset_index(drop=True)
