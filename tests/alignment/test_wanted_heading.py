"""What a heading that is not known as well as wanted says of more time: nothing that the log contradicts."""

from dataclasses import replace

import numpy as np

from truenorth.alignment import align
from truenorth.alignment.verdict import judged
from truenorth.core.position import Position
from truenorth.records.specs import imu_spec
from truenorth.simulation import rest, simulate
from truenorth.state.evidence import Effect, Evidence

PLACE, WANTED = Position.from_degrees(45.0, 9.0, 100.0), np.radians(5.0)


def test_more_time_is_promised_only_where_it_helps():
    """Before: 300 s of log were "about 48 s in all would bring it near its floor: record longer", with a floor of 13.9 deg."""
    spec = imu_spec("navigation")
    record = simulate(rest(PLACE, 0.5), imu=spec, rate=20.0, duration=60.0, seed=2).record
    answer = replace(align(record, PLACE, spec), evidence=())
    P = answer.phi_covariance.copy()
    P[2, 2] = (1.2 * WANTED) ** 2
    early = judged(replace(answer, phi_covariance=P, pays_until=20.0), [], WANTED)
    later = judged(replace(answer, phi_covariance=P, pays_until=200.0), [], WANTED)
    assert [a.evidence[0].key for a in (early, later)] == ["heading.short", "heading.short_until"]
    figures = {
        "axis": "east",
        "onset": 30.0,
        "velocity": 0.1,
        "ratio": 14.0,
        "chance": 12.0,
        "heading": 0.25,
        "level": 0.0,
    }
    hint = Evidence("drift.ramp", figures, "hint", Effect(heading=0.25), remedies=("still_part",))
    hinted = judged(replace(answer, pays_until=20.0), [hint], WANTED)
    assert hinted.status == "not_converged"
    assert not any("record longer" in reason or "in all" in reason for reason in hinted.reasons), hinted.reasons
