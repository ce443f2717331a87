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
from truenorth.estimate.poorer import FACTORS, poorer
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import contradiction

LED_AWAY = "innovations.step"  # evidence that a receiver is
CLOCKS = ("second_look.late", "second_look.early", "delay.gyros_")  # evidence of them


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
    # A receiver that is led away is none of the IMU's, though a poorer one would follow it.
    spoken = [item.key for item in answer.evidence if item.kind != "note" and item.key != LED_AWAY]
    if axes or not any(key.startswith("innovations.") for key in spoken):
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
