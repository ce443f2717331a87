"""Evidence in words: fields of a template are filled with figures, each time anew."""

import math

import pytest

from truenorth.core.language import in_language
from truenorth.state import wording
from truenorth.state.english import SENTENCES
from truenorth.state.evidence import Evidence

TEMPLATE = "{{so}} {axis}: {size:deg/h|.2f} deg/h, {turned:angle}, {name!r}, {share:.0%} of {size:deg/h|}"


@pytest.fixture
def words(monkeypatch):
    monkeypatch.setitem(SENTENCES, "made.up", TEMPLATE)
    return lambda **figures: wording.sentence(Evidence("made.up", figures))


def test_a_template_is_filled_with_the_figures_of_each_call(words):
    deg_h = math.radians(1.0) / 3600.0
    figures = {"axis": "x", "size": 2.5 * deg_h, "turned": math.radians(2.0), "name": "a", "share": 0.25}
    assert words(**figures) == "{so} x: 2.50 deg/h, 2.00 deg, 'a', 25% of 2.5"
    assert words(**figures | {"axis": "y", "share": 0.5}) == "{so} y: 2.50 deg/h, 2.00 deg, 'a', 50% of 2.5"


def test_a_field_without_a_figure_is_refused(words):
    with pytest.raises(KeyError, match="axis"):
        words(size=1.0)


def test_each_language_has_templates_of_its_own():
    item = Evidence("heading.known", {"sigma": 1e-3, "floor": 5e-4})
    english = wording.sentence(item)
    with in_language("zh"):
        chinese = wording.sentence(item)
    assert chinese != english
    assert wording.sentence(item) == english
