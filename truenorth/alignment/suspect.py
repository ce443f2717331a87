"""Is it the specification that the measurements contradict? The same log once more with poorer IMUs.

A class of IMU that is too good makes the filter follow its gyros where it should follow the measurements: these are rejected by the
thousand, and seem to be at fault. Where an IMU some times poorer is contradicted no more, the specification is; but it is no
suspect where a clock is found to be, that of the receiver or of the gyros, or axes are: a poorer IMU would cover it as well.

White noise is another matter: it stands in the rows themselves, whatever they are fitted to. A vehicle that vibrates faster than
its rows show makes sensors noisier than they are at rest, and their biases no larger. Where rows are noisier than the
specification says and the log is contradicted no more with their own noise, that is the answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from truenorth.alignment.result import Alignment
from truenorth.core.errors import AlignmentError, DataError
from truenorth.estimate.poorer import FACTORS, poorer
from truenorth.quality.density import with_noise_of
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import contradiction, note

LED_AWAY = "innovations.step"
CLOCKS = ("second_look.late", "second_look.early", "delay.gyros_")  # evidence of them


def as_noisy_as_its_rows(answer: Alignment, record: ImuRecord, again: Callable[[ImuSpec], Alignment]) -> Alignment:
    """The answer by the white noise that the rows show, where the specification's contradicts the log and theirs does not.

    Parameters
    ----------
    answer : Alignment
    record : ImuRecord
        Of the log.
    again : callable
        The same log with another specification.
    """
    if answer.status != "inconsistent":
        return answer
    noisier = with_noise_of(record, answer.imu)
    if noisier is answer.imu:
        return answer
    try:
        other = again(noisier)
    except (AlignmentError, DataError):
        return answer
    if other.status == "inconsistent":
        return answer
    gyro = noisier.gyro_random_walk / answer.imu.gyro_random_walk
    accel = noisier.accel_random_walk / answer.imu.accel_random_walk
    said = note("specification.noisier", gyro=gyro, accel=accel, imu=answer.imu_source)
    return replace(other, evidence=(said, *other.evidence))


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
