"""A disk that fails at any write of any saver: after each failure the folder holds the old result or the new one, whole."""

import shutil
from contextlib import contextmanager, suppress

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest

import truenorth
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
from truenorth.simulation.folder import save_run
from truenorth.simulation.scenario import read_scenario

PLACE = Position.from_degrees(45.0, 10.0)


def record_of(seed):
    return simulate(rest(PLACE, 0.3), rate=10.0, duration=60.0, imu=imu_spec("navigation"), seed=seed).record


@pytest.fixture(scope="module")
def records():
    return record_of(1), record_of(2)


@pytest.fixture(scope="module")
def alignments(records):
    return [truenorth.align(record, PLACE, "navigation", method="kalman") for record in records]


@pytest.fixture(scope="module")
def navigations(records):
    record = records[0]
    start = truenorth.align(record.between(None, 30.0), PLACE, "navigation", method="kalman", heading_limit=3.0)
    return [truenorth.navigate(record.between(None, stop), start) for stop in (45.0, 60.0)]


def savers(kind, request):
    """Two functions of a folder: one writes an old result, the other a new one."""
    if kind in ("alignment", "navigation"):
        old, new = request.getfixturevalue(f"{kind}s")
        return lambda folder: truenorth.save(old, folder), lambda folder: truenorth.save(new, folder)
    old, new = request.getfixturevalue("records")
    if kind in ("log.csv", "log.parquet", "log.npz"):
        return lambda folder: write_imu(old, folder / kind), lambda folder: write_imu(new, folder / kind)
    if kind == "simulation":
        text = {"name": "quay", "duration": "5 s", "rate": "20 Hz", "position": {"lat": "45 deg"}, "imu": "navigation"}
        scenario = read_scenario(text | {"motion": {"kind": "rest"}})
        return tuple(
            lambda folder, seed=seed: save_run(
                scenario, scenario.simulate(seed=seed), folder, seed=seed, run=0, plot=False
            )
            for seed in (1, 2)
        )
    if kind == "live rows":
        rows = [np.column_stack([r.time, r.gyro, r.accel]) for r in (old, new)]

        def part(folder, which):
            journal = Journal(folder, resume=True)
            journal.add(rows[which][:20], old.kind)
            journal.flush(old.kind)

        return lambda folder: None, lambda folder: part(folder, 1)
    if kind == "a specification from noise":
        from truenorth.cli.noise import _write
        from truenorth.quality import inspect

        found = inspect(old)
        return tuple(lambda folder, like=like: _write(folder, found, like) for like in ("navigation", "tactical"))
    if kind == "a layout":
        from truenorth.formats import read_imu, write_layout

        log = "log.csv"
        return (
            lambda folder: write_imu(old, folder / log),
            lambda folder: write_layout(read_imu(folder / log, axes="FRD"), folder / log),
        )
    if kind == "the tables of faults":
        from truenorth.campaign.fault_pages import keeper
        from truenorth.campaign.faults import Trial

        first, second = (Trial("still", "none", 0, run, "", "harmless", 1.0, "") for run in (0, 1))
        return (
            lambda folder: keeper(folder / "trials.csv", [first]),
            lambda folder: keeper(folder / "trials.csv", [first, second]),
        )
    plan = read_plan(PLAN)
    tables = [work(plan.to_mapping(), Block(0, first, first)) for first in (0, 1)]
    return tuple(lambda folder, table=table: Store(folder).write(Block(0, 0, 0), table) for table in tables)


KINDS = ["alignment", "simulation", "log.csv", "log.parquet", "log.npz", "live rows", "shard"]
KINDS += ["a specification from noise", "a layout", "the tables of faults"]
KINDS += [pytest.param("navigation", marks=pytest.mark.slow)]


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
