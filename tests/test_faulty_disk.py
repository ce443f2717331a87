"""A disk that fails at any write of a log, of live rows, of a shard: what the folder holds is the old one or the new one, whole."""

import shutil
from contextlib import contextmanager, suppress

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest

from tests.campaign.test_plan import PLAN
from tests.test_atomic import failing
from truenorth.campaign import read_plan
from truenorth.campaign.execution import work
from truenorth.campaign.store import Block, Store
from truenorth.core.errors import UsageError
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.live.journal import Journal
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(45.0, 10.0)


def record_of(seed):
    return simulate(rest(PLACE, 0.3), rate=10.0, duration=60.0, imu=imu_spec("navigation"), seed=seed).record


@pytest.fixture(scope="module")
def records():
    return record_of(1), record_of(2)


def savers(kind, request):
    """Two functions of a folder: one writes an old result, the other a new one."""
    old, new = request.getfixturevalue("records")
    if kind in ("log.csv", "log.parquet", "log.npz"):
        return lambda folder: write_imu(old, folder / kind), lambda folder: write_imu(new, folder / kind)
    if kind == "live rows":
        rows = [np.column_stack([r.time, r.gyro, r.accel]) for r in (old, new)]

        def part(folder, which):
            journal = Journal(folder, resume=True)
            journal.add(rows[which][:20], old.kind)
            journal.flush(old.kind)

        return lambda folder: None, lambda folder: part(folder, 1)
    plan = read_plan(PLAN)
    tables = [work(plan.to_mapping(), Block(0, first, first)) for first in (0, 1)]
    return tuple(lambda folder, table=table: Store(folder).write(Block(0, 0, 0), table) for table in tables)


KINDS = ["log.csv", "log.parquet", "log.npz", "live rows", "shard"]


@pytest.mark.parametrize("kind", KINDS)
def test_the_old_result_stands_or_the_new_one_whole(kind, tmp_path, monkeypatch, request):
    save_old, save_new = savers(kind, request)
    before = tmp_path / "before"
    (before / "runs" if kind == "shard" else before).mkdir(parents=True)
    save_old(before)
    old, after = contents(before), tmp_path / "after"
    shutil.copytree(before, after)
    save_new(after)
    new = contents(after)
    assert new != old
    for number in range(1, 400):
        folder = tmp_path / str(number)
        shutil.copytree(before, folder)
        with (
            failing(monkeypatch, number) as calls,
            failing_libraries(monkeypatch, number, calls),
            suppress(UsageError, OSError),  # a failure may also be made good, by another way to write
        ):
            save_new(folder)
        assert contents(folder) in (old, new), f"call {number} failed"
        if calls[0] < number:
            assert contents(folder) == new
            return
    raise AssertionError("no run came through")


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@contextmanager
def failing_libraries(monkeypatch, number, calls):
    """Writers that open their files outside Python fail in turn, too."""

    def counted(function):
        def wrapped(*args, **kwargs):
            calls[0] += 1
            if calls[0] == number:
                raise OSError(28, "No space left on device")
            return function(*args, **kwargs)

        return wrapped

    with monkeypatch.context() as patch:
        patch.setattr(pyarrow.parquet, "write_table", counted(pyarrow.parquet.write_table))
        patch.setattr(pd.DataFrame, "to_parquet", counted(pd.DataFrame.to_parquet))
        yield
