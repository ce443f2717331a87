"""Whether gyros of another moment than the accelerometers explain an aided log better, with the clocks of its sensors open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from truenorth.aiding.aids import Gnss, Odometer, VelocityLog
from truenorth.core.errors import DataError
from truenorth.estimate.sensor_delay import gyro_delay_evidence, on_springs
from truenorth.navigation.given import looked_at, mounted_as
from truenorth.navigation.passes import delayed
from truenorth.navigation.plan import Plan
from truenorth.navigation.second_look import on_any_clock
from truenorth.quality.innovations import contradicted
from truenorth.records import ImuRecord
from truenorth.state.evidence import Evidence
from truenorth.state.track import Track

MOMENT = 1800.0  # s of a log, that show whether gyros and accelerometers are of one moment


def gyros_of_another_moment(plan: Plan, given: Mapping[str, Any]) -> list[Evidence]:
    """Whether gyros that are earlier or later than the accelerometers explain the measurements better, over the log's first part.

    Sensors that are late look like gyros that are early: their clocks are left open first.
    """
    own = looked_at(given)
    seen = {key: on_any_clock(own[key]) for key, a in given.items() if isinstance(a, Gnss | Odometer | VelocityLog)}
    if not seen:
        return []
    open_ = mounted_as(given, own | seen)
    aiding = on_springs(plan.sources(open_))

    def run(record: ImuRecord) -> Track:
        return replace(plan, record=record).run(aiding)

    part = plan.record.between(None, plan.record.time[0] + MOMENT)
    try:
        track = run(part)
        later = delayed(replace(plan, record=part), open_, track)
        if later is not open_:
            usual, whole, aiding = aiding, track, on_springs(plan.sources(later))
            track = run(part)
            if contradicted(track.residuals) and not contradicted(whole.residuals):  # that was no delay
                aiding, track = usual, whole
    except DataError:  # the filter broke down: no explanation
        return []
    return gyro_delay_evidence(run, track, part)
