"""Which states a manoeuvre separates under velocity matching, in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from truenorth.alignment.transfer_system import seen_states, system_of_motion
from truenorth.analysis.observability import observability
from truenorth.errors.master import ARM
from truenorth.papers.transfer.filtering import METHODS, model_of, prior_of
from truenorth.papers.transfer.truth import END, TAU_SIGMA, VELOCITY_NOISE, Case

STEP = 0.5  # s
EVEN_ARM = TAU_SIGMA * 200.0  # m: the way flown in the delay's prior sigma, so that neither is favoured in the words


@dataclass(frozen=True)
class Seen:
    """What sixteen states and velocity matching show in one manoeuvre."""

    rank: int  # with perfect measurements
    words: str  # with the noise as it is: what stays above .9 of its prior sigma

    def __str__(self) -> str:
        return self.words


def seen_in(case: Case) -> Seen:
    """What velocity matching with sixteen states shows in a case's manoeuvre."""
    scenario, method = case.scenario, METHODS["states16"]
    motion = scenario.build_motion()
    model = model_of(method, scenario.imu_spec)
    P0 = prior_of(method, model, scenario.imu_spec, motion.states(np.array(0.0)).C_nb)
    arm = model.slice_of(ARM)
    assert arm is not None
    P0[arm, arm] = EVEN_ARM**2 * np.eye(3)
    rows = VELOCITY_NOISE**2 * 0.1 / STEP  # of ten a second, in one
    R = np.array([rows] * 3 + [np.inf] * 3)
    seen = seen_states(model)
    names, units = [model.names[i] for i in seen], [model.units[i] for i in seen]
    found = observability(system_of_motion(motion, model, P0, R, END, STEP), names, units)
    hardly = "; ".join(map(str, found.hardly))
    words = f"what keeps more than .9 of its prior sigma: {hardly}" if hardly else "all states are separated"
    return Seen(found.rank, words)
