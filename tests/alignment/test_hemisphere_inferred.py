"""The other hemisphere, where the noise of the gyros is inferred from the log and may be too small."""

import numpy as np
import pytest

import truenorth
from truenorth.alignment import hemisphere
from truenorth.campaign.fault_benches import BENCHES


def drawn(seed, run):
    return BENCHES["unspecified"].draw(seed, run)[0]


def test_a_noise_that_is_too_small_by_chance_turns_no_place_round(monkeypatch):
    """This log was refused, with a ratio of 19, by a noise a fifth of the true one."""
    inputs, ratios = drawn(70219, 30), []
    of_any = hemisphere._of_any_noise

    def asked(fine, z):
        ratios.append(of_any(fine, z))
        return ratios[-1]

    monkeypatch.setattr(hemisphere, "_of_any_noise", asked)
    answer = truenorth.align(inputs["record"], inputs["place"])
    assert answer.status == "aligned", answer.reasons
    own, other = ratios
    assert 5.0 < own - other < 15.0  # as it is: 19


@pytest.mark.parametrize("run", [0, 1])
def test_a_noise_as_inferred_gives_the_ratio_of_the_signature(run, monkeypatch):
    """With nothing to choose from, both ways to the ratio agree."""
    inputs, found = drawn(70219, 30 + run), []
    matched = hemisphere.hemisphere_evidence

    def both(match, fine, position, *rest, **more):
        ratio, size = float(match.ratio[0]), float(match.size[0])
        z, off = fine.system.z, hemisphere.hemisphere_signature(fine, position).measured_course[..., 0]
        found.append(
            (
                ratio / size * (2.0 - 1.0 / size),
                hemisphere._of_any_noise(fine, z) - hemisphere._of_any_noise(fine, z - off),
            )
        )
        return matched(match, fine, position, *rest, **more)

    monkeypatch.setattr(hemisphere, "WALKS", np.zeros(1))
    monkeypatch.setattr("truenorth.alignment.signatures.hemisphere_evidence", both)
    truenorth.align(inputs["record"], inputs["place"])
    np.testing.assert_allclose(*found[-1], atol=1e-3)  # of some 9000 each
