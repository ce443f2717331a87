"""The page and the files of an alignment: whole, self-contained, and saying what the result says."""

import json
import re
import zlib
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest

from truenorth.alignment import align
from truenorth.alignment.assumptions import reason as assumed
from truenorth.alignment.procedure import POSITIONS
from truenorth.alignment.table import TablePosition, TurntableErrors
from truenorth.core.errors import UsageError
from truenorth.core.language import in_language
from truenorth.core.position import Position
from truenorth.quality import inspect
from truenorth.records.specs import imu_spec
from truenorth.report import write_report
from truenorth.report.numbers import of_sigma, short
from truenorth.report.words import clauses
from truenorth.results import save
from truenorth.simulation import rest, simulate

PLACE = Position.from_degrees(40.0, 118.0)


@pytest.fixture(scope="module")
def aligned():
    record = simulate(rest(PLACE, 1.0), rate=20.0, duration=120.0, imu=imu_spec("navigation"), seed=1).record
    return replace(align(record, PLACE, "navigation"), inspection=inspect(record, PLACE.lat), source="a <log> & more")


@pytest.fixture(scope="module")
def levelled():
    record = simulate(rest(PLACE, 1.0), rate=20.0, duration=60.0, imu=imu_spec("consumer"), seed=1).record
    return align(record, PLACE, "consumer")


def test_files(aligned, tmp_path):
    paths = save(aligned, tmp_path / "new" / "folder")
    assert [p.name for p in paths] == ["summary.json", "history.parquet", "report.html", "result.npz"]
    assert sorted(p.name for p in paths[0].parent.iterdir()) == sorted(p.name for p in paths)
    assert json.loads(paths[0].read_text())["status"] == "aligned"
    import pandas as pd

    frame = pd.read_parquet(paths[1])
    pd.testing.assert_frame_equal(frame, aligned.to_frame(), check_exact=True)
    assert frame.index.name == "time"
    assert frame["heading_deg"].iloc[-1] == pytest.approx(np.degrees(aligned.heading), abs=1e-6)


def test_the_page_says_what_the_result_says(aligned, tmp_path):
    path = write_report(aligned, tmp_path / "report.html")
    page = path.read_text()
    assert path.stat().st_size < 1.0e6
    assert f"{np.degrees(aligned.heading):.4f}°" in page
    assert "Aligned" in page
    for reason in aligned.reasons:
        assert reason in page
    assert "a &lt;log&gt; &amp; more" in page
    assert "a <log>" not in page
    body = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"(src|href)\s*=\s*[\"']https?:", body)


def test_the_page_asks_nothing_of_the_network(aligned, tmp_path):
    """Outside the scripts no address at all, no link, import or frame; the charts' library is inside."""
    page = write_report(aligned, tmp_path / "report.html").read_text()
    outside = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"https?:|<link|<iframe|@import|url\(", outside)
    assert not re.search(r"<script[^>]+src", page)
    assert "plotly.js (cartesian" in unpacked(page)["plotly"]


def unpacked(page):
    """The deflated scripts of a page, by their names."""
    found = re.findall(r'<script type="text/plain" id="([^"]+)" data-packed>([^<]*)</script>', page)
    return {name: zlib.decompress(b64decode(text)).decode() for name, text in found}


def test_the_charts_travel_with_the_page(aligned, tmp_path):
    content = unpacked(write_report(aligned, tmp_path / "report.html").read_text())
    assert json.loads(content["data-convergence"])["data"][0]["type"] == "scatter"


def test_the_page_shows_all_that_led_to_the_answer(aligned, tmp_path):
    page = write_report(aligned, tmp_path / "report.html").read_text()
    for title in ("Convergence", "How the uncertainty falls", "Gyro bias", "Accelerometer bias", "Innovations"):
        assert f"<h2>{title}</h2>" in page
    for words in ("Floor", "dashed: three sigma", "95 % band", "Angle random walk", "Velocity random walk", "20 Hz"):
        assert words in page
    assert "More time" in page
    assert page.index('class="badge"') < page.index("<h2>Attitude") < page.index("<h2>Convergence")
    assert page.index("<h2>Normalised") < page.index("<h2>Allan deviation") < page.index("<h2>Health of the log")


def test_near_the_vertical_the_combination_comes_first(tmp_path):
    log = simulate(rest(PLACE, 1.0, np.radians(89.0)), rate=20.0, duration=120.0, imu=imu_spec("navigation"), seed=1)
    result = align(log.record, PLACE, "navigation")
    page = write_report(result, tmp_path / "report.html").read_text()
    assert page.index("Heading minus roll") < page.index('<th scope="row">Heading</th>')
    assert f"{np.degrees(result.azimuth[1]):.4f}°" in page
    assert "belong together" in page


def test_biases_and_motion_have_units_that_fit(aligned, levelled, tmp_path):
    """Tens of micro-g of a navigation grade, tens of milli-g of a consumer's; a base that moves by metres a second."""
    pages = [write_report(result, tmp_path / "report.html").read_text() for result in (aligned, levelled)]
    assert [re.search(r"Accelerometer x</th>.*?([µm]g)</td></tr>", page, re.DOTALL)[1] for page in pages] == [
        "µg",
        "mg",
    ]
    moved = replace(aligned, disturbance=np.array([13.0, 12.0, 0.2]))
    assert "13, 12, 0.2 m/s RMS" in write_report(moved, tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    "why",
    [
        "the base is disturbed: mean rates would be off, the inertial frame is not; its own motion is fitted to the log",
        f"the base is rotating: only the inertial frame follows it{POSITIONS}; its own motion is fitted to the log",
        assumed("imakf", 0.25),
        assumed("sgkf"),
        "the IMU turns on an indexer (angles of 2 axes from enc.csv), the base may sway: its own motion is fitted to the log",
        "25 states, closed loop over 1999 rows of m.csv",
        "gyro errors of 100 deg/h hide the earth's rate: motion has to tell heading",
        "specification 'navigation'",
    ],
)
def test_why_a_method_was_taken_is_in_the_reader_s_language(why):
    assert clauses(why) == why
    with in_language("zh"):
        rest = re.sub(r"Positions|deg/h|IMU|navigation|enc.csv|m.csv", "", clauses(why))
    assert not re.search(r"[A-Za-z]", rest), rest


