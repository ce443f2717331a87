"""Related work: late rows taken at their own time, and a flight whose turn comes after the release."""

import numpy as np

from truenorth.papers.related.in_flight import RELEASE, scenarios
from truenorth.papers.related.lag_fusion import one
from truenorth.simulation.scenario import read_scenario


def test_a_late_row_at_its_own_time_is_as_good_as_one_in_time():
    """To the bit but for rows still on their way, which cost a little in real time; a lag that is ignored is seen at once."""
    late = read_scenario("late_sensors")
    content = late.to_mapping()
    prompt = read_scenario(
        {**content, **{name: {**content[name], "latency": "0 s"} for name in ("odometer", "gnss")}, "duration": "60 s"}
    )
    late = read_scenario({**content, "duration": "60 s"})
    found = one(late, prompt, seed=1, run=0)
    np.testing.assert_allclose(found["own_time"][0][:58], found["in_time"][0][:58], atol=1e-9)
    real, later = found["real_time"], found["own_time"]
    np.testing.assert_allclose(real[0][-1], later[0][-1], atol=1e-9)  # at the end both have the same rows
    assert np.abs(real[0][:58, :2] - later[0][:58, :2]).max() > 0.01
    assert np.all(real[1][5:58] > later[1][5:58])
    speed, lag = 10.0, 0.6
    assert np.abs(found["ignored"][0][40:, :2]).max() > 0.3 * speed * lag


def test_straight_flight_and_manoeuvres_differ_before_the_release_alone():
    turns = {}
    for name, scenario in scenarios().items():
        t = np.arange(1.0, scenario.duration)
        turning = np.linalg.norm(scenario.build_motion().states(t).w_ib_b, axis=1) > 0.02
        turns[name] = turning[t < RELEASE].any(), turning[t > RELEASE].any()
    assert turns == {"manoeuvres": (True, True), "straight": (False, True)}
