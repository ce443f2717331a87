"""A latitude of the wrong sign: gravity bends the other way, which a base that sways does not hide."""

import pytest

from tests.runs import some
from truenorth.campaign.fault_benches import BENCHES
from truenorth.core.position import Position


@pytest.mark.slow
@pytest.mark.parametrize(("bench", "run"), some([("swaying", 1), ("rotary", 0)], [("swaying", 2), ("rotary", 4)]))
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
