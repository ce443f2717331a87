"""The page of a simulated run: what it shows of truth and logs, in which units."""

import numpy as np
import pytest

from truenorth.simulation.scenario import read_scenario, shipped


def page(name, duration):
    scenario = read_scenario(name).model_copy(update={"duration": duration})
    return scenario.simulate().plot(title=name, aiding=scenario.simulate_aiding())


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped())
def test_every_scenario_has_its_page(name, tmp_path):
    figure = page(name, 60.0)
    figure.savefig(tmp_path / "page.png")
    labels = {ax.get_title(loc="left") or ax.get_title(): ax.get_ylabel() for ax in figure.axes}
    assert next(iter(labels)).startswith("Track of the IMU, from ")
    far = name in ("transfer_flat_turn", "transfer_release")  # 12 km in a minute
    assert list(labels.values()) == ["north, km" if far else "north, m", "m/s", "m", "deg", "deg", "deg/s", "g"]
    drawn = {text.get_text() for ax in figure.axes if ax.get_legend() for text in ax.get_legend().get_texts()}
    assert drawn >= {key.replace("_", " ") for key in read_scenario(name).aiding_specs}


def test_angles_that_go_round_draw_no_line_across():
    """An IMU that spins about two axes: heading and roll come in again on the other side."""
    *_, heading, tilt, _, _ = page("rotary_ship", 120.0).axes
    for line in (heading.lines[0], next(x for x in tilt.lines if x.get_label() == "roll")):
        values = np.asarray(line.get_ydata(), dtype=float)
        assert np.isnan(values).any()
        assert np.nanmax(np.abs(np.diff(values))) < 180.0


def test_dots_of_aiding_are_legible_in_the_legend():
    track, speed, *_ = page("van", 60.0).axes
    for ax, label in ((track, "gnss"), (speed, "odometer")):
        legend = ax.get_legend()
        texts = [text.get_text() for text in legend.get_texts()]
        assert legend.legend_handles[texts.index(label)].get_markersize() == 9
        assert next(line for line in ax.lines if line.get_label() == label).get_markersize() < 4
