"""Results are data: drawn, written, read back and shown by one registry."""

from dataclasses import dataclass, fields, is_dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

import truenorth as tn
from truenorth.core.archive import read_archive, write_archive
from truenorth.core.errors import DataError, UsageError
from truenorth.core.shown import Shown
from truenorth.simulation import rest, simulate

PLACE = tn.Position.from_degrees(40.0, 118.0)


@pytest.fixture(scope="module")
def record():
    return simulate(rest(PLACE, 1.0), rate=20.0, duration=120.0, imu="navigation", seed=1).record


@pytest.fixture(scope="module")
def results(record):
    alignment = replace(
        tn.align(record.between(None, 90.0), PLACE, "navigation"), inspection=tn.inspect(record, PLACE.lat)
    )
    return {
        "alignment": alignment,
        "navigation": tn.navigate(record, alignment),
        "inspection": tn.inspect(record, PLACE.lat),
        "advice": tn.advise("navigation", PLACE, np.radians(0.05), longest=600.0),
        "manoeuvres": tn.advise_manoeuvre("tactical", PLACE, 50.0, np.radians(0.2), longest=40.0),
    }


def same(a, b):
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
    if is_dataclass(a):
        kept = [f.name for f in fields(a) if f.metadata.get("archive", True)]
        return type(a) is type(b) and all(same(getattr(a, name), getattr(b, name)) for name in kept)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return a == b or (a != a and b != b)


@pytest.mark.parametrize("name", ["alignment", "navigation", "inspection", "advice", "manoeuvres"])
def test_saved_and_read_back_to_the_same_bits(results, name, tmp_path):
    paths = tn.save(results[name], tmp_path / "folder")
    assert all(path.is_file() for path in paths)
    again = tn.load(tmp_path / "folder")
    assert same(results[name], again)
    if name != "inspection":  # its log is not kept
        assert tn.plot(again).axes


@pytest.mark.slow
@pytest.mark.parametrize("name", ["alignment", "navigation", "inspection", "advice", "manoeuvres"])
def test_shown_in_a_notebook(results, name):
    result = results[name]
    assert len(repr(result)) < 700
    html = result._repr_html_()
    assert "<table>" in html
    assert "data:image/png" in html
    assert len(html) < 100_000  # a notebook keeps each one
    assert result._repr_png_().startswith(b"\x89PNG")
    assert len(result.to_frame())


def test_navigation_goes_on_from_what_was_read(record, results, tmp_path):
    tn.save(results["alignment"], tmp_path)
    again = tn.navigate(record, tn.load(tmp_path))
    np.testing.assert_array_equal(again.track.C_nb, results["navigation"].track.C_nb)


def test_estimates_of_a_filter_are_a_table():
    """One run, and runs by name; the short text has their sizes."""
    from truenorth.filters import LinearSystem, kalman

    z = np.random.default_rng(0).standard_normal((3, 5, 1))
    one, eye = np.ones((1, 1, 1)), np.eye(1)
    system = LinearSystem(Phi=one, Q=0.1 * one, H=one, R=one, z=z, x0=np.zeros(1), P0=eye)
    found = kalman(system, history="sigma", innovations=True)
    table = found.to_frame()
    assert table.index.names == ["run_0", "epoch"]
    assert list(table.columns) == ["x_0", "sigma_0", "nis"]
    assert table.loc[(2, 4), "x_0"] == found.x[2, 4, 0]
    assert repr(found).startswith("Estimates(runs: 3, epochs: 5, states: 1, NIS over rows: ")
    assert "<table>" in found._repr_html_()


@pytest.mark.parametrize("name", ["alignment", "navigation", "inspection", "advice", "manoeuvres", "record"])
def test_xarray_where_it_is_installed(results, record, name):
    result = record if name == "record" else results[name]
    try:
        import xarray  # noqa: F401
    except ImportError:
        with pytest.raises(UsageError, match="xarray is not installed"):
            result.to_xarray()
    else:
        assert set(result.to_xarray().data_vars) == set(result.to_frame().columns)


def test_tables_and_data_sets_go_in(record):
    """The same bits as the record they were made from."""
    table = record.to_frame()
    for given in (table, SimpleNamespace(to_dataframe=lambda: table)):  # as an xarray.Dataset has it
        same_record = tn.ImuRecord.of(given)
        np.testing.assert_array_equal(same_record.gyro, record.gyro)
        np.testing.assert_array_equal(same_record.time, record.time)


@dataclass(frozen=True, repr=False)
class Mine(Shown):
    values: np.ndarray

    def in_brief(self):
        return {"values": str(len(self.values))}


def test_a_type_of_ones_own(tmp_path):
    mine = Mine(np.arange(3.0))
    with pytest.raises(UsageError, match="register_result"):
        tn.plot(mine)
    tn.register_result(Mine, tn.Views(files=lambda result: {"a.txt": lambda path: path.write_text("mine")}))
    assert [path.name for path in mine.save(tmp_path)] == ["a.txt", "result.npz"]
    assert same(tn.load(tmp_path), mine)
    assert repr(mine) == "Mine(values: 3)"
    assert "img" not in mine._repr_html_()


def test_what_cannot_be_read(tmp_path):
    with pytest.raises(DataError, match=r"no result\.npz"):
        tn.load(tmp_path)
    (tmp_path / "result.npz").write_bytes(b"PK\x03\x04 cut")
    with pytest.raises(DataError, match=r"result\.npz"):
        tn.load(tmp_path)


def test_only_results_are_made_on_reading(tmp_path, monkeypatch):
    """A file that names any other type is refused: reading executes nothing."""
    path = tmp_path / "result.npz"
    tree = '{"type": "subprocess:Popen", "fields": {"args": "true"}}'
    np.savez(path, tree=np.frombuffer(tree.encode(), dtype=np.uint8))
    with pytest.raises(DataError, match="not a registered type"):
        read_archive(path)


@pytest.mark.parametrize("value", [lambda: 1, {"a": object()}, np.array([object()])])
def test_what_cannot_be_kept_is_named(value, tmp_path):
    with pytest.raises(TypeError, match="cannot be kept"):
        write_archive(value, tmp_path / "x.npz")


def test_archives_keep_every_kind_of_value(tmp_path):
    rng = np.random.default_rng(1)
    P = rng.normal(size=(4, 7, 7))
    value = {"P": P + P.swapaxes(1, 2), "x": (1, 2.5, None, "a", float("inf")), "s": slice(1, 3), 3: [np.float32(2.0)]}
    write_archive(value, tmp_path / "x.npz")
    assert same(read_archive(tmp_path / "x.npz"), value)
