"""Is it the specification that the measurements contradict? The same log once more with poorer IMUs.

A class of IMU that is too good makes the filter follow its gyros where it should follow the measurements: these are rejected by the
thousand, and seem to be at fault. Where an IMU some times poorer is contradicted no more, the specification is; but it is no
suspect where a clock is found to be, that of the receiver or of the gyros, or axes are: a poorer IMU would cover it as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from truenorth.alignment.result import Alignment
from truenorth.core.errors import AlignmentError, DataError
from truenorth.estimate.rivals import likelihood_ratio, moved, rival
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, contradiction
from truenorth.state.limits import limit
from truenorth.state.track import Track

FACTORS = (3.0, 10.0, 30.0, 100.0)  # classes of IMUs lie up to a hundred times apart
CLOCKS = ("second_look.late", "second_look.early", "delay.gyros_")  # evidence of them
FIELDS = ("bias", "turn_on_bias", "random_walk", "bias_instability", "rate_random_walk", "scale_factor", "misalignment")


def poorer(spec: ImuSpec, factor: float) -> ImuSpec:
    """A specification all of whose errors are so many times as large."""
    names = [f"{sensor}_{field}" for sensor in ("gyro", "accel") for field in FIELDS]
    return replace(spec, **{name: factor * getattr(spec, name) for name in names})


def poorer_evidence(run: Callable[[ImuSpec], Track], first: Track, spec: ImuSpec) -> list[Evidence]:
    """Whether a poorer IMU fits the measurements as well, and by what the answer moves with it.

    Measurements rule it out by far where the specification is right (ratios of -60 and less for a drive of four minutes): errors
    three times as large would have shown.

    Parameters
    ----------
    run : callable
        The same log with another specification.
    first : track
        Of the specification itself.
    spec : ImuSpec
    """
    found = []
    for factor in FACTORS:
        try:
            other = run(poorer(spec, factor))
        except DataError:  # the filter broke down: no explanation
            break
        ratio = likelihood_ratio(first.residuals, other.residuals)
        if ratio < -limit("ruled out"):
            break
        found.append(rival("rival.poorer", {"factor": factor}, ratio, moved(first, other), "specification"))
    return sorted(found, key=lambda item: item.effect.level)[-1:]


def name_specification(answer: Alignment, again: Callable[[ImuSpec], Alignment]) -> Alignment:
    """The answer, its specification named as the first suspect where a poorer one is contradicted no more.

    Parameters
    ----------
    answer : Alignment
    again : callable
        The same log with another specification.
    """
    if answer.status != "inconsistent":
        return answer
    clocks = [item for name in CLOCKS for item in answer.evidence if item.key.startswith(name)]
    if clocks:
        return replace(answer, evidence=(*clocks, *(item for item in answer.evidence if item not in clocks)))
    axes = any("imu_axes" in item.remedies for item in answer.evidence if item.key == "bias.accel")
    if axes or not any(item.key.startswith("innovations.") for item in answer.evidence):
        return answer
    for factor in FACTORS:
        try:
            other = again(poorer(answer.imu, factor))
        except (AlignmentError, DataError):
            continue
        if other.status != "inconsistent":
            suspect = contradiction("specification.suspect", "specification", factor=factor, imu=answer.imu_source)
            rest = (replace(item, remedies=()) if item.kind == "unknown" else item for item in answer.evidence)
            return replace(answer, evidence=(suspect, *rest))
    return answer