def test_the_reason_on_the_page_is_in_its_language(aligned, levelled, tmp_path):
    for result in (aligned, levelled):
        with in_language("zh"):
            page = write_report(result, tmp_path / "report.html").read_text(encoding="utf-8")
        said = re.search(r"方法</th><td>\w+: (.*?)</td>", page)[1]
        assert not re.search(r"[a-z]{4}", said.replace("Ljung-Box", "")), said


def test_positions_of_a_turntable_are_a_table(aligned, tmp_path):
    stops = tuple(
        TablePosition(60.0 * k, 60.0 * k + 50.0, aligned.C_nb, np.array([0.0, 0.0, 0.5 * np.pi * (k > 0)]))
        for k in (0, 1)
    )
    table = TurntableErrors(stops, None, *(np.zeros((3, 3)),) * 4, np.zeros(3), np.zeros(3))
    page = write_report(replace(aligned, table=table), tmp_path / "report.html").read_text()
    assert page.count("Positions of the turntable") == 2  # contents and heading
    assert re.search(r"<td[^>]*>60</td><td[^>]*>110</td><td[^>]*>90.000</td>", page)


@pytest.mark.parametrize(
    ("value", "shown"), [(1000.0, "1000"), (30001.0, "30000"), (3.57e-5, "0.0000357"), (-12.19, "-12.2"), (0.0, "0")]
)
def test_figures_have_no_exponent(value, shown):
    from truenorth.report.numbers import short

    assert short(value) == shown


@pytest.mark.parametrize(
    ("value", "sigma", "shown"),
    [
        (-1.17e-5, 50.0, "0"),
        (24.71, 35.6, "24.7"),
        (30.0312, 0.949, "30.031"),
        (-0.5274, 1.71, "-0.53"),
        (219.91234, 0.101, "219.912"),
        (3.0, 0.0, "3"),
    ],
)
def test_a_value_has_the_digits_of_its_sigma(value, sigma, shown):
    assert of_sigma(value, sigma) == shown


def test_a_result_without_history_leaves_none_of_an_earlier_one(aligned, levelled, tmp_path):
    """Else the folder would hold the summary of one log with the history of another."""
    save(aligned, tmp_path)
    assert (tmp_path / "history.parquet").exists()
    assert [p.name for p in save(levelled, tmp_path)] == ["summary.json", "report.html", "result.npz"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report.html", "result.npz", "summary.json"]


@pytest.mark.parametrize("stop", [KeyboardInterrupt, RuntimeError])
def test_an_interrupt_leaves_the_earlier_files_together(aligned, levelled, tmp_path, monkeypatch, stop):
    import truenorth.report.page

    save(levelled, tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}

    def interrupted(result):
        raise stop

    monkeypatch.setattr(truenorth.report.page, "alignment_page", interrupted)
    with pytest.raises(stop):
        save(aligned, tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == before


def test_a_refused_heading_is_refused_on_the_page(levelled, tmp_path):
    assert levelled.status == "level_only"
    page = write_report(levelled, tmp_path / "report.html").read_text()
    assert "heading refused" in page
    assert "deg/h" in page
    assert levelled.reasons[0] in page.replace("&#39;", "'")


@pytest.mark.slow
def test_the_figure(aligned, levelled, tmp_path):
    aligned.plot().savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 20_000
    with pytest.raises(ValueError, match="no history"):
        levelled.plot()


def test_a_warning_makes_a_good_verdict_amber_and_stands_on_top_once(aligned, tmp_path):
    from truenorth.quality.sampling import Finding

    inspection = replace(aligned.inspection, findings=(Finding("warning", "gaps", "two gaps of a second"),))
    page = write_report(replace(aligned, inspection=inspection), tmp_path / "report.html").read_text()
    assert 'class="verdict fair"' in page
    assert "Aligned, with warnings" in page
    assert page.count("two gaps of a second") == 1
    assert page.index("two gaps of a second") < page.index("<h2>Attitude")


def test_tables_name_their_rows_and_columns(aligned, tmp_path):
    """Every heading cell has a scope, every chart a name and a description, every entry of the contents its place."""
    page = write_report(aligned, tmp_path / "report.html").read_text()
    assert set(re.findall(r"<th(?! scope=)[^>]*>", page.split("<body>")[1])) <= {"<thead>"}
    assert page.count('class="chart" role="figure" aria-label=') == page.count('class="chart"') == 7
    places = set(re.findall(r'id="([^"]+)"', page))
    for target in re.findall(r'<a href="#([^"]+)"', page):
        assert target in places
    assert set(re.findall(r'aria-describedby="([^"]+)"', page)) <= places


def test_a_failure_leaves_nothing_half_written(aligned, tmp_path, monkeypatch):
    from pathlib import Path

    real = Path.write_text

    def broken(self, text, **options):
        real(self, text[: len(text) // 2], **options)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", broken)
    with pytest.raises(UsageError, match="No space left"):
        write_report(aligned, tmp_path / "report.html")
    assert list(tmp_path.iterdir()) == []


def test_what_is_zero_but_for_rounding_is_zero():
    assert short(3e-17) == "0"
    assert short(-0.0123456) == "-0.0123"
