"""Degrees of observability of the paper's states in each case: what the measurements take off the prior, in figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from truenorth.analysis.observability import Observability, observability
from truenorth.errors.stationary import KEPT, names_and_units
from truenorth.filters import LinearSystem
from truenorth.papers.table import Table

# Quantities of the table for each of the ten states.
QUANTITIES = (
    "phi_e",
    "phi_n",
    "phi_u",
    "v_e",
    "v_n",
    "gyro_bias_x",
    "gyro_bias_y",
    "gyro_bias_z",
    "accel_bias_x",
    "accel_bias_y",
)


def degrees_of(system: LinearSystem) -> Observability:
    """Of the first run; all runs have the same covariances."""
    return observability(replace(system, z=system.z[0]), *names_and_units(system.states))


def add_degrees(table: Table, seen: Mapping[tuple[str, int], Observability]) -> None:
    """Singular values, greatest first, and the part of its prior sigma that each state keeps."""
    for (case, states), result in seen.items():
        method = f"states{states}"
        for number, degree in enumerate(result.degrees, 1):
            table.value(case, method, f"degree_{number}", "value", degree, "1")
        for quantity, kept in zip(np.array(QUANTITIES)[KEPT[states]], result.sigma_ratio, strict=True):
            table.value(case, method, quantity, "ratio", kept, "1")


def hardly_in_words(result: Observability) -> str:
    """What keeps most of its prior sigma, state by state."""
    kept = [
        f"{name} {part:.2f}"
        for name, part in zip(result.names, result.sigma_ratio, strict=True)
        if part > result.not_estimated
    ]
    return ", ".join(kept) if kept else "none"
