"""The posterior Cramer-Rao bound of aligning a case: what no method can beat on average.

On a base at rest, attitude and biases enter the velocity linearly and all noise is Gaussian: the bound is the covariance of
the Kalman filter that knows the truth about the noise and linearised about the truth (P. Tichavsky, C. H. Muravchik, A.
Nehorai, Posterior Cramer-Rao bounds for discrete-time nonlinear filtering, IEEE Trans. Signal Process. 46, 1998, eq. 21, which
is then the information filter). Where the base sways no bound is given: that filter takes its velocity for white noise, and a
method that finds the sway's spectrum has less than a fifth of its error (`swaying` at a quay, two minutes).
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from truenorth.alignment import align
from truenorth.alignment.task import deflection_covariance
from truenorth.campaign.aligning import ARCMIN
from truenorth.campaign.plan import Case, Plan
from truenorth.core.earth import normal_gravity
from truenorth.core.errors import TruenorthError
from truenorth.core.position import Position
from truenorth.records import ImuRecord
from truenorth.simulation import IdealLog

Array = NDArray[np.float64]


def bounds(plan: Plan) -> pd.DataFrame:
    """Bound of each attitude error of each case at each time.

    Returns
    -------
    DataFrame
        case, time_s, quantity (phi_e, phi_n, phi_u), bound (arcmin); NaN where the filter has no answer, where the base moves,
        and for a scenario that cannot be simulated.
    """
    rows = []
    for case in plan.cases:
        try:
            ideal = case.built.ideal(plan.seed, 0, case.scenario_number)
        except TruenorthError:  # a motion that cannot be: its runs say so
            ideal = None
        if ideal is not None and np.any(ideal.motion.states(ideal.edges).v_n):
            ideal = None
        for time in (*plan.times, case.built.duration):
            found = np.full(3, np.nan) if ideal is None else _bound(case, ideal, time)
            for quantity, bound in zip(("phi_e", "phi_n", "phi_u"), found, strict=True):
                rows.append((case.number, time, quantity, bound))
    return pd.DataFrame(rows, columns=["case", "time_s", "quantity", "bound"])


def _bound(case: Case, ideal: IdealLog, time: float) -> Array:
    rows = ideal.edges[1:] <= case.built.start + time * (1 + 1e-12)
    record = ImuRecord(ideal.edges[1:][rows], ideal.dtheta[rows], ideal.dvel[rows], "increments", case.name)
    start = ideal.motion.states(ideal.edges[0])
    lat, alt = float(start.lat), float(start.alt)
    place = Position(lat, float(start.lon), alt, horizontal_sigma=0.0, vertical_sigma=0.0)
    try:
        answer = align(record, place, case.built.imu_spec, method="kalman")
    except TruenorthError:
        return np.full(3, np.nan)
    # The simulated vertical is the ellipsoid's normal: its deflection, which the answer allows for, is not in the data.
    covariance = answer.phi_covariance - deflection_covariance(lat, float(normal_gravity(lat, alt)))
    return np.sqrt(np.diag(covariance)) / ARCMIN
