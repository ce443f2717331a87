"""What the runs of a campaign and the steps of an alignment share is worked out once, and workers keep their memory."""

import os
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest

from truenorth.campaign.aligning import _truth_of
from truenorth.campaign.execution import one_thread_each
from truenorth.campaign.rows import SCHEMA, Row, table_of
from truenorth.core.position import Position
from truenorth.errors.staying import QUIETEST_BASE, StaticModel
from truenorth.estimate.base_motion import VelocityNoise
from truenorth.estimate.staying import core_system
from truenorth.filters import LinearSystem
from truenorth.records import ImuRecord
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.simulation.ideal import ideal_log
from truenorth.simulation.runs import simulate_runs
from truenorth.strapdown.inertial import _grid, integrate

PLACE = Position.from_degrees(45.0, 0.0)


def test_states_of_a_shared_motion_are_worked_out_once():
    motion = rest(PLACE)
    first = _truth_of(motion)(3.0)
    assert _truth_of(motion)(3.0) is first
    assert np.array_equal(first.C_nb, motion.states(np.array(3.0)).C_nb)
    assert _truth_of(rest(PLACE))(3.0) is not first


def test_check_and_alignment_share_one_linearisation_and_no_other():
    log = simulate(rest(PLACE), duration=60.0, imu="navigation", seed=1).record
    noise, P0 = StaticModel.of(imu_spec("navigation")), np.eye(12)

    def system(integrals, C, prior):
        return core_system(noise, integrals, integrals, C, PLACE, prior, "velocity")

    integrals, C = integrate(log), np.eye(3)
    one, other = system(integrals, C, P0), system(integrals, C, 4.0 * P0)
    assert other.Phi is one.Phi
    assert np.array_equal(other.P0, 4.0 * P0)
    assert np.array_equal(one.P0, P0)
    turned = system(integrals, C[[1, 0, 2]], P0)
    assert not np.array_equal(turned.Phi, one.Phi)
    biased = system(integrate(log, gyro_bias=np.array([1e-3, 0.0, 0.0])), C, P0)
    assert not np.array_equal(biased.Phi, one.Phi)


def test_workers_keep_memory_unless_the_user_says_otherwise(monkeypatch):
    monkeypatch.delenv("MALLOC_TRIM_THRESHOLD_", raising=False)
    monkeypatch.setenv("MALLOC_MMAP_THRESHOLD_", "7")
    with one_thread_each():
        assert int(os.environ["MALLOC_TRIM_THRESHOLD_"]) >= 2**25
        assert os.environ["MALLOC_MMAP_THRESHOLD_"] == "7"
    assert "MALLOC_TRIM_THRESHOLD_" not in os.environ
    assert os.environ["MALLOC_MMAP_THRESHOLD_"] == "7"


def test_runs_share_what_their_times_decide_and_no_other():
    ideal = ideal_log(rest(PLACE), rate=100.0, duration=60.0)
    one, other = (run.record for run in simulate_runs(ideal, imu_spec("navigation"), 2))
    rows = np.array([5999]) + 1
    assert other.steps is one.steps
    assert _grid(other, 1.0, rows, 0) is _grid(one, 1.0, rows, 0)
    for grid in (_grid(one, 2.0, rows, 0), _grid(one, 1.0, rows - 1, 0), _grid(one, 1.0, rows, 2)):
        assert grid is not _grid(one, 1.0, rows, 0)
    late = one.shifted(5.0)
    late = ImuRecord(np.delete(late.time, 3000), np.delete(one.gyro, 3000, 0), np.delete(one.accel, 3000, 0), one.kind)
    assert (len(late.gaps), len(one.gaps)) == (1, 0)
    assert not np.array_equal(integrate(late).time, integrate(one).time)


def test_a_linearised_log_stands_the_check_that_it_is_spared():
    log = simulate(rest(PLACE), duration=60.0, imu="navigation", seed=1).record
    integrals, noise = integrate(log), StaticModel.of(imu_spec("navigation"))
    for form in ("velocity", "force"):
        system = core_system(noise, integrals, integrals, np.eye(3), PLACE, np.eye(12), form)
        checked = LinearSystem(**{name: getattr(system, name) for name in system.axes})
        loud = VelocityNoise(np.tile([1e-6, 4e-6, 1e-8], (system.epochs, 1)), [], 1)._with_motion(checked)
        LinearSystem(**{name: getattr(loud, name) for name in loud.axes})
        added = np.array([1e-6, 4e-6, 1e-8]) - QUIETEST_BASE**2
        np.testing.assert_allclose(loud.R - system.R, np.tile(np.diag(added), (system.epochs, 1, 1)), atol=1e-18)
        for name in ("Phi", "Q", "H", "R", "S", "P0"):
            assert getattr(system, name).flags.c_contiguous


def test_rows_become_the_table_that_arrow_makes_of_them():
    rows = [
        Row(0, "kalman", k, 600.0, what, 0.1 * k, unit="µg", reason="é" * k)
        for k in range(3)
        for what in ("nis", "phi_u")
    ]
    columns = zip(*rows, strict=True)
    theirs = [pa.array(list(column), field.type) for column, field in zip(columns, SCHEMA, strict=True)]
    ours, theirs = table_of(rows).to_pydict(), pa.Table.from_arrays(theirs, schema=SCHEMA).to_pydict()
    assert np.isnan(ours.pop("sigma")).all()
    assert np.isnan(theirs.pop("sigma")).all()
    assert ours == theirs
    assert table_of([]).schema == SCHEMA


@pytest.mark.slow
def test_a_worker_loads_no_pandas():
    code = (
        "import sys\nfrom truenorth.campaign.execution import work\nfrom truenorth.campaign.store import Block\n"
        "from tests.campaign.test_plan import PLAN\nfrom truenorth.campaign.plan import read_plan\n"
        "work(read_plan(PLAN).to_mapping(), Block(0, 0, 0))\nassert 'pandas' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
