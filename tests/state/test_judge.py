"""Laws of the judge: what has no effect never changes a status, what is larger than sigma always does, more is never better."""

import math
import string
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from truenorth.state.english import SENTENCES
from truenorth.state.evidence import ANY_EFFECT, NO_EFFECT, OUTPUTS, Effect, Evidence, contradiction, note
from truenorth.state.judge import Claim, judge, weight
from truenorth.state.limits import limit
from truenorth.state.remedies import REMEDIES
from truenorth.state.titles import TITLES
from truenorth.state.wording import angle, headline, sentence

RANK = {"good": 0, "level_only": 1, "not_converged": 2, "not_observable": 2, "inconsistent": 3}
sizes = st.one_of(st.just(0.0), st.floats(1e-9, 1e3), st.just(math.inf))
sigmas = st.one_of(st.floats(1e-7, 1e2), st.just(math.inf))
effects = st.builds(Effect, sizes, sizes, sizes, sizes)
claims = st.builds(
    Claim,
    sigma=st.builds(Effect, sigmas, st.floats(1e-7, 0.04), sigmas, sigmas),
    heading_limit=st.one_of(st.floats(1e-3, 1.0), st.just(math.inf)),
    floor=st.floats(0.0, 0.5),
    waiting=st.booleans(),
    hidden=st.booleans(),
    able=st.booleans(),
)
items = st.builds(
    Evidence,
    key=st.just("text"),
    figures=st.just({"text": "seen"}),
    kind=st.sampled_from(["hint", "known", "bounded", "unknown"]),
    effect=effects,
)


@given(claims, st.lists(items, max_size=4))
def test_what_has_no_effect_changes_nothing(claim, evidence):
    """A note, and evidence of any kind whose effect is zero."""
    before = judge(claim, evidence)
    for kind in ("note", "hint", "known", "bounded", "unknown"):
        after = judge(claim, [*evidence, Evidence("text", {"text": ""}, kind, NO_EFFECT)])
        assert (after.finding, after.sigma, after.added) == (before.finding, before.sigma, before.added)
    assert judge(claim, [*evidence, Evidence("text", {"text": ""}, "note", ANY_EFFECT)]).finding == before.finding


@given(claims, items)
def test_what_is_larger_than_sigma_is_flagged_or_in_sigma(claim, item):
    """Of every output that is given, the sigma at the end covers each effect, or the result is inconsistent."""
    verdict = judge(claim, [item])
    if verdict.finding == "inconsistent":
        return
    for name in OUTPUTS:
        effect, sigma = getattr(item.effect, name), getattr(claim.sigma, name)
        refused = name == "heading" and sigma > claim.heading_limit
        if not refused and math.isfinite(sigma):
            assert effect <= max(getattr(verdict.sigma, name), limit("negligible") * sigma) * (1 + 1e-12)


@given(claims, items, st.sampled_from(OUTPUTS))
def test_a_bound_larger_than_sigma_always_flags(claim, item, name):
    claim = replace(claim, sigma=replace(claim.sigma, **{name: 1e-4}), heading_limit=1.0)
    item = replace(item, kind="bounded", effect=replace(item.effect, **{name: 1.01e-4}))
    assert judge(claim, [item]).finding == "inconsistent"


@given(claims, st.lists(items, max_size=4), items)
def test_more_evidence_is_never_better(claim, evidence, item):
    assert RANK[judge(claim, [*evidence, item]).finding] >= RANK[judge(claim, evidence).finding]


@given(claims, items, st.floats(1.0, 100.0))
def test_a_larger_effect_is_never_better(claim, item, factor):
    larger = replace(item, effect=Effect(*(factor * size for _, size in item.effect.items())))
    small, large = judge(claim, [item]), judge(claim, [larger])
    assert RANK[large.finding] >= RANK[small.finding]
    if large.finding != "inconsistent":
        assert all(b >= a for (_, a), (_, b) in zip(small.sigma.items(), large.sigma.items(), strict=True))


@given(claims)
def test_contradictions_of_unknown_size_are_inconsistent(claim):
    verdict = judge(claim, [note("text", text=""), contradiction("text", text="")])
    assert verdict.finding == "inconsistent"
    assert verdict.evidence[0].kind == "unknown"  # what decides stands first


