"""A log whose rows are far noisier than the specification says: by the noise of its rows, where theirs is contradicted no more.

White noise stands in the rows themselves, whatever they are fitted to. A vehicle that vibrates faster than its rows show makes
sensors noisier than they are at rest, and their biases no larger: it is neither a poorer IMU nor a bias that wanders, which the
same log would be taken for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeVar, cast

from truenorth.core.errors import AlignmentError, DataError
from truenorth.quality.density import with_noise_of
from truenorth.records import ImuRecord
from truenorth.records.specs import ImuSpec
from truenorth.state.evidence import Evidence, Figure


class Judged(Protocol):
    """An alignment or a navigation with its verdict."""

    @property
    def status(self) -> str:
        """Of it."""
        ...

    @property
    def evidence(self) -> Sequence[Evidence]:
        """What its checks saw."""
        ...

    @property
    def imu_source(self) -> str:
        """Where the specification came from."""
        ...


Answer = TypeVar("Answer", bound=Judged)
AT_REST = "innovations.at_rest"  # of a vehicle that stands and a receiver that moves: no noise does that


def as_noisy_as_its_rows(
    answer: Answer, record: ImuRecord, spec: ImuSpec, again: Callable[[ImuSpec], Answer]
) -> Answer:
    """The answer by the white noise that the rows show, where the specification's contradicts the log and theirs does not.

    Parameters
    ----------
    answer : Alignment or Navigation
    record : ImuRecord
        Of the log.
    spec : ImuSpec
        By which it was found.
    again : callable
        The same log with another specification.
    """
    if answer.status != "inconsistent" or (noisier := with_noise_of(record, spec)) is spec:
        return answer
    if any(item.key == AT_REST for item in answer.evidence):
        return answer
    try:
        other = again(noisier)
    except (AlignmentError, DataError):
        return answer
    if other.status == "inconsistent":
        return answer
    figures: dict[str, Figure] = {
        "gyro": noisier.gyro_random_walk,
        "accel": noisier.accel_random_walk,
        "imu": answer.imu_source,
    }
    # Urgent: what a quieter log would show is lost in such noise (gyros .3 s late moved headings by up to five sigmas).
    said = Evidence("specification.noisier", figures, urgent=True)
    found = cast(Any, other)  # a dataclass with evidence, whichever it is
    return cast(Answer, replace(found, evidence=(said, *found.evidence)))
