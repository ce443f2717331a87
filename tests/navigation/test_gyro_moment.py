"""Gyros of another moment are held against a run that fits: a delay of the receiver that spoils it is none."""

from dataclasses import replace

import pytest

import truenorth as tn
from truenorth.aiding.aids import Gnss
from truenorth.navigation import gyro_moment
from truenorth.simulation.scenario import read_scenario

WRONG = -3.0  # s: what a state that is linear in the delay made of a crane's turns
SHARE = 0.2  # of the measurements


@pytest.mark.slow
def test_a_delay_that_spoils_the_run_is_not_taken(monkeypatch) -> None:
    van = read_scenario({**read_scenario("van").to_mapping(), "duration": "120 s"})
    driven, logs = van.simulate(run=0), van.simulate_aiding(run=0)
    gnss = Gnss(logs["gnss"].record)
    start = tn.align(driven.record.between(None, 70.0), imu="industrial", aid=gnss)
    held = []

    def mistaken(plan, given, track):
        found = given["gnss"]
        return {**given, "gnss": replace(found, mounting=replace(found.mounting, latency=WRONG, latency_sigma=0.01))}

    def against(run, first, record):
        held.extend([first, run(record)])
        return []

    monkeypatch.setattr(gyro_moment, "delayed", mistaken)
    monkeypatch.setattr(gyro_moment, "gyro_delay_evidence", against)
    assert tn.navigate(driven.record, start, aid=gnss).status == "navigated"
    assert len(held) == 2, "the run that fits, and what rivals are run with"
    for track in held:
        assert all(r.rejected <= SHARE * len(r.time) for r in track.residuals)
