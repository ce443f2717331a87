"""The catalogue of each language: whole, with the same fields, and what the pages say."""

from __future__ import annotations

import string

import pytest
from typer.testing import CliRunner

from tests.report.catalogue import OTHERS, catalogue, compiled, messages, path, texts
from truenorth.cli import _language_first, app, main
from truenorth.core.errors import UsageError
from truenorth.core.language import in_language, retold, translated
from truenorth.core.position import Position
from truenorth.formats import write_imu
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate


def fields(text: str) -> list[tuple[str, str]]:
    """Fields of a template with their units, in any order: a sentence may be turned round."""
    return sorted((name, spec or "") for _, name, spec, _ in string.Formatter().parse(text) if name is not None)


@pytest.mark.parametrize("code", OTHERS)
def test_no_text_lacks_a_translation(code):
    known = {message.id for message in catalogue(code) if message.id and message.string and not message.fuzzy}
    assert texts() - known == set(), "run make messages, and translate what it names"


@pytest.mark.parametrize("code", OTHERS)
def test_no_translation_is_left_over(code):
    assert {message.id for message in catalogue(code) if message.id} - texts() == set(), "run make messages"


@pytest.mark.parametrize("code", OTHERS)
def test_a_translation_has_the_fields_of_its_text(code):
    for message in catalogue(code):
        if message.id:
            assert fields(message.string) == fields(message.id), message.id


@pytest.mark.parametrize("code", OTHERS)
def test_the_compiled_catalogue_is_that_of_the_text(code):
    assert path(code, "mo").read_bytes() == compiled(catalogue(code)), "run make messages"


@pytest.mark.parametrize("code", OTHERS)
def test_every_message_is_found_by_what_it_says(code):
    """Whatever its figures are, a message comes back as the translation of its own template, not of one that looks like it."""
    assert len(messages()) > 500
    with in_language(code):
        for text in messages():
            figures = [f"q{i}z" for i in range(len(fields(text)))]
            assert retold(text.format(*figures)) == translated(text).format(*figures)


def test_a_message_inside_a_message_is_said_too():
    said = "a.csv: latitude 95 deg; expected -90 to 90 deg, north positive: check `lat`"
    assert retold(said) == said
    with in_language("zh"):
        assert retold(said) == "a.csv：纬度 95 deg；应为 -90 至 90 deg，北为正：请检查 `lat`"
        assert retold("whatever another library says") == "whatever another library says"


def test_an_error_of_the_program_speaks(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["truenorth", "align", "nothing.csv", "--lang", "zh"])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    assert "缺少纬度" in capsys.readouterr().err


def test_a_language_is_in_force_inside_only():
    assert translated("heading") == "heading"
    with in_language("zh"):
        assert translated("heading") == "航向"
        assert translated("a text that no catalogue has") == "a text that no catalogue has"
    assert translated("heading") == "heading"
    with pytest.raises(UsageError, match="'xx' is not known"), in_language("xx"):
        pass


def test_the_program_speaks_the_language_it_is_asked_for(tmp_path):
    place = Position.from_degrees(40.0, 118.0)
    log = simulate(rest(place, 1.0), rate=20.0, duration=60.0, imu=imu_spec("consumer"), seed=1)
    write_imu(log.record, tmp_path / "log.csv")
    arguments = [
        "align",
        str(tmp_path / "log.csv"),
        "--lat",
        "40",
        "--imu",
        "consumer",
        "-o",
        str(tmp_path / "r"),
        "--lang",
        "zh",
    ]
    done = CliRunner().invoke(app, _language_first(arguments))
    assert done.exit_code == 0, done.output
    assert "航向不予给出" in done.output
    assert "陀螺零偏，deg/h" in done.output
    page = (tmp_path / "r" / "report.html").read_text(encoding="utf-8")
    assert '<html lang="zh">' in page
    for words in ("已调平；航向不予给出", "姿态", "陀螺零偏"):
        assert words in page


def test_the_language_is_found_anywhere_on_the_line():
    assert _language_first(["align", "--lang", "zh", "log.csv"]) == ["--lang", "zh", "align", "log.csv"]
    assert _language_first(["align", "log.csv", "--lang=zh"]) == ["--lang=zh", "align", "log.csv"]
    assert _language_first(["align", "log.csv"]) == ["align", "log.csv"]
