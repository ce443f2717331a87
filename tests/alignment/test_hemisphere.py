"""A latitude of the wrong sign: gravity bends the other way, which a base that sways does not hide."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.alignment.test_bias_step import PLACE, ship
from truenorth.alignment import align, rotary, signatures
from truenorth.alignment.hemisphere import hemisphere_evidence, hemisphere_signature
from truenorth.alignment.matched import innovations_of, whitened
from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.position import Position
from truenorth.filters.gains import through
from truenorth.simulation import rest, simulate
from truenorth.state.limits import limit


@pytest.mark.slow
@pytest.mark.parametrize(("bench", "run"), [("swaying", 1), ("rotary", 0), ("swaying", 2), ("rotary", 4)])
def test_the_other_hemisphere_is_named_and_the_right_one_is_not(bench, run):
    """Of 10 draws of each the ratios were -20 to -180 at the right latitude, 22 to 160 at the wrong one."""
    inputs, _ = BENCHES[bench].draw(8301, run)
    place = inputs["place"]
    sound = BENCHES[bench].align(inputs)
    assert sound.status == "aligned"
    wrong = BENCHES[bench].align(inputs | {"place": Position(-place.lat, place.lon, place.alt)})
    assert wrong.status == "inconsistent"
    assert any("other hemisphere" in reason for reason in wrong.reasons)
    assert not any("other hemisphere" in reason for reason in sound.reasons)


def test_aligning_anew_is_asked_where_the_bend_can_be_seen():
    """Fits of a motion end some tens short of the likeliest: 85 where a third of a sigma of the bend is seen says nothing."""
    place, fine = Position.from_degrees(46.5, 10.0), SimpleNamespace(form="velocity")
    for ratio, size, asked in ((0.9, 2.56, False), (10.0, 0.7, True)):
        match = SimpleNamespace(ratio=[ratio], size=[size])
        found = hemisphere_evidence(match, fine, place, lambda where: 85.0 * (where.lat > 0.0))
        assert [item.key for item in found] == ["place.hemisphere"] * asked


@pytest.mark.parametrize("lat", [5.0, -30.0])
def test_of_hours_at_rest_the_bend_is_what_the_innovations_hold_of_it(lat, monkeypatch):
    """Gravity bends by 1.8 km/s at 5 deg in 3 h, of which the filter leaves .7 sigmas; a sum lost them, and the size was 2e298."""
    place, kept = Position.from_degrees(lat, 10.0), []
    of = signatures.hemisphere_evidence

    def keep(match, fine, *rest, **more):
        kept.append((match, fine))
        return of(match, fine, *rest, **more)

    monkeypatch.setattr(signatures, "hemisphere_evidence", keep)
    log = simulate(rest(place, heading=1.0), rate=2.0, duration=3 * 3600.0, imu="tactical", seed=70317).record
    assert "other hemisphere" not in str(align(log, place, "tactical").reasons)
    (match, fine), *_ = kept
    seen = innovations_of(fine)
    made = whitened(seen.L, through(fine.gains, hemisphere_signature(fine, place).measured_course)[0])[..., 0]
    energy, agree = np.sum(made**2), np.sum(made * seen.white[..., 0])
    np.testing.assert_allclose([match.ratio[0], match.size[0]], [agree**2 / energy, agree / energy], rtol=1e-6)
    assert abs(match.size[0]) < 5.0 / np.sqrt(energy)


@pytest.fixture(scope="module")
def hidden():
    """An indexer whose fitted motion takes up a part of the bend: answers in both hemispheres, their filters, and for each of
    these how well both places fit."""
    inputs, _ = BENCHES["rotary"].draw(90411, 1)
    here, kept, of = inputs["place"], [], rotary.what_begins

    def keep(fine, *rest, **more):
        kept.append(fine)
        return of(fine, *rest, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rotary, "what_begins", keep)
        places = here, replace(here, lat=-here.lat)
        answers = [BENCHES["rotary"].align(inputs | {"place": place}) for place in places]
    return answers, kept, [[fine.misfit_at(place) for place in places] for fine in kept]


@pytest.mark.slow
def test_a_bend_that_a_fitted_motion_hides_is_found_by_aligning_anew(hidden):
    """Once silent: 15 sigmas of heading, by a ratio of 10 of the bend alone."""
    (sound, wrong), _, _ = hidden
    assert sound.status == "aligned"
    assert any("other hemisphere" in reason for reason in wrong.reasons)


@pytest.mark.parametrize(
    ("gained", "key", "urgent"),
    [(2.0, None, False), (25.0, "place.hemisphere_in_doubt", True), (100.0, "place.hemisphere", False)],
)
def test_a_ratio_that_fitted_motions_reach_by_chance_is_a_warning(gained, key, urgent):
    """25 of a motion that is fitted anew: not silent, nor refused; 100 is the other hemisphere."""
    match = SimpleNamespace(ratio=[12.0], size=[1.0])
    misfit = {PLACE.lat: gained, -PLACE.lat: 0.0}
    found = hemisphere_evidence(match, None, PLACE, lambda place: misfit[place.lat])
    assert [item.key for item in found] == ([key] if key else [])
    assert [item.urgent for item in found] == ([urgent] if key else [])


@pytest.mark.slow
def test_axes_of_a_swaying_imu_are_no_other_hemisphere():
    """Taken for perfect they made it likelier by 20 (twice the logarithm) where this ship is; as states by nothing."""
    record, spec = ship(5)
    answer = align(record, PLACE, spec)
    assert answer.status == "aligned"
    assert not any("hemisphere" in item.key for item in answer.evidence)


@pytest.mark.slow
def test_how_well_a_place_fits_depends_on_no_place_that_was_given(hidden):
    """A log has one likelihood in each hemisphere, whichever the answer was made in: the ratio changes its sign with the place."""
    _, _, ((here, there), by_the_other) = hidden
    np.testing.assert_allclose(by_the_other, [here, there], rtol=1e-9)
    assert there - here > limit("hemisphere refitted")


@pytest.mark.slow
def test_the_motion_is_fitted_until_it_settles(hidden):
    """Another place is compared with fits that gain no more: a log is as likely by them as by the answer, or likelier (70 here)."""
    _, fits, misfits = hidden
    for number, fine in enumerate(fits):
        assert misfits[number][number] <= -2.0 * float(fine.estimates.log_likelihood)
