"""What rejected measurements make one look at first: the place, the height, the sensor, or the IMU's specification."""

import numpy as np
import pytest

from truenorth.quality.innovations import innovation_evidence
from truenorth.state.evidence import Effect
from truenorth.state.track import Residuals

N = 100
SIGMA = Effect(heading=1e-3, level=1e-4, velocity=0.1, position=1.0)


def source(name, offset, unit="m/s", scatter=0.5):
    """Innovations about an offset; all rejected where there is one."""
    noise = scatter * np.random.default_rng(1).standard_normal((N, 3))
    used = np.full(N, not np.any(offset))
    time = np.arange(float(N))
    return Residuals(
        name, time, noise + offset, np.full((N, 3), scatter), np.full(N, 3.0), used, 0, time, ~used & False, unit
    )


@pytest.mark.parametrize(
    ("offset", "key", "remedies"),
    [
        ([150.0, 20.0, 0.0], "innovations.elsewhere", ("place",)),
        ([0.0, 0.0, -100.0], "innovations.height", ("height",)),
        ([0.0, 1.0, 0.0], "innovations.rejected", ("source", "specification")),  # no more than it scatters
    ],
)
def test_fixes_that_are_all_off_alike(offset, key, remedies):
    found = innovation_evidence([source("GNSS position", offset, "m")], SIGMA)
    assert (found[0].key, found[0].remedies) == (key, remedies)
    if key != "innovations.rejected":
        assert found[0].figures["distance"] == pytest.approx(np.linalg.norm(offset), rel=0.02)


def test_where_rest_contradicts_the_track_so_does_the_imu():
    """A zero velocity has no axes, unit, clock or lever arm that could be wrong."""
    sources = [source("zero velocity", [3.0, 0.0, 0.0]), source("odometer", [9.0, 0.0, 0.0])]
    assert [item.remedies for item in innovation_evidence(sources, SIGMA)] == [
        ("specification",),
        ("specification", "source"),
    ]
    sound = [source("zero velocity", [0.0, 0.0, 0.0]), sources[1]]
    rejected = [item for item in innovation_evidence(sound, SIGMA) if item.key == "innovations.rejected"]
    assert [item.remedies for item in rejected] == [("source", "specification")]
