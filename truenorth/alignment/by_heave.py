"""What the level force says against the gyros of a base that sways, weighed by its slow vertical velocity.

Late, scaled and exchanged gyros are read from gravity as it swings, and a sea that pushes the base in step with its tilt looks
like each of them. The vertical (:mod:`truenorth.alignment.heave`) has no such push. A reading of the gyros that it makes less
likely than the one given, by more than chance does, is none: the accusation falls. One that the whole log has tried, against a
push in step with the tilt, falls where the vertical says more against it than that has gained: attitude and arm are not fitted
anew here, and a true scale of 10 % was 24 less likely, where the log was 4300 likelier with it (39 sigmas of level, in
silence). A delay that the vertical shows beyond chance is one, though the level force may show another, or none, as a push has
hidden it. And where the level force shows a delay, and the vertical that it is smaller, what it may be is the vertical's
figure.

Where the vertical shows nothing slow, or cannot tell, all stays as it was said.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from truenorth.alignment.heave import Delay, Heave
from truenorth.alignment.late_gyros import turned_by
from truenorth.records import ImuRecord
from truenorth.records.interpolation import gyros_behind
from truenorth.state.evidence import Effect, Evidence, Kind
from truenorth.state.limits import limit, may_be_chance

Array = NDArray[np.float64]
Reading = Callable[[ImuRecord], ImuRecord]

LATE, EARLY = ("tilt.gyros_late", "response.gyros_late"), ("tilt.gyros_early", "response.gyros_early")


def weighed_by_heave(heave: Heave | None, evidence: Sequence[Evidence], record: ImuRecord) -> list[Evidence]:
    """The evidence without what the vertical contradicts, and with what it shows of the gyros' clock.

    Parameters
    ----------
    heave : Heave or None
    evidence : sequence of Evidence
        Of a base that sways.
    record : ImuRecord
        Whose turns a delay makes tilts of.
    """
    if heave is None or heave.delay is None:
        return list(evidence)
    delay = heave.delay
    against = {key: min(_against(heave, read) for read in reads) for key, reads in _readings(evidence)}
    stays = [item for item in evidence if against.get(item.key, 0.0) <= max(limit("hint"), _gained(item))]
    others = [item for item in stays if item.key not in LATE + EARLY]
    clocks = [item for item in evidence if item.key in LATE + EARLY]
    effect = turned_by(delay.rms, record)
    if delay.ratio <= limit("hint"):
        return others + [_no_more(item, effect, excluded(heave, _put_right(item))) for item in clocks]
    sure = [item for item in clocks if item.kind != "hint" and not excluded(heave, _put_right(item))]
    return [*others, *sure, _shown(delay, effect)]


def excluded(heave: Heave, read: Reading) -> bool:
    """Whether the vertical makes a reading less likely than the gyros as given, by more than chance does."""
    return _against(heave, read) > limit("hint")


def _against(heave: Heave, read: Reading) -> float:
    """By how much the vertical makes a reading less likely than the gyros as given: twice the logarithm of the ratio."""
    return heave.misfit(read) - heave.misfit()


def _gained(item: Evidence) -> float:
    """By how much the whole log is likelier with the gyros put right (:mod:`~truenorth.alignment.gyro_matrix`); else zero."""
    return float(item.figures.get("ratio", 0.0)) if item.key.startswith("tilt.") else 0.0


def scaled(scale: Array) -> Reading:
    """Gyros whose scale factors are off by (3,), put right."""
    return lambda record: replace(record, gyro=record.gyro / (1.0 + scale))


def columns(names: str) -> Reading:
    """Gyros whose columns x, y, z hold the axes of these names, such as ``+y +x +z``."""

    def read(record: ImuRecord) -> ImuRecord:
        gyro = np.empty_like(record.gyro)
        for column, name in enumerate(names.split()):
            gyro[:, "xyz".index(name[1])] = float(f"{name[0]}1") * record.gyro[:, column]
        return replace(record, gyro=gyro)

    return read


def _readings(evidence: Sequence[Evidence]) -> list[tuple[str, list[Reading]]]:
    """Another order of the gyros and other scale factors, where the evidence has them: what it is of, and the gyros put right.

    A push may add to a scale factor that is there. So half of it must be excluded, too.
    """
    found = [(item.key, [columns(str(item.figures["axes"]))]) for item in evidence if item.key == "tilt.axes"]
    scale = np.zeros(3)
    for item in evidence:
        if item.key == "tilt.scale":  # fitted together, they stand or fall together
            scale["xyz".index(str(item.figures["axis"]))] = float(item.figures["scale"])
    return [*found, ("tilt.scale", [scaled(0.5 * scale), scaled(scale)])] if scale.any() else found


def _put_right(item: Evidence) -> Reading:
    late = float(item.figures["delay"]) * (1.0 if item.key in LATE else -1.0)
    return lambda record: gyros_behind(record, -late)


def _no_more(item: Evidence, effect: Effect, false: bool) -> Evidence:
    """A delay that the level force shows, with no more of an effect than the vertical allows where that tells."""
    if (false or item.kind == "hint") and effect.level < item.effect.level:
        return replace(item, kind="hint", effect=effect)
    return item


def _shown(delay: Delay, effect: Effect) -> Evidence:
    certain = not may_be_chance(delay.ratio) and abs(delay.size) >= limit("late sensor")
    kind: Kind = "bounded" if certain else "hint"
    figures = {
        "delay": delay.size,
        "sigma": delay.sigma,
        "ratio": delay.ratio,
        "chance": limit("hint"),
        "heading": effect.heading,
        "level": effect.level,
    }
    return Evidence("heave.delay", figures, kind, effect, ("common_clock",))