def test_what_is_added_is_in_sigma():
    claim = Claim(Effect(3e-3, 1e-4, math.inf, math.inf), heading_limit=0.1)
    verdict = judge(claim, [Evidence("text", {}, "known", Effect(heading=4e-3))])
    assert (verdict.finding, verdict.sigma.heading, verdict.sigma.level) == ("good", pytest.approx(5e-3), 1e-4)


@given(claims, items)
def test_what_chance_may_have_shown_refuses_nothing(claim, item):
    """However large: its effect is in sigma, which may then be too large to be of use."""
    item = replace(
        item, kind="hint", effect=Effect(*(size if math.isfinite(size) else 0.0 for _, size in item.effect.items()))
    )
    verdict = judge(claim, [item])
    assert verdict.finding != "inconsistent"
    for name in OUTPUTS:
        assert getattr(verdict.sigma, name) >= getattr(claim.sigma, name)


def test_what_two_checks_have_found_is_said_once():
    """A step of 1.3 mm/s stood in a result twice, with the ratio of each check."""
    found = {"axis": "east", "velocity": 1e-3, "heading": 0.0, "level": 0.0, "chance": 12.0}
    twice = [Evidence("drift.step", found | {"onset": 75.2, "ratio": r}, "hint", Effect()) for r in (102.0, 148.0)]
    later = Evidence("drift.step", found | {"onset": 90.0, "ratio": 30.0}, "hint", Effect())
    claim = Claim(Effect(heading=1e-3, level=1e-4))
    assert judge(claim, [*twice, later]).evidence == (twice[1], later)


def test_a_sigma_that_grows_beyond_its_limit_is_no_good():
    claim = Claim(Effect(3e-3, 1e-4, math.inf, math.inf), heading_limit=4e-3, waiting=False)
    assert judge(claim, []).finding == "good"
    assert judge(claim, [Evidence("text", {}, "known", Effect(heading=4e-3))]).finding == "level_only"


def test_an_output_that_is_refused_is_not_made_wrong():
    claim = Claim(Effect(1.0, 1e-4, math.inf, math.inf), heading_limit=0.1, floor=1.0)
    item = contradiction("text", effect=Effect(heading=math.inf), text="")
    assert judge(claim, [item]).finding == "level_only"
    assert judge(replace(claim, able=True), [item]).finding == "inconsistent"  # it is missed, and that is why


@given(effects)
def test_the_weight_is_the_largest_share_of_sigma(effect):
    sigma = Effect(1e-3, 1e-4, 0.1, math.inf)
    shares = [e / s for (_, e), (_, s) in zip(effect.items(), sigma.items(), strict=True) if math.isfinite(s)]
    assert weight(effect, sigma) == max(shares)


# ------------------------------------------------------------------------------------------------------------ words


def test_english_names_no_option():
    """Options stand in the command line's table alone."""
    assert not any("--" in text for table in (TITLES, SENTENCES, REMEDIES) for text in table.values())


def test_the_command_line_offers_remedies_that_exist():
    from truenorth.cli.remedies import OPTIONS

    assert OPTIONS.keys() <= REMEDIES.keys()


def test_templates_are_sound():
    """Each field has a name, so that another language may order them otherwise."""
    for text in (*SENTENCES.values(), *REMEDIES.values()):
        assert all(name for _, name, _, _ in string.Formatter().parse(text) if name is not None)


def test_figures_are_shown_in_their_units():
    item = Evidence(
        "rate.misses",
        {"axis": "north", "residual": 4.848e-6, "allowed": 4.848e-8, "imu": "preset"},
        "bounded",
        Effect(heading=0.1),
        ("latitude", "units"),
    )
    text = sentence(item, {"latitude": "--lat"})
    assert "along north misses the earth's by 1 deg/h" in text
    assert "allows 0.01 deg/h: check the latitude (--lat); check the units" in text
    assert item.to_dict()["effect"] == {"heading": 0.1}
    assert headline("inconsistent", (item,)) == "The gyros contradict the place or their specification"
    assert headline("aligned", (item,)) == "Aligned"


def test_no_effect_is_larger_than_half_a_turn():
    """What a linear model makes of a large error, such as "heading moves by 4156.11 deg", is no angle."""
    degrees = [0.004, 0.4, 0.6, 179.0, 181.0, 4156.11, math.inf]
    assert [angle(math.radians(x)) for x in degrees] == [
        "0.24 arcmin",
        "24.00 arcmin",
        "0.60 deg",
        "179.00 deg",
        *3 * ["more than 180 deg"],
    ]
