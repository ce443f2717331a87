"""Levels of processors: what a processor has, and what is compiled for."""

import pytest

from truenorth.core import processor


def levels_of(flags, monkeypatch):
    monkeypatch.setattr(processor, "said_of_processor", lambda: repr([f"flags\t: {' '.join(flags)}"]))
    return processor.levels.__wrapped__()


def test_a_processor_has_a_level_where_it_has_all_of_its_flags(monkeypatch):
    assert levels_of(processor.V4 | {"fpu", "sse2"}, monkeypatch) == ("x86-64-v4", "x86-64-v3")
    assert levels_of(processor.V3, monkeypatch) == ("x86-64-v3",)
    assert levels_of([], monkeypatch) == ()
    for flag in processor.V3:
        assert levels_of(processor.V4 - {flag}, monkeypatch) == ()
    for flag in processor.V4 - processor.V3:
        assert levels_of(processor.V4 - {flag}, monkeypatch) == ("x86-64-v3",)


def test_a_system_that_does_not_describe_its_processor_has_none(monkeypatch, tmp_path):
    monkeypatch.setattr(processor, "SAYS", tmp_path / "cpuinfo")
    monkeypatch.setattr(processor, "said_of_processor", processor.said_of_processor.__wrapped__)
    assert processor.levels.__wrapped__() == ()
    with pytest.raises(OSError, match="cpuinfo"):
        processor.said_of_processor()


def test_only_a_level_that_this_processor_has_is_compiled_for(monkeypatch):
    monkeypatch.setattr(processor, "levels", lambda: ("x86-64-v3",))
    monkeypatch.setattr(processor, "said_of_processor", lambda: "this one")
    asked = []
    for name, features in ((None, None), ("x86-64-v3", None), ("x86-64-v4", ""), ("skylake", ""), ("x86-64-v3", "")):
        for variable, value in ((processor.NAME, name), (processor.FEATURES, features)):
            monkeypatch.delenv(variable, raising=False)
            if value is not None:
                monkeypatch.setenv(variable, value)
        asked.append(processor.compiled_for())
    assert asked == ["this one"] * 4 + ["x86-64-v3"]


def test_the_highest_level_ships_where_its_folder_is_there(monkeypatch, tmp_path):
    monkeypatch.delenv(processor.NAME, raising=False)
    monkeypatch.setattr(processor, "SHIPPED", tmp_path)
    monkeypatch.setattr(processor, "levels", lambda: ("x86-64-v4", "x86-64-v3"))
    assert processor.shipped_level.__wrapped__() == ""
    processor.folder_of("x86-64-v3").mkdir()
    assert processor.shipped_level.__wrapped__() == ""  # kernels of a lower level are slower than those compiled here
    processor.folder_of("x86-64-v4").mkdir()
    assert processor.shipped_level.__wrapped__() == "x86-64-v4"
